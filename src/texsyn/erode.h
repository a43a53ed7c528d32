#ifndef TEXSYN_ERODE_H
#define TEXSYN_ERODE_H

#include "laying.h"
#include "order.h"

/* ---- erosion: the exemplar -------------------------------------------------------------- */

enum {
    TXS_LEAST_STONE = 32, /* pixels: shorter exemplars have no cracks to speak of                */
    TXS_DEPTHS = 8,       /* parts of the order in which ratios are limited                      */
    TXS_INTACT_BORDER = 2 /* pixels around cracks that do not count as intact                    */
};
#define TXS_SHARE 0.1f       /* of the picture that is eroded at level 1                      */
#define TXS_MOST_SHARE 0.5f
#define TXS_LIGHTEST 0.75    /* the lightest quarter of each depth is limited to the rest        */

struct texsyn_erosion {
    txm_arena arena; /* holds all, this struct too                                        */
    int width, height;
    float share;
    uint32_t *rank; /* of each pixel: how many erode before it                           */
    uint8_t *ratio; /* 3 per pixel: what its colour is multiplied by, of TXS_RATIO_ONE   */
};

static txm_status txs_check_erosion(const texsyn_erosion_desc *d, txm_env *env) {
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    txm_status status = txm_image_check(&d->weathered, "weathered", TEXSYN_MAX_PIXELS, env);
    if (status == TXM_OK) status = txs_check_mask(&d->mask, &d->weathered, "mask", env);
    if (status != TXM_OK) return status;
    if (!(d->share >= 0 && d->share <= TXS_MOST_SHARE))
        return txm_fail(env, TXM_BAD_ARGUMENT, "share must be 0 (default) to 0.5");
    if (!txs_image_is_moderate(&d->weathered))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "weathered",
                           "has samples that are not finite or beyond a million");
    if (d->weathered.width < TXS_LEAST_STONE || d->weathered.height < TXS_LEAST_STONE)
        return txm_fail_numbers_at(env, TXM_TOO_SMALL, "weathered", "must be at least # x #",
                                   TXS_LEAST_STONE, TXS_LEAST_STONE);
    return TXM_OK;
}

/* How many pixels are known: opaque and in the mask. */
static size_t txs_find_known(txs_stone *s, const txm_image *im, const txm_image *mask) {
    size_t count = 0;
    if (mask->pixels) txm_mask_read(mask, TXM_MASK_ALLOWS, s->known);
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            uint8_t *known = &s->known[(size_t)y * (size_t)s->width + (size_t)x];
            int ok = !mask->pixels || *known;
            if (im->channels % 2 == 0)
                ok = ok && txm_image_get(im, x, y, im->channels - 1) >= 0.5f;
            *known = (uint8_t)ok;
            count += (size_t)ok;
        }
    }
    return count;
}

/* The planes of an exemplar, in arena; the room for the filters too. */
static txm_status txs_make_stone(const texsyn_erosion_desc *d, txm_arena *arena, txs_stone *s,
                                 txm_env *env, float from, float to) {
    const txm_image im = txm_image_resolve(d->weathered);
    const size_t n = txs_pixels_of(im.width, im.height);
    const size_t longer = (size_t)(im.width > im.height ? im.width : im.height);
    txs_filter_room room;
    s->width = im.width;
    s->height = im.height;
    s->dark = (float *)txm_arena_alloc(arena, n, sizeof(float));
    s->strength = (float *)txm_arena_alloc(arena, n, sizeof(float));
    s->ratio = (uint8_t *)txm_arena_alloc(arena, n, 3);
    s->known = (uint8_t *)txm_arena_alloc(arena, n, 1);
    room.weight = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.mean = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.wide = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.square = (float *)txm_arena_alloc(arena, n, sizeof(float));
    room.line = (float *)txm_arena_alloc(arena, longer, sizeof(float));
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the exemplar");
    if (txm_progress(env, from, "darkness")) return txm_fail(env, TXM_CANCELLED, "cancelled");
    if (txs_find_known(s, &im, &d->mask) < (size_t)TXS_LEAST_STONE * TXS_LEAST_STONE)
        return txm_fail_numbers_at(env, TXM_TOO_SMALL, "weathered",
                                   "fewer than # opaque pixels in the mask",
                                   (uint64_t)TXS_LEAST_STONE * TXS_LEAST_STONE, 0);
    txs_find_dark(s, &im, &room);
    txs_find_ratios(s, &im, &room);
    return txs_find_strength(s->dark, s->strength, s->width, s->height, env,
                             txm_lerpf(from, to, 0.3f), to);
}

