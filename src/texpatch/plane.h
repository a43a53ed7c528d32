#ifndef TEXPATCH_PLANE_H
#define TEXPATCH_PLANE_H

#include "draw.h"

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

#endif /* TEXPATCH_PLANE_H */
