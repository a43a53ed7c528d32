/* texmath.h - v0.2.0 - what all texkit headers share
   SPDX-License-Identifier: MIT OR Unlicense                   (full text: end of file)

   WHAT IT DOES
     The basics that every texkit header needs: status codes, the environment (allocator,
     progress and cancel, parallel-for), checked size arithmetic, image views, a random number
     generator, a sort, vectors, quaternions, sRGB; and the few kernels that more than one of them
     uses: eigenvectors of a symmetric 3x3 matrix, the minimum-error cut, the minimum cut of a grid,
     levels of detail of an image, means of pixels weighted by alpha and colour for those that hide
     theirs, the measuring and the evening of uneven light, the Poisson equation on a masked image,
     and the edge adjacency of a mesh.

   QUICK START                                 (tests build and run this very block)
     // Fill a hole in an image smoothly. cc -std=c99 quick.c -lm
     #include "texmath.h"
     #include <stdio.h>

     int main(void) {
         static float pixels[64 * 64];            // the caller owns all pixels
         static unsigned char hole[64 * 64];
         static txm_poisson_desc desc;            // static: all zero, the default for every field
         static txm_env env;                      // malloc, silent, serial; receives the message
         desc.image.pixels = pixels;
         desc.image.width = desc.image.height = 64;
         desc.image.sample = TXM_F32;
         desc.mask = desc.image;
         desc.mask.pixels = hole;
         desc.mask.sample = TXM_U8;
         for (int y = 0; y < 64; y++) {
             for (int x = 0; x < 64; x++) {
                 hole[64 * y + x] = x >= 16 && x < 48 && y >= 16 && y < 48 ? 255 : 0;
                 txm_image_set(&desc.image, x, y, 0, hole[64 * y + x] ? 0.0f : (float)x / 63.0f);
             }
         }
         if (txm_poisson(&desc, &env) != TXM_OK) {
             fprintf(stderr, "poisson: %s\n", env.message);
             return 1;
         }
         printf("centre of the ramp: %.4f\n", txm_image_get(&desc.image, 32, 32, 0)); // 0.5079
         return 0;
     }

   CONFIGURATION
     TXM_ASSERT(x)          checks for errors in the library, which no input can trigger; default
                            assert of <assert.h>
     Every function is static inline, there is no implementation section: include the file
     wherever it is needed, in C99 or later and in C++11 or later, and link the math library.

   CONVENTIONS
     Right-handed space. Angles are in radians. A quaternion (x, y, z, w) has its scalar last, as in
     glTF. Image rows go from top to bottom, x to the right.
     Masks are pictures of any form: gray times alpha, and what is at least half of its range counts.
     txm_mask_use tells the whole rule, which all headers of the suite keep.

   MEMORY
     Nine functions allocate, all through the environment: txm_alloc, txm_arena_alloc,
     txm_arena_zero, txm_flow_make and txm_image_bled (from an arena), txm_image_bleed, txm_even,
     txm_uneven and txm_poisson. The last four free all of it before they return: txm_poisson holds
     64 + 4 * channels bytes for each unknown pixel. The sort, the minimum-error cut and the sides of a mesh work in the caller's memory.

   THREADS
     No global state. Two calls may overlap unless they share what one of them writes: an env, an
     arena, a generator, an image.

   SAME BYTES
     Integers, 8- and 16-bit samples, generator, hash and sort: the same bits everywhere. All else
     is computed in double in a fixed order and rounded once, by txm_float, which works around a
     bug of gcc (vectors in double are not rounded). That gives the same bits wherever arithmetic is
     IEEE 754 (on 32-bit x86: -msse2), with -ffp-contract=off (the default of gcc -std=c99) and
     without -ffast-math. No result depends on the C library: of its functions only sqrt, fabs, floor
     and ceil are used, which are exact.
     Sort, cut, eigenvectors and the sides of a mesh give the same result even where there are
     ties.

   LIMITS
     An image may span PTRDIFF_MAX bytes; txm_poisson takes up to 2^31 - 1 unknowns; a mesh may have
     up to 2^32 - 2 sides. Functions that return no status expect arguments in the range stated and
     do not check them.

   REFERENCES
     [1] M. O'Neill. PCG: a family of simple fast space-efficient statistically good algorithms for
         random number generation. Harvey Mudd College HMC-CS-2014-0905, 2014.
     [2] A. A. Efros, W. T. Freeman. Image quilting for texture synthesis and transfer.
         SIGGRAPH 2001.
     [3] P. Perez, M. Gangnet, A. Blake. Poisson image editing. SIGGRAPH 2003.
     [4] R. Bridson. Fluid simulation for computer graphics, section 4.3 (the preconditioner
         MIC(0) of I. Gustafsson. A class of first order factorization methods. BIT 18, 1978).
     [5] IEC 61966-2-1:1999 (sRGB).
     [6] G. H. Golub, C. F. Van Loan. Matrix computations, 4th ed., section 8.5 (Jacobi).
     [7] S. W. Shepperd. Quaternion from rotation matrix. J. Guidance and Control 1(3), 1978.
     [8] Y. Boykov, V. Kolmogorov. An experimental comparison of min-cut/max-flow algorithms for
         energy minimization in vision. IEEE PAMI 26(9), 2004.
     [9] S. J. Gortler, R. Grzeszczuk, R. Szeliski, M. F. Cohen. The lumigraph, section 3.4 (pull
         and push). SIGGRAPH 1996.
     [10] I. Castano. Computing alpha mipmaps. The Witness (blog), 2010.                       */
#ifndef TEXMATH_H
#define TEXMATH_H

/* ---- configuration ------------------------------------------------------------------ */

#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define TEXMATH_VERSION "0.2.0"

/* what no input can make false: an error in the library */
#ifndef TXM_ASSERT
#include <assert.h>
#define TXM_ASSERT(x) assert(x)
#endif

#define TXM_PI 3.14159265358979323846

#ifdef __cplusplus
extern "C" {
#endif

/* ---- status ---------------------------------------------------------------------------- */

/* What every call that can fail returns. Zero is success. */
typedef enum txm_status {
    TXM_OK = 0,
    TXM_BAD_ARGUMENT,  /* NULL, a field outside its range, NaN            */
    TXM_TOO_SMALL,     /* the input holds too little to work on           */
    TXM_TOO_LARGE,     /* sizes overflow or exceed a stated limit         */
    TXM_OUT_OF_MEMORY, /* the allocator returned NULL                     */
    TXM_CANCELLED,     /* the progress callback asked to stop             */
    TXM_BAD_DATA       /* bytes that are not a valid file of their kind   */
} txm_status;

/* What a status means, a few English words without a full stop. */
static inline const char *txm_status_text(txm_status status) {
    switch (status) {
    case TXM_OK: return "success";
    case TXM_BAD_ARGUMENT: return "bad argument";
    case TXM_TOO_SMALL: return "too small to work on";
    case TXM_TOO_LARGE: return "too large";
    case TXM_OUT_OF_MEMORY: return "out of memory";
    case TXM_CANCELLED: return "cancelled";
    case TXM_BAD_DATA: return "damaged or foreign data";
    }
    return "unknown status";
}

/* ---- environment ------------------------------------------------------------------------ */

/* How a call allocates, reports progress and runs in parallel. All zero (or a NULL pointer) means
   malloc/free, silent, serial. An env may be used by only one call at a time. A model or
   job copies the allocator, so the env need not outlive it, but what memory_user points to must. */
typedef struct txm_env {
    void *(*allocate)(void *user, size_t bytes); /* NULL = malloc; may return NULL           */
    void (*release)(void *user, void *block);    /* NULL = free; never called with NULL      */
    void *memory_user;                           /* first argument of the two                */
    /* Called from the calling thread only. fraction 0..1 of the whole call, never decreasing;
       stage: one or two short English words. Returning non-zero cancels. NULL = silent.     */
    int (*progress)(void *user, float fraction, const char *stage);
    void *progress_user;
    /* Must call body(context, i) once for each i in 0..count-1, in any order, on any threads,
       and return when all are done. Results do not depend on the order. NULL = serial.      */
    void (*parallel_for)(void *user, int count, void (*body)(void *context, int index),
                         void *context);
    void *parallel_user;
    char message[160]; /* out: after a failure one English line that says what and why       */
} txm_env;

/* Record a failure: copy the message into env (if there is one), return the status. */
static inline txm_status txm_fail(txm_env *env, txm_status status, const char *message) {
    if (env) {
        size_t i = 0;
        for (; message[i] && i + 1 < sizeof env->message; i++) env->message[i] = message[i];
        env->message[i] = 0;
    }
    return status;
}

/* The same, preceded by the name of what is wrong: "name: message". */
static inline txm_status txm_fail_at(txm_env *env, txm_status status, const char *name,
                                     const char *message) {
    char line[sizeof env->message];
    const char *part[3] = {name, ": ", message};
    size_t n = 0;
    for (int k = 0; k < 3; k++) {
        for (const char *s = part[k]; *s && n + 1 < sizeof line; s++) line[n++] = *s;
    }
    line[n] = 0;
    return txm_fail(env, status, line);
}

/* text into line, each # replaced by a number: the first by a, all others by b; cut to fit */
static inline void txm_put_numbers(char *line, size_t capacity, const char *text, uint64_t a,
                                   uint64_t b) {
    size_t n = 0;
    for (; *text && n + 1 < capacity; text++) {
        char digits[20];
        int count = 0;
        if (*text != '#') {
            line[n++] = *text;
            continue;
        }
        for (; a || !count; a /= 10) digits[count++] = (char)('0' + a % 10);
        while (count && n + 1 < capacity) line[n++] = digits[--count];
        a = b;
    }
    line[n] = 0;
}

/* Record a failure whose message has numbers: the first # of text stands for a, the next for b. */
static inline txm_status txm_fail_numbers(txm_env *env, txm_status status, const char *text,
                                          uint64_t a, uint64_t b) {
    char line[sizeof env->message];
    txm_put_numbers(line, sizeof line, text, a, b);
    return txm_fail(env, status, line);
}

/* The same, preceded by the name of what is wrong: "name: text". */
static inline txm_status txm_fail_numbers_at(txm_env *env, txm_status status, const char *name,
                                             const char *text, uint64_t a, uint64_t b) {
    char line[sizeof env->message];
    txm_put_numbers(line, sizeof line, text, a, b);
    return txm_fail_at(env, status, name, line);
}

/* bytes of the environment's memory, not cleared; NULL if there is none or bytes is 0 */
static inline void *txm_alloc(const txm_env *env, size_t bytes) {
    if (bytes == 0) return NULL;
    return env && env->allocate ? env->allocate(env->memory_user, bytes) : malloc(bytes);
}

/* Free what txm_alloc returned; NULL is allowed. */
static inline void txm_free(const txm_env *env, void *block) {
    if (!block) return;
    if (env && env->release) env->release(env->memory_user, block);
    else free(block);
}

/* Report progress; non-zero: the caller has cancelled, stop. */
static inline int txm_progress(const txm_env *env, float fraction, const char *stage) {
    return env && env->progress ? env->progress(env->progress_user, fraction, stage) : 0;
}

/* body(context, 0..count-1), on the environment's threads if it has any */
static inline void txm_parallel_for(const txm_env *env, int count,
                                    void (*body)(void *context, int index), void *context) {
    if (env && env->parallel_for && count > 1) {
        env->parallel_for(env->parallel_user, count, body, context);
    } else {
        for (int i = 0; i < count; i++) body(context, i);
    }
}

/* *bytes = a * b * c; 0 (and *bytes untouched) if that does not fit a size_t */
static inline int txm_mul(size_t a, size_t b, size_t c, size_t *bytes) {
    if (a && b > SIZE_MAX / a) return 0;
    if (a && b && c > SIZE_MAX / a / b) return 0;
    *bytes = a * b * c;
    return 1;
}

/* *sum = a + b; 0 (and *sum untouched) if that does not fit a size_t */
static inline int txm_add(size_t a, size_t b, size_t *sum) {
    if (b > SIZE_MAX - a) return 0;
    *sum = a + b;
    return 1;
}

/* ---- arena ------------------------------------------------------------------------------ */

/* Blocks that are freed together, so that one exit path frees all allocations so far. Keeps
   a copy of the allocator, so it may outlive the env and may lie in one of its own blocks.

       raw block:  | link to the older block | padding | 64-byte aligned result ...        */
typedef struct txm_arena {
    void *(*allocate)(void *user, size_t bytes); /* as in txm_env                 */
    void (*release)(void *user, void *block);
    void *memory_user;
    void *blocks; /* the newest block, which links to the older ones; NULL = none */
    int failed;   /* non-zero: an allocation has failed since the arena was empty, so that a
                     caller can make several and check once                      */
} txm_arena;

enum { TXM_ALIGN = 64 }; /* bytes; a cache line, and enough for any vector unit   */

/* An empty arena on the memory of env (NULL = malloc and free). */
static inline void txm_arena_init(txm_arena *arena, const txm_env *env) {
    arena->allocate = env ? env->allocate : NULL;
    arena->release = env ? env->release : NULL;
    arena->memory_user = env ? env->memory_user : NULL;
    arena->blocks = NULL;
    arena->failed = 0;
}

/* count * size bytes, not cleared, aligned to 64. NULL if that is 0, or if it overflows or there is
   no memory, which also sets arena->failed. Each is one allocation, larger by 64 bytes and a
   pointer. */
static inline void *txm_arena_alloc(txm_arena *arena, size_t count, size_t size) {
    size_t bytes, total;
    void *raw = NULL;
    if (count == 0 || size == 0) return NULL;
    if (txm_mul(count, size, 1, &bytes) && txm_add(bytes, TXM_ALIGN + sizeof(void *), &total))
        raw = arena->allocate ? arena->allocate(arena->memory_user, total) : malloc(total);
    if (!raw) {
        arena->failed = 1;
        return NULL;
    }
    memcpy(raw, &arena->blocks, sizeof(void *));
    arena->blocks = raw;
    unsigned char *first = (unsigned char *)raw + sizeof(void *);
    return first + (TXM_ALIGN - (uintptr_t)first % TXM_ALIGN) % TXM_ALIGN;
}

/* The same, all bytes 0. */
static inline void *txm_arena_zero(txm_arena *arena, size_t count, size_t size) {
    void *block = txm_arena_alloc(arena, count, size);
    if (block) memset(block, 0, count * size);
    return block;
}

/* Free all blocks; the arena is then empty and may be used again (unless it was in one of them). */
static inline void txm_arena_free(txm_arena *arena) {
    const txm_arena copy = *arena;
    void *block = arena->blocks;
    arena->blocks = NULL;
    arena->failed = 0;
    while (block) {
        void *older;
        memcpy(&older, block, sizeof(void *));
        if (copy.release) copy.release(copy.memory_user, block);
        else free(block);
        block = older;
    }
}

/* ---- numbers ---------------------------------------------------------------------------- */

/* neither infinite nor NaN; looks at the bits, so that -ffast-math cannot remove it */
static inline int txm_is_finite(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return ((bits >> 52) & 0x7ff) != 0x7ff;
}

/* x rounded to float, in all cases. From -O2 on gcc 12 drops the rounding of neighbouring values
   that are widened again ((double)(float)x becomes x), so that results depend on what was inlined.
   Code that needs the same bits everywhere rounds with this, not with a cast: gcc must assume that
   the empty asm changes f, and it costs nothing. */
static inline float txm_float(double x) {
    float f = (float)x;
#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#if defined(__SSE2__)
    __asm__("" : "+x"(f));
#elif defined(__aarch64__)
    __asm__("" : "+w"(f));
#else
    __asm__("" : "+m"(f));
#endif
#endif
    return f;
}

static inline float txm_minf(float a, float b) {
    return b < a ? b : a;
}
static inline float txm_maxf(float a, float b) {
    return b > a ? b : a;
}
/* x limited to low..high; low for NaN */
static inline float txm_clampf(float x, float low, float high) {
    return x >= low ? txm_minf(x, high) : low;
}
static inline int txm_clampi(int x, int low, int high) {
    return x < low ? low : x > high ? high : x;
}
/* a (1 - t) + b t; exactly a at t = 0, b at t = 1, and a wherever a = b */
static inline float txm_lerpf(float a, float b, float t) {
    return txm_float((double)a - (double)a * t + (double)b * t);
}

/* the number of the lowest bit of x that is set, 0..63; x must not be 0 */
static inline int txm_lowest_bit(uint64_t x) {
#if defined(__GNUC__)
    return __builtin_ctzll(x);
#else
    int n = 0;
    for (int step = 32; step; step /= 2) {
        if (x & (((uint64_t)1 << step) - 1)) continue;
        x >>= step;
        n += step;
    }
    return n;
#endif
}

/* Sine and cosine of an angle of at most a few thousand turns, to 1e-10: reduced to -pi/4..pi/4,
   then Taylor. Sums, products and quotients only, so that the bits are the same everywhere,
   unlike those of the C library. */
static inline void txm_sincos(double angle, double *sine, double *cosine) {
    const double turns = angle * (2 / TXM_PI);
    const int quarter = (int)(turns + (turns < 0 ? -0.5 : 0.5));
    const double x = angle - quarter * (TXM_PI / 2), xx = x * x;
    const double s =
        x * (1 - xx / 6 * (1 - xx / 20 * (1 - xx / 42 * (1 - xx / 72 * (1 - xx / 110)))));
    const double c =
        1 - xx / 2 * (1 - xx / 12 * (1 - xx / 30 * (1 - xx / 56 * (1 - xx / 90 * (1 - xx / 132)))));
    const int q = quarter & 3;
    *sine = q == 0 ? s : q == 1 ? c : q == 2 ? -s : -c;
    *cosine = q == 0 ? c : q == 1 ? -s : q == 2 ? -c : s;
}

/* The angle of (x, y), -pi..pi, to 1e-15; 0 of (0, 0). Both must be finite. Reduced to less than
   pi/16 by halving twice, then Taylor. The same bits everywhere, as above. */
static inline double txm_atan2(double y, double x) {
    const double a = fabs(x), b = fabs(y), most = a > b ? a : b;
    if (!(most > 0)) return 0;
    double t = (a > b ? b : a) / most, sum = 0;
    for (int half = 0; half < 2; half++) t /= 1 + sqrt(1 + t * t);
    for (int k = 23; k > 0; k -= 2) sum = 1.0 / k - t * t * sum;
    double angle = 4 * t * sum;
    if (b > a) angle = TXM_PI / 2 - angle;
    if (x < 0) angle = TXM_PI - angle;
    return y < 0 ? -angle : angle;
}

/* The cosine alone. */
static inline double txm_cos(double angle) {
    double sine, cosine;
    txm_sincos(angle, &sine, &cosine);
    return cosine;
}

/* 2^x for x from -1000 to 1000, to 1e-11 of the result: the whole part into the exponent, the rest
   by Taylor. The same bits everywhere, as above. */
static inline double txm_exp2(double x) {
    const int whole = (int)(x + 1024.5) - 1024; /* rounded to nearest */
    const double y = (x - whole) * 0.69314718055994530942;
    const uint64_t bits = (uint64_t)(whole + 1023) << 52;
    double sum = 1, power;
    for (int k = 11; k > 0; k--) sum = 1 + sum * y / k;
    memcpy(&power, &bits, sizeof power);
    return sum * power;
}

/* log2 of x > 0, to 1e-12: by its exponent and a series. The same bits everywhere, as above. */
static inline double txm_log2(double x) {
    int whole;
    x = frexp(x, &whole); /* 0.5 <= x < 1 */
    if (x <= 0.70710678118654752) x *= 2, whole--;
    const double t = (x - 1) / (x + 1), tt = t * t;
    double sum = 0;
    for (int k = 17; k > 0; k -= 2) sum = sum * tt + 1.0 / k;
    return whole + 2 * t * sum / 0.69314718055994530942;
}

/* x^y for x >= 0 and y > 0, to 1e-10 of the result if that lies within 2^-1000 to 2^1000. The same
   bits everywhere, as above. */
static inline double txm_pow(double x, double y) {
    return x > 0 ? txm_exp2(y * txm_log2(x)) : 0;
}

/* ---- images ----------------------------------------------------------------------------- */

typedef enum txm_sample {
    TXM_U8 = 0,  /* 0..255, sRGB-encoded unless a function says otherwise         */
    TXM_F32 = 1, /* nominally 0..1                                                */
    TXM_U16 = 2  /* uint16_t, 0..65535, sRGB-encoded unless a function says otherwise */
} txm_sample;

/* A view of pixels that the caller owns: rows from top to bottom, channels interleaved. */
typedef struct txm_image {
    void *pixels;      /* first sample of the top row: uint8_t, uint16_t or float, aligned    */
    int width, height; /* pixels, 1 or more                                                   */
    int channels;      /* 1..4: gray, gray + alpha, RGB, RGBA; 0 = 1                          */
    txm_sample sample; /* sample type; 0 = 8 bit                                              */
    ptrdiff_t stride;  /* bytes from one row to the next; 0 = packed rows; negative: the rows lie
                          bottom-up in memory, pixels still points at the top one             */
} txm_image;

/* bytes of one sample */
static inline size_t txm_sample_bytes(txm_sample sample) {
    return sample == TXM_F32 ? sizeof(float) : sample == TXM_U16 ? sizeof(uint16_t) : 1;
}

/* Is this a valid view? Everything but the samples themselves is checked.

   name        what the caller calls the image, for the message: "mask: pixels is NULL; ..."
   max_pixels  refuse larger images; 0 = whatever the address space holds
   return      TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE                                    */
static inline txm_status txm_image_check(const txm_image *image, const char *name,
                                         size_t max_pixels, txm_env *env) {
    if (!image || !image->pixels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "pixels is NULL; point it at the first sample of the top row");
    if (image->width < 1 || image->height < 1)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "width and height must be 1 or more");
    if (image->channels < 0 || image->channels > 4)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "channels must be 1 to 4 (0 means 1)");
    if (image->sample != TXM_U8 && image->sample != TXM_U16 && image->sample != TXM_F32)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "sample must be TXM_U8, TXM_U16 or TXM_F32");

    const size_t channels = image->channels ? (size_t)image->channels : 1;
    const size_t width = (size_t)image->width, height = (size_t)image->height;
    const size_t bytes = txm_sample_bytes(image->sample);
    size_t row, span;
    if (max_pixels && height > max_pixels / width)
        return txm_fail_at(env, TXM_TOO_LARGE, name,
                           "too many pixels; make it smaller or raise the limit");
    if (!txm_mul(width, channels, bytes, &row)) row = SIZE_MAX;
    /* the magnitude, also of PTRDIFF_MIN */
    size_t stride = image->stride < 0 ? 0 - (size_t)image->stride : (size_t)image->stride;
    if (stride == 0) stride = row;
    if (stride < row && row <= PTRDIFF_MAX)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "stride is shorter than a row; give bytes per row, or 0 if packed");
    if (!txm_mul(stride, height - 1, 1, &span) || !txm_add(span, row, &span) || span > PTRDIFF_MAX)
        return txm_fail_at(env, TXM_TOO_LARGE, name,
                           "width * height * channels is beyond the address space; use tiles");
    if ((uintptr_t)image->pixels % bytes || stride % bytes)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           bytes == 2 ? "16-bit pixels and stride must be multiples of 2 bytes"
                                      : "float pixels and stride must be multiples of 4 bytes");
    return TXM_OK;
}