/* The ratio of the luma, of TXS_RATIO_ONE. */
static int txs_gray_ratio(const uint8_t ratio[3]) {
    return (77 * ratio[0] + 150 * ratio[1] + 29 * ratio[2] + 128) >> 8;
}

/* which depth a rank is, TXS_DEPTHS for those beyond the share */
static int txs_depth_of(uint32_t rank, double most) {
    const double depth = (double)rank / most * (double)TXS_DEPTHS;
    return depth < (double)TXS_DEPTHS ? (int)depth : TXS_DEPTHS;
}

/* The largest gray ratio of each depth of the exemplar, but for the lightest quarter: bridges between
   the parts of a crack are as dark as the crack. */
static void txs_find_limits(const txs_stone *s, const uint32_t *rank, double most,
                            int limit[TXS_DEPTHS]) {
    uint32_t histogram[TXS_DEPTHS][256];
    const size_t n = txs_pixels_of(s->width, s->height);
    memset(histogram, 0, sizeof histogram);
    for (size_t i = 0; i < n; i++) {
        const int depth = txs_depth_of(rank[i], most);
        if (depth < TXS_DEPTHS && s->known[i])
            histogram[depth][txs_gray_ratio(s->ratio + 3 * i)]++;
    }
    for (int d = 0; d < TXS_DEPTHS; d++) {
        uint64_t count = 0, seen = 0;
        for (int v = 0; v < 256; v++) count += histogram[d][v];
        limit[d] = TXS_RATIO_ONE;
        for (int v = 0; v < TXS_RATIO_ONE && count; v++) {
            seen += histogram[d][v];
            if ((double)seen < TXS_LIGHTEST * (double)count) continue;
            limit[d] = v;
            break;
        }
    }
}

/* What the stone becomes at each pixel: the exemplar's ratios, limited by depth. */
static void txs_take_ratios(texsyn_erosion *e, const txs_stone *s, const int32_t *source,
                            const int limit[TXS_DEPTHS]) {
    const size_t n = txs_pixels_of(e->width, e->height);
    const double most = (double)e->share * (double)n;
    for (size_t i = 0; i < n; i++) {
        const uint8_t *from = s->ratio + 3 * (size_t)source[i];
        const int depth = txs_depth_of(e->rank[i], most), gray = txs_gray_ratio(from);
        const int most_gray = limit[depth < TXS_DEPTHS ? depth : TXS_DEPTHS - 1];
        for (size_t c = 0; c < 3; c++)
            e->ratio[3 * i + c] =
                gray <= most_gray ? from[c] : (uint8_t)((from[c] * most_gray + gray / 2) / gray);
    }
}

/* ---- erosion: making -------------------------------------------------------------------- */

