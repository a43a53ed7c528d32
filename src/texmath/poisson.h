#ifndef TEXMATH_POISSON_H
#define TEXMATH_POISSON_H

#include "mask.h"

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

#endif /* TEXMATH_POISSON_H */