/* The same view, with channels and stride set where they were 0. The functions below do this
   themselves; it is for loops that access the samples directly. */
static inline txm_image txm_image_resolve(txm_image image) {
    if (image.channels == 0) image.channels = 1;
    if (image.stride == 0)
        image.stride = (ptrdiff_t)((size_t)image.width * (size_t)image.channels *
                                   txm_sample_bytes(image.sample));
    return image;
}

/* first sample of row y, 0..height-1; cast it to uint8_t *, uint16_t * or float * */
static inline void *txm_image_row(const txm_image *image, int y) {
    return (char *)image->pixels + txm_image_resolve(*image).stride * y;
}
static inline const void *txm_image_row_const(const txm_image *image, int y) {
    return txm_image_row(image, y);
}

/* sample i of a row as it is stored: 0 to 255, 0 to 65535, or a float */
static inline float txm_sample_code(const void *row, txm_sample sample, size_t i) {
    if (sample == TXM_F32) return ((const float *)row)[i];
    if (sample == TXM_U16) return (float)((const uint16_t *)row)[i];
    return (float)((const uint8_t *)row)[i];
}

/* sample i of a row; 8 bit: value / 255; 16 bit: value / 65535 */
static inline float txm_sample_get(const void *row, txm_sample sample, size_t i) {
    const float code = txm_sample_code(row, sample, i);
    return sample == TXM_F32 ? code : code / (sample == TXM_U16 ? 65535.0f : 255.0f);
}

/* sample c of pixel (x, y), all inside, as txm_sample_get gives it */
static inline float txm_image_get(const txm_image *image, int x, int y, int c) {
    const size_t i = (size_t)x * (size_t)(image->channels ? image->channels : 1) + (size_t)c;
    return txm_sample_get(txm_image_row_const(image, y), image->sample, i);
}

/* Store a sample. 8 and 16 bit: clamped to 0..1 (NaN to 0), times 255 or 65535, rounded; float: as
   it is. */
static inline void txm_image_set(const txm_image *image, int x, int y, int c, float value) {
    void *row = txm_image_row(image, y);
    const size_t i = (size_t)x * (size_t)(image->channels ? image->channels : 1) + (size_t)c;
    const double unit = (double)txm_clampf(value, 0, 1);
    if (image->sample == TXM_F32) ((float *)row)[i] = value;
    else if (image->sample == TXM_U16) ((uint16_t *)row)[i] = (uint16_t)(unit * 65535.0 + 0.5);
    else ((uint8_t *)row)[i] = (uint8_t)(unit * 255.0 + 0.5);
}

/* non-zero if no sample is infinite or NaN (8- and 16-bit samples never are) */
static inline int txm_image_is_finite(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const size_t count = (size_t)im.width * (size_t)im.channels;
    if (im.sample != TXM_F32) return 1;
    for (int y = 0; y < im.height; y++) {
        const float *row = (const float *)txm_image_row_const(&im, y);
        for (size_t i = 0; i < count; i++) {
            if (!txm_is_finite(row[i])) return 0;
        }
    }
    return 1;
}

/* ---- colour ----------------------------------------------------------------------------- */

/* The n-th root of x > 0, n 2 or more, to an ulp or two: a guess from the exponent, then Newton. Sums,
   products and quotients only, so that the bits are the same everywhere, unlike those of pow. */
static inline double txm_root(double x, int n) {
    const uint64_t one = (uint64_t)1023 << 52;
    uint64_t bits;
    double y;
    if (!txm_is_finite(x)) return x;
    memcpy(&bits, &x, sizeof bits);
    bits = bits / (uint64_t)n + (one - one / (uint64_t)n); /* within 6 % */
    memcpy(&y, &bits, sizeof y);
    for (int i = 0; i < 5; i++) {
        double power = y;
        for (int k = 2; k < n; k++) power *= y;
        y += (x / power - y) / n;
    }
    return y;
}

/* sRGB code value to linear light and back [5]; 0..1 to 0..1. Outside, the same curves are
   extrapolated (below 0: the linear part); nothing is clamped. x^2.4 is x^2 times the fifth root of
   x^2, and x^(1/2.4) the twelfth root of x^5. */
static inline float txm_srgb_to_linear(float s) {
    if (s <= 0.04045f) return txm_float(s / 12.92);
    const double x = ((double)s + 0.055) / 1.055, xx = x * x;
    return txm_float(xx * txm_root(xx, 5));
}
static inline float txm_linear_to_srgb(float l) {
    if (l <= 0.0031308f) return txm_float(12.92 * (double)l);
    const double x = (double)l, xx = x * x;
    return txm_float(1.055 * txm_root(sqrt(sqrt(xx * xx * x)), 3) - 0.055);
}

/* ---- masks ------------------------------------------------------------------------------ */

/* One rule for all masks of the suite. A mask is a picture of any sample type with 1 to 4 channels
   and the size of what it masks. Its value is gray times alpha, 0 (black or transparent) to 1
   (white and opaque), and a pixel counts where that is at least half. So the noise of a JPEG, and
   what an eraser left under its alpha, do not matter.

   The rim of a smooth (antialiased, blurred) mask is a mixture: its pixels may show a little of what
   was masked although they are more white than black. So where a mask is smooth, the rim goes to the
   side that does no harm: not used where the mask allows, replaced where it replaces. */
typedef enum txm_mask_use {
    TXM_MASK_DIVIDES = 0,  /* both sides are alike, as in a layout: at least half, no more        */
    TXM_MASK_ALLOWS = 1,   /* what counts may be used or kept: the rim does not count             */
    TXM_MASK_REPLACES = 2  /* what counts is replaced: all of the rim counts                      */
} txm_mask_use;

enum {
    TXM_MASK_RIM = 8,   /* pixels: what is farther from the other side is no rim; ours            */
    TXM_MASK_TILE = 64, /* pixels: smooth or sharp is decided for squares of that side, by        */
    TXM_MASK_ROUND = 32 /* what is in them and so far around; ours                                */
};
#define TXM_MASK_FEW (1.0 / 32) /* of the pixels at the border: a smooth mask has more that lie between
                                   their neighbours, at a quarter to three quarters (antialiased
                                   shapes a quarter, a JPEG of quality 50 or more at most 1/40);
                                   ours                                                           */

/* What a mask says at (x, y), inside: gray times alpha, 0..1. Gray of RGB is (54 R + 183 G + 19 B) /
   256; samples beyond 0..1 are clamped, NaN is 0. */
static inline double txm_mask_value(const txm_image *mask, int x, int y) {
    const int n = mask->channels ? mask->channels : 1;
    double v[4] = {0, 0, 0, 0};
    for (int c = 0; c < n; c++) v[c] = (double)txm_clampf(txm_image_get(mask, x, y, c), 0, 1);
    const double gray = n < 3 ? v[0] : (54 * v[0] + 183 * v[1] + 19 * v[2]) / 256;
    return n % 2 ? gray : gray * v[n - 1];
}

/* Does the mask count at (x, y)? At least half, without regard to rims. */
static inline int txm_mask_at(const txm_image *mask, int x, int y) {
    return txm_mask_value(mask, x, y) >= 0.5;
}

/* Is this a valid mask of a picture of that size?

   name        what the caller calls it, for the message: "mask: is 30 x 20 pixels, ..."
   max_pixels  as for txm_image_check
   return      TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE                                    */
static inline txm_status txm_mask_check(const txm_image *mask, const char *name, int width,
                                        int height, size_t max_pixels, txm_env *env) {
    char line[sizeof env->message], rest[sizeof env->message];
    const txm_status status = txm_image_check(mask, name, max_pixels, env);
    if (status != TXM_OK) return status;
    if (mask->width != width || mask->height != height) {
        txm_put_numbers(line, sizeof line, "is # x # pixels, ", (uint64_t)mask->width,
                        (uint64_t)mask->height);
        txm_put_numbers(rest, sizeof rest, "its picture # x #; give them the same size",
                        (uint64_t)width, (uint64_t)height);
        const size_t n = strlen(line);
        for (size_t i = 0; n + i + 1 < sizeof line; i++) {
            line[n + i] = rest[i];
            line[n + i + 1] = 0;
            if (!rest[i]) break;
        }
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, line);
    }
    if (!txm_image_is_finite(mask))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "samples must be finite");
    return TXM_OK;
}

/* What txm_mask_read is doing. A byte is 255 where the mask counts, 0 where not, or the step by which
   the rim has reached the pixel. The rim grows from the side `from` into the other one. */
typedef struct txm_mask_reader {
    txm_image mask;
    uint8_t *bytes;
    int from, to;
} txm_mask_reader;

static inline uint8_t *txm_mask_byte(const txm_mask_reader *r, int x, int y) {
    return r->bytes + (size_t)y * (size_t)r->mask.width + (size_t)x;
}

/* the pixels with at least half */
static inline void txm_mask_halves(const txm_mask_reader *r) {
    for (int y = 0; y < r->mask.height; y++) {
        uint8_t *to = txm_mask_byte(r, 0, y);
        const uint8_t *row = (const uint8_t *)txm_image_row_const(&r->mask, y);
        const int is_plain = r->mask.sample == TXM_U8 && r->mask.channels == 1;
        for (int x = 0; x < r->mask.width; x++)
            to[x] = (uint8_t)((is_plain ? row[x] >= 128 : txm_mask_at(&r->mask, x, y)) ? 255 : 0);
    }
}

/* Has (x, y) a neighbour to the left, right, above or below on the other side? What the rim has
   reached still is on the side where it was. */
static inline int txm_mask_is_border(const txm_mask_reader *r, int x, int y) {
    const uint8_t *p = txm_mask_byte(r, x, y);
    const size_t width = (size_t)r->mask.width;
    const int side = *p == r->from;
    return (x > 0 && (p[-1] == r->from) != side) ||
           (x + 1 < r->mask.width && (p[1] == r->from) != side) ||
           (y > 0 && (*(p - width) == r->from) != side) ||
           (y + 1 < r->mask.height && (p[width] == r->from) != side);
}

/* Is there a pixel of either side in the square at (x0, y0) and the pixels next to it? */
static inline int txm_mask_is_mixed(const txm_mask_reader *r, int x0, int y0) {
    const int left = txm_clampi(x0 - 1, 0, x0), top = txm_clampi(y0 - 1, 0, y0);
    const int side = *txm_mask_byte(r, x0, y0) == r->from;
    for (int y = top; y < r->mask.height && y - y0 <= TXM_MASK_TILE; y++) {
        const uint8_t *row = txm_mask_byte(r, 0, y);
        for (int x = left; x < r->mask.width && x - x0 <= TXM_MASK_TILE; x++)
            if ((row[x] == r->from) != side) return 1;
    }
    return 0;
}

/* Is the value at (x, y) near the half and between those of neighbours? That of an evenly gray area is
   not. */
static inline int txm_mask_is_between(const txm_mask_reader *r, int x, int y) {
    const double here = txm_mask_value(&r->mask, x, y);
    int lower = 0, higher = 0;
    if (here < 0.25 || here > 0.75) return 0;
    for (int v = txm_clampi(y - 1, 0, y); v - y <= 1 && v < r->mask.height; v++) {
        for (int u = txm_clampi(x - 1, 0, x); u - x <= 1 && u < r->mask.width; u++) {
            const double there = txm_mask_value(&r->mask, u, v);
            lower |= there < here;
            higher |= there > here;
        }
    }
    return lower && higher;
}

/* Is the mask smooth in and around the square at (x0, y0)? */
static inline int txm_mask_is_smooth(const txm_mask_reader *r, int x0, int y0) {
    const int left = txm_clampi(x0 - TXM_MASK_ROUND, 0, x0);
    const int top = txm_clampi(y0 - TXM_MASK_ROUND, 0, y0);
    const int reach = TXM_MASK_TILE + TXM_MASK_ROUND;
    size_t border = 0, between = 0;
    for (int y = top; y < r->mask.height && y - y0 < reach; y++) {
        for (int x = left; x < r->mask.width && x - x0 < reach; x++) {
            if (!txm_mask_is_border(r, x, y)) continue;
            border++;
            between += (size_t)txm_mask_is_between(r, x, y);
        }
    }
    return (double)between > TXM_MASK_FEW * (double)border;
}

/* Give this step to the neighbours of (x, y) that the rim reaches from there: those on the other
   side whose value is farther from this side's, but not at the end of the range. */
static inline void txm_mask_step(const txm_mask_reader *r, int x, int y, int step) {
    double here = -1;
    for (int v = txm_clampi(y - 1, 0, y); v - y <= 1 && v < r->mask.height; v++) {
        for (int u = txm_clampi(x - 1, 0, x); u - x <= 1 && u < r->mask.width; u++) {
            uint8_t *p = txm_mask_byte(r, u, v);
            if (*p != r->to) continue;
            const double there = txm_mask_value(&r->mask, u, v);
            if (here < 0) here = txm_mask_value(&r->mask, x, y);
            if (r->from ? there < here && there > 0 : there > here && there < 1) *p = (uint8_t)step;
        }
    }
}

/* Mark the rim in bytes: first in the squares where the mask is smooth, then on from there. */
static inline void txm_mask_grow(const txm_mask_reader *r) {
    const int width = r->mask.width, height = r->mask.height;
    for (int j = 0; j <= (height - 1) / TXM_MASK_TILE; j++) {
        for (int i = 0; i <= (width - 1) / TXM_MASK_TILE; i++) {
            const int x0 = i * TXM_MASK_TILE, y0 = j * TXM_MASK_TILE;
            if (!txm_mask_is_mixed(r, x0, y0) || !txm_mask_is_smooth(r, x0, y0)) continue;
            for (int y = y0; y < height && y - y0 < TXM_MASK_TILE; y++)
                for (int x = x0; x < width && x - x0 < TXM_MASK_TILE; x++)
                    if (*txm_mask_byte(r, x, y) == r->from) txm_mask_step(r, x, y, 1);
        }
    }
    for (int step = 2; step <= TXM_MASK_RIM; step++) {
        for (int y = 0; y < height; y++) {
            const uint8_t *row = txm_mask_byte(r, 0, y);
            for (int x = 0; x < width; x++)
                if (row[x] == step - 1) txm_mask_step(r, x, y, step);
        }
    }
}

/* Read a mask by the rule above.

   mask   one that txm_mask_check has found good
   bytes  width * height of them, row after row without gaps: receives 255 where the mask counts,
          else 0
   return how many count
   cost   some 10 ns a pixel, of smooth masks twice that; no memory                        */
static inline size_t txm_mask_read(const txm_image *mask, txm_mask_use use, uint8_t *bytes) {
    txm_mask_reader r;
    r.mask = txm_image_resolve(*mask);
    r.bytes = bytes;
    r.from = use == TXM_MASK_REPLACES ? 255 : 0;
    r.to = 255 - r.from;
    txm_mask_halves(&r);
    if (use != TXM_MASK_DIVIDES) txm_mask_grow(&r);
    size_t count = 0;
    const size_t pixels = (size_t)r.mask.width * (size_t)r.mask.height;
    for (size_t i = 0; i < pixels; i++) {
        if (bytes[i] != r.to) bytes[i] = (uint8_t)r.from; /* the rim joins the side it came from */
        count += bytes[i] != 0;
    }
    return count;
}

/* ---- normal maps ------------------------------------------------------------------------ */

/* One coordinate of a normal map's vector, -1..1, of the sample that txm_image_get returns, and back.
   A flat surface must stay flat however it is turned or mirrored, so 128 of 255 is exactly 0, not
   1/255, and 32768 of 65535 likewise:

       8 bit: n = (s - 128) / 127,   16 bit: n = (s - 32768) / 32767,   float: n = 2 s - 1,

   and the sample 0, which would be below, is -1. */
