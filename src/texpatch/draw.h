#ifndef TEXPATCH_DRAW_H
#define TEXPATCH_DRAW_H

#include "begin.h"

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

#endif /* TEXPATCH_DRAW_H */
