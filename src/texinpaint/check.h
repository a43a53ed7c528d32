#ifndef TEXINPAINT_CHECK_H
#define TEXINPAINT_CHECK_H

#include "config.h"

/* ---- checks of what the caller gives ------------------------------------------------------- */

#define TXI_MAX_UV 4096.0f /* repeats of the texture; beyond, a float no longer tells its texels
                              apart                                                              */

static txm_status txi_check_size(const txm_image *im, const char *name, const txm_image *like,
                                 txm_env *env) {
    const txm_status status = txm_image_check(im, name, TEXINPAINT_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (im->width > TEXINPAINT_MAX_SIDE || im->height > TEXINPAINT_MAX_SIDE)
        return txm_fail_at(env, TXM_TOO_LARGE, name, "sides may have up to 32768 pixels");
    if (im->width != like->width || im->height != like->height)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "must have the size of image");
    return TXM_OK;
}

/* Are all samples finite, and not so large that sums of them are not? */
static int txi_is_moderate(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const size_t row_count = (size_t)im.width * (size_t)im.channels;
    for (int y = 0; y < im.height && im.sample == TXM_F32; y++) {
        const float *row = (const float *)txm_image_row_const(&im, y);
        for (size_t i = 0; i < row_count; i++) {
            if (!(row[i] >= -TXI_MOST_SAMPLE && row[i] <= TXI_MOST_SAMPLE)) return 0;
        }
    }
    return 1;
}

static txm_status txi_check_picture(const txm_image *im, const char *name, const txm_image *like,
                                    txm_env *env) {
    const txm_status status = txi_check_size(im, name, like, env);
    if (status == TXM_OK && !txi_is_moderate(im))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, name, "samples must be finite, and at most 1e30");
    return status;
}

static txm_status txi_check_mask(const txm_image *im, const char *name, const txm_image *like,
                                 txm_env *env) {
    return txm_mask_check(im, name, like->width, like->height, TEXINPAINT_MAX_PIXELS, env);
}

static txm_status txi_check_maps(const texinpaint_desc *d, txm_env *env) {
    if (d->map_count < 0 || d->map_count >= TEXINPAINT_MAX_MAPS || (d->map_count && !d->maps))
        return txm_fail(env, TXM_BAD_ARGUMENT, "map_count must be 0 to 15, and maps not NULL");
    for (int i = 0; i < d->map_count; i++) {
        const texinpaint_map *map = &d->maps[i];
        const txm_status status = txi_check_picture(&map->image, "maps", &d->image, env);
        if (status != TXM_OK) return status;
        if (map->is_normal < 0 || map->is_normal > 2 || (map->is_normal && map->image.channels < 3))
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "is_normal must be 0 to 2, for maps with 3 or 4 channels");
        if (map->is_normal && map->is_label)
            return txm_fail(env, TXM_BAD_ARGUMENT, "a map has is_normal or is_label, not both");
    }
    return TXM_OK;
}

static txm_status txi_check_surface(const texinpaint_desc *d, txm_env *env) {
    const txm_status status = txm_mesh_check(&d->mesh, "mesh", 3, 1, 0, env);
    if (status != TXM_OK) return status;
    if (d->mesh.face_count == 0) return TXM_OK;
    if (!d->uv || !d->uv_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "the mesh has no texture coordinates: set uv");
    if (d->uv_count > SIZE_MAX / 16) return txm_fail(env, TXM_TOO_LARGE, "uv_count is too large");
    if (!d->uv_indices && d->uv_count < d->mesh.vertex_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "without uv_indices each vertex needs an uv");
    for (size_t i = 0; d->uv_indices && i < 3 * d->mesh.face_count; i++) {
        if (d->uv_indices[i] >= d->uv_count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "face # names uv #, which is not below uv_count", i / 3,
                                    d->uv_indices[i]);
    }
    for (size_t i = 0; i < 2 * d->uv_count; i++) {
        if (!(d->uv[i] >= -TXI_MAX_UV && d->uv[i] <= TXI_MAX_UV))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "uv # is not finite or farther than 4096 from 0", i / 2, 0);
    }
    return TXM_OK;
}

static txm_status txi_check_lines(const texinpaint_desc *d, txm_env *env) {
    if (d->line_count < 0 || (d->line_count && !d->lines))
        return txm_fail(env, TXM_BAD_ARGUMENT, "line_count must be 0 or more, and lines not NULL");
    for (int i = 0; i < d->line_count; i++) {
        const texinpaint_line *line = &d->lines[i];
        if (line->count < 2 || !line->points)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "line # needs 2 points or more",
                                    (uint64_t)i, 0);
        for (size_t k = 0; k < 3 * (size_t)line->count; k++) {
            if (!txm_is_finite(line->points[k]))
                return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                        "line # has a point that is not finite", (uint64_t)i, 0);
        }
    }
    return TXM_OK;
}

/* Everything but the mask, which calls without a hole may leave out. */
static txm_status txi_check_common(const texinpaint_desc *d, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    status = txi_check_picture(&d->image, "image", &d->image, env);
    if (status == TXM_OK) status = txi_check_maps(d, env);
    if (status == TXM_OK) status = txi_check_surface(d, env);
    if (status == TXM_OK && (d->gutter < -1 || d->gutter > TEXINPAINT_MAX_SIDE))
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be -1 to 32768 texels");
    return status;
}

