#ifndef TEXPATCH_BEGIN_H
#define TEXPATCH_BEGIN_H

#include "finish.h"
#include "job.h"

/* ---- public: checks ----------------------------------------------------------------------- */

static int txp_is_in(float x, float low, float high) {
    return x >= low && x <= high;
}

/* The smallest and largest sample of a map over all exemplars; 8- and 16-bit samples span 0..1. */
static void txp_range(const txm_image *im, float *low, float *high) {
    if (im->sample != TXM_F32) {
        *low = txm_minf(*low, 0);
        *high = txm_maxf(*high, 1);
        return;
    }
    for (int y = 0; y < im->height; y++) {
        const float *row = (const float *)txm_image_row_const(im, y);
        for (size_t i = 0; i < (size_t)im->width * (size_t)im->channels; i++) {
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

static txm_status txp_check_mask(const txm_image *im, const char *name, int width, int height,
                                 txm_env *env) {
    const txm_status status = txm_image_check(im, name, TEXPATCH_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (im->sample != TXM_U8 || im->channels > 1 || im->width != width || im->height != height)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name,
                           "must be TXM_U8 with 1 channel and the size of its picture");
    return TXM_OK;
}

/* The exemplars and how they are treated; the output's side is checked by the caller. */
static txm_status txp_check_exemplars(const texpatch_desc *d, txp_setup *u, txp_source *s,
                                      txm_env *env) {
    txm_status status = TXM_OK;
    int bytes = 0, rows = 0;
    if (!d->exemplars || d->exemplar_count < 1 || d->exemplar_count > TEXPATCH_MAX_EXEMPLARS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "exemplar_count must be 1 to 8, exemplars not NULL");
    if (d->map_count < 1 || d->map_count > TEXPATCH_MAX_MAPS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map_count must be 1 to 16");
    if (d->turns != 0 && d->turns != 1 && d->turns != 2 && d->turns != 4)
        return txm_fail(env, TXM_BAD_ARGUMENT, "turns must be 1, 2 or 4 (0 means 1)");
    if (d->patch < 0 || d->patch > TEXPATCH_MAX_SIDE)
        return txm_fail(env, TXM_BAD_ARGUMENT, "patch must be 0 to 8192 pixels");
    if (d->passes < -1 || d->passes > 16)
        return txm_fail(env, TXM_BAD_ARGUMENT, "passes must be 1 to 16, 0 for 3, or -1 for none");
    if (!txp_is_in(d->novelty, 0, 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "novelty must be 0 to 1");
    if (!txp_is_in(d->guide_weight, 0, 16))
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
            return txm_fail(env, TXM_BAD_ARGUMENT, "lattice_vectors must be 8192 pixels at most");
        u->lattice_vectors[i] = (double)d->lattice_vectors[i];
    }
    if (d->lattice == 1 && !(fabs(txp_det(u->lattice_vectors, u->lattice_vectors + 2)) >= 16))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "lattice_vectors must span 16 pixels or more; use lattice 0 to find them");
    for (int m = 0; m < d->map_count; m++) {
        if (d->maps) u->kinds[m] = d->maps[m];
        else u->kinds[m].weight = m ? 0.0f : 1.0f;
        if (!txp_is_in(u->kinds[m].weight, 0, 16))
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
            txp_range(im, &u->low[m], &u->high[m]);
            if (e == 0 && u->kinds[m].weight > 0) bytes += im->channels;
        }
        const int w = u->maps[e][0].width, h = u->maps[e][0].height;
        if (w < TEXPATCH_MIN_SIDE || h < TEXPATCH_MIN_SIDE)
            return txm_fail(env, TXM_TOO_SMALL, "an exemplar must be 32 x 32 pixels or more");
        if (w > TEXPATCH_MAX_SIDE || h > TEXPATCH_MAX_SIDE)
            return txm_fail(env, TXM_TOO_LARGE, "an exemplar may be 8192 x 8192 pixels at most");
        rows += (u->turns > 2 ? (w > h ? w : h) : h) * u->turns * (u->mirror ? 2 : 1);
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
            txp_range(&u->guides[e], &u->guide_low, &u->guide_high);
        }
        if (x->mask.pixels) {
            status = txp_check_mask(&x->mask, "mask", w, h, env);
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
    if (rows > INT16_MAX)
        return txm_fail(env, TXM_TOO_LARGE,
                        "the exemplars are too high together (32767 rows, each "
                        "turned form counted)");
    u->most_weight = s->guide_bytes ? u->guide_weight : 0;
    for (int m = 0; m < u->map_count; m++)
        u->most_weight = txm_maxf(u->most_weight, u->kinds[m].weight);
    s->bytes = (bytes + s->guide_bytes + 3) / 4 * 4;
    s->guide_at = s->guide_bytes ? bytes : s->bytes;
    return TXM_OK;
}

/* The output's side of a description. */
static txm_status txp_check_output(const texpatch_desc *d, txp_setup *u, const txp_source *s,
                                   txm_env *env) {
    txm_status status = TXM_OK;
    if (d->width < 1 || d->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (d->height > TEXPATCH_MAX_PIXELS / d->width)
        return txm_fail(env, TXM_TOO_LARGE, "more than TEXPATCH_MAX_PIXELS pixels; use windows");
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
    if (d->guide.pixels) {
        status = txp_check_picture(&d->guide, "guide", env);
        if (status != TXM_OK) return status;
        const txm_image guide = txm_image_resolve(d->guide);
        if (guide.width != d->width || guide.height != d->height ||
            guide.channels != u->guides[0].channels || guide.sample != u->guides[0].sample)
            return txm_fail_at(env, TXM_BAD_ARGUMENT, "guide",
                               "must have the size of the output and "
                               "the format of the exemplars' guides");
        if (d->guide_mask.pixels)
            status = txp_check_mask(&d->guide_mask, "guide_mask", d->width, d->height, env);
    }
    if (status != TXM_OK || !d->kept) return status;
    if (!d->keep.pixels) return txm_fail(env, TXM_BAD_ARGUMENT, "kept needs the mask keep");
    status = txp_check_mask(&d->keep, "keep", d->width, d->height, env);
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

/* ---- public: jobs ------------------------------------------------------------------------- */

/* The lattice of a torus whose sides are multiples of it: the steps nearest to `lattice` of which
   whole numbers lead along the sides that wrap. 0: none is within a quarter. */
static int txp_lattice_close(const double lattice[4], int tileable, double width, double height,
                             double out[4]) {
    const double *a = lattice, *b = lattice + 2;
    const double det = txp_det(a, b), sides[2] = {width, height};
    double count[2][2], target[2][2];
    for (int d = 0; d < 2; d++) {
        /* steps to the end of this axis, rounded */
        const double x = d ? 0 : sides[0], y = d ? sides[1] : 0;
        const double u = (x * b[1] - y * b[0]) / det, v = (a[0] * y - a[1] * x) / det;
        count[d][0] = floor(u + 0.5);
        count[d][1] = floor(v + 0.5);
        target[d][0] = x;
        target[d][1] = y;
        if (!(tileable & (d ? TEXPATCH_TILE_Y : TEXPATCH_TILE_X))) { /* free: where it is now */
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

/* Sheets, stacks and lattice; a torus of a texture with a lattice gets a sheet that is stretched
   until the sides are multiples of the steps. The arenas hold what is kept. */
static txm_status txp_source_make(const txp_setup *u, txp_source *s, txm_arena *memory,
                                  txm_env *env) {
    int least = INT_MAX;
    if (u->tileable & TEXPATCH_TILE_X) least = u->width;
    if (u->tileable & TEXPATCH_TILE_Y && u->height < least) least = u->height;
    txm_arena first;
    double closed[4], stretch[4], det;
    const double *v = s->stack[0].lattice;
    txm_arena_init(&first, env);
    txp_sheets(u, s, NULL);
    txp_source_sizes(s, least);
    txm_status status = txp_stacks(u, s, &first, env);
    if (status == TXM_OK) status = txp_lattice_search(u, s, env);
    if (status != TXM_OK || !s->has_lattice || !u->tileable || s->sheets > 1) goto done;
    if (!txp_lattice_close(v, u->tileable, u->width, u->height, closed)) {
        s->has_lattice = 0; /* too small a torus for it */
        goto done;
    }
    /* the exemplar at stretch p is what the sheet shows at p: it takes closed to v */
    det = txp_det(closed, closed + 2);
    stretch[0] = (v[0] * closed[3] - v[2] * closed[1]) / det;
    stretch[1] = (v[1] * closed[3] - v[3] * closed[1]) / det;
    stretch[2] = (v[2] * closed[0] - v[0] * closed[2]) / det;
    stretch[3] = (v[3] * closed[0] - v[1] * closed[2]) / det;
    txm_arena_free(&first);
    txp_sheets(u, s, stretch);
    txp_source_sizes(s, least);
    status = txp_stacks(u, s, &first, env);
    for (int l = 0; l < s->levels && status == TXM_OK; l++)
        txp_lattice_set(&s->stack[l], closed, 1.0 / (1 << l));
done:
    if (status == TXM_OK) txp_find_contrast(s);
    if (status == TXM_OK) *memory = first;
    else txm_arena_free(&first);
    return status;
}

/* Where the lattice begins: anywhere, as the seed has it. */
static void txp_first_shift(const txp_source *s, uint64_t seed, double *x, double *y) {
    txm_rng rng = txm_rng_make(seed, 5);
    *x = txm_rng_below(&rng, (uint32_t)s->stack[0].wide[0]);
    *y = txm_rng_below(&rng, (uint32_t)s->stack[0].high[0]);
}

/* A job on a source, with nothing given yet. It owns `memory`, in which it lies, on success. */
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

/* Room for what is given of a canvas; what is 0 here is not wanted. */
static int txp_given_make(txp_given *g, const txp_source *s, size_t pixels, int fixed,
                          int free_guide, int places, txm_arena *memory) {
    g->pixels = (uint8_t *)txm_arena_zero(memory, pixels, (size_t)s->bytes);
    if (fixed) g->fixed = (uint8_t *)txm_arena_zero(memory, pixels, 1);
    if (free_guide) g->free_guide = (uint8_t *)txm_arena_zero(memory, pixels, 1);
    if (places) {
        g->at = (txp_place *)txm_arena_alloc(memory, pixels, sizeof *g->at);
        g->bend = (float *)txm_arena_zero(memory, pixels, 2 * sizeof(float));
        g->tone = (float *)txm_arena_zero(memory, pixels, (size_t)txp_lanes(s) * sizeof(float));
    }
    return g->pixels && (!fixed || g->fixed) && (!free_guide || g->free_guide) &&
           (!places || (g->at && g->bend && g->tone));
}

/* The guide and its mask, on the canvas; the margin has what the border has. */
static void txp_guide_load(const texpatch_job *job, const txm_image *guide, const txm_image *mask,
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
                g->free_guide[i] =
                    mask->pixels && ((const uint8_t *)txm_image_row_const(mask, gy))[gx] == 0;
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
    txp_source source;
    txm_arena memory, source_memory;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a texpatch_desc");
    memset(&setup, 0, sizeof setup);
    memset(&source, 0, sizeof source);
    txm_status status = txp_check_exemplars(desc, &setup, &source, env);
    if (status == TXM_OK) status = txp_check_output(desc, &setup, &source, env);
    if (status != TXM_OK) return status;
    status = txp_source_make(&setup, &source, &source_memory, env);
    if (status != TXM_OK) return status;

    const int wx = desc->tileable & TEXPATCH_TILE_X, wy = desc->tileable & TEXPATCH_TILE_Y;
    const int room = 2 * TXP_WINDOW << (source.levels - 1); /* a canvas must hold some patches */
    int width = desc->width + (wx ? 0 : 2 * TXP_MARGIN);
    int height = desc->height + (wy ? 0 : 2 * TXP_MARGIN);
    if (!wx && width < room) width = room;
    if (!wy && height < room) height = room;
    const size_t pixels = (size_t)width * (size_t)height;
    txm_arena_init(&memory, env);
    txp_source *s = (txp_source *)txm_arena_alloc(&memory, 1, sizeof *s);
    if (s) *s = source;
    texpatch_job *job = s ? txp_job_make(&setup, s, width, height, desc->seed, &memory, env) : NULL;
    if (!job) goto no_memory;
    job->margin_x = wx ? 0 : TXP_MARGIN;
    job->margin_y = wy ? 0 : TXP_MARGIN;
    txp_first_shift(s, desc->seed, &job->shift_x, &job->shift_y);
    if (s->guide_bytes || desc->kept) {
        if (!txp_given_make(&job->given, s, pixels, desc->kept != NULL, s->guide_bytes > 0, 0,
                            &memory))
            goto no_memory;
        for (int y = 0; y < desc->height && desc->kept; y++) {
            const uint8_t *keep = (const uint8_t *)txm_image_row_const(&desc->keep, y);
            for (int x = 0; x < desc->width; x++) {
                const size_t i =
                    (size_t)(y + job->margin_y) * (size_t)width + (size_t)(x + job->margin_x);
                if (!keep[x]) continue;
                job->given.fixed[i] = 1;
                txp_features(&setup, s, setup.kept, NULL, x, y, 1,
                             job->given.pixels + i * (size_t)s->bytes);
            }
        }
        if (s->guide_bytes) {
            const txm_image guide = txm_image_resolve(desc->guide);
            const txm_image mask =
                desc->guide_mask.pixels ? txm_image_resolve(desc->guide_mask) : desc->guide_mask;
            txp_guide_load(job, &guide, &mask, &job->given);
        }
    }
    job->memory = memory;
    job->source_memory = source_memory;
    *out = job;
    return TXM_OK;
no_memory:
    txm_arena_free(&memory);
    txm_arena_free(&source_memory);
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a job");
}

/* The two fields of the finished canvas. */
static txm_status txp_finish(texpatch_job *job, txp_canvas *c, txm_arena *memory, float **bent,
                             float **toned, txm_env *env) {
    const txp_source *s = job->source;
    const int lanes = txp_lanes(s), bands = (c->height + TXP_BAND - 1) / TXP_BAND;
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    txm_arena scratch;
    txp_field bend, tone;
    txp_seams seams;
    txm_status status = TXM_OK;
    memset(&bend, 0, sizeof bend);
    memset(&tone, 0, sizeof tone);
    txm_arena_init(&scratch, env);
    if (!txp_field_make(&bend, c, 2, 0.02, memory, &scratch) ||
        !txp_field_make(&tone, c, lanes, 0.004, memory, &scratch)) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to finish the picture");
        goto done;
    }
    for (size_t i = 0; i < pixels && job->given.bend; i++) {
        if (!job->given.fixed[i]) continue;
        const float *b = job->given.bend + 2 * i, *v = job->given.tone + (size_t)lanes * i;
        const int x = (int)(i % (size_t)c->width), y = (int)(i / (size_t)c->width);
        float most = 0;
        memcpy(bend.value + 2 * i, b, 2 * sizeof(float));
        memcpy(tone.value + (size_t)lanes * i, v, (size_t)lanes * sizeof(float));
        for (int k = 0; k < lanes; k++) most = txm_maxf(most, fabsf(v[k]));
        if (fabsf(b[0]) + fabsf(b[1]) > 0.05f) txp_field_mark(&bend, x, y);
        if (most > 0.25f) txp_field_mark(&tone, x, y);
    }
    seams.source = s;
    seams.canvas = c;
    seams.bend = &bend;
    seams.tone = &tone;
    /* A band asks something of the first row of the next: every second one at a time, the last
       (whose next may be the first) by itself. */
    for (int turn = 0; turn < 3; turn++) {
        const int end = turn < 2 ? bands - 1 : bands, from = turn < 2 ? turn : bands - 1;
        for (seams.first_band = from; seams.first_band < end; seams.first_band += 2 * TXP_LANES) {
            const int count = (end - seams.first_band + 1) / 2;
            status = txp_report(job, env, "blending");
            if (status != TXM_OK) goto done;
            txm_parallel_for(env, count < TXP_LANES ? count : TXP_LANES, txp_measure_band, &seams);
        }
    }
    txp_field_spread(&bend);
    txp_field_spread(&tone);
    for (int i = 0; i < TXP_ROUNDS; i++) {
        status = txp_report(job, env, "blending");
        if (status != TXM_OK) goto done;
        txp_relax_field(&bend, env);
        txp_relax_field(&tone, env);
    }
    *bent = bend.value;
    *toned = tone.value;
done:
    txm_arena_free(&scratch);
    return status;
}

/* A step of a job without a part. */
static txm_status txp_step_run(texpatch_job *job, txm_env *env) {
    txm_arena memory;
    txp_canvas canvas, finer;
    txm_status status = TXM_OK;
    const txp_step *t = &job->steps[job->next_step];
    int level = job->level;
    txm_arena_init(&memory, env);
    canvas = job->canvas;
    if (t->kind == TXP_STEP_QUILT) {
        status = txp_step_quilt(job, &memory, &canvas, env);
        level = t->level;
    }
    while (status == TXM_OK && level > t->level) {
        status = txp_refine(job, &canvas, --level, &memory, &finer, env);
        canvas = finer;
    }
    const int is_new = level != job->level || t->kind == TXP_STEP_QUILT;
    if (status == TXM_OK && t->kind != TXP_STEP_QUILT && t->kind != TXP_STEP_FINISH) {
        if (t->kind == TXP_STEP_PASS) status = txp_run_pass(job, t, &canvas, env);
        else status = txp_run_polish(job, &canvas, env);
        if (status == TXM_OK) {
            txp_place *old = canvas.at;
            canvas.at = canvas.next;
            canvas.next = old;
            txp_canvas_show(job->source, &job->source->stack[level], &canvas, 0, canvas.height);
        }
    }
    if (status == TXM_OK && t->kind == TXP_STEP_FINISH) {
        txm_arena fields;
        txm_arena_init(&fields, env);
        status = txp_finish(job, &canvas, &fields, &job->bend, &job->tone, env);
        if (status == TXM_OK) job->finish_memory = fields;
        else txm_arena_free(&fields);
    }
    if (status != TXM_OK) {
        txm_arena_free(&memory);
        return status;
    }
    if (is_new) {
        txm_arena_free(&job->canvas_memory);
        job->canvas_memory = memory;
    }
    job->canvas = canvas;
    job->level = level;
    job->next_step++;
    return TXM_OK;
}

/* The part that was made anew becomes part of the whole. */
static void txp_part_join(texpatch_job *job) {
    texpatch_job *part = job->part;
    const txp_source *s = job->source;
    const size_t lanes = (size_t)txp_lanes(s), n = (size_t)s->bytes;
    for (int y = 0; y < part->height; y++) {
        for (int x = 0; x < part->width; x++) {
            const size_t i = txp_index(&part->canvas, x, y);
            const size_t k = txp_index(&job->canvas, job->part_x + x, job->part_y + y);
            if (part->given.fixed[i]) continue;
            job->canvas.at[k] = part->canvas.at[i];
            memcpy(txp_canvas_at(s, &job->canvas, job->part_x + x, job->part_y + y),
                   txp_canvas_at(s, &part->canvas, x, y), n);
            memcpy(job->bend + 2 * k, part->bend + 2 * i, 2 * sizeof(float));
            memcpy(job->tone + lanes * k, part->tone + lanes * i, lanes * sizeof(float));
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

#endif /* TEXPATCH_BEGIN_H */