static inline double txm_normal_decode(double value, txm_sample sample) {
    const double n = sample == TXM_U8    ? (value * 255 - 128) / 127
                     : sample == TXM_U16 ? (value * 65535 - 32768) / 32767
                                         : 2 * value - 1;
    return sample != TXM_F32 && n < -1 ? -1 : n;
}
static inline double txm_normal_encode(double n, txm_sample sample) {
    return sample == TXM_U8    ? (n * 127 + 128) / 255
           : sample == TXM_U16 ? (n * 32767 + 32768) / 65535
                               : 0.5 + 0.5 * n;
}

/* The vector of pixel (x, y) of a normal map, in any length. */
static inline void txm_normal_get(const txm_image *map, int x, int y, double n[3]) {
    for (int c = 0; c < 3; c++)
        n[c] = txm_normal_decode((double)txm_image_get(map, x, y, c), map->sample);
}

/* Turn a normal, the samples v of a map, with its picture, and give it unit length. axes: where x and y
   of the result point in the map, each right and down, at right angles and of any length but 0: a
   rotation or a reflection. is_down: green points down in the picture, not up. */
static inline void txm_normal_turn(const double axes[4], int is_down, txm_sample sample, float v[3]) {
    const double down = is_down ? 1 : -1; /* rows run downwards */
    const double nx = txm_normal_decode((double)v[0], sample);
    const double ny = txm_normal_decode((double)v[1], sample) * down;
    double nz = txm_normal_decode((double)v[2], sample);
    const double lx = sqrt(axes[0] * axes[0] + axes[1] * axes[1]);
    const double ly = sqrt(axes[2] * axes[2] + axes[3] * axes[3]);
    double x = (axes[0] * nx + axes[1] * ny) / lx;
    double y = (axes[2] * nx + axes[3] * ny) / ly;
    double length = sqrt(x * x + y * y + nz * nz);
    if (!(length > 1e-6)) {
        x = y = 0;
        nz = length = 1;
    }
    v[0] = txm_float(txm_normal_encode(x / length, sample));
    v[1] = txm_float(txm_normal_encode(y / length * down, sample));
    v[2] = txm_float(txm_normal_encode(nz / length, sample));
}

/* Does a picture look like a normal map? Its mean is within 30 degrees of (0, 0, 1), and at least 19
   of 20 pixels have unit length (within 0.06) and do not point down. For warnings: a picture of one
   light blue is one, too. Looks at about 4096 pixels, spread evenly. */
static inline int txm_image_is_normals(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const int step_x = (im.width - 1) / 64 + 1, step_y = (im.height - 1) / 64 + 1;
    double sum[3] = {0, 0, 0}, seen = 0, good = 0;
    if (im.channels < 3) return 0;
    for (int y = step_y / 2; y < im.height; y += step_y) {
        for (int x = step_x / 2; x < im.width; x += step_x) {
            double n[3];
            if (im.channels == 4 && !(txm_image_get(&im, x, y, 3) > 0)) continue;
            txm_normal_get(&im, x, y, n);
            const double square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
            seen += 1;
            good += square > 0.94 * 0.94 && square < 1.06 * 1.06 && n[2] > -0.05;
            for (int c = 0; c < 3; c++) sum[c] += n[c];
        }
    }
    const double length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    return seen > 0 && good >= 0.95 * seen && sum[2] > 0.866 * length;
}

/* ---- colour and alpha ------------------------------------------------------------------- */

/* Alpha is straight: the last of 2 or 4 channels says how much of a pixel shows, and its colour is
   stored as if all of it did. Where alpha is 0 the colour is hidden: whatever a file has there was
   never seen by anybody, so it must not matter. Work on such pictures in three steps:

       in       txm_image_bled: hidden colour is replaced by that of the visible neighbours
       between  txm_mean: averages in which colour counts as much as it shows
       out      txm_image_bleed: so that other programs' filters show no fringe; where pixels are
                kept to the byte, txm_image_bleed_part of the others                          */

/* non-zero if the last channel is alpha: gray + alpha or RGBA */
static inline int txm_image_has_alpha(const txm_image *image) {
    return image->channels == 2 || image->channels == 4;
}

/* the channels of colour, those before alpha: 1 or 3 (2 if the caller says there is no alpha) */
static inline int txm_image_colours(const txm_image *image) {
    return image->channels < 2 ? 1 : image->channels - txm_image_has_alpha(image);
}

/* non-zero if the image has alpha and a pixel whose alpha is 0 (or less, or NaN) */
static inline int txm_image_has_hidden(const txm_image *image) {
    const size_t n = (size_t)image->channels, end = (size_t)image->width * n;
    if (!txm_image_has_alpha(image)) return 0;
    for (int y = 0; y < image->height; y++) {
        const void *row = txm_image_row_const(image, y);
        for (size_t i = n - 1; i < end; i += n) {
            if (!(txm_sample_code(row, image->sample, i) > 0)) return 1;
        }
    }
    return 0;
}

/* A weighted mean of pixels in which colour counts as much as it shows:

       colour = sum w a c / sum w a,   alpha = sum w a / sum w.

   Where nothing shows it is the plain mean of the colours. Of pixels without alpha, and of opaque
   ones, it is the plain mean to the last bit. */
typedef struct txm_mean {
    int channels;            /* 1..4; 2 and 4: the last is alpha                              */
    double weight, shown;    /* sum of w, of w a                                              */
    double sum[4], plain[4]; /* of w a c, of w c                                              */
} txm_mean;

/* An empty mean of pixels with that many channels. */
static inline txm_mean txm_mean_of(int channels) {
    txm_mean m;
    memset(&m, 0, sizeof m);
    m.channels = channels;
    return m;
}

/* Add a pixel with a weight. */
static inline void txm_mean_add(txm_mean *m, const float *pixel, double weight) {
    const int colours = m->channels - (m->channels % 2 == 0);
    double shown = weight;
    if (m->channels % 2 == 0) shown *= pixel[colours] > 0 ? (double)pixel[colours] : 0;
    m->weight += weight;
    m->shown += shown;
    for (int c = 0; c < colours; c++) {
        if (shown != 0) m->sum[c] += shown * (double)pixel[c];
        m->plain[c] += weight * (double)pixel[c];
    }
}

/* The mean; the sum of all weights must not be 0. */
static inline void txm_mean_get(const txm_mean *m, float *pixel) {
    const int colours = m->channels - (m->channels % 2 == 0), shows = m->shown > 0;
    for (int c = 0; c < colours; c++)
        pixel[c] = txm_float(shows ? m->sum[c] / m->shown : m->plain[c] / m->weight);
    if (colours < m->channels) pixel[colours] = txm_float(m->shown / m->weight);
}

/* all channels of pixel (x, y), inside the image, which is resolved */
static inline void txm_image_pixel(const txm_image *image, int x, int y, float *pixel) {
    const void *row = txm_image_row_const(image, y);
    const size_t n = (size_t)image->channels, i = (size_t)x * n;
    for (size_t c = 0; c < n; c++) pixel[c] = txm_sample_get(row, image->sample, i + c);
}

/* ---- kernel: hidden colour from the visible neighbours ---------------------------------- */

enum { TXM_WRAP_X = 1, TXM_WRAP_Y = 2 }; /* left meets right, top meets bottom                 */

enum {
    TXM_BLEED_LEVELS = 32,     /* an int has 31 bits                                           */
    TXM_BLEED_PIXELS = 1 << 20 /* between two reports of progress                              */
};

/* One level of the pyramid, lanes numbers a pixel: its colour, and how much that counts, 0..1. */
typedef struct txm_bleed_level {
    int width, height;
    float *pixels;
} txm_bleed_level;

typedef struct txm_bleed {
    txm_image image;
    const uint8_t *part; /* NULL, or a byte for each pixel: 0 where its colour stays            */
    int wrap, lanes, levels;
    int at, is_up, first;  /* the level that is made now, which way, and from which row on       */
    double done, pixels;   /* of all levels, both ways                                          */
    float from, to;        /* what is reported at the beginning and at the end                  */
    txm_bleed_level level[TXM_BLEED_LEVELS]; /* 0: unused, it is the image                      */
} txm_bleed;

/* pixel (x, y) of a level: colour and weight */
static inline void txm_bleed_get(const txm_bleed *b, int level, int x, int y, float *pixel) {
    if (level == 0) {
        txm_image_pixel(&b->image, x, y, pixel);
        return;
    }
    const txm_bleed_level *from = &b->level[level];
    memcpy(pixel, from->pixels + ((size_t)y * (size_t)from->width + (size_t)x) * (size_t)b->lanes,
           (size_t)b->lanes * sizeof(float));
}

/* One row of level `at` from the level below it: of 2 x 2 pixels, colour weighted by weight; a
   single visible pixel is enough for the full weight. */
static inline void txm_bleed_pull(void *context, int y) {
    const txm_bleed *b = (const txm_bleed *)context;
    const txm_bleed_level *to = &b->level[b->at];
    const int colours = b->lanes - 1;
    const int width = b->at > 1 ? b->level[b->at - 1].width : b->image.width;
    const int height = b->at > 1 ? b->level[b->at - 1].height : b->image.height;
    float *out = to->pixels + (size_t)y * (size_t)to->width * (size_t)b->lanes;
    for (int x = 0; x < to->width; x++, out += b->lanes) {
        double sum[3] = {0, 0, 0}, weight = 0;
        for (int v = 2 * y; v < 2 * y + 2 && v < height; v++) {
            for (int u = 2 * x; u < 2 * x + 2 && u < width; u++) {
                float pixel[4];
                txm_bleed_get(b, b->at - 1, u, v, pixel);
                if (!(pixel[colours] > 0)) continue;
                weight += (double)pixel[colours];
                for (int c = 0; c < colours; c++)
                    sum[c] += (double)pixel[colours] * (double)pixel[c];
            }
        }
        for (int c = 0; c < colours; c++) out[c] = weight > 0 ? txm_float(sum[c] / weight) : 0.0f;
        out[colours] = weight < 1 ? txm_float(weight) : 1.0f;
    }
}

/* the coarser pixel next to that of x, on the side where x lies, and x's own: 1/4 and 3/4 */
static inline void txm_bleed_sides(int x, int size, int wraps, int side[2]) {
    side[0] = x / 2;
    side[1] = side[0] + (x % 2 ? 1 : -1);
    if (side[1] < 0) side[1] = wraps ? size - 1 : 0;
    if (side[1] >= size) side[1] = wraps ? 0 : size - 1;
}

/* The colour of the level above `at` at pixel (x, y) of this one: linear between 2 x 2 pixels. */
static inline void txm_bleed_above(const txm_bleed *b, int x, int y, double *colour) {
    const txm_bleed_level *from = &b->level[b->at + 1];
    const int colours = b->lanes - 1;
    int u[2], v[2];
    txm_bleed_sides(x, from->width, b->wrap & TXM_WRAP_X, u);
    txm_bleed_sides(y, from->height, b->wrap & TXM_WRAP_Y, v);
    for (int c = 0; c < colours; c++) colour[c] = 0;
    for (int k = 0; k < 4; k++) {
        const double weight = (k % 2 ? 0.25 : 0.75) * (k / 2 ? 0.25 : 0.75);
        float pixel[4];
        txm_bleed_get(b, b->at + 1, u[k % 2], v[k / 2], pixel);
        for (int c = 0; c < colours; c++) colour[c] += weight * (double)pixel[c];
    }
}

/* One row of level `at`: what counts less than fully is completed from the level above. */
static inline void txm_bleed_push(void *context, int y) {
    const txm_bleed *b = (const txm_bleed *)context;
    const int colours = b->lanes - 1;
    double colour[3];
    if (b->at == 0) {
        for (int x = 0; x < b->image.width; x++) {
            if (txm_image_get(&b->image, x, y, colours) > 0) continue;
            if (b->part && !b->part[(size_t)y * (size_t)b->image.width + (size_t)x]) continue;
            txm_bleed_above(b, x, y, colour);
            for (int c = 0; c < colours; c++)
                txm_image_set(&b->image, x, y, c, txm_float(colour[c]));
        }
        return;
    }
    const txm_bleed_level *to = &b->level[b->at];
    float *out = to->pixels + (size_t)y * (size_t)to->width * (size_t)b->lanes;
    for (int x = 0; x < to->width; x++, out += b->lanes) {
        if (out[colours] >= 1) continue;
        const double own = (double)out[colours];
        txm_bleed_above(b, x, y, colour);
        for (int c = 0; c < colours; c++)
            out[c] = txm_float(own * (double)out[c] + (1 - own) * colour[c]);
    }
}

/* Make room for the pyramid of an image, which is resolved; arena->failed tells if there was none. */
static inline void txm_bleed_begin(txm_bleed *b, const txm_image *image, int wrap,
                                   txm_arena *arena) {
    int width = image->width, height = image->height;
    memset(b, 0, sizeof *b);
    b->image = *image;
    b->wrap = wrap;
    b->lanes = image->channels;
    b->pixels = (double)width * height;
    do {
        TXM_ASSERT(b->levels + 1 < TXM_BLEED_LEVELS);
        txm_bleed_level *to = &b->level[++b->levels];
        to->width = width = width / 2 + width % 2;
        to->height = height = height / 2 + height % 2;
        to->pixels = (float *)txm_arena_alloc(arena, (size_t)width * (size_t)height,
                                              (size_t)b->lanes * sizeof(float));
        b->pixels += 2.0 * width * height;
    } while (width > 1 || height > 1);
}

static inline void txm_bleed_row(void *context, int row) {
    const txm_bleed *b = (const txm_bleed *)context;
    if (b->is_up) txm_bleed_pull(context, b->first + row);
    else txm_bleed_push(context, b->first + row);
}

/* Make one level, some rows at a time. b->done counts pixels of all levels, of b->pixels. */
static inline txm_status txm_bleed_level_run(txm_bleed *b, int level, int is_up, txm_env *env) {
    const int width = level ? b->level[level].width : b->image.width;
    const int height = level ? b->level[level].height : b->image.height;
    const int some = TXM_BLEED_PIXELS / width + 1;
    b->at = level;
    b->is_up = is_up;
    for (b->first = 0; b->first < height; b->first += some) {
        const int rows = height - b->first < some ? height - b->first : some;
        if (txm_progress(env, txm_lerpf(b->from, b->to, (float)(b->done / b->pixels)), "colours"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        txm_parallel_for(env, rows, txm_bleed_row, b);
        b->done += (double)rows * width;
    }
    return TXM_OK;
}

/* All levels. After a cancellation an unknown part of what is hidden is as it was. */
static inline txm_status txm_bleed_run(txm_bleed *b, txm_env *env) {
    txm_status status = TXM_OK;
    for (int l = 1; l <= b->levels && status == TXM_OK; l++)
        status = txm_bleed_level_run(b, l, 1, env);
    for (int l = b->levels - 1; l >= 0 && status == TXM_OK; l--)
        status = txm_bleed_level_run(b, l, 0, env);
    return status;
}

/* Replace the colour of fully transparent pixels, where alpha is 0, by a smooth continuation of
   the visible pixels, so that filters which average straight colours show no fringe. Nearest are
   the colours of the visible neighbours, further away those of wider surroundings (pull and push
   [9], weighted by alpha); all lie within the range of the visible colours. If nothing shows the
   colour becomes 0. Visible pixels and alpha are untouched, so pictures that differ in hidden
   colour alone become equal.

   image   in place; 1 or 3 channels, or nothing hidden: left as it is. Samples of any type; float
           ones must be finite where they show
   part    NULL: everywhere; or width * height bytes, row after row: 0 where even hidden colours stay
   wrap    TXM_WRAP_X | TXM_WRAP_Y: the picture tiles that way
   from, to  progress is reported as a fraction in this range, 0..1, stage "colours"
   return  TXM_OK; TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY: image is untouched;
           TXM_CANCELLED: a part of the hidden colours is replaced
   cost    a look at alpha if nothing is hidden; else about 50 ns per pixel on one thread, and
           (channels) * 4 / 3 bytes per pixel                                              */
static inline txm_status txm_image_bleed_part(const txm_image *image, const uint8_t *part, int wrap,
                                              float from, float to, txm_env *env) {
    txm_bleed b;
    txm_arena arena;
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status != TXM_OK) return status;
    const txm_image im = txm_image_resolve(*image);
    if (!txm_image_has_hidden(&im)) return TXM_OK;
    txm_arena_init(&arena, env);
    txm_bleed_begin(&b, &im, wrap, &arena);
    if (arena.failed)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to continue visible colours");
    else {
        b.part = part;
        b.from = from;
        b.to = to;
        status = txm_bleed_run(&b, env);
    }
    txm_arena_free(&arena);
    return status;
}

/* The same, everywhere, as the last thing that a call does: 1 is reported. */
static inline txm_status txm_image_bleed(const txm_image *image, int wrap, txm_env *env) {
    return txm_image_bleed_part(image, NULL, wrap, 1, 1, env);
}

/* The image as it is if nothing is hidden in it, else a copy whose hidden colour is bled: what a
   function that takes a picture should go on with, so that hidden colour cannot matter. It is the first
   thing that a call does: 0 is reported.

   wrap    as above
   arena   receives the copy
   out     receives the image, resolved, or the copy, with packed rows; untouched after an error
   return  TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED       */
static inline txm_status txm_image_bled(const txm_image *image, int wrap, txm_arena *arena,
                                        txm_env *env, txm_image *out) {
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image);
    if (!txm_image_has_hidden(&from)) {
        *out = from;
        return TXM_OK;
    }
    txm_image copy = from;
    const size_t row = (size_t)from.width * (size_t)from.channels * txm_sample_bytes(from.sample);
    copy.stride = (ptrdiff_t)row;
    copy.pixels = txm_arena_alloc(arena, (size_t)from.height, row);
    if (!copy.pixels)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a copy of the picture");
    for (int y = 0; y < from.height; y++)
        memcpy(txm_image_row(&copy, y), txm_image_row_const(&from, y), row);
    status = txm_image_bleed_part(&copy, NULL, wrap, 0, 0, env);
    if (status == TXM_OK) *out = copy;
    return status;
}

/* ---- kernel: levels of detail ----------------------------------------------------------- */

/* What the samples of a picture are; says how they are averaged. */
typedef enum txm_content {
    TXM_COLOR = 0, /* 8 and 16 bits: sRGB, averaged in linear light; float: linear light already.
                      Weighted by alpha, if there is any                                        */
    TXM_DATA,      /* quantities, every channel by itself                                      */
    TXM_NORMALS,   /* 3 or 4 channels, the first three unit vectors (txm_normal_decode): averaged as
                      vectors and brought back to unit length; the fourth as data              */
    TXM_LABELS     /* not averaged: one of them is taken                                       */
} txm_content;

/* Side of level k, 0 or more, of a picture: max(1, floor(side / 2^k)), as in OpenGL, Vulkan and
   Direct3D. */
static inline int txm_level_side(int side, int k) {
    return k > 30 || side >> k < 1 ? 1 : side >> k;
}

/* Which pixels of a row of `side` lie under pixel x of half the side, and how much of them, out of
   *total. Returns their number, 1 to 3: of an odd side 2 n + 1 each covers 2 + 1 / n pixels. */
static inline int txm_level_taps(int side, int x, double weight[3], double *total) {
    const int n = side / 2;
    *total = side > 1 && side % 2 ? side : side > 1 ? 2 : 1;
    if (side == 1) {
        weight[0] = 1;
        return 1;
    }
    weight[0] = side % 2 ? n - x : 1;
    weight[1] = side % 2 ? n : 1;
    weight[2] = x + 1;
    return 2 + side % 2;
}

