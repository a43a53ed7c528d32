#ifndef TEXSYN_LEARN_H
#define TEXSYN_LEARN_H

#include "file.h"
#include "mask.h"

/* ---- public: learning ------------------------------------------------------------------- */

static txm_status txs_learn_check(const texsyn_learn_desc *d, txm_env *env) {
    txm_status status;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "learn: desc is NULL");
    if ((status = txm_image_check(&d->example, "example", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->example.channels == 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: 2 channels; give 1, 3 or 4");
    if (d->example.width < 16 || d->example.height < 16)
        return txm_fail(env, TXM_TOO_SMALL, "example: both sides must be at least 16 pixels");
    if (!txs_image_is_moderate(&d->example))
        return txm_fail(env, TXM_BAD_ARGUMENT, "example: a sample is NaN or beyond a million");
    if ((status = txs_check_mask(&d->mask, &d->example, "mask", env)) != TXM_OK) return status;
    if (d->max_distance < 0 || d->max_distance == 1 || d->max_distance > TXS_MAX_REACH)
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_distance must be 2 to 60, or 0");
    if (d->max_types < 0 || d->max_types > 60)
        return txm_fail(env, TXM_BAD_ARGUMENT, "max_types must be 1 to 60, or 0");
    if (d->levels < 0 || d->levels > TXS_MAX_LEVELS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "levels must be 1 to 6, or 0");
    if (!(d->threshold >= 0) || !txm_is_finite((double)d->threshold))
        return txm_fail(env, TXM_BAD_ARGUMENT, "threshold must be 0 or more");
    return TXM_OK;
}

/* Bands of the example at full resolution; hidden pixels get borrowed colours. s->weight: room for
   the weights, set to NULL if there is no need of them. Returns 0 if there is no memory. */
static int txs_split_visible(texsyn_model *m, const txm_image *im, txs_source *s,
                             txm_arena *arena) {
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    if (s->weight && !txs_weigh(im, s->mask, s->weight)) s->weight = NULL;
    if (txs_find_bands(m, im, s) && s->weight) txs_put_alpha_first(m);
    txs_split(m, im, s);
    if (!s->weight) return 1;
    uint32_t visible = 0, *list = (uint32_t *)txm_arena_alloc(arena, pixels, sizeof *list);
    for (int b = 0; b < m->bands && list; b++)
        if (!txs_is_alpha(m, b))
            visible = txs_borrow(s->value + (size_t)b * pixels, s->weight, s->width, s->height, list);
    if (!visible) s->weight = NULL;
    return list != NULL;
}

/* Are there enough pixels inside the mask, and a visible one? */
static int txs_is_enough(const txs_source *s) {
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    size_t inside = 0, visible = 0;
    for (size_t i = 0; i < pixels && s->mask; i++) inside += s->mask[i] != 0;
    for (size_t i = 0; i < pixels && s->weight; i++)
        visible += (!s->mask || s->mask[i]) && s->weight[i];
    return (!s->mask || inside >= 256) && (!s->weight || visible);
}

/* Split the example into levels of quantised bands. */
static txm_status txs_prepare(const texsyn_learn_desc *desc, texsyn_model *m, txs_source *source,
                              txm_arena *arena, txm_env *env) {
    const txm_image *im = &desc->example;
    const int side = im->width < im->height ? im->width : im->height;
    m->channels = im->channels ? im->channels : 1;
    m->levels = 1;
    while (m->levels < (desc->levels ? desc->levels : TXS_MAX_LEVELS) &&
           side >> m->levels >= (desc->levels ? 8 : TXS_SMALLEST))
        m->levels++;
    for (int i = 0; i < m->levels; i++) {
        txs_source *s = &source[i];
        s->width = im->width >> i;
        s->height = im->height >> i;
        const size_t pixels = (size_t)s->width * (size_t)s->height;
        s->step = (int)(pixels / (1 << 17)) | 1;
        s->value = (float *)txm_arena_alloc(arena, pixels * (size_t)m->channels, sizeof(float));
        if (desc->mask.pixels) s->mask = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
        if (m->channels == 4) s->weight = (uint8_t *)txm_arena_alloc(arena, pixels, 1);
        s->canvas.width = s->width;
        s->canvas.height = s->height;
        s->canvas.stride = s->width;
        s->canvas.plane = (ptrdiff_t)pixels;
        s->canvas.pixels = (uint8_t *)txm_arena_zero(arena, pixels, 2 * (size_t)m->channels + 1);
        if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        if (i == 0) {
            if (s->mask && txm_mask_read(&desc->mask, TXM_MASK_ALLOWS, s->mask) < 256)
                return txm_fail(env, TXM_TOO_SMALL,
                                "mask: fewer than 256 pixels (16 x 16) count; they do where gray "
                                "times alpha is at least half");
            if (!txs_split_visible(m, im, s, arena))
                return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        } else {
            if (!source[i - 1].weight) s->weight = NULL;
            txs_halve(&source[i - 1], s, m);
            if (!txs_is_enough(s)) { /* too little of an irregular region is left at this level */
                m->levels = i;
                break;
            }
        }
        for (int b = 0; b < m->bands; b++) {
            float fill = txs_quantise_band(&m->level[i], b, s, txs_is_alpha(m, b) ? NULL : s->weight);
            if (i == 0) m->dither[b] = fill;
        }
    }
    for (int i = m->levels - 2; i >= 0; i--) {
        txs_fill_parent(&m->level[i + 1], &source[i + 1].canvas, &m->level[i], &source[i].canvas,
                        m->bands);
        if (!txs_cut_labels(&m->level[i], &source[i], txs_is_alpha(m, 0) ? NULL : source[i].weight,
                            m->bands, arena))
            return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the example");
        txs_fill_labels(&m->level[i], &source[i].canvas, m->bands);
    }
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_learn(const texsyn_learn_desc *desc, txm_env *env,
                                   texsyn_model **out) {
    if (out) *out = NULL;
    else return txm_fail(env, TXM_BAD_ARGUMENT, "learn: out is NULL");
    txm_status status = txs_learn_check(desc, env);
    if (status != TXM_OK) return status;

    txm_arena arena;
    txs_source source[TXS_MAX_LEVELS];
    txs_canvas canvas, above;
    texsyn_model *m = NULL;
    uint8_t *bytes = NULL;
    size_t size;
    float from = 0, total = 0;
    memset(source, 0, sizeof source);
    memset(&canvas, 0, sizeof canvas);
    memset(&above, 0, sizeof above);
    txm_arena_init(&arena, env);

    int16_t *noise = (int16_t *)txm_arena_alloc(&arena, TXS_NOISE + TXS_VALUES, sizeof *noise);
    m = (texsyn_model *)txm_arena_zero(&arena, 1, sizeof *m);
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
        goto done;
    }
    txs_noise_table(noise);
    m->version = TXS_VERSION;
    if ((status = txs_prepare(desc, m, source, &arena, env)) != TXM_OK) goto done;

    for (int i = 0; i < m->levels; i++) total += 1.0f / (float)(1 << 2 * i);
    for (int i = m->levels - 1; i >= 0; i--) {
        txs_learner a;
        memset(&a, 0, sizeof a);
        a.desc = desc;
        a.model = m;
        a.index = i;
        a.level = &m->level[i];
        a.source = &source[i];
        a.canvas = &canvas;
        a.shapes = 1;
        a.level->types = (txs_type *)txm_arena_zero(&arena, TXS_MAX_TYPES, sizeof(txs_type));
        const int margin = i + 1 == m->levels ? TXS_MAX_REACH : TXS_NEAR;
        if (!a.level->types ||
            !txs_canvas_make(&canvas, env, txm_clampi(source[i].width, 128, 256),
                             txm_clampi(source[i].height, 128, 256), margin, 2 * m->bands + 1)) {
            status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
            goto done;
        }
        if (above.pixels) {
            txs_fill_parent(a.level + 1, &above, a.level, &canvas, m->bands);
            txs_fill_labels(a.level, &canvas, m->bands);
        }
        txs_canvas_free(&above, env);
        const float to = from + 1.0f / (float)(1 << 2 * i) / total;
        if ((status = txs_learn_level(&a, noise, env, from, to)) != TXM_OK) goto done;
        from = to;
        above = canvas;
        canvas.pixels = NULL;
    }

    /* the model returned has been through the file format, so that saving it loses nothing more */
    if ((status = texsyn_save(m, env, NULL, 0, &size)) != TXM_OK) goto done;
    bytes = (uint8_t *)txm_arena_alloc(&arena, size, 1);
    if (!bytes) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to learn the model");
    else if ((status = texsyn_save(m, env, bytes, size, &size)) == TXM_OK)
        status = texsyn_load(bytes, size, env, out);
done:
    txs_canvas_free(&canvas, env);
    txs_canvas_free(&above, env);
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXSYN_LEARN_H */
