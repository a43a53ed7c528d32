#ifndef TEXPATCH_CHECK_H
#define TEXPATCH_CHECK_H

#include "sheets.h"

/* ---- checks of what the caller gives ---------------------------------------------------- */

static int txp_is_within(float x, float low, float high) {
    return x >= low && x <= high;
}

/* The smallest and largest sample of a map over all exemplars; 8- and 16-bit samples span 0..1.
   has_alpha: hidden colours do not count. */
static void txp_range(const txm_image *im, int has_alpha, float *low, float *high) {
    const size_t n = (size_t)im->channels;
    if (im->sample != TXM_F32) {
        *low = txm_minf(*low, 0);
        *high = txm_maxf(*high, 1);
        return;
    }
    for (int y = 0; y < im->height; y++) {
        const float *row = (const float *)txm_image_row_const(im, y);
        for (size_t i = 0; i < (size_t)im->width * n; i++) {
            if (has_alpha && !(row[i / n * n + n - 1] > 0)) continue;
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

/* Which of the compared bytes are alpha, and of which others. */
static void txp_find_alphas(const txp_setup *u, txp_source *s) {
    int n = 0;
    memset(s->alpha_at, -1, sizeof s->alpha_at);
    for (int m = 0; m < u->map_count; m++) {
        const txm_image *im = &u->maps[0][m];
        if (!(u->kinds[m].weight > 0)) continue;
        for (int c = 0; c < im->channels - 1 && txp_has_alpha(&u->kinds[m], im); c++) {
            const double weight = (double)u->kinds[m].weight / (double)u->most_weight;
            s->has_alpha = 1;
            s->alpha_at[n + c] = (int16_t)(n + im->channels - 1);
            s->opaque[n + c] = (uint8_t)(255 * weight + 0.5);
        }
        n += im->channels;
    }
}

/* A picture whose hidden colours are those of visible neighbours; of labels 0, for one label is not
   between others. The picture as it is if nothing is hidden, else a copy in memory. */
static txm_status txp_show(txm_image *im, int is_label, int wrap, txm_arena *memory, txm_env *env) {
    const txm_status status = txm_image_bled(im, wrap, memory, env, im);
    if (status != TXM_OK || !is_label || !txm_image_has_hidden(im)) return status;
    const size_t bytes = (size_t)im->channels * txm_sample_bytes(im->sample);
    for (int y = 0; y < im->height; y++) {
        char *pixel = (char *)txm_image_row(im, y);
        for (int x = 0; x < im->width; x++, pixel += bytes) {
            if (!(txm_image_get(im, x, y, im->channels - 1) > 0)) memset(pixel, 0, bytes);
        }
    }
    return status;
}

/* Replace all pictures of a setup in which colour is hidden. */
static txm_status txp_show_all(txp_setup *u, txm_arena *memory, txm_env *env) {
    txm_status status = TXM_OK;
    for (int e = 0; e < u->exemplar_count && status == TXM_OK; e++) {
        for (int m = 0; m < u->map_count && status == TXM_OK; m++) {
            if (txp_has_alpha(&u->kinds[m], &u->maps[e][m]))
                status = txp_show(&u->maps[e][m], u->kinds[m].is_label, 0, memory, env);
        }
        if (status == TXM_OK && u->guides[e].pixels)
            status = txp_show(&u->guides[e], 0, 0, memory, env);
    }
    for (int m = 0; m < u->map_count && status == TXM_OK; m++) {
        if (u->kept[m].pixels && txp_has_alpha(&u->kinds[m], &u->kept[m]))
            status = txp_show(&u->kept[m], u->kinds[m].is_label, u->tileable, memory, env);
    }
    return status;
}

/* The fields about exemplars and how they are treated; u and s are set. */
static txm_status txp_check_exemplars(const texpatch_desc *d, txp_setup *u, txp_source *s,
                                      txm_env *env) {
    txm_status status = TXM_OK;
    int bytes = 0;
    memset(u, 0, sizeof *u);
    memset(s, 0, sizeof *s);
    if (!d->exemplars || d->exemplar_count < 1 || d->exemplar_count > TEXPATCH_MAX_EXEMPLARS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "exemplar_count must be 1 to 8, exemplars not NULL");
    if (d->map_count < 1 || d->map_count > TEXPATCH_MAX_MAPS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map_count must be 1 to 16");
    if (d->turns != 0 && d->turns != 1 && d->turns != 2 && d->turns != 4)
        return txm_fail(env, TXM_BAD_ARGUMENT, "turns must be 1, 2 or 4 (0 means 1)");
    if (d->patch < 0 || d->patch > TEXPATCH_MAX_SIDE)
        return txm_fail(env, TXM_BAD_ARGUMENT, "patch must be 0 to 16384 pixels");
    if (d->passes < -1 || d->passes > 16)
        return txm_fail(env, TXM_BAD_ARGUMENT, "passes must be 1 to 16, 0 for 3, or -1 for none");
    if (!txp_is_within(d->novelty, 0, 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "novelty must be 0 to 1");
    if (!txp_is_within(d->guide_weight, 0, 16))
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
            return txm_fail(env, TXM_BAD_ARGUMENT, "lattice_vectors must be 16384 pixels at most");
        u->lattice_vectors[i] = (double)d->lattice_vectors[i];
    }
    if (d->lattice == 1 && !(fabs(txp_det(u->lattice_vectors, u->lattice_vectors + 2)) >= 16))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "lattice_vectors must span 16 pixels or more; use lattice 0 to find them");
    for (int m = 0; m < d->map_count; m++) {
        if (d->maps) u->kinds[m] = d->maps[m];
        else u->kinds[m].weight = m ? 0.0f : 1.0f;
        if (!txp_is_within(u->kinds[m].weight, 0, 16))
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
            txp_range(im, txp_has_alpha(&u->kinds[m], im), &u->low[m], &u->high[m]);
            if (e == 0 && u->kinds[m].weight > 0) bytes += im->channels;
        }
        const int w = u->maps[e][0].width, h = u->maps[e][0].height;
        if (w < TEXPATCH_MIN_SIDE || h < TEXPATCH_MIN_SIDE)
            return txm_fail(env, TXM_TOO_SMALL, "an exemplar must be 32 x 32 pixels or more");
        if (w > TEXPATCH_MAX_SIDE || h > TEXPATCH_MAX_SIDE)
            return txm_fail(env, TXM_TOO_LARGE, "an exemplar may be 16384 x 16384 pixels at most");
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
            txp_range(&u->guides[e], txm_image_has_alpha(&u->guides[e]), &u->guide_low,
                      &u->guide_high);
        }
        if (x->mask.pixels) {
            status = txm_mask_check(&x->mask, "mask", w, h, TEXPATCH_MAX_PIXELS, env);
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
    u->most_weight = s->guide_bytes ? u->guide_weight : 0;
    for (int m = 0; m < u->map_count; m++)
        u->most_weight = txm_maxf(u->most_weight, u->kinds[m].weight);
    s->tones = bytes;
    s->bytes = (bytes + s->guide_bytes + 3) / 4 * 4;
    s->guide_at = s->guide_bytes ? bytes : s->bytes;
    txp_find_alphas(u, s);
    return TXM_OK;
}

/* The guide of the output and its mask, which may be NULL or without pixels. */
static txm_status txp_check_guide(const txm_image *guide, const txm_image *mask,
                                  const txp_setup *u, int width, int height, txm_env *env) {
    const txm_status status = txp_check_picture(guide, "guide", env);
    if (status != TXM_OK) return status;
    const txm_image im = txm_image_resolve(*guide);
    if (im.width != width || im.height != height || im.channels != u->guides[0].channels ||
        im.sample != u->guides[0].sample)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "guide",
                           "must have the size of the output and "
                           "the format of the exemplars' guides");
    if (!mask || !mask->pixels) return TXM_OK;
    return txm_mask_check(mask, "guide_mask", width, height, TEXPATCH_MAX_PIXELS, env);
}

/* The fields about the output. */
static txm_status txp_check_output(const texpatch_desc *d, txp_setup *u, const txp_source *s,
                                   txm_env *env) {
    txm_status status = TXM_OK;
    if (d->width < 1 || d->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (d->height > TEXPATCH_MAX_PIXELS / d->width)
        return txm_fail(env, TXM_TOO_LARGE,
                        "more than TEXPATCH_MAX_PIXELS pixels; use windows of a plane");
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
    if (d->guide.pixels)
        status = txp_check_guide(&d->guide, &d->guide_mask, u, d->width, d->height, env);
    if (status != TXM_OK || !d->kept) return status;
    if (!d->keep.pixels) return txm_fail(env, TXM_BAD_ARGUMENT, "kept needs the mask keep");
    status = txm_mask_check(&d->keep, "keep", d->width, d->height, TEXPATCH_MAX_PIXELS, env);
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

#endif /* TEXPATCH_CHECK_H */