/* The mean direction of vectors, v in any length, as samples. Those that cancel each other out
   have none: it is (0, 0, 1). */
static inline void txm_level_normal(const double v[3], txm_sample kind, float *sample) {
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const int is_none = !(length > 1e-6);
    for (int c = 0; c < 3; c++) {
        const double unit = is_none ? c == 2 : v[c] / length;
        sample[c] = txm_float(txm_normal_encode(unit, kind));
    }
}

typedef struct txm_halving {
    const txm_image *image, *half;
    txm_content content;
    const float
        *linear;       /* linear light of each 8-bit sample; NULL: the samples are taken as they are
                            (or decoded one by one: 16 bits)                                    */
    const float *code; /* linear light at which each 8-bit sample but the first begins        */
} txm_halving;

/* pixel (x, y) as it is averaged */
static inline void txm_level_load(const txm_halving *h, const void *row, int x, float *pixel) {
    const txm_image *im = h->image;
    const int n = im->channels, colours = txm_image_colours(im);
    const size_t i = (size_t)x * (size_t)n;
    for (int c = 0; c < n; c++) {
        const int is_coded = h->content == TXM_COLOR && c < colours;
        if (im->sample == TXM_F32) {
            pixel[c] = ((const float *)row)[i + (size_t)c];
        } else if (im->sample == TXM_U16) {
            pixel[c] = (float)((const uint16_t *)row)[i + (size_t)c] / 65535.0f;
            if (is_coded) pixel[c] = txm_srgb_to_linear(pixel[c]);
        } else {
            const uint8_t sample = ((const uint8_t *)row)[i + (size_t)c];
            pixel[c] = is_coded ? h->linear[sample] : (float)sample / 255.0f;
        }
    }
}

/* the 8-bit sample of linear light, rounded to nearest in sRGB */
static inline uint8_t txm_level_code(const float *code, float light) {
    int low = 0; /* code[s - 1] <= light for all s <= low */
    for (int step = 128; step; step /= 2) {
        if (low + step < 256 && code[low + step - 1] <= light) low += step;
    }
    return (uint8_t)low;
}

static inline void txm_level_store(const txm_halving *h, int x, int y, const float *pixel) {
    const txm_image *to = h->half;
    const int n = to->channels, colours = txm_image_colours(to);
    for (int c = 0; c < n; c++) {
        const int is_coded = h->content == TXM_COLOR && c < colours && to->sample != TXM_F32;
        if (is_coded && to->sample == TXM_U8)
            ((uint8_t *)txm_image_row(to, y))[x * n + c] = txm_level_code(h->code, pixel[c]);
        else txm_image_set(to, x, y, c, is_coded ? txm_linear_to_srgb(pixel[c]) : pixel[c]);
    }
}

/* Pixel (x, y) of half: the mean of what it covers. */
static inline void txm_level_pixel(const txm_halving *h, int x, int y) {
    const txm_image *im = h->image;
    const int n = im->channels;
    double wx[3], wy[3], across, along, sum[4] = {0, 0, 0, 0};
    const int columns = txm_level_taps(im->width, x, wx, &across);
    const int rows = txm_level_taps(im->height, y, wy, &along);
    const int weighs_alpha = h->content == TXM_COLOR && n % 2 == 0;
    txm_mean mean = txm_mean_of(n);
    float pixel[4];
    for (int v = 0; v < rows; v++) {
        const void *row = txm_image_row_const(im, 2 * y + v);
        for (int u = 0; u < columns; u++) {
            const double weight = wx[u] * wy[v];
            txm_level_load(h, row, 2 * x + u, pixel);
            if (weighs_alpha) txm_mean_add(&mean, pixel, weight);
            for (int c = 0; c < n && !weighs_alpha; c++) {
                const int is_vector = h->content == TXM_NORMALS && c < 3;
                const double sample = (double)pixel[c];
                sum[c] += weight * (is_vector ? txm_normal_decode(sample, im->sample) : sample);
            }
        }
    }
    if (weighs_alpha) txm_mean_get(&mean, pixel);
    for (int c = 0; c < n && !weighs_alpha; c++) pixel[c] = txm_float(sum[c] / (across * along));
    if (h->content == TXM_NORMALS) txm_level_normal(sum, im->sample, pixel);
    txm_level_store(h, x, y, pixel);
}

static inline void txm_level_row(void *context, int y) {
    const txm_halving *h = (const txm_halving *)context;
    const txm_image *im = h->image, *to = h->half;
    const size_t bytes = txm_sample_bytes(im->sample) * (size_t)im->channels;
    if (h->content != TXM_LABELS) {
        for (int x = 0; x < to->width; x++) txm_level_pixel(h, x, y);
        return;
    }
    const char *from = (const char *)txm_image_row_const(im, 2 * y);
    char *out = (char *)txm_image_row(to, y);
    for (int x = 0; x < to->width; x++)
        memcpy(out + (size_t)x * bytes, from + (size_t)(2 * x) * bytes, bytes);
}

/* The next coarser level of detail: each pixel is the mean of what it covers, which is 2 x 2 pixels,
   or 3 along sides that are odd, the outer ones in part (so that no pixel is lost or counts
   twice). No pixel is taken from beyond the border, so the levels of a picture that tiles tile too.

   image    1 pixel or more
   content  how samples are averaged
   wrap     TXM_WRAP_X | TXM_WRAP_Y: the picture tiles that way (matters for hidden colour only)
   half     txm_level_side(side, 1) for both sides, channels and sample of image, not overlapping.
            The colour of its transparent pixels is that of visible neighbours, see txm_image_bleed;
            untouched after an error
   return   TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY (only if colour is hidden)
   cost     about 30 ns per pixel of image on one thread                                   */
static inline txm_status txm_image_halve(const txm_image *image, txm_content content, int wrap,
                                         const txm_image *half, txm_env *env) {
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status == TXM_OK) status = txm_image_check(half, "half", 0, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image), to = txm_image_resolve(*half);
    if (from.sample != to.sample || from.channels != to.channels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "half",
                           "must have the channels and samples of image");
    if (to.width != txm_level_side(from.width, 1) || to.height != txm_level_side(from.height, 1))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "half",
                           "its sides must be half those of image, rounded down, and 1 at least");
    if (content == TXM_NORMALS && from.channels < 3)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "a normal map has 3 or 4 channels");
    float linear[256], code[255];
    txm_halving h = {&from, &to, content, linear, code};
    txm_bleed bleed;
    txm_arena arena;
    const int may_hide = content == TXM_COLOR && txm_image_has_hidden(&from);
    txm_arena_init(&arena, env);
    if (may_hide) txm_bleed_begin(&bleed, &to, wrap, &arena);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to continue visible colours");
    }
    for (int i = 0; i < 256; i++) {
        linear[i] = txm_srgb_to_linear((float)i / 255.0f);
        if (i) code[i - 1] = txm_srgb_to_linear(((float)i - 0.5f) / 255.0f);
    }
    txm_parallel_for(env, to.height, txm_level_row, &h);
    if (may_hide && txm_image_has_hidden(&to)) {
        txm_env quiet; /* half is complete or untouched: it cannot be cancelled */
        memset(&quiet, 0, sizeof quiet);
        if (env) quiet = *env;
        quiet.progress = NULL;
        status = txm_bleed_run(&bleed, &quiet);
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- cutouts ---------------------------------------------------------------------------- */

/* alpha of a pixel in 65535ths, rounded; 65535 without alpha */
static inline int txm_alpha_code(const txm_image *image, int x, int y) {
    if (!txm_image_has_alpha(image)) return 65535;
    const float alpha = txm_image_get(image, x, y, image->channels - 1);
    return (int)((double)txm_clampf(alpha, 0, 1) * 65535 + 0.5);
}

/* the smallest alpha, in 65535ths, that a test against threshold, 0..1, lets pass */
static inline int txm_alpha_limit(float threshold) {
    return (int)ceil((double)txm_clampf(threshold, 0, 1) * 65535);
}

/* The share of pixels, 0..1, whose alpha is threshold, 0..1, or more. */
static inline double txm_image_coverage(const txm_image *image, float threshold) {
    const txm_image im = txm_image_resolve(*image);
    const int limit = txm_alpha_limit(threshold);
    double count = 0;
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) count += txm_alpha_code(&im, x, y) >= limit;
    }
    return count / im.width / im.height;
}

/* Scale the alpha of a level of a cutout (leaves, fences) so that a test against threshold lets
   the same share of pixels pass as in the picture itself; means alone let thin parts vanish and
   gaps close [10]. Make all levels first, from each other, then scale each of them: coarser levels
   made from scaled ones would be wrong.

   image      in place; 2 or 4 channels, else untouched
   coverage   txm_image_coverage of the picture, 0..1: the nearest that any factor gives is taken
   threshold  above 0, up to 1; that of the test, mostly 0.5
   return     TXM_OK, TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY (untouched)       */
static inline txm_status txm_image_set_coverage(const txm_image *image, double coverage,
                                                float threshold, txm_env *env) {
    enum { CODES = 65536 };
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status != TXM_OK) return status;
    if (!(coverage >= 0 && coverage <= 1 && threshold > 0 && threshold <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "coverage must be 0 to 1, threshold above 0 and up to 1");
    const txm_image im = txm_image_resolve(*image);
    if (!txm_image_has_alpha(&im)) return TXM_OK;
    size_t *count = (size_t *)txm_alloc(env, CODES * sizeof *count);
    if (!count) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to count alphas");
    memset(count, 0, CODES * sizeof *count);
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) count[txm_alpha_code(&im, x, y)]++;
    }
    /* The limits that let a share nearest to coverage pass are those from first to last, for they
       lie between two alphas that occur; the pass must hold after the new alphas are rounded, so
       the middle is taken, unless the limit that there is will do. */
    const int limit = txm_alpha_limit(threshold);
    const double want = coverage * im.width * im.height;
    double nearest = want, passed = 0; /* of the limits from 65536 on, which nothing passes */
    int first = CODES, last = 2 * CODES;
    for (int t = CODES - 1; t > 0; t--) {
        passed += (double)count[t];
        const double miss = fabs(passed - want);
        if (miss < nearest) {
            nearest = miss;
            last = first = t;
        } else if (count[t] == 0 && first == t + 1) {
            first = t;
        }
    }
    txm_free(env, count);
    if (limit >= first && limit <= last) return TXM_OK;
    const int middle = first + (last - first) / 2;
    const double factor = (double)limit / middle;
    for (int y = 0; y < im.height; y++) {
        for (int x = 0; x < im.width; x++) {
            const float alpha = txm_image_get(&im, x, y, im.channels - 1);
            txm_image_set(&im, x, y, im.channels - 1,
                          txm_minf(txm_float((double)alpha * factor), 1));
        }
    }
    return TXM_OK;
}

/* ---- kernel: uneven light --------------------------------------------------------------- */

/* A photograph is lit unevenly: a lens darkens its corners, a lamp or a window is nearer to one
   side. The eye does not mind, but where such a picture is cut up and put together again, the
   pieces have different light, and it shows as patches and crescents. Light multiplies: what a
   camera sees is i(x) = l(x) r(x), in linear light, with l slow and r the texture. txm_even estimates
   l as what is left of i once everything narrower is averaged out, and divides by it;
   txm_uneven tells whether a picture needs that.                                           */
typedef struct txm_even_desc {
    txm_image image; /* colours: 8 and 16 bits sRGB-encoded, float linear light; alpha says how much
                        each pixel counts                                                         */
    txm_image mask;  /* the size of the image: only pixels where it counts (txm_mask_at) are looked
                        at, though all are changed; pixels NULL: all are                          */
    float radius;    /* pixels, TXM_EVEN_LEAST..TXM_EVEN_MOST: changes of light wider than this are
                        taken out; a wave of twice this length loses half its height. 0 = half the
                        smaller side of the image                                                 */
} txm_even_desc;

#define TXM_EVEN_LEAST 8.0f
#define TXM_EVEN_MOST 1e6f
#define TXM_EVEN_BRIGHTER 8.0 /* dark parts become brighter by at most this factor: 3 stops, so that
                                 their noise does not become texture                              */

enum {
    TXM_LIGHT_CELLS = 4,  /* cells of the grid for each radius ...                                */
    TXM_LIGHT_LEAST = 8,  /* ... and at least for each side, so that there are planes to fit      */
    TXM_LIGHT_RING = 2,   /* nodes beyond the outer cells on each side, for the splines           */
    TXM_LIGHT_BANDS = 64, /* into which the rows are divided for threads                          */
    TXM_LIGHT_REACH = 3   /* deviations of the window after which it ends                         */
};

/* a Gaussian of this deviation, in radii, halves waves of two radii: sqrt(2 ln 2) / pi          */
#define TXM_LIGHT_DEVIATION 0.375
/* of the cells' boxes and of the cubic splines between nodes, in cells: 1/12 + 1/3              */
#define TXM_LIGHT_SMOOTH (5.0 / 12.0)
#define TXM_LIGHT_RIDGE 0.001 /* of the window's variance: no slopes where all known cells lie on a line */

/* The grid of one picture. Nodes are cell centres, and a ring beyond: node k lies on cell k - 2. */
typedef struct txm_light {
    txm_image image, mask, out;
    int colours, wide, high; /* cells                                                             */
    int across, down;        /* nodes: wide and high and both rings                               */
    int reach[2];            /* of the window, cells                                              */
    double *window[2];       /* its weights, 2 reach + 1, for x and y                             */
    float *decoded;          /* light of each code of 8 or 16 bits; NULL: float samples           */
    double *sums;            /* of each cell: weight, then weighted light of each colour          */
    double *moments;         /* of each row of cells at each node: 3 of weight, 2 of each colour  */
    double *nodes;           /* of each node and colour: gain in light to the power 1 / 2.4       */
    double *lines;           /* of each band: nodes of one row of pixels                          */
    double mean[3];
} txm_light;

/* the same without libm, whose pow is not the same everywhere */
static inline double txm_light_of(double code) {
    return code <= 0.04045 ? code / 12.92 : txm_pow((code + 0.055) / 1.055, 2.4);
}
static inline double txm_light_code(double light) {
    return light <= 0.0031308 ? 12.92 * light : 1.055 * txm_pow(light, 1 / 2.4) - 0.055;
}

/* The code of a sample in light that is power^2.4 times brighter. On the curve's upper part, where
   nearly all samples are, no power of it is needed: (code + 0.055) power - 0.055.               */
static inline double txm_light_scale(double code, double power) {
    if (code > 0.04045) {
        const double scaled = (code + 0.055) * power - 0.055;
        if (scaled > 0.04045) return scaled;
    }
    return txm_light_code(txm_light_of(code) * txm_pow(power, 2.4));
}

/* first pixel of cell k of count, along a side */
static inline int txm_light_edge(int side, int k, int count) {
    return (int)((int64_t)side * k / count);
}

/* how much pixel (x, y) counts, 0..1 */
static inline double txm_light_weight(const txm_image *image, const txm_image *mask, int x, int y) {
    if (mask->pixels && !txm_mask_at(mask, x, y)) return 0;
    if (!txm_image_has_alpha(image)) return 1;
    return (double)txm_clampf(txm_image_get(image, x, y, image->channels - 1), 0, 1);
}

/* light of sample c of pixel (x, y); decoded as in txm_light */
static inline double txm_light_get(const txm_image *image, const float *decoded, int x, int y,
                                   int c) {
    const void *row = txm_image_row_const(image, y);
    const size_t i = (size_t)x * (size_t)image->channels + (size_t)c;
    const float code = txm_sample_code(row, image->sample, i);
    return (double)(decoded ? decoded[(int)code] : code);
}

/* The light of each code of 8 or 16 bits; NULL for float samples, or without memory. */
static inline float *txm_light_decode(const txm_image *image, txm_arena *arena) {
    const int codes = image->sample == TXM_U8 ? 256 : 65536;
    if (image->sample == TXM_F32) return NULL;
    float *decoded = (float *)txm_arena_alloc(arena, (size_t)codes, sizeof(float));
    for (int k = 0; k < codes && decoded; k++)
        decoded[k] = txm_float(txm_light_of((double)k / (codes - 1)));
    return decoded;
}

/* Sum up the cells of one row. */
static inline void txm_light_sum(void *context, int row) {
    const txm_light *l = (const txm_light *)context;
    const int lanes = 1 + l->colours;
    double *sums = l->sums + (size_t)row * (size_t)l->wide * (size_t)lanes;
    memset(sums, 0, (size_t)l->wide * (size_t)lanes * sizeof *sums);
    const int bottom = txm_light_edge(l->image.height, row + 1, l->high);
    for (int y = txm_light_edge(l->image.height, row, l->high); y < bottom; y++) {
        double *cell = sums;
        for (int k = 0; k < l->wide; k++, cell += lanes) {
            const int end = txm_light_edge(l->image.width, k + 1, l->wide);
            for (int x = txm_light_edge(l->image.width, k, l->wide); x < end; x++) {
                const double weight = txm_light_weight(&l->image, &l->mask, x, y);
                if (!(weight > 0)) continue;
                cell[0] += weight;
                for (int c = 0; c < l->colours; c++)
                    cell[1 + c] += weight * txm_light_get(&l->image, l->decoded, x, y, c);
            }
        }
    }
}

/* Along one row of cells, at each node: the window's sums of weight times 1, u, u^2 and of light times
   1, u, where u is the distance to the cell. */
static inline void txm_light_across(void *context, int row) {
    const txm_light *l = (const txm_light *)context;
    const int lanes = 1 + l->colours, count = 3 + 2 * l->colours, reach = l->reach[0];
    const double *sums = l->sums + (size_t)row * (size_t)l->wide * (size_t)lanes;
    double *m = l->moments + (size_t)row * (size_t)l->across * (size_t)count;
    for (int node = 0; node < l->across; node++, m += count) {
        for (int i = 0; i < count; i++) m[i] = 0;
        for (int u = -reach; u <= reach; u++) {
            const int k = node - TXM_LIGHT_RING + u;
            if (k < 0 || k >= l->wide) continue;
            const double *cell = sums + (size_t)k * (size_t)lanes, w = l->window[0][u + reach];
            m[0] += w * cell[0];
            m[1] += w * u * cell[0];
            m[2] += w * u * u * cell[0];
            for (int c = 0; c < l->colours; c++) {
                m[3 + 2 * c] += w * cell[1 + c];
                m[4 + 2 * c] += w * u * cell[1 + c];
            }
        }
    }
}

/* The value at (0, 0) of the plane a + b u + c v that fits best: weights w, values z.
   s: sums of w times 1, u, v, u^2, u v, v^2;  z: sums of w z times 1, u, v;  ridge: added to the
   variances of u and v. */
static inline double txm_light_plane(const double s[6], const double z[3], const double ridge[2]) {
    const double a = s[3] - s[1] * s[1] / s[0] + ridge[0] * s[0], b = s[4] - s[1] * s[2] / s[0];
    const double d = s[5] - s[2] * s[2] / s[0] + ridge[1] * s[0];
    const double p = z[1] - s[1] * z[0] / s[0], q = z[2] - s[2] * z[0] / s[0];
    const double det = a * d - b * b; /* above 0: a and d are ridged                              */
    const double du = (d * p - b * q) / det, dv = (a * q - b * p) / det;
    return (z[0] - du * s[1] - dv * s[2]) / s[0];
}

