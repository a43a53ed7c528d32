#ifndef TEXPATCH_SEAMS_H
#define TEXPATCH_SEAMS_H

#include "relax.h"

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

#endif /* TEXPATCH_SEAMS_H */
