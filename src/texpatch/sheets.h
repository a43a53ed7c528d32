#ifndef TEXPATCH_SHEETS_H
#define TEXPATCH_SHEETS_H

#include "canvas.h"
#include "courses.h"

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

#endif /* TEXPATCH_SHEETS_H */