/* One row of nodes: light there, from a plane fitted in the window, and the gain that it takes. */
static inline void txm_light_down(void *context, int row) {
    const txm_light *l = (const txm_light *)context;
    const int count = 3 + 2 * l->colours, reach = l->reach[1];
    double ridge[2], *to = l->nodes + (size_t)row * (size_t)l->across * (size_t)l->colours;
    for (int axis = 0; axis < 2; axis++) {
        const double deviation = (double)l->reach[axis] / (int)TXM_LIGHT_REACH;
        ridge[axis] = TXM_LIGHT_RIDGE * deviation * deviation;
    }
    for (int node = 0; node < l->across; node++, to += l->colours) {
        double s[6] = {0}, z[3][3] = {{0}};
        for (int v = -reach; v <= reach; v++) {
            const int k = row - TXM_LIGHT_RING + v;
            if (k < 0 || k >= l->high) continue;
            const size_t place = (size_t)k * (size_t)l->across + (size_t)node;
            const double *m = l->moments + place * (size_t)count;
            const double w = l->window[1][v + reach];
            s[0] += w * m[0];
            s[1] += w * m[1];
            s[2] += w * v * m[0];
            s[3] += w * m[2];
            s[4] += w * v * m[1];
            s[5] += w * v * v * m[0];
            for (int c = 0; c < l->colours; c++) {
                z[c][0] += w * m[3 + 2 * c];
                z[c][1] += w * m[4 + 2 * c];
                z[c][2] += w * v * m[3 + 2 * c];
            }
        }
        for (int c = 0; c < l->colours; c++) {
            const double mean = l->mean[c], least = mean / TXM_EVEN_BRIGHTER;
            double light = mean;
            if (s[0] > 0) light = txm_light_plane(s, z[c], ridge);
            if (!(light >= least)) light = least;
            to[c] = mean > 0 ? txm_pow(mean / light, 1 / 2.4) : 1;
        }
    }
}

/* Weights of the four nodes around a place between the second and the third, at t from 0 to 1: the
   cubic B-spline. */
static inline void txm_light_spline(double t, double w[4]) {
    const double u = 1 - t, tt = t * t, ttt = tt * t;
    w[0] = u * u * u / 6;
    w[1] = (3 * ttt - 6 * tt + 4) / 6;
    w[2] = (-3 * ttt + 3 * tt + 3 * t + 1) / 6;
    w[3] = ttt / 6;
}

/* The first of the four nodes around pixel x of a side of so many cells, and their weights. */
static inline int txm_light_place(int x, int side, int cells, double w[4]) {
    const double at = (x + 0.5) * cells / side - 0.5 + (int)TXM_LIGHT_RING; /* 1.5 or more             */
    const int node = (int)at;
    txm_light_spline(at - node, w);
    return node - 1;
}

/* the nodes of one row of pixels */
static inline void txm_light_line(const txm_light *l, int y, double *line) {
    double w[4];
    const size_t count = (size_t)l->across * (size_t)l->colours;
    const double *from =
        l->nodes + (size_t)txm_light_place(y, l->image.height, l->high, w) * count;
    for (size_t i = 0; i < count; i++)
        line[i] = w[0] * from[i] + w[1] * from[i + count] + w[2] * from[i + 2 * count] +
                  w[3] * from[i + 3 * count];
}

/* Apply the gains to one band of rows. */
static inline void txm_light_apply(void *context, int band) {
    const txm_light *l = (const txm_light *)context;
    const int n = l->colours, last = txm_light_edge(l->image.height, band + 1, TXM_LIGHT_BANDS);
    double *line = l->lines + (size_t)band * (size_t)l->across * (size_t)n, w[4];
    for (int y = txm_light_edge(l->image.height, band, TXM_LIGHT_BANDS); y < last; y++) {
        txm_light_line(l, y, line);
        for (int x = 0; x < l->image.width; x++) {
            const int node = txm_light_place(x, l->image.width, l->wide, w);
            const double *p = line + (size_t)node * (size_t)n;
            for (int c = 0; c < l->image.channels; c++) {
                const float code = txm_image_get(&l->image, x, y, c);
                if (c >= n) { /* alpha */
                    txm_image_set(&l->out, x, y, c, code);
                    continue;
                }
                const double power = w[0] * p[c] + w[1] * p[c + n] + w[2] * p[c + 2 * n] +
                                     w[3] * p[c + 3 * n];
                const double scaled = l->decoded ? txm_light_scale((double)code, power)
                                                 : (double)code * txm_pow(power, 2.4);
                txm_image_set(&l->out, x, y, c, txm_float(scaled));
            }
        }
    }
}

/* The mean light of each colour; in cell order, so that threads do not matter. 0: nothing counts. */
static inline int txm_light_mean(txm_light *l) {
    const size_t lanes = 1 + (size_t)l->colours, cells = (size_t)l->wide * (size_t)l->high;
    double total[4] = {0};
    for (size_t i = 0; i < cells; i++)
        for (size_t k = 0; k < lanes; k++) total[k] += l->sums[i * lanes + k];
    for (int c = 0; c < l->colours && total[0] > 0; c++) l->mean[c] = total[1 + c] / total[0];
    return total[0] > 0;
}

/* what the splines make of colour c of the nodes at the centre of a cell, whose node this is */
static inline double txm_light_centre(const txm_light *l, const double *node, size_t c) {
    static const double w[3] = {1.0 / 6, 4.0 / 6, 1.0 / 6};
    const size_t n = (size_t)l->colours, row = (size_t)l->across * n;
    double sum = 0;
    for (size_t y = 0; y < 3; y++)
        for (size_t x = 0; x < 3; x++) sum += w[y] * w[x] * node[c + y * row + x * n - row - n];
    return sum;
}

/* Scale all gains so that the mean light of each colour stays what it is. */
static inline void txm_light_keep_mean(txm_light *l) {
    const size_t n = (size_t)l->colours, lanes = 1 + n, row = (size_t)l->across * n;
    double before[3] = {0}, after[3] = {0};
    for (int y = 0; y < l->high; y++) {
        for (int x = 0; x < l->wide; x++) {
            const double *cell = l->sums + ((size_t)y * (size_t)l->wide + (size_t)x) * lanes;
            const double *node = l->nodes + (size_t)(y + TXM_LIGHT_RING) * row +
                                 (size_t)(x + TXM_LIGHT_RING) * n;
            for (size_t c = 0; c < n; c++) {
                before[c] += cell[1 + c];
                after[c] += cell[1 + c] * txm_pow(txm_light_centre(l, node, c), 2.4);
            }
        }
    }
    for (size_t c = 0; c < n; c++) {
        if (!(before[c] > 0 && after[c] > 0)) continue;
        const double power = txm_pow(before[c] / after[c], 1 / 2.4);
        for (size_t i = c; i < row * (size_t)l->down; i += n) l->nodes[i] *= power;
    }
}

/* The window along one axis, and room for it. */
static inline void txm_light_window(txm_light *l, int axis, double radius, txm_arena *arena) {
    const int side = axis ? l->image.height : l->image.width, cells = axis ? l->high : l->wide;
    const double wide = TXM_LIGHT_DEVIATION * radius * cells / side;
    const double variance = fmax(wide * wide - TXM_LIGHT_SMOOTH, 0.25);
    const double reach = ceil((int)TXM_LIGHT_REACH * sqrt(variance));
    /* further cells than these there are not */
    l->reach[axis] = reach < cells + TXM_LIGHT_RING ? (int)reach : cells + TXM_LIGHT_RING;
    const int size = 2 * l->reach[axis] + 1;
    l->window[axis] = (double *)txm_arena_alloc(arena, (size_t)size, sizeof(double));
    for (int i = 0; i < size && l->window[axis]; i++) {
        const double u = i - l->reach[axis], ln2 = 0.69314718055994530942;
        l->window[axis][i] = txm_exp2(-fmin(u * u / (2 * variance * ln2), 900));
    }
}

/* how many cells of about this size a side is divided into */
static inline int txm_light_count(int side, double cell) {
    const int least = side < TXM_LIGHT_LEAST ? side : TXM_LIGHT_LEAST;
    return (int)fmax(side / cell + 0.5, least);
}

static inline void txm_light_make_room(txm_light *l, double radius, txm_arena *arena) {
    const double cell = radius / (int)TXM_LIGHT_CELLS;
    const int n = l->colours;
    l->wide = txm_light_count(l->image.width, cell);
    l->high = txm_light_count(l->image.height, cell);
    l->across = l->wide + 2 * TXM_LIGHT_RING;
    l->down = l->high + 2 * TXM_LIGHT_RING;
    for (int axis = 0; axis < 2; axis++) txm_light_window(l, axis, radius, arena);
    const size_t wide = (size_t)l->wide, high = (size_t)l->high, across = (size_t)l->across;
    l->sums = (double *)txm_arena_alloc(arena, wide * high, (size_t)(1 + n) * sizeof(double));
    const size_t nodes = across * (size_t)l->down, colours = (size_t)n * sizeof(double);
    l->moments = (double *)txm_arena_alloc(arena, across * high, (size_t)(3 + 2 * n) * sizeof(double));
    l->nodes = (double *)txm_arena_alloc(arena, nodes, colours);
    l->lines = (double *)txm_arena_alloc(arena, across * TXM_LIGHT_BANDS, colours);
    l->decoded = txm_light_decode(&l->image, arena);
}

static inline txm_status txm_light_check(const txm_even_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    txm_status status = txm_image_check(&desc->image, "image", 0, env);
    if (status != TXM_OK) return status;
    if (!txm_image_is_finite(&desc->image))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "has samples that are infinite or NaN");
    if (!(desc->radius == 0 || (desc->radius >= TXM_EVEN_LEAST && desc->radius <= TXM_EVEN_MOST)))
        return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "radius must be 0 (default) or # to #",
                                (uint64_t)TXM_EVEN_LEAST, (uint64_t)TXM_EVEN_MOST);
    if (!desc->mask.pixels) return TXM_OK;
    return txm_mask_check(&desc->mask, "mask", desc->image.width, desc->image.height, 0, env);
}

/* the radius that is meant */
static inline double txm_even_radius(const txm_even_desc *desc) {
    const int w = desc->image.width, h = desc->image.height;
    return desc->radius > 0 ? (double)desc->radius : fmax((w < h ? w : h) / 2.0, TXM_EVEN_LEAST);
}

/* Take out slow changes of light and colour. In linear light, in each channel of colour,

       out(x) = image(x) min(mean / l(x), 8)

   where l(x) is the value at x of a plane that is fitted to all that counts, by a Gaussian window
   around x: unlike a mean, it is right next to borders and holes too. All is scaled so that the
   mean light of each channel stays. Local contrast, as a ratio of light, is kept.

   out     the same size, channels and samples as the image, which it may be; all pixels are
           changed, alpha is not. Integer samples are clamped: what was nearly white in a dark
           part becomes white. Where nothing counts at all, the image as it is
   env     progress "even light"
   return  TXM_OK; TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED: out is untouched
   cost    about 30 ns for each sample on one thread, any radius; 1200 bytes for each square of
           radius x radius pixels                                                          */
static inline txm_status txm_even(const txm_even_desc *desc, txm_env *env, const txm_image *out) {
    txm_light l;
    txm_arena arena;
    txm_status status = txm_light_check(desc, env);
    if (status == TXM_OK) status = txm_image_check(out, "out", 0, env);
    if (status != TXM_OK) return status;
    memset(&l, 0, sizeof l);
    l.image = txm_image_resolve(desc->image);
    l.out = txm_image_resolve(*out);
    if (desc->mask.pixels) l.mask = txm_image_resolve(desc->mask);
    if (l.out.width != l.image.width || l.out.height != l.image.height ||
        l.out.channels != l.image.channels || l.out.sample != l.image.sample)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have size, channels and samples of the image");
    l.colours = txm_image_colours(&l.image);
    txm_arena_init(&arena, env);
    txm_light_make_room(&l, txm_even_radius(desc), &arena);
    if (arena.failed) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to even the light");
    else if (txm_progress(env, 0, "even light")) status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status == TXM_OK) {
        txm_parallel_for(env, l.high, txm_light_sum, &l);
        if (!txm_light_mean(&l)) l.mean[0] = l.mean[1] = l.mean[2] = 0; /* gains of 1             */
        txm_parallel_for(env, l.high, txm_light_across, &l);
        txm_parallel_for(env, l.down, txm_light_down, &l);
        txm_light_keep_mean(&l);
        if (txm_progress(env, 0.5f, "even light"))
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
    }
    if (status == TXM_OK) txm_parallel_for(env, TXM_LIGHT_BANDS, txm_light_apply, &l);
    txm_arena_free(&arena);
    return status;
}

/* ---- is it light? ----------------------------------------------------------------------- */

/* What tells uneven light from content (a stone, courses of brick, a meadow beside rock): light is
   slower than all else, and it changes everything alike. Of each of 16 x 16 cells the mean, the
   quartiles and the deviation of light are taken, in stops (log2). Polynomials of degree 1 and 2 in x
   and y fit the means (falloff to a side, dark corners). They are light if

     - they are large: 0.35 stops or more between the brightest and the darkest cell;
     - they are alone: each of these five polynomials holds on average 20 times as much of the
       variance as each of the next 22, of degrees 3 to 6. Content has large parts and smaller ones;
     - they are everywhere: the quartiles of the cells, so dark and bright pixels, follow them, and
       so does the deviation. Where there is more rock than grass, only their shares change. */
enum {
    TXM_UNEVEN_SIDE = 16,
    TXM_UNEVEN_COUNT = TXM_UNEVEN_SIDE * TXM_UNEVEN_SIDE,
    TXM_UNEVEN_DEGREE = 6,                /* of the polynomials that are compared                 */
    TXM_UNEVEN_SLOW = 2,                  /* of those that are slow                               */
    TXM_UNEVEN_BASIS = 28,                /* polynomials of degree 0 to 6                         */
    TXM_UNEVEN_LEAST_CELL = 4,            /* pixels a side                                        */
    TXM_UNEVEN_LEAST_CELLS = TXM_UNEVEN_COUNT / 2, /* that must be known                          */
    TXM_UNEVEN_LOOK = 2048,               /* pixels of a side that are looked at                  */
    TXM_UNEVEN_BINS = 256,
    TXM_UNEVEN_FIGURES = 5                /* mean, three quartiles, deviation                     */
};
#define TXM_UNEVEN_STOPS 0.35             /* a smaller change does not show among texture         */
#define TXM_UNEVEN_RATIO 20.0
#define TXM_UNEVEN_FOLLOW 0.5             /* quartiles follow by 1 +- so much ...                 */
#define TXM_UNEVEN_DEVIATION 0.6          /* ... and deviations by so much                        */
#define TXM_UNEVEN_BLACK (1.0 / 512)      /* light that is nothing, lest the log2 of noise counts */

typedef struct txm_uneven_grid {
    txm_image image, mask;
    const float *decoded;
    int colours, step_x, step_y;
    double known[TXM_UNEVEN_COUNT]; /* share of the cell's pixels that counts                      */
    double stops[3][TXM_UNEVEN_FIGURES][TXM_UNEVEN_COUNT];
    double bins[TXM_UNEVEN_SIDE][3][TXM_UNEVEN_BINS];
    double basis[TXM_UNEVEN_BASIS][TXM_UNEVEN_COUNT];
    int degree[TXM_UNEVEN_BASIS], cells, functions;
} txm_uneven_grid;

/* the bin of a sample: its code in 8 bits */
static inline int txm_uneven_bin(const txm_image *image, int x, int y, int c) {
    double code = (double)txm_clampf(txm_image_get(image, x, y, c), 0, 1);
    if (image->sample == TXM_F32) code = txm_light_code(code);
    return (int)(code * (TXM_UNEVEN_BINS - 1) + 0.5);
}

/* The light below which this share of the bins lies, linear within a bin. */
static inline double txm_uneven_quantile(const double *bins, double total, double share) {
    double below = 0;
    int k = 0;
    while (k < TXM_UNEVEN_BINS - 1 && below + bins[k] <= share * total) below += bins[k++];
    const double within = bins[k] > 0 ? (share * total - below) / bins[k] : 0.5;
    return txm_light_of(fmax(k - 0.5 + within, 0) / (TXM_UNEVEN_BINS - 1));
}

/* The figures of the cells of one row. */
static inline void txm_uneven_row(void *context, int row) {
    txm_uneven_grid *g = (txm_uneven_grid *)context;
    const int n = TXM_UNEVEN_SIDE, bottom = txm_light_edge(g->image.height, row + 1, n);
    for (int k = 0; k < n; k++) {
        const int end = txm_light_edge(g->image.width, k + 1, n), cell = row * n + k;
        double weight = 0, seen = 0, sum[3] = {0}, square[3] = {0};
        memset(g->bins[row], 0, sizeof g->bins[row]);
        for (int y = txm_light_edge(g->image.height, row, n); y < bottom; y += g->step_y) {
            for (int x = txm_light_edge(g->image.width, k, n); x < end; x += g->step_x) {
                const double w = txm_light_weight(&g->image, &g->mask, x, y);
                seen += 1;
                if (!(w > 0)) continue;
                weight += w;
                for (int c = 0; c < g->colours; c++) {
                    const double light = txm_light_get(&g->image, g->decoded, x, y, c);
                    sum[c] += w * light;
                    square[c] += w * light * light;
                    g->bins[row][c][txm_uneven_bin(&g->image, x, y, c)] += w;
                }
            }
        }
        g->known[cell] = weight / seen;
        for (int c = 0; c < g->colours && weight > 0; c++) {
            const double mean = sum[c] / weight;
            double figure[TXM_UNEVEN_FIGURES];
            figure[0] = mean;
            for (int q = 1; q < 4; q++)
                figure[q] = txm_uneven_quantile(g->bins[row][c], weight, 0.25 * q);
            figure[4] = sqrt(fmax(square[c] / weight - mean * mean, 0));
            for (int f = 0; f < TXM_UNEVEN_FIGURES; f++)
                g->stops[c][f][cell] = txm_log2(fmax(figure[f], 0) + TXM_UNEVEN_BLACK);
        }
    }
}

/* Leave the cells of which at least a quarter counts: known becomes 1 or 0. */
static inline void txm_uneven_choose(txm_uneven_grid *g) {
    g->cells = 0;
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) {
        g->known[i] = g->known[i] >= 0.25;
        g->cells += g->known[i] > 0;
    }
}

/* the sum over known cells of a b */
static inline double txm_uneven_dot(const txm_uneven_grid *g, const double *a, const double *b) {
    double sum = 0;
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) sum += g->known[i] * a[i] * b[i];
    return sum;
}

/* Polynomials of x and y that are orthogonal over the known cells, of mean square 1: Gram-Schmidt in
   order of degree, each twice. Those that the others can express there are left out. */
static inline void txm_uneven_basis(txm_uneven_grid *g) {
    g->functions = 0;
    for (int degree = 0; degree <= TXM_UNEVEN_DEGREE; degree++) {
        for (int p = 0; p <= degree; p++) {
            double *f = g->basis[g->functions];
            for (int i = 0; i < TXM_UNEVEN_COUNT; i++) {
                const double x = (i % TXM_UNEVEN_SIDE * 2 + 1.0) / (int)TXM_UNEVEN_SIDE - 1;
                const double y = ((int)(i / TXM_UNEVEN_SIDE) * 2 + 1.0) / (int)TXM_UNEVEN_SIDE - 1;
                f[i] = 1;
                for (int k = 0; k < degree; k++) f[i] *= k < p ? x : y;
            }
            const double before = txm_uneven_dot(g, f, f);
            for (int k = 0; k < 2 * g->functions; k++) {
                const double *other = g->basis[k % g->functions];
                const double part = txm_uneven_dot(g, f, other) / g->cells;
                for (int i = 0; i < TXM_UNEVEN_COUNT; i++) f[i] -= part * other[i];
            }
            const double after = txm_uneven_dot(g, f, f);
            if (!(after > 1e-9 * before)) continue;
            const double scale = sqrt(g->cells / after);
            for (int i = 0; i < TXM_UNEVEN_COUNT; i++) f[i] *= scale;
            TXM_ASSERT(g->functions < (int)(sizeof g->degree / sizeof *g->degree));
            g->degree[g->functions++] = degree;
        }
    }
}