/* Everything between the check and the object; planes that are no longer needed are in work. */
static txm_status txs_erode_exemplar(const texsyn_erosion_desc *d, texsyn_erosion *e,
                                     txm_arena *work, txm_env *env) {
    txs_stone stone;
    int limit[TXS_DEPTHS];
    const size_t n = txs_pixels_of(e->width, e->height);
    txm_status status = txs_make_stone(d, work, &stone, env, 0, 0.2f);
    if (status != TXM_OK) return status;
    const size_t size = txs_pixels_of(stone.width, stone.height);
    uint32_t *rank = (uint32_t *)txm_arena_alloc(work, size, sizeof(uint32_t));
    int32_t *source = (int32_t *)txm_arena_alloc(work, n, sizeof(int32_t));
    float *dark = (float *)txm_arena_alloc(work, n, sizeof(float));
    float *strength = (float *)txm_arena_alloc(work, n, sizeof(float));
    if (work->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the cracks");
    status = txs_find_ranks(stone.strength, stone.width, stone.height, (double)e->share, work, rank,
                            env, 0.2f);
    if (status == TXM_OK)
        status = txs_lay_all(&stone, e->width, e->height, d->seed, work, source, env, 0.25f, 0.6f);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < n; i++) dark[i] = stone.dark[source[i]];
    status = txs_find_strength(dark, strength, e->width, e->height, env, 0.6f, 0.85f);
    if (status == TXM_OK)
        status = txs_find_ranks(strength, e->width, e->height, (double)e->share, work, e->rank, env,
                                0.85f);
    if (status != TXM_OK) return status;
    txs_find_limits(&stone, rank, (double)e->share * (double)size, limit);
    txs_take_ratios(e, &stone, source, limit);
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_erosion_make(const texsyn_erosion_desc *desc, txm_env *env,
                                          texsyn_erosion **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    txm_status status = txs_check_erosion(desc, env);
    if (status != TXM_OK) return status;
    if (desc->width < 1 || desc->height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (desc->height > TEXSYN_MAX_PIXELS / desc->width)
        return txm_fail(env, TXM_TOO_LARGE, "more than TEXSYN_MAX_PIXELS pixels");

    txm_arena own, work;
    txm_arena_init(&own, env);
    txm_arena_init(&work, env);
    const size_t n = txs_pixels_of(desc->width, desc->height);
    texsyn_erosion *e = (texsyn_erosion *)txm_arena_alloc(&own, 1, sizeof *e);
    uint32_t *rank = (uint32_t *)txm_arena_alloc(&own, n, sizeof(uint32_t));
    uint8_t *ratio = (uint8_t *)txm_arena_alloc(&own, n, 3);
    if (own.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the erosion");
    } else {
        e->width = desc->width;
        e->height = desc->height;
        e->share = desc->share > 0 ? desc->share : TXS_SHARE;
        e->rank = rank;
        e->ratio = ratio;
        status = txs_erode_exemplar(desc, e, &work, env);
    }
    txm_arena_free(&work);
    if (status == TXM_OK && txm_progress(env, 1, "done"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status != TXM_OK) {
        txm_arena_free(&own);
        return status;
    }
    e->arena = own;
    *out = e;
    return TXM_OK;
}

TEXSYN_API void texsyn_erosion_free(texsyn_erosion *erosion) {
    if (!erosion) return;
    txm_arena arena = erosion->arena;
    txm_arena_free(&arena);
}

TEXSYN_API float texsyn_erosion_share(const texsyn_erosion *erosion) {
    return erosion ? erosion->share : 0;
}

/* ---- erosion: drawing ------------------------------------------------------------------- */

enum { TXS_COVERED = 16 }; /* weight of a pixel all of whose neighbours are eroded as well */

typedef struct txs_level_of { /* how far a pixel is eroded */
    const texsyn_erosion *erosion;
    float level;
    const txm_image *levels;
    double most;
} txs_level_of;

static int txs_is_eroded(const txs_level_of *l, int x, int y) {
    double level = (double)l->level;
    if (l->levels) {
        const int channels = l->levels->channels;
        level *= (double)txm_clampf(txm_image_get(l->levels, x, y, 0), 0, 1);
        if (channels == 2) level *= (double)txm_clampf(txm_image_get(l->levels, x, y, 1), 0, 1);
    }
    const size_t i = (size_t)y * (size_t)l->erosion->width + (size_t)x;
    return (double)l->erosion->rank[i] < floor(level * l->most + 0.5);
}

static txm_status txs_check_levels(const texsyn_erosion *e, float level, const txm_image *levels,
                                   txm_env *env) {
    if (!e) return txm_fail(env, TXM_BAD_ARGUMENT, "erosion is NULL");
    if (!(level >= 0 && level <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "level must be 0 to 1");
    if (!levels) return TXM_OK;
    const txm_status status = txm_image_check(levels, "levels", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (levels->channels > 2)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "levels", "must be gray, with or without alpha");
    if (levels->width != e->width || levels->height != e->height)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "levels", "must be # x # like the erosion",
                                   (uint64_t)e->width, (uint64_t)e->height);
    if (!txm_image_is_finite(levels))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "levels", "has samples that are not finite");
    return TXM_OK;
}

static txs_level_of txs_level_make(const texsyn_erosion *e, float level, const txm_image *levels) {
    txs_level_of l;
    l.erosion = e;
    l.level = level;
    l.levels = levels;
    l.most = (double)e->share * (double)txs_pixels_of(e->width, e->height);
    return l;
}

TEXSYN_API txm_status texsyn_erosion_mask(const texsyn_erosion *erosion, float level,
                                          const txm_image *levels, txm_env *env, txm_image out) {
    txm_status status = txs_check_levels(erosion, level, levels, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (out.width != erosion->width || out.height != erosion->height || out.channels > 1)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "out", "must be # x #, with one channel",
                                   (uint64_t)erosion->width, (uint64_t)erosion->height);
    const txs_level_of l = txs_level_make(erosion, level, levels);
    for (int y = 0; y < out.height; y++) {
        for (int x = 0; x < out.width; x++)
            txm_image_set(&out, x, y, 0, txs_is_eroded(&l, x, y) ? 1.0f : 0.0f);
    }
    return TXM_OK;
}

/* How much of a pixel is covered, 0..TXS_COVERED: a tent over its neighbours; an eroded pixel at least
   three quarters, another at most half, so that lines of one pixel are dark and rims are soft. */
static int txs_cover(const uint8_t *const rows[3], int x, int width) {
    static const int weight[3][3] = {{1, 2, 1}, {2, 4, 2}, {1, 2, 1}};
    int sum = 0;
    for (int v = 0; v < 3; v++) {
        for (int u = 0; u < 3; u++)
            sum += weight[v][u] * rows[v][txm_clampi(x + u - 1, 0, width - 1)];
    }
    const int least = TXS_COVERED * 3 / 4;
    if (rows[1][x]) return sum > least ? sum : least;
    return sum / 2;
}

/* One pixel of the picture; one that nothing covers is copied as it is. */
static void txs_erode_pixel(const texsyn_erosion *e, const txm_image *from, const txm_image *to, int x,
                            int y, int cover) {
    const uint8_t *ratio = e->ratio + 3 * ((size_t)y * (size_t)e->width + (size_t)x);
    const int colours = from->channels < 3 ? 1 : 3;
    for (int c = 0; c < from->channels; c++) {
        const float v = txm_image_get(from, x, y, c);
        const int one = TXS_RATIO_ONE, whole = one * (int)TXS_COVERED;
        const int r = colours == 1 ? txs_gray_ratio(ratio) : c < 3 ? ratio[c] : one;
        const double factor = (whole - cover * (one - r)) / (double)whole;
        txm_image_set(to, x, y, c, c < colours && cover ? txm_float((double)v * factor) : v);
    }
}

TEXSYN_API txm_status texsyn_erosion_draw(const texsyn_erosion *erosion, float level,
                                          const txm_image *levels, const txm_image *picture,
                                          txm_env *env, txm_image out) {
    txm_status status = txs_check_levels(erosion, level, levels, env);
    if (status == TXM_OK) status = txm_image_check(picture, "picture", TEXSYN_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    txm_image from = txm_image_resolve(*picture);
    const txm_image to = txm_image_resolve(out);
    if (from.width != erosion->width || from.height != erosion->height)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "picture", "must be # x # like the erosion",
                                   (uint64_t)erosion->width, (uint64_t)erosion->height);
    if (to.width != from.width || to.height != from.height || to.channels != from.channels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have the size and the channels of the picture");
    if (!txm_image_is_finite(&from))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "picture", "has samples that are not finite");

    /* three rows of the mask, those above and below the one that is drawn */
    const size_t width = (size_t)from.width;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint8_t *mask = (uint8_t *)txm_arena_alloc(&arena, 3, width);
    status = mask ? txm_image_bled(picture, 0, &arena, env, &from)
                  : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for three rows");
    const txs_level_of l = txs_level_make(erosion, level, levels);
    for (int y = 0; y <= from.height && status == TXM_OK; y++) {
        uint8_t *next = mask + width * (size_t)(y % 3);
        for (int x = 0; x < from.width && y < from.height; x++)
            next[x] = (uint8_t)txs_is_eroded(&l, x, y);
        if (y == 0) continue;
        const uint8_t *const rows[3] = {mask + width * (size_t)((y > 1 ? y - 2 : 0) % 3),
                                        mask + width * (size_t)((y - 1) % 3),
                                        y < from.height ? next : mask + width * (size_t)((y - 1) % 3)};
        for (int x = 0; x < from.width; x++)
            txs_erode_pixel(erosion, &from, &to, x, y - 1, txs_cover(rows, x, from.width));
    }
    txm_arena_free(&arena);
    return status;
}

/* ---- the intact stone ------------------------------------------------------------------- */

/* Is there a crack within TXS_INTACT_BORDER pixels? */
static int txs_near_crack(const txs_stone *s, const uint32_t *rank, double most, int x, int y) {
    for (int v = y - TXS_INTACT_BORDER; v <= y + TXS_INTACT_BORDER; v++) {
        for (int u = x - TXS_INTACT_BORDER; u <= x + TXS_INTACT_BORDER; u++) {
            if (u < 0 || v < 0 || u >= s->width || v >= s->height) continue;
            if ((double)rank[(size_t)v * (size_t)s->width + (size_t)u] < most) return 1;
        }
    }
    return 0;
}

TEXSYN_API txm_status texsyn_erosion_intact(const texsyn_erosion_desc *desc, txm_env *env,
                                            txm_image out) {
    txm_status status = txs_check_erosion(desc, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (out.width != desc->weathered.width || out.height != desc->weathered.height ||
        out.channels > 1)
        return txm_fail_numbers_at(env, TXM_BAD_ARGUMENT, "out", "must be # x #, with one channel",
                                   (uint64_t)desc->weathered.width,
                                   (uint64_t)desc->weathered.height);
    txm_arena work;
    txs_stone stone;
    const size_t n = txs_pixels_of(out.width, out.height);
    const double share = (double)(desc->share > 0 ? desc->share : TXS_SHARE);
    txm_arena_init(&work, env);
    status = txs_make_stone(desc, &work, &stone, env, 0, 0.7f);
    uint32_t *rank = status == TXM_OK ? (uint32_t *)txm_arena_alloc(&work, n, sizeof(uint32_t)) : NULL;
    if (status == TXM_OK && !rank) status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the order");
    if (status == TXM_OK)
        status = txs_find_ranks(stone.strength, out.width, out.height, share, &work, rank, env, 0.7f);
    if (status == TXM_OK && txm_progress(env, 1, "done"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    for (int y = 0; y < out.height && status == TXM_OK; y++) {
        for (int x = 0; x < out.width; x++) {
            const int intact = stone.known[(size_t)y * (size_t)out.width + (size_t)x] &&
                               !txs_near_crack(&stone, rank, floor(share * (double)n + 0.5), x, y);
            txm_image_set(&out, x, y, 0, intact ? 1.0f : 0.0f);
        }
    }
    txm_arena_free(&work);
    return status;
}

#endif /* TEXSYN_ERODE_H */
