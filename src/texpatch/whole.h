#ifndef TEXPATCH_WHOLE_H
#define TEXPATCH_WHOLE_H

#include "frame.h"

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

#endif /* TEXPATCH_WHOLE_H */