/* The slow part of a figure: its value in each cell. Returns how much more of the variance each of
   its polynomials holds than each of the others, on average. */
static inline double txm_uneven_slow(const txm_uneven_grid *g, const double *figure, double *slow) {
    double held[2] = {0, 0};
    int count[2] = {0, 0};
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) slow[i] = 0;
    for (int k = 0; k < g->functions; k++) {
        if (g->degree[k] == 0) continue;
        const double part = txm_uneven_dot(g, g->basis[k], figure) / g->cells;
        const int is_fast = g->degree[k] > TXM_UNEVEN_SLOW;
        held[is_fast] += part * part;
        count[is_fast]++;
        for (int i = 0; i < TXM_UNEVEN_COUNT && !is_fast; i++) slow[i] += part * g->basis[k][i];
    }
    if (!count[0] || !count[1]) return 0;
    return held[0] / count[0] / fmax(held[1] / count[1], 1e-12);
}

/* The stops of uneven light in one colour, or 0 if it is not light. */
static inline double txm_uneven_colour(const txm_uneven_grid *g, int colour) {
    double slow[TXM_UNEVEN_FIGURES][TXM_UNEVEN_COUNT], low = 0, high = 0;
    const double ratio = txm_uneven_slow(g, g->stops[colour][0], slow[0]);
    for (int i = 0; i < TXM_UNEVEN_COUNT; i++) {
        if (!(g->known[i] > 0)) continue;
        low = fmin(low, slow[0][i]);
        high = fmax(high, slow[0][i]);
    }
    if (!(ratio >= TXM_UNEVEN_RATIO && high - low >= TXM_UNEVEN_STOPS)) return 0;
    const double own = txm_uneven_dot(g, slow[0], slow[0]);
    for (int f = 1; f < TXM_UNEVEN_FIGURES; f++) {
        txm_uneven_slow(g, g->stops[colour][f], slow[f]);
        const double follows = txm_uneven_dot(g, slow[0], slow[f]) / own;
        const double most = f == 4 ? TXM_UNEVEN_DEVIATION : TXM_UNEVEN_FOLLOW;
        if (!(fabs(follows - 1) <= most)) return 0;
    }
    return high - low;
}

/* How uneven is the light of a picture?

   desc    its radius does not matter
   stops   receives the difference between its brightest and its darkest part, log2 of light, in the
           colour where it is largest; 0 if it is even enough, if the change is one of content, or
           if the picture is too small to tell (less than 64 pixels a side, or most of it masked)
   env     progress "measure light"
   return  TXM_OK; TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED: *stops is 0
   cost    about 30 ns for each sample on one thread, of at most 2048 x 2048 pixels; 200 kB */