/* The whole description of a completion. */
static txm_status txi_check(const texinpaint_desc *d, txm_env *env) {
    txm_status status = txi_check_common(d, env);
    if (status == TXM_OK) status = txi_check_mask(&d->mask, "mask", &d->image, env);
    if (status == TXM_OK && d->source.pixels)
        status = txi_check_mask(&d->source, "source", &d->image, env);
    if (status == TXM_OK) status = txi_check_lines(d, env);
    if (status != TXM_OK) return status;
    if (d->structure < TEXINPAINT_AUTO || d->structure > TEXINPAINT_PATTERN)
        return txm_fail(env, TXM_BAD_ARGUMENT, "structure must be one of TEXINPAINT_AUTO ...");
    if (d->prior < TEXINPAINT_PRIOR_NONE || d->prior > TEXINPAINT_PRIOR_LINES)
        return txm_fail(env, TXM_BAD_ARGUMENT, "prior must be one of TEXINPAINT_PRIOR_NONE ...");
    if (d->prior == TEXINPAINT_PRIOR_CREST && d->mesh.face_count == 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "a picture has no crest lines; give lines");
    if (d->prior == TEXINPAINT_PRIOR_LINES && d->line_count == 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "TEXINPAINT_PRIOR_LINES needs lines");
    if (!(d->alpha >= 0 && d->alpha <= 1e6f) || d->beta < 0 || d->beta > 4096)
        return txm_fail(env, TXM_BAD_ARGUMENT, "alpha must be 0 to 1e6, beta 0 to 4096");
    return TXM_OK;
}

/* Are these pictures of the form of the inputs? */
static txm_status txi_check_outputs(const texinpaint_desc *d, const txm_image *out, int count,
                                    txm_env *env) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    for (int i = 0; i < count; i++) {
        const txm_image *in = i ? &d->maps[i - 1].image : &d->image;
        const txm_status status = txi_check_size(&out[i], "out", &d->image, env);
        if (status != TXM_OK) return status;
        if (txm_image_resolve(out[i]).channels != txm_image_resolve(*in).channels ||
            out[i].sample != in->sample)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "out: channels and sample must be those of the input");
    }
    return TXM_OK;
}

/* ---- the domain ---------------------------------------------------------------------------- */

/* Copy samples between pictures of one form. */
static void txi_copy_picture(const txm_image *from, const txm_image *to) {
    const txm_image a = txm_image_resolve(*from), b = txm_image_resolve(*to);
    const size_t row = (size_t)a.width * (size_t)a.channels * txm_sample_bytes(a.sample);
    for (int y = 0; y < a.height; y++)
        memmove(txm_image_row(&b, y), txm_image_row_const(&a, y), row);
}

/* Copies of the maps in their given state, and which texels are missing and usable. Checked inputs;
   a mask without pixels: none is missing. txi_surface_make must follow, which sets covered. */
static txm_status txi_domain_make(txi_domain *domain, const texinpaint_desc *desc, txm_arena *arena,
                                  txm_env *env) {
    const size_t count = (size_t)desc->image.width * (size_t)desc->image.height;
    memset(domain, 0, sizeof *domain);
    domain->desc = desc;
    domain->width = desc->image.width;
    domain->height = desc->image.height;
    domain->map_count = 1 + desc->map_count;
    for (int i = 0; i < domain->map_count; i++) {
        const txm_image *in = i ? &desc->maps[i - 1].image : &desc->image;
        txm_image *map = &domain->maps[i];
        *map = *in;
        map->stride = 0;
        *map = txm_image_resolve(*map);
        map->pixels = txm_arena_alloc(arena, (size_t)map->height, (size_t)map->stride);
        if (!map->pixels) return txi_no_memory(env);
        txi_copy_picture(in, map);
    }
    domain->missing = (uint8_t *)txm_arena_zero(arena, count, 1);
    domain->usable = (uint8_t *)txm_arena_zero(arena, count, 1);
    if (arena->failed) return txi_no_memory(env);
    if (desc->mask.pixels) txm_mask_read(&desc->mask, TXM_MASK_REPLACES, domain->missing);
    if (desc->source.pixels) txm_mask_read(&desc->source, TXM_MASK_ALLOWS, domain->usable);
    for (size_t i = 0; i < count; i++) {
        domain->missing[i] = domain->missing[i] != 0;
        domain->usable[i] = !domain->missing[i] && (!desc->source.pixels || domain->usable[i]);
    }
    return TXM_OK;
}

/* Deliver an intermediate result to the caller, if wanted. */
static void txi_show(const txi_domain *domain, const char *name, uint8_t *pixels, int width,
                     int height, int channels) {
    txm_image picture;
    if (!domain->desc->show) return;
    memset(&picture, 0, sizeof picture);
    picture.pixels = pixels;
    picture.width = width;
    picture.height = height;
    picture.channels = channels;
    domain->desc->show(domain->desc->show_user, name, &picture);
}

#endif /* TEXINPAINT_CHECK_H */
