#ifndef TEXPATCH_SPECTRA_H
#define TEXPATCH_SPECTRA_H

#include "evened.h"

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

#endif /* TEXPATCH_SPECTRA_H */