static inline txm_status txm_uneven(const txm_even_desc *desc, txm_env *env, float *stops) {
    txm_arena arena;
    if (!stops) return txm_fail(env, TXM_BAD_ARGUMENT, "stops is NULL");
    *stops = 0;
    txm_status status = txm_light_check(desc, env);
    if (status != TXM_OK) return status;
    const int least = TXM_UNEVEN_SIDE * TXM_UNEVEN_LEAST_CELL;
    if (desc->image.width < least || desc->image.height < least) return TXM_OK;
    txm_arena_init(&arena, env);
    txm_uneven_grid *g = (txm_uneven_grid *)txm_arena_zero(&arena, 1, sizeof *g);
    if (g) {
        g->image = txm_image_resolve(desc->image);
        if (desc->mask.pixels) g->mask = txm_image_resolve(desc->mask);
        g->decoded = txm_light_decode(&g->image, &arena);
    }
    if (arena.failed || !g)
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to measure the light");
    else if (txm_progress(env, 0, "measure light"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status == TXM_OK) {
        g->colours = txm_image_colours(&g->image);
        g->step_x = (g->image.width - 1) / TXM_UNEVEN_LOOK + 1;
        g->step_y = (g->image.height - 1) / TXM_UNEVEN_LOOK + 1;
        txm_parallel_for(env, TXM_UNEVEN_SIDE, txm_uneven_row, g);
        txm_uneven_choose(g);
        if (g->cells >= TXM_UNEVEN_LEAST_CELLS) {
            txm_uneven_basis(g);
            for (int c = 0; c < g->colours; c++)
                *stops = txm_maxf(*stops, txm_float(txm_uneven_colour(g, c)));
        }
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- random numbers --------------------------------------------------------------------- */

/* PCG32 (O'Neill 2014): 64 bits of state, the same stream on every machine. */
typedef struct txm_rng {
    uint64_t state;
} txm_rng;

/* Mix 64 bits into 64 bits, bijectively (the finaliser of SplitMix64). */
static inline uint64_t txm_hash(uint64_t x) {
    x ^= x >> 30;
    x *= 0xbf58476d1ce4e5b9u;
    x ^= x >> 27;
    x *= 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/* A generator for (seed, stream): different pairs give unrelated streams. */
static inline txm_rng txm_rng_make(uint64_t seed, uint64_t stream) {
    txm_rng rng;
    rng.state = txm_hash(seed + 0x9e3779b97f4a7c15u * (txm_hash(stream) | 1u));
    return rng;
}

/* 32 uniform bits */
static inline uint32_t txm_rng_next(txm_rng *rng) {
    uint64_t s = rng->state;
    rng->state = s * 6364136223846793005u + 1442695040888963407u;
    uint32_t x = (uint32_t)(((s >> 18) ^ s) >> 27), r = (uint32_t)(s >> 59);
    return (x >> r) | (x << ((32u - r) & 31u));
}

/* uniform in 0..n-1, n >= 1 (bias below n / 2^32) */
static inline uint32_t txm_rng_below(txm_rng *rng, uint32_t n) {
    return (uint32_t)(((uint64_t)txm_rng_next(rng) * n) >> 32);
}

/* uniform in low..high, both included, low <= high; the whole range of int is allowed */
static inline int txm_rng_range(txm_rng *rng, int low, int high) {
    const uint64_t n = (uint64_t)((int64_t)high - low) + 1; /* 1..2^32 */
    return (int)(low + (int64_t)((txm_rng_next(rng) * n) >> 32));
}

/* uniform multiples of 2^-24 in [0, 1): all are equally likely, 1 is never returned */
static inline float txm_rng_float(txm_rng *rng) {
    return (float)(txm_rng_next(rng) >> 8) * (1.0f / 16777216.0f);
}

/* uniform multiples of 2^-53 in [0, 1); takes two steps of the generator */
static inline double txm_rng_double(txm_rng *rng) {
    const uint64_t high = txm_rng_next(rng) >> 5, low = txm_rng_next(rng) >> 6;
    return (double)((high << 26) | low) * (1.0 / 9007199254740992.0);
}

/* Put the items in random order, all orders equally likely (Fisher and Yates). */
static inline void txm_shuffle(txm_rng *rng, int *items, int count) {
    for (int i = count - 1; i > 0; i--) {
        const int j = (int)txm_rng_below(rng, (uint32_t)i + 1);
        const int item = items[i];
        items[i] = items[j];
        items[j] = item;
    }
}

/* ---- sorting ---------------------------------------------------------------------------- */

typedef struct txm_pair {
    uint32_t key, value;
} txm_pair;

/* A key in the order of the floats: a < b gives key(a) < key(b), and -0 comes before +0. */
static inline uint32_t txm_sort_key(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

/* Sort by ascending key; pairs with equal keys keep their order (stable).

   Counting sort by each byte of the key, lowest first; a byte that all keys share is skipped.
   scratch  room for count pairs; its contents are lost
   cost     O(count), 8 KiB of stack on 64-bit machines                                    */
static inline void txm_sort_pairs(txm_pair *pairs, txm_pair *scratch, size_t count) {
    size_t next[4][256];
    txm_pair *from = pairs, *to = scratch;
    memset(next, 0, sizeof next);
    for (size_t i = 0; i < count; i++) {
        for (int b = 0; b < 4; b++) next[b][(pairs[i].key >> (8 * b)) & 255]++;
    }
    for (int b = 0; b < 4 && count > 1; b++) {
        size_t sum = 0;
        if (next[b][(pairs[0].key >> (8 * b)) & 255] == count) continue;
        for (int d = 0; d < 256; d++) { /* from how many to where the first goes */
            const size_t n = next[b][d];
            next[b][d] = sum;
            sum += n;
        }
        for (size_t i = 0; i < count; i++) to[next[b][(from[i].key >> (8 * b)) & 255]++] = from[i];
        txm_pair *t = from;
        from = to;
        to = t;
    }
    if (from != pairs) memcpy(pairs, from, count * sizeof *pairs);
}

/* ---- vectors ---------------------------------------------------------------------------- */

typedef struct txm_vec2 {
    float x, y;
} txm_vec2;
typedef struct txm_vec3 {
    float x, y, z;
} txm_vec3;

/* Constructors, as C++11 has no compound literals. */
static inline txm_vec2 txm_v2(float x, float y) {
    const txm_vec2 v = {x, y};
    return v;
}
static inline txm_vec3 txm_v3(float x, float y, float z) {
    const txm_vec3 v = {x, y, z};
    return v;
}

/* Component by component: a + b, a - b, a s, a (1 - t) + b t. Dot product; length; length 1 in the
   same direction, the zero vector for the zero vector; cross product. */
static inline txm_vec3 txm_vec3_add(txm_vec3 a, txm_vec3 b) {
    return txm_v3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline txm_vec3 txm_vec3_sub(txm_vec3 a, txm_vec3 b) {
    return txm_v3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline txm_vec3 txm_vec3_scale(txm_vec3 a, float s) {
    return txm_v3(a.x * s, a.y * s, a.z * s);
}
static inline txm_vec3 txm_vec3_lerp(txm_vec3 a, txm_vec3 b, float t) {
    return txm_v3(txm_lerpf(a.x, b.x, t), txm_lerpf(a.y, b.y, t), txm_lerpf(a.z, b.z, t));
}
static inline float txm_vec3_dot(txm_vec3 a, txm_vec3 b) {
    return txm_float((double)a.x * b.x + (double)a.y * b.y + (double)a.z * b.z);
}
static inline float txm_vec3_length(txm_vec3 a) {
    return txm_float(sqrt((double)a.x * a.x + (double)a.y * a.y + (double)a.z * a.z));
}
static inline txm_vec3 txm_vec3_normalize(txm_vec3 a) {
    const double n = sqrt((double)a.x * a.x + (double)a.y * a.y + (double)a.z * a.z);
    return n > 0 ? txm_v3(txm_float(a.x / n), txm_float(a.y / n), txm_float(a.z / n)) : a;
}
static inline txm_vec3 txm_vec3_cross(txm_vec3 a, txm_vec3 b) {
    return txm_v3(txm_float((double)a.y * b.z - (double)a.z * b.y),
                  txm_float((double)a.z * b.x - (double)a.x * b.z),
                  txm_float((double)a.x * b.y - (double)a.y * b.x));
}

/* some unit vector at a right angle to v; x for the zero vector */
static inline txm_vec3 txm_vec3_perpendicular(txm_vec3 v) {
    const float x = fabsf(v.x), y = fabsf(v.y), z = fabsf(v.z);
    if (x <= 0 && y <= 0 && z <= 0) return txm_v3(1, 0, 0);
    /* the cross product with the axis that v is least along */
    const txm_vec3 axis = x <= y && x <= z ? txm_v3(1, 0, 0)
                          : y <= z         ? txm_v3(0, 1, 0)
                                           : txm_v3(0, 0, 1);
    return txm_vec3_normalize(txm_vec3_cross(txm_vec3_normalize(v), axis));
}

/* ---- vectors in double ------------------------------------------------------------------ */

/* For geometric decisions: computed in double, no rounding to float in between. Plain sums and
   products in the order written, so the bits are the same everywhere. */
typedef struct txm_dvec3 {
    double x, y, z;
} txm_dvec3;

static inline txm_dvec3 txm_d3(double x, double y, double z) {
    txm_dvec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}
/* the three floats at p */
static inline txm_dvec3 txm_d3_load(const float *p) {
    return txm_d3(p[0], p[1], p[2]);
}
static inline txm_dvec3 txm_d3_add(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline txm_dvec3 txm_d3_sub(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline txm_dvec3 txm_d3_scale(txm_dvec3 a, double s) {
    return txm_d3(a.x * s, a.y * s, a.z * s);
}
/* a + b s */
static inline txm_dvec3 txm_d3_mad(txm_dvec3 a, txm_dvec3 b, double s) {
    return txm_d3(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s);
}
static inline double txm_d3_dot(txm_dvec3 a, txm_dvec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline txm_dvec3 txm_d3_cross(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
/* length and distance, also squared */
static inline double txm_d3_len2(txm_dvec3 a) {
    return txm_d3_dot(a, a);
}
static inline double txm_d3_len(txm_dvec3 a) {
    return sqrt(txm_d3_dot(a, a));
}
static inline double txm_d3_dist2(txm_dvec3 a, txm_dvec3 b) {
    return txm_d3_len2(txm_d3_sub(a, b));
}
static inline double txm_d3_dist(txm_dvec3 a, txm_dvec3 b) {
    return sqrt(txm_d3_dist2(a, b));
}
/* length 1 in the same direction, however long; the zero vector for the zero vector */
static inline txm_dvec3 txm_d3_unit(txm_dvec3 a) {
    const double n = txm_d3_len(a);
    if (n > 1e-150 && n < 1e150) return txm_d3_scale(a, 1 / n);
    /* its square has too few bits, or is out of range */
    const double most = fmax(fabs(a.x), fmax(fabs(a.y), fabs(a.z)));
    if (!(most > 0)) return a;
    a = txm_d3(a.x / most, a.y / most, a.z / most);
    return txm_d3_scale(a, 1 / txm_d3_len(a));
}
/* twice the area of the triangle a b c times its unit normal, on the side from which it is
   counter-clockwise */
static inline txm_dvec3 txm_d3_area2(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c) {
    return txm_d3_cross(txm_d3_sub(b, a), txm_d3_sub(c, a));
}

/* ---- quaternions ------------------------------------------------------------------------ */

/* A rotation: x, y, z = axis * sin(angle / 2), w = cos(angle / 2), of length 1. q and -q are the
   same rotation. No rotation is {0, 0, 0, 1}. */
typedef struct txm_quat {
    double x, y, z, w;
} txm_quat;

/* length 1; no rotation for the zero quaternion */
static inline txm_quat txm_quat_unit(txm_quat q) {
    const double n = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    const txm_quat none = {0, 0, 0, 1}, unit = {q.x / n, q.y / n, q.z / n, q.w / n};
    return n > 0 ? unit : none;
}
/* a after b */
static inline txm_quat txm_quat_mul(txm_quat a, txm_quat b) {
    const txm_quat q = {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                        a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z,
                        a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x,
                        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
    return q;
}
/* the opposite rotation */
static inline txm_quat txm_quat_conjugate(txm_quat q) {
    const txm_quat c = {-q.x, -q.y, -q.z, q.w};
    return c;
}
/* v turned by q: v + 2 w (u x v) + 2 u x (u x v), u = (x, y, z) */
static inline txm_dvec3 txm_quat_rotate(txm_quat q, txm_dvec3 v) {
    const double tx = 2 * (q.y * v.z - q.z * v.y), ty = 2 * (q.z * v.x - q.x * v.z);
    const double tz = 2 * (q.x * v.y - q.y * v.x);
    return txm_d3(v.x + q.w * tx + (q.y * tz - q.z * ty), v.y + q.w * ty + (q.z * tx - q.x * tz),
                  v.z + q.w * tz + (q.x * ty - q.y * tx));
}
/* The rotation that takes the axes to x, y, z, unit vectors at right angles. Not of length 1: its
   length is 4 times its largest component. [7]: of the four ways to compute it, the one that never
   divides by something small. */
static inline txm_quat txm_quat_from_axes(txm_dvec3 x, txm_dvec3 y, txm_dvec3 z) {
    const double c[4] = {1 + x.x - y.y - z.z, 1 - x.x + y.y - z.z, 1 - x.x - y.y + z.z,
                         1 + x.x + y.y + z.z};
    txm_quat q;
    int k = 3;
    for (int i = 0; i < 3; i++) {
        if (c[i] > c[k]) k = i;
    }
    q.x = k == 0 ? c[0] : k == 1 ? y.x + x.y : k == 2 ? z.x + x.z : y.z - z.y;
    q.y = k == 0 ? y.x + x.y : k == 1 ? c[1] : k == 2 ? z.y + y.z : z.x - x.z;
    q.z = k == 0 ? z.x + x.z : k == 1 ? z.y + y.z : k == 2 ? c[2] : x.y - y.x;
    q.w = k == 0 ? y.z - z.y : k == 1 ? z.x - x.z : k == 2 ? x.y - y.x : c[3];
    return q;
}

/* ---- kernel: symmetric 3x3 eigensystem -------------------------------------------------- */

/* Eigenvalues and eigenvectors of

       | a[0] a[1] a[2] |
   A = | a[1] a[3] a[4] |      A vectors[k] = values[k] vectors[k]
       | a[2] a[4] a[5] |

   by cyclic Jacobi rotations in double [6]; A is usually the covariance of points.

   values   descending
   vectors  unit length, at right angles, vectors[2] = vectors[0] x vectors[1]; of the first two
            the component of largest magnitude (the first such) is positive. For equal values any
            basis of their space is right; this one depends on the bits of A only.
   return   TXM_OK, or TXM_BAD_ARGUMENT (nothing written) if an entry is not finite         */
static inline txm_status txm_eigen3(const double a[6], double values[3], double vectors[3][3]) {
    double m[3][3] = {{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
    double v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}; /* columns become the vectors */
    double scale = 0;
    int order[3] = {0, 1, 2};
    for (int i = 0; i < 6; i++) {
        if (!txm_is_finite(a[i])) return TXM_BAD_ARGUMENT;
        scale = fmax(scale, fabs(a[i]));
    }
    for (int i = 0; i < 9 && scale > 0; i++) m[i / 3][i % 3] /= scale; /* squares cannot overflow */

    /* Each rotation zeroes m[p][q]; the off-diagonal elements converge quadratically: usually 6 sweeps
       are enough, and 32 always. It ends when rotations no longer change the diagonal. */
    for (int sweep = 0, turned = 1; turned && sweep < 32; sweep++) {
        turned = 0;
        for (int k = 0; k < 3; k++) {
            const int p = k == 2 ? 1 : 0, q = k == 0 ? 1 : 2, r = 3 - p - q;
            if (fabs(m[p][q]) <= 1e-18) {
                m[p][q] = m[q][p] = 0;
                continue;
            }
            turned = 1;
            const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
            const double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1));
            const double c = 1 / sqrt(t * t + 1), s = t * c;
            const double rp = m[r][p], rq = m[r][q];
            m[p][p] -= t * m[p][q];
            m[q][q] += t * m[p][q];
            m[p][q] = m[q][p] = 0;
            m[r][p] = m[p][r] = c * rp - s * rq;
            m[r][q] = m[q][r] = s * rp + c * rq;
            for (int i = 0; i < 3; i++) {
                const double ip = v[i][p], iq = v[i][q];
                v[i][p] = c * ip - s * iq;
                v[i][q] = s * ip + c * iq;
            }
        }
    }
    for (int k = 0; k < 3; k++) { /* three compare-and-swaps that keep the order of equals */
        const int i = k == 1 ? 1 : 0, x = order[i], y = order[i + 1];
        if (m[y][y] > m[x][x]) {
            order[i] = y;
            order[i + 1] = x;
        }
    }
    for (int k = 0; k < 3; k++) {
        const int o = order[k];
        double sign = 0, most = 0;
        for (int i = 0; i < 3; i++) {
            /* nearly equal magnitudes count as equal, so that rounding does not choose the sign */
            if (fabs(v[i][o]) > most * (1 + 1e-9)) {
                most = fabs(v[i][o]);
                sign = v[i][o] < 0 ? -1 : 1;
            }
        }
        values[k] = m[o][o] * scale;
        for (int i = 0; i < 3; i++) vectors[k][i] = sign * v[i][o];
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        vectors[2][i] = vectors[0][j] * vectors[1][k] - vectors[0][k] * vectors[1][j];
    }
    return TXM_OK;
}

/* ---- kernel: minimum-error cut ---------------------------------------------------------- */

/* The cheapest path through a strip from its first line to its last, moving at most one pixel
   sideways per line [2]:

       E(i, j) = e(i, j) + min(E(i-1, j-1), E(i-1, j), E(i-1, j+1)),  path(last) = argmin E(last, .)

             j 0 .. width-1             e(i, j) = error[i * along + j * across], in floats
         i 0 . . # . .
           1 . # . . .                  a cut from top to bottom: along = row, across = 1
           2 . # . . .                  from left to right:       along = 1, across = row
           3 . . # . .

   Of equal sums the same j wins, then the smaller j; of equal ends the smaller j.
   error    >= 0; INFINITY excludes a pixel as long as the path can avoid it
   path     receives j for each line, length of them
   scratch  room for length * width doubles
   return   the sum of the errors on the path; 0 (nothing written) if length or width is below 1
   cost     O(length * width)                                                              */
static inline double txm_cut(const float *error, int length, int width, ptrdiff_t along,
                             ptrdiff_t across, int *path, double *scratch) {
    if (length < 1 || width < 1) return 0;
    const size_t w = (size_t)width;
    for (int i = 0; i < length; i++) {
        double *line = scratch + (size_t)i * w;
        const double *above = i ? line - w : NULL;
        for (int j = 0; j < width; j++) {
            double best = above ? above[j] : 0;
            if (above && j > 0 && above[j - 1] < best) best = above[j - 1];
            if (above && j + 1 < width && above[j + 1] < best) best = above[j + 1];
            line[j] = best + error[i * along + j * across];
        }
    }
    const double *line = scratch + (size_t)(length - 1) * w;
    int j = 0;
    for (int k = 1; k < width; k++) {
        if (line[k] < line[j]) j = k;
    }
    const double total = line[j];
    for (int i = length - 1;; i--) {
        path[i] = j;
        if (i == 0) return total;
        const double *above = scratch + (size_t)(i - 1) * w;
        int best = j;
        if (j > 0 && above[j - 1] < above[best]) best = j - 1;
        if (j + 1 < width && above[j + 1] < above[best]) best = j + 1;
        j = best;
    }
}

/* ---- kernel: minimum cut on a grid ------------------------------------------------------ */

/* The minimum cut that separates the nodes of a grid into those of a source and those of a sink:
   maximum flow by two growing search trees [8]. A node is a cell of the grid, which has a margin of
   one cell on all sides whose capacities stay zero. Arc d of node p goes to p + step[d]; the
   opposite arc is d + directions / 2 there.

   txm_flow_make allocates the memory. Then set step[] and count, fill arc[][] and excess[], call
   txm_flow_solve, and read tree[]: TXM_FLOW_SINK are the nodes on the sink's side. Sums of the
   capacities at a node must stay below 2^30. Integers only, so the same cut everywhere. */
enum { TXM_FLOW_FREE = 0, TXM_FLOW_SOURCE = 1, TXM_FLOW_SINK = 2 };
/* parents that are not an arc */
enum { TXM_FLOW_TERMINAL = 6, TXM_FLOW_NONE = 7, TXM_FLOW_ORPHAN = 8 };

typedef struct txm_flow {
    int directions; /* 4 or 6 */
    int step[6];
    int count;        /* nodes, margin included             */
    int32_t *arc[6];  /* residual capacities                */
    int32_t *excess;  /* > 0 from the source, < 0 to the sink */
    int32_t *next;    /* queue of active nodes: -2 = not in it, -1 = last */
    int32_t *orphans; /* circular                           */
    int32_t *stamp, *distance;
    uint8_t *tree, *parent;
    int first, last, orphan_at, orphan_count, time;
} txm_flow;

static inline int txm_flow_opposite(const txm_flow *g, int d) {
    const int half = g->directions / 2;
    return d < half ? d + half : d - half;
}

static inline void txm_flow_activate(txm_flow *g, int p) {
    if (g->next[p] != -2) return;
    g->next[p] = -1;
    if (g->last >= 0) g->next[g->last] = p;
    else g->first = p;
    g->last = p;
}

static inline void txm_flow_orphan(txm_flow *g, int p) {
    int at = g->orphan_at + g->orphan_count++;
    if (at >= g->count) at -= g->count;
    g->parent[p] = TXM_FLOW_ORPHAN;
    g->orphans[at] = p;
}

/* Push flow along the path that arc d of p (in the source's tree) closes. */
static inline void txm_flow_augment(txm_flow *g, int p, int d) {
    const int q = p + g->step[d];
    int32_t flow = g->arc[d][p];
    for (int x = p;; x += g->step[g->parent[x]]) {
        const int up = g->parent[x];
        const int32_t rest = up == TXM_FLOW_TERMINAL
                                 ? g->excess[x]
                                 : g->arc[txm_flow_opposite(g, up)][x + g->step[up]];
        if (rest < flow) flow = rest;
        if (up == TXM_FLOW_TERMINAL) break;
    }
    for (int x = q;; x += g->step[g->parent[x]]) {
        const int up = g->parent[x];
        const int32_t rest = up == TXM_FLOW_TERMINAL ? -g->excess[x] : g->arc[up][x];
        if (rest < flow) flow = rest;
        if (up == TXM_FLOW_TERMINAL) break;
    }
    g->arc[d][p] -= flow;
    g->arc[txm_flow_opposite(g, d)][q] += flow;
    for (int x = p, end = 0; !end;) {
        const int up = g->parent[x];
        if (up == TXM_FLOW_TERMINAL) {
            g->excess[x] -= flow;
            if (g->excess[x] == 0) txm_flow_orphan(g, x);
            end = 1;
        } else {
            const int y = x + g->step[up];
            g->arc[up][x] += flow;
            g->arc[txm_flow_opposite(g, up)][y] -= flow;
            if (g->arc[txm_flow_opposite(g, up)][y] == 0) txm_flow_orphan(g, x);
            x = y;
        }
    }
    for (int x = q, end = 0; !end;) {
        const int up = g->parent[x];
        if (up == TXM_FLOW_TERMINAL) {
            g->excess[x] += flow;
            if (g->excess[x] == 0) txm_flow_orphan(g, x);
            end = 1;
        } else {
            const int y = x + g->step[up];
            g->arc[up][x] -= flow;
            g->arc[txm_flow_opposite(g, up)][y] += flow;
            if (g->arc[up][x] == 0) txm_flow_orphan(g, x);
            x = y;
        }
    }
}

/* Capacity of the arc that connects p to its neighbour in direction d, in the direction of p's
   tree. */
static inline int32_t txm_flow_hold(const txm_flow *g, int p, int d) {
    if (g->tree[p] != TXM_FLOW_SOURCE) return g->arc[d][p];
    return g->arc[txm_flow_opposite(g, d)][p + g->step[d]];
}

/* Find a new parent for an orphan, the nearest to the terminal, or free it and its children. */
static inline void txm_flow_adopt(txm_flow *g, int p) {
    int best = TXM_FLOW_NONE, least = INT_MAX;
    const uint8_t tree = g->tree[p];
    for (int d = 0; d < g->directions; d++) {
        const int q = p + g->step[d];
        if (g->tree[q] != tree || g->parent[q] == TXM_FLOW_NONE || txm_flow_hold(g, p, d) == 0)
            continue;
        int length = 0, x = q;
        for (;;) { /* is q still connected to the terminal? */
            if (g->stamp[x] == g->time) {
                length += g->distance[x];
                break;
            }
            const int up = g->parent[x];
            length++;
            if (up == TXM_FLOW_TERMINAL) {
                g->stamp[x] = g->time;
                g->distance[x] = 1;
                break;
            }
            if (up == TXM_FLOW_ORPHAN || up == TXM_FLOW_NONE) {
                length = INT_MAX;
                break;
            }
            x += g->step[up];
        }
        if (length == INT_MAX) continue;
        if (length < least) {
            least = length;
            best = d;
        }
        for (x = q; g->stamp[x] != g->time; x += g->step[g->parent[x]]) {
            g->stamp[x] = g->time;
            g->distance[x] = length--;
        }
    }
    g->parent[p] = (uint8_t)best;
    if (best != TXM_FLOW_NONE) {
        g->stamp[p] = g->time;
        g->distance[p] = least + 1;
        return;
    }
    for (int d = 0; d < g->directions; d++) {
        const int q = p + g->step[d];
        if (g->tree[q] != tree || g->parent[q] == TXM_FLOW_NONE) continue;
        if (txm_flow_hold(g, p, d) > 0) txm_flow_activate(g, q);
        if (g->parent[q] < 6 && q + g->step[g->parent[q]] == p) txm_flow_orphan(g, q);
    }
    g->tree[p] = TXM_FLOW_FREE;
}

/* Grow the tree of p by one ring. Returns 1 with (*from, *d) the arc where the two trees touch. */
static inline int txm_flow_grow(txm_flow *g, int p, int *from, int *direction) {
    const int is_source = g->tree[p] == TXM_FLOW_SOURCE;
    for (int d = 0; d < g->directions; d++) {
        const int q = p + g->step[d], back = txm_flow_opposite(g, d);
        if ((is_source ? g->arc[d][p] : g->arc[back][q]) == 0) continue;
        if (g->tree[q] == TXM_FLOW_FREE) {
            g->tree[q] = g->tree[p];
            g->parent[q] = (uint8_t)back;
            g->stamp[q] = g->stamp[p];
            g->distance[q] = g->distance[p] + 1;
            txm_flow_activate(g, q);
        } else if (g->tree[q] != g->tree[p]) {
            *from = is_source ? p : q;
            *direction = is_source ? d : back;
            return 1;
        } else if (g->stamp[q] <= g->stamp[p] && g->distance[q] > g->distance[p]) {
            g->parent[q] = (uint8_t)back; /* a shorter path */
            g->stamp[q] = g->stamp[p];
            g->distance[q] = g->distance[p] + 1;
        }
    }
    return 0;
}

/* Push the maximum flow. Afterwards the nodes whose tree is TXM_FLOW_SINK lie beyond the cut;
   the arcs and excess hold what is left.
   cost  linear in practice, some 0.1 us per node; polynomial at worst                        */
static inline void txm_flow_solve(txm_flow *g) {
    g->first = g->last = -1;
    g->orphan_at = g->orphan_count = 0;
    g->time = 0;
    for (int p = 0; p < g->count; p++) {
        g->next[p] = -2;
        g->stamp[p] = 0;
        g->distance[p] = 1;
        g->tree[p] = TXM_FLOW_FREE;
        g->parent[p] = TXM_FLOW_NONE;
        if (g->excess[p] == 0) continue;
        g->tree[p] = g->excess[p] > 0 ? TXM_FLOW_SOURCE : TXM_FLOW_SINK;
        g->parent[p] = TXM_FLOW_TERMINAL;
        txm_flow_activate(g, p);
    }
    int current = -1;
    for (;;) {
        int p = current, from, d;
        if (p < 0 || g->parent[p] == TXM_FLOW_NONE) {
            do { /* the next active node that still belongs to a tree */
                p = g->first;
                if (p < 0) return;
                g->first = g->next[p];
                if (g->first < 0) g->last = -1;
                g->next[p] = -2;
            } while (g->parent[p] == TXM_FLOW_NONE);
        }
        current = -1;
        const int touch = txm_flow_grow(g, p, &from, &d);
        g->time++;
        if (!touch) continue;
        current = p; /* it may touch again */
        txm_flow_augment(g, from, d);
        while (g->orphan_count) {
            const int orphan = g->orphans[g->orphan_at];
            if (++g->orphan_at == g->count) g->orphan_at = 0;
            g->orphan_count--;
            txm_flow_adopt(g, orphan);
        }
    }
}

/* Memory for up to most nodes with 4 or 6 directions, 22 + 4 * directions bytes each, from the
   arena. 0: there is none. */
static inline int txm_flow_make(txm_flow *g, txm_arena *arena, int directions, int most) {
    const size_t n = (size_t)most;
    g->directions = directions;
    int ok = 1;
    for (int d = 0; d < directions && ok; d++) {
        g->arc[d] = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
        ok = g->arc[d] != NULL;
    }
    int32_t *block = ok ? (int32_t *)txm_arena_alloc(arena, n, 5 * sizeof(int32_t)) : NULL;
    g->tree = (uint8_t *)txm_arena_alloc(arena, n, 2);
    if (!block || !g->tree) return 0;
    g->excess = block;
    g->next = block + n;
    g->orphans = block + 2 * n;
    g->stamp = block + 3 * n;
    g->distance = block + 4 * n;
    g->parent = g->tree + n;
    return 1;
}

/* ---- kernel: Poisson equation ----------------------------------------------------------- */

typedef struct txm_poisson_desc {
    txm_image image;    /* TXM_F32, finite. In: known values outside the mask, a first guess
                           inside. Out: the solution inside; untouched after an error       */
    txm_image mask;     /* same size: unknown where it counts, see txm_mask_at              */
    txm_image target;   /* TXM_F32, size and channels of image: target Laplacian; NULL = 0  */
    float screen;       /* 0..1e6: pull towards the first guess; 0 = none                   */
    float tolerance;    /* relative residual to stop at, 1e-12..1; 0 = 1e-6                 */
    int max_iterations; /* per channel, then the last iterate is taken; 0 = 10000           */
    float progress_from, progress_to; /* the part of the caller's bar that this call fills,
                           0 <= from <= to <= 1; both 0 = all of it                         */
} txm_poisson_desc;

/* What txm_poisson works on: one number per unknown pixel, in raster order. */
typedef struct txm_poisson_grid {
    size_t count;
    int32_t *side[4];      /* unknown to the left, right, above, below; -1 = known or no pixel */
    double *diagonal;      /* screen + number of neighbours, known or not                      */
    double *factor;        /* 1 / diagonal of the incomplete factor                            */
    double *r, *z, *p, *x; /* residual, preconditioned residual, direction, solution           */
} txm_poisson_grid;

/* z = M^-1 r: with A = L + D + L^T and factor f, solves (F + L) F^-1 (F + L^T) z = r, the two
   triangular halves one after the other. */
static inline void txm_poisson_precondition(const txm_poisson_grid *g) {
    const double *f = g->factor;
    double *z = g->z;
    for (size_t i = 0; i < g->count; i++) {
        const int32_t left = g->side[0][i], up = g->side[2][i];
        double sum = g->r[i];
        if (left >= 0) sum += f[left] * z[left];
        if (up >= 0) sum += f[up] * z[up];
        z[i] = sum * f[i];
    }
    for (size_t i = g->count; i-- > 0;) {
        const int32_t right = g->side[1][i], down = g->side[3][i];
        double sum = 0;
        if (right >= 0) sum += z[right];
        if (down >= 0) sum += z[down];
        z[i] = (z[i] + f[i] * sum) * f[i];
    }
}

/* (A v)(i) */
static inline double txm_poisson_apply(const txm_poisson_grid *g, const double *v, size_t i) {
    double sum = g->diagonal[i] * v[i];
    for (int k = 0; k < 4; k++) {
        if (g->side[k][i] >= 0) sum -= v[g->side[k][i]];
    }
    return sum;
}

/* Report that the share reached (0..1) of channel c is done. */
static inline int txm_poisson_report(const txm_poisson_desc *desc, const txm_env *env, int c,
                                     double reached) {
    const double from = desc->progress_from, to = desc->progress_to > 0 ? desc->progress_to : 1;
    const int channels = desc->image.channels ? desc->image.channels : 1;
    return txm_progress(env, txm_float(from + (to - from) * ((c + reached) / channels)),
                        "blending");
}

/* Solve A x = b by preconditioned conjugate gradients; on entry x holds the guess, r holds b. */
static inline txm_status txm_poisson_solve(const txm_poisson_grid *g, const txm_poisson_desc *desc,
                                           int c, const txm_env *env) {
    const double tolerance = desc->tolerance > 0 ? desc->tolerance : 1e-6;
    const int most = desc->max_iterations ? desc->max_iterations : 10000;
    const size_t n = g->count;
    double norm = 0, rest = 0, rz = 0, reached = 0;
    for (size_t i = 0; i < n; i++) {
        norm += g->r[i] * g->r[i];
        g->r[i] -= txm_poisson_apply(g, g->x, i);
        rest += g->r[i] * g->r[i];
    }
    const double goal = norm * tolerance * tolerance, first = rest;
    for (int k = 0; k < most && rest > goal; k++) {
        double old = rz, curvature = 0;
        /* how far on the way from the first residual to the goal, in digits */
        if (rest < first && goal > 0)
            reached = fmin(fmax(reached, log(first / rest) / log(first / goal)), 1);
        if (txm_poisson_report(desc, env, c, reached)) return TXM_CANCELLED;
        txm_poisson_precondition(g);
        rz = 0;
        for (size_t i = 0; i < n; i++) rz += g->r[i] * g->z[i];
        for (size_t i = 0; i < n; i++) g->p[i] = g->z[i] + (k ? rz / old : 0) * (k ? g->p[i] : 0);
        for (size_t i = 0; i < n; i++) {
            g->z[i] = txm_poisson_apply(g, g->p, i);
            curvature += g->p[i] * g->z[i];
        }
        if (!(curvature > 0)) break; /* nothing left but rounding */
        const double step = rz / curvature;
        rest = 0;
        for (size_t i = 0; i < n; i++) {
            g->x[i] += step * g->p[i];
            g->r[i] -= step * g->z[i];
            rest += g->r[i] * g->r[i];
        }
    }
    return TXM_OK;
}

/* Number the unknowns, link them, and build diagonal and factor. above: width numbers of scratch.

   MIC(0): an incomplete factor with the stencil of A; what it drops is taken off the diagonal to
   0.97, so that smooth vectors pass almost unchanged. For rows of five points this is [4]

       e = d - f_left^2 (1 + 0.97 [left has a lower neighbour])
             - f_up^2   (1 + 0.97 [upper has a right neighbour]),   f = 1 / sqrt(e),

   and e = d where that would fall below d / 4. It makes the iterations grow with the square root
   of the width of the hole, not with the width itself. */
static inline void txm_poisson_link(txm_poisson_grid *g, const txm_image *mask, double screen,
                                    int32_t *above) {
    const int width = mask->width, height = mask->height;
    size_t i = 0;
    for (int x = 0; x < width; x++) above[x] = -1;
    for (int y = 0; y < height; y++) {
        int32_t left = -1;
        for (int x = 0; x < width; x++) {
            const int32_t up = above[x], me = txm_mask_at(mask, x, y) ? (int32_t)i : -1;
            if (me >= 0) {
                g->side[0][i] = left;
                g->side[1][i] = -1;
                g->side[2][i] = up;
                g->side[3][i] = -1;
                g->diagonal[i] = screen + (x > 0) + (x + 1 < width) + (y > 0) + (y + 1 < height);
                if (left >= 0) g->side[1][left] = me;
                if (up >= 0) g->side[3][up] = me;
                i++;
            }
            above[x] = left = me;
        }
    }
    for (i = 0; i < g->count; i++) {
        const int32_t left = g->side[0][i], up = g->side[2][i];
        double e = g->diagonal[i];
        if (left >= 0) e -= g->factor[left] * g->factor[left] * (g->side[3][left] >= 0 ? 1.97 : 1);
        if (up >= 0) e -= g->factor[up] * g->factor[up] * (g->side[1][up] >= 0 ? 1.97 : 1);
        if (e < 0.25 * g->diagonal[i]) e = g->diagonal[i];
        g->factor[i] = 1 / sqrt(e);
    }
}

/* Fill r with the right side and x with the guess of channel c. */
static inline void txm_poisson_load(const txm_poisson_grid *g, const txm_poisson_desc *desc,
                                    const txm_image *image, int c) {
    const int width = image->width, height = image->height;
    size_t i = 0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            if (!txm_mask_at(&desc->mask, x, y)) continue;
            double b = (double)desc->screen * txm_image_get(image, x, y, c);
            if (desc->target.pixels) b -= txm_image_get(&desc->target, x, y, c);
            if (x > 0 && g->side[0][i] < 0) b += txm_image_get(image, x - 1, y, c);
            if (x + 1 < width && g->side[1][i] < 0) b += txm_image_get(image, x + 1, y, c);
            if (y > 0 && g->side[2][i] < 0) b += txm_image_get(image, x, y - 1, c);
            if (y + 1 < height && g->side[3][i] < 0) b += txm_image_get(image, x, y + 1, c);
            g->r[i] = b;
            g->x[i++] = txm_image_get(image, x, y, c);
        }
    }
}

/* Refuse what cannot be solved; *unknown receives the number of masked pixels. */
static inline txm_status txm_poisson_check(const txm_poisson_desc *desc, size_t *unknown,
                                           txm_env *env) {
    const txm_image *image = &desc->image, *mask = &desc->mask, *target = &desc->target;
    txm_status status = txm_image_check(image, "image", 0, env);
    if (status == TXM_OK)
        status = txm_mask_check(mask, "mask", image->width, image->height, 0, env);
    if (status == TXM_OK && target->pixels) status = txm_image_check(target, "target", 0, env);
    if (status != TXM_OK) return status;
    if (image->sample != TXM_F32 || !txm_image_is_finite(image))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image",
                           "samples must be TXM_F32 and finite, in the hole too");
    if (target->pixels &&
        (target->sample != TXM_F32 || target->width != image->width ||
         target->height != image->height || !txm_image_is_finite(target) ||
         txm_image_resolve(*target).channels != txm_image_resolve(*image).channels))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "target",
                           "must be finite TXM_F32 with the size and channels of image");
    if (!(desc->screen >= 0 && desc->screen <= 1e6f))
        return txm_fail(env, TXM_BAD_ARGUMENT, "screen must be 0 to 1e6");
    if (!(desc->tolerance >= 0 && desc->tolerance <= 1) ||
        (desc->tolerance > 0 && desc->tolerance < 1e-12f))
        return txm_fail(env, TXM_BAD_ARGUMENT, "tolerance must be 1e-12 to 1, or 0 for 1e-6");
    if (desc->max_iterations < 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_iterations must be 1 or more, or 0 for 10000");
    if (!(desc->progress_from >= 0 && desc->progress_to <= 1 &&
          desc->progress_from <= desc->progress_to))
        return txm_fail(env, TXM_BAD_ARGUMENT, "progress_from..progress_to must lie in 0..1");
    *unknown = 0;
    for (int y = 0; y < mask->height; y++) {
        for (int x = 0; x < mask->width; x++) *unknown += (size_t)txm_mask_at(mask, x, y);
    }
    if (*unknown > INT32_MAX)
        return txm_fail_at(env, TXM_TOO_LARGE, "mask",
                           "more than 2^31 - 1 unknown pixels; use tiles");
    /* The pixels of an image are connected, so one known pixel determines the unknown ones. */
    if (!(desc->screen > 0) && *unknown == (size_t)mask->width * (size_t)mask->height)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "mask",
                           "every pixel is unknown; leave one known, or set screen");
    return TXM_OK;
}

/* Solve the (screened) Poisson equation inside a mask, with known values around it [3]:

       screen (u - u0) - Lu = -target,   Lu(x) = sum over the neighbours y of x: u(y) - u(x)

   where x has up to four neighbours: none beyond the border of the image (the natural or
   Neumann boundary condition), and outside the mask u is the image (Dirichlet). With
   target and screen 0 this is the membrane through the known values. To paste gradients, let
   target(x) be the sum of the desired differences u(y) - u(x).

   The channels are solved one by one, by conjugate gradients with the preconditioner MIC(0) [4].
   desc    only the pixels of desc->image are written, and only on success
   env     NULL, or how to allocate, report and cancel
   return  TXM_OK (also where no pixel is masked, or max_iterations was reached);
           TXM_BAD_ARGUMENT, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost    some 20 to 200 iterations (they grow with the square root of the width of the hole) of
           about 20 ns per unknown and channel; 64 + 4 * channels bytes per unknown       */
static inline txm_status txm_poisson(const txm_poisson_desc *desc, txm_env *env) {
    txm_poisson_grid g;
    txm_arena arena;
    size_t n = 0;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a txm_poisson_desc");
    txm_status status = txm_poisson_check(desc, &n, env);
    if (status != TXM_OK || n == 0) return status;

    const txm_image image = txm_image_resolve(desc->image);
    const size_t channels = (size_t)image.channels;
    txm_arena_init(&arena, env);
    double *numbers = (double *)txm_arena_alloc(&arena, n, 6 * sizeof(double));
    int32_t *sides = (int32_t *)txm_arena_alloc(&arena, n, 4 * sizeof(int32_t));
    int32_t *above = (int32_t *)txm_arena_alloc(&arena, (size_t)image.width, sizeof(int32_t));
    float *result = (float *)txm_arena_alloc(&arena, n, channels * sizeof(float));
    if (!numbers || !sides || !above || !result) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the Poisson equation");
        goto done;
    }
    g.count = n;
    g.diagonal = numbers;
    g.factor = numbers + n;
    g.r = numbers + 2 * n;
    g.z = numbers + 3 * n;
    g.p = numbers + 4 * n;
    g.x = numbers + 5 * n;
    for (int k = 0; k < 4; k++) g.side[k] = sides + (size_t)k * n;
    txm_poisson_link(&g, &desc->mask, desc->screen, above);

    for (int c = 0; c < image.channels; c++) {
        txm_poisson_load(&g, desc, &image, c);
        status = txm_poisson_solve(&g, desc, c, env);
        if (status != TXM_OK) {
            txm_fail(env, status, "cancelled while solving the Poisson equation");
            goto done;
        }
        for (size_t i = 0; i < n; i++) result[i * channels + (size_t)c] = txm_float(g.x[i]);
    }
    for (int y = 0, i = 0; y < image.height; y++) {
        float *out = (float *)txm_image_row(&image, y);
        for (int x = 0; x < image.width; x++) {
            if (!txm_mask_at(&desc->mask, x, y)) continue;
            memcpy(out + (size_t)x * channels, result + (size_t)i++ * channels,
                   channels * sizeof(float));
        }
    }
done:
    txm_arena_free(&arena);
    return status;
}

/* ---- meshes ----------------------------------------------------------------------------- */

/* A mesh that the caller owns: faces of 3 corners each, or of 4. */
typedef struct txm_mesh {
    const float *positions;  /* 3 per vertex, finite; NULL where a function needs none         */
    const uint32_t *indices; /* the vertices of each face, counter-clockwise seen from outside */
    size_t vertex_count, face_count;
    int corners; /* of a face: 3 or 4; 0 = 3 */
} txm_mesh;

/* A place on a mesh of triangles: (1 - u - v) a + u b + v c of the corners a, b, c of a triangle,
   in the order of its indices. */
typedef struct txm_mesh_place {
    uint32_t triangle;
    float u, v; /* each 0..1, u + v at most 1 */
} txm_mesh_place;

/* no side, as sides are numbered in 32 bits */
#define TXM_NO_SIDE 0xffffffffu

/* corners of a face, sides of a mesh */
static inline size_t txm_mesh_corners(const txm_mesh *mesh) {
    return mesh->corners ? (size_t)mesh->corners : 3;
}
static inline size_t txm_mesh_sides(const txm_mesh *mesh) {
    return mesh->face_count * txm_mesh_corners(mesh);
}

/* Is this a valid mesh? Any connectivity is allowed: borders, edges of many faces,
   faces that name a vertex twice. A mesh without faces or vertices needs no array for them.

   name       what the caller calls the mesh, for the message: "mesh: indices is NULL"
   corners    number of corners that faces must have, 3 or 4; 0 = either
   positions  non-zero: they are needed and must be finite; 0: they are ignored
   most       refuse more vertices or faces; 0 = no limit but that of 32-bit numbers of sides
   return     TXM_OK; TXM_BAD_ARGUMENT; TXM_TOO_LARGE. The message names the first face or vertex
              that is wrong, from 0
   cost       O(faces + vertices)                                                          */
static inline txm_status txm_mesh_check(const txm_mesh *mesh, const char *name, int corners,
                                        int positions, size_t most, txm_env *env) {
    if (!mesh) return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "is NULL; pass a txm_mesh");
    if (mesh->corners != 0 && mesh->corners != 3 && mesh->corners != 4)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "corners must be 3 or 4 (0 means 3)");
    const size_t n = txm_mesh_corners(mesh);
    if (corners && n != (size_t)corners)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           corners == 3 ? "faces must be triangles" : "faces must be quads");
    if (most && (mesh->vertex_count > most || mesh->face_count > most))
        return txm_fail_numbers_at(env, TXM_TOO_LARGE, name, "more than # vertices or faces", most,
                                   0);
    if (mesh->face_count > (TXM_NO_SIDE - 1) / n || mesh->face_count > SIZE_MAX / 64 ||
        (positions && mesh->vertex_count > SIZE_MAX / 64))
        return txm_fail_at(env, TXM_TOO_LARGE, name,
                           "more faces or vertices than 32 bits can number the sides of");
    if (mesh->face_count && !mesh->indices)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "indices is NULL");
    if (positions && mesh->vertex_count && !mesh->positions)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "positions is NULL");
    for (size_t i = 0; i < n * mesh->face_count; i++) {
        if (mesh->indices[i] >= mesh->vertex_count)
            return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, name,
                                       "face # names vertex #, which is not below vertex_count",
                                       i / n, mesh->indices[i]);
    }
    for (size_t i = 0; positions && i < 3 * mesh->vertex_count; i++) {
        if (!txm_is_finite(mesh->positions[i]))
            return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, name,
                                       "the position of vertex # is not finite", i / 3, 0);
    }
    return TXM_OK;
}

