#ifndef TEXPATCH_RECTIFY_H
#define TEXPATCH_RECTIFY_H

#include "check.h"
#include "whole.h"

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

#endif /* TEXPATCH_RECTIFY_H */