/* the position of a corner; corner k of face f has the number f * corners + k */
static inline txm_dvec3 txm_mesh_point(const txm_mesh *mesh, size_t corner) {
    return txm_d3_load(mesh->positions + 3 * (size_t)mesh->indices[corner]);
}
/* the positions of a triangle's corners */
static inline void txm_mesh_triangle(const txm_mesh *mesh, size_t face, txm_dvec3 p[3]) {
    for (size_t k = 0; k < 3; k++) p[k] = txm_mesh_point(mesh, 3 * face + k);
}

/* Side i runs from corner i to the next corner of its face, whose number this is. */
static inline size_t txm_mesh_next(const txm_mesh *mesh, size_t i) {
    if (mesh->corners == 4) return i % 4 == 3 ? i - 3 : i + 1;
    return i % 3 == 2 ? i - 2 : i + 1;
}
/* the lower and the higher vertex of side i: its edge */
static inline uint32_t txm_mesh_low(const txm_mesh *mesh, size_t i) {
    const uint32_t a = mesh->indices[i], b = mesh->indices[txm_mesh_next(mesh, i)];
    return a < b ? a : b;
}
static inline uint32_t txm_mesh_high(const txm_mesh *mesh, size_t i) {
    const uint32_t a = mesh->indices[i], b = mesh->indices[txm_mesh_next(mesh, i)];
    return a < b ? b : a;
}

/* Does side i run from the higher vertex to the lower? From a vertex to itself: the last side of a
   face does, so that they do not all run one way round. */
static inline int txm_mesh_runs_down(const txm_mesh *mesh, size_t i) {
    const size_t next = txm_mesh_next(mesh, i);
    const uint32_t a = mesh->indices[i], b = mesh->indices[next];
    return a == b ? next < i : a > b;
}

/* A color 0..colors-1 for the edge of side i, by hash of its two vertices, so that all functions
   that color the edges of a mesh with the same seed and number agree. */
static inline int txm_mesh_edge_color(const txm_mesh *mesh, size_t i, uint64_t seed, int colors) {
    const uint64_t edge = (uint64_t)txm_mesh_high(mesh, i) << 32 | txm_mesh_low(mesh, i);
    const uint64_t hash = txm_hash(txm_hash(seed ^ 0x7465787475726573u) + edge) >> 32;
    return (int)(hash * (uint64_t)colors >> 32);
}

/* the order of sides: by the lower, then by the higher vertex of the edge, then by number */
static inline int txm_mesh_before(const txm_mesh *mesh, uint32_t a, uint32_t b) {
    const uint32_t a_low = txm_mesh_low(mesh, a), b_low = txm_mesh_low(mesh, b);
    const uint32_t a_high = txm_mesh_high(mesh, a), b_high = txm_mesh_high(mesh, b);
    if (a_low != b_low) return a_low < b_low;
    return a_high != b_high ? a_high < b_high : a < b;
}

/* Restore the heap from root down. */
static inline void txm_mesh_sift(const txm_mesh *mesh, uint32_t *heap, size_t root, size_t count) {
    for (size_t child = 2 * root + 1; child < count; root = child, child = 2 * root + 1) {
        if (child + 1 < count && txm_mesh_before(mesh, heap[child], heap[child + 1])) child++;
        if (txm_mesh_before(mesh, heap[child], heap[root])) return;
        const uint32_t side = heap[root];
        heap[root] = heap[child];
        heap[child] = side;
    }
}

/* Sort the sides of one bin: a few with the same lower vertex, as most bins are, by insertion,
   their keys being the higher vertex and the number; others as a heap. */
static inline void txm_mesh_sort_bin(const txm_mesh *mesh, uint32_t *sides, size_t count,
                                     int is_vertex) {
    enum { FEW = 48 };
    uint64_t key[FEW];
    if (count < 2) return;
    if (!is_vertex || count > FEW) {
        for (size_t i = count / 2; i-- > 0;) txm_mesh_sift(mesh, sides, i, count);
        for (size_t end = count - 1; end > 0; end--) {
            const uint32_t side = sides[0];
            sides[0] = sides[end];
            sides[end] = side;
            txm_mesh_sift(mesh, sides, 0, end);
        }
        return;
    }
    for (size_t i = 0; i < count; i++) {
        const uint64_t k = (uint64_t)txm_mesh_high(mesh, sides[i]) << 32 | sides[i];
        size_t at = i;
        for (; at > 0 && key[at - 1] > k; at--) key[at] = key[at - 1];
        key[at] = k;
    }
    for (size_t i = 0; i < count; i++) sides[i] = (uint32_t)key[i];
}

/* Which sides share an edge, that is, have the same two vertices: sort the sides by the lower, then
   by the higher vertex of their edge. Those of one edge lie together, the lowest number first.

       for (size_t i = 0, end; i < sides; i = end) {
           end = txm_mesh_edge_end(mesh, sorted, i);
           ...  sorted[i] to sorted[end - 1] are the sides of one edge
       }

   The sides are counted into bins by the lower vertex, or by ranges of it if vertex numbers are
   larger than the number of sides, and each bin is sorted. The mesh must have passed
   txm_mesh_check.
   sorted  receives the numbers of the sides; room for 2 for each, the upper half is scratch
   cost    O(n log m) for n sides, of which at most m are in one bin; m is usually about 6 */
static inline void txm_mesh_sort_sides(const txm_mesh *mesh, uint32_t *sorted) {
    const size_t sides = txm_mesh_sides(mesh);
    uint32_t *next = sorted + sides, sum = 0, begin = 0;
    uint64_t span = 0; /* above all lower vertices */
    for (size_t i = 0; i < sides; i++) {
        const uint64_t low = txm_mesh_low(mesh, i);
        if (low >= span) span = low + 1;
    }
    const int is_vertex = span <= sides;
    const size_t bins = is_vertex ? (size_t)span : sides;
    memset(next, 0, bins * sizeof *next);
    for (size_t i = 0; i < sides; i++) {
        const uint64_t low = txm_mesh_low(mesh, i);
        next[is_vertex ? low : low * sides / span]++;
    }
    for (size_t b = 0; b < bins; b++) { /* from how many to where the first goes */
        const uint32_t n = next[b];
        next[b] = sum;
        sum += n;
    }
    for (size_t i = 0; i < sides; i++) {
        const uint64_t low = txm_mesh_low(mesh, i);
        sorted[next[is_vertex ? low : low * sides / span]++] = (uint32_t)i;
    }
    for (size_t b = 0; b < bins; b++) {
        txm_mesh_sort_bin(mesh, sorted + begin, next[b] - begin, is_vertex);
        begin = next[b];
    }
}

/* one past the last of the sorted sides that share the edge of sorted[i] */
static inline size_t txm_mesh_edge_end(const txm_mesh *mesh, const uint32_t *sorted, size_t i) {
    const size_t sides = txm_mesh_sides(mesh);
    const uint32_t low = txm_mesh_low(mesh, sorted[i]), high = txm_mesh_high(mesh, sorted[i]);
    do i++;
    while (i < sides && txm_mesh_low(mesh, sorted[i]) == low &&
           txm_mesh_high(mesh, sorted[i]) == high);
    return i;
}

/* options of txm_mesh_link; add them up */
enum {
    TXM_LINK_DOWN = 1,  /* each side to the one before it, the lowest to the highest          */
    TXM_LINK_POINTS = 2 /* sides from a vertex to itself have an edge like others             */
};

/* Link the sides of each edge into a ring: next[side] is the next higher side there, after the
   highest the lowest; a side without others, or from a vertex to itself, is its own next.

   sorted  the sides as txm_mesh_sort_sides left them
   flags   0, or options
   next    receives one side for each; may be sorted + sides                               */
static inline void txm_mesh_link(const txm_mesh *mesh, const uint32_t *sorted, int flags,
                                 uint32_t *next) {
    const size_t sides = txm_mesh_sides(mesh);
    for (size_t i = 0, end; i < sides; i = end) {
        end = txm_mesh_edge_end(mesh, sorted, i);
        const int is_point = txm_mesh_low(mesh, sorted[i]) == txm_mesh_high(mesh, sorted[i]);
        for (size_t k = i; k < end; k++) {
            const size_t up = k + 1 < end ? k + 1 : i, down = k > i ? k - 1 : end - 1;
            const size_t other = is_point && !(flags & TXM_LINK_POINTS) ? k
                                 : flags & TXM_LINK_DOWN                ? down
                                                                        : up;
            next[sorted[k]] = sorted[other];
        }
    }
}

#ifdef __cplusplus
}
#endif
#endif /* TEXMATH_H */

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
