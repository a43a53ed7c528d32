#ifndef TEXSYN_RELIGHT_H
#define TEXSYN_RELIGHT_H

#include "light.h"

/* ---- materials --------------------------------------------------------------------------

   Two pictures may show the same materials in unequal shares; matching their distributions would
   then turn one material into another. So clusters of colours are matched too, pixels are weighed
   until matched clusters have equal shares, and the light is fitted again. Clusters are matched
   after a first guess of the light, once that of the whole distributions and once no change. Of
   all these lights the one is kept under which most colours have a counterpart in the other
   picture, whatever their number. */

enum {
    TXS_MATERIALS = 3,      /* clusters a picture                                              */
    TXS_MEANS_ROUNDS = 10,  /* of k-means                                                      */
    TXS_MATCH_ROUNDS = 3,   /* matching, weighing, fitting                                     */
    TXS_COMPARED = 512      /* colours that are compared one by one                            */
};
#define TXS_CHROMA_WEIGHT 1.5 /* of s against V in distances of colours                        */
#define TXS_FEW 0.01          /* share of a cluster that is left out                           */
#define TXS_TOO_FAR 0.2       /* colours farther apart than this have no counterpart           */
#define TXS_WHOLE_BONUS 0.85  /* the light of the whole distributions is kept unless another is
                                 better by more than this factor                               */

typedef struct txs_point {
    double at[3];
} txs_point;

typedef struct txs_cloud { /* the colours of one picture, under some light */
    int count;
    txs_point *points;
    uint8_t *cluster;
    txs_point centre[TXS_MATERIALS];
    double share[TXS_MATERIALS];
} txs_cloud;

static double txs_apart(const txs_point *a, const txs_point *b) {
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += (a->at[k] - b->at[k]) * (a->at[k] - b->at[k]);
    return sum;
}

static void txs_place_points(txs_cloud *cloud, const txs_swatches *s, const texsyn_light *light) {
    cloud->count = s->count;
    for (int i = 0; i < s->count; i++) {
        double rgb[3] = {s->rgb[i][0], s->rgb[i][1], s->rgb[i][2]}, v;
        if (light) txs_light_at(light, s->rgb[i], rgb);
        const txs_chroma c = txs_chroma_of(rgb, &v);
        cloud->points[i].at[0] = v;
        cloud->points[i].at[1] = TXS_CHROMA_WEIGHT * c.x;
        cloud->points[i].at[2] = TXS_CHROMA_WEIGHT * c.y;
    }
}

static void txs_assign_points(txs_cloud *c) {
    for (int i = 0; i < c->count; i++) {
        int best = 0;
        for (int k = 1; k < TXS_MATERIALS; k++)
            if (txs_apart(&c->points[i], &c->centre[k]) < txs_apart(&c->points[i], &c->centre[best]))
                best = k;
        c->cluster[i] = (uint8_t)best;
    }
}

/* k-means, from centres that are evenly spaced in the order of brightness. */
static void txs_find_clusters(txs_cloud *c, txm_pair *order) {
    for (int i = 0; i < c->count; i++) {
        order[i].key = txm_sort_key(txm_float(c->points[i].at[0]));
        order[i].value = (uint32_t)i;
    }
    txm_sort_pairs(order, order + c->count, (size_t)c->count);
    for (int k = 0; k < TXS_MATERIALS; k++)
        c->centre[k] = c->points[order[(2 * k + 1) * c->count / (2 * TXS_MATERIALS)].value];
    for (int round = 0; round < TXS_MEANS_ROUNDS; round++) {
        txs_point sum[TXS_MATERIALS];
        memset(sum, 0, sizeof sum);
        memset(c->share, 0, sizeof c->share);
        txs_assign_points(c);
        for (int i = 0; i < c->count; i++) {
            for (int k = 0; k < 3; k++) sum[c->cluster[i]].at[k] += c->points[i].at[k];
            c->share[c->cluster[i]]++;
        }
        for (int k = 0; k < TXS_MATERIALS; k++) {
            for (int d = 0; d < 3 && c->share[k] > 0; d++)
                c->centre[k].at[d] = sum[k].at[d] / c->share[k];
            c->share[k] /= c->count;
        }
    }
}

/* Go through all ways to match the clusters from `from` on; the best is kept. */
static void txs_match_from(const txs_cloud *a, const txs_cloud *b, int from, double sum,
                           int match[TXS_MATERIALS], double *least, int best[TXS_MATERIALS]) {
    if (sum >= *least) return;
    if (from == TXS_MATERIALS) {
        *least = sum;
        for (int k = 0; k < TXS_MATERIALS; k++) best[k] = match[k];
        return;
    }
    for (int k = from; k < TXS_MATERIALS; k++) {
        const int other = match[k];
        match[k] = match[from];
        match[from] = other;
        txs_match_from(a, b, from + 1, sum + txs_apart(&a->centre[from], &b->centre[other]), match,
                       least, best);
        match[from] = match[k];
        match[k] = other;
    }
}

/* Weigh the samples of both pictures so that matched clusters have equal shares. 0: nothing is left. */
static int txs_weigh_materials(const txs_cloud *a, const txs_cloud *b, txs_swatches *of_a,
                               txs_swatches *of_b) {
    int match[TXS_MATERIALS], best[TXS_MATERIALS];
    double least = 1e300, total = 0, to_a[TXS_MATERIALS], to_b[TXS_MATERIALS];
    for (int k = 0; k < TXS_MATERIALS; k++) match[k] = best[k] = k;
    txs_match_from(a, b, 0, 0, match, &least, best);
    for (int k = 0; k < TXS_MATERIALS; k++) {
        const double p = a->share[k], q = b->share[best[k]];
        const double share = p < TXS_FEW || q < TXS_FEW ? 0 : sqrt(p * q);
        to_a[k] = share > 0 ? share / p : 0;
        to_b[best[k]] = share > 0 ? share / q : 0;
        total += share;
    }
    for (int i = 0; i < of_a->count; i++) of_a->weight[i] = to_a[a->cluster[i]];
    for (int i = 0; i < of_b->count; i++) of_b->weight[i] = to_b[b->cluster[i]];
    return total > 0;
}

/* Mean distance from colours of a to the nearest of b. */
static double txs_one_way(const txs_cloud *a, const txs_cloud *b) {
    const int n = a->count < TXS_COMPARED ? a->count : TXS_COMPARED;
    const int m = b->count < TXS_COMPARED ? b->count : TXS_COMPARED;
    double sum = 0;
    for (int i = 0; i < n; i++) {
        const txs_point *p = &a->points[(int)((int64_t)i * a->count / n)];
        double least = TXS_TOO_FAR * TXS_TOO_FAR;
        for (int k = 0; k < m; k++) {
            const double d = txs_apart(p, &b->points[(int)((int64_t)k * b->count / m)]);
            if (d < least) least = d;
        }
        sum += sqrt(least);
    }
    return sum / n;
}

/* ---- learning a light ------------------------------------------------------------------- */

typedef struct txs_lighting {
    txs_swatches a, b;
    txs_cloud of_a, of_b;
} txs_lighting;

static double txs_light_cost(txs_lighting *w, const texsyn_light *light) {
    txs_place_points(&w->of_a, &w->a, light);
    return txs_one_way(&w->of_a, &w->of_b) + txs_one_way(&w->of_b, &w->of_a);
}

/* The light of matched materials, from a first guess. */
static texsyn_light txs_match_materials(txs_lighting *w, texsyn_light light, int raised) {
    for (int round = 0; round < TXS_MATCH_ROUNDS; round++) {
        txs_place_points(&w->of_a, &w->a, &light);
        txs_find_clusters(&w->of_a, w->a.order);
        if (!txs_weigh_materials(&w->of_a, &w->of_b, &w->a, &w->b)) break;
        light = txs_fit_light(&w->a, &w->b, raised);
    }
    return light;
}

static txm_status txs_choose_light(txs_lighting *w, txm_env *env, texsyn_light *out) {
    for (int i = 0; i < w->a.count; i++) w->a.weight[i] = 1;
    for (int i = 0; i < w->b.count; i++) w->b.weight[i] = 1;
    const texsyn_light whole[2] = {txs_fit_light(&w->a, &w->b, 0), txs_fit_light(&w->a, &w->b, 1)};
    txs_place_points(&w->of_b, &w->b, NULL);
    txs_find_clusters(&w->of_b, w->b.order);
    texsyn_light best = whole[0];
    double least = TXS_WHOLE_BONUS * txs_light_cost(w, &whole[0]);
    for (int k = 1; k < 6; k++) { /* even: black stays; then whole, matched, matched from no change */
        const int raised = k % 2;
        if (txm_progress(env, 0.15f * (float)k, "materials"))
            return txm_fail(env, TXM_CANCELLED, "cancelled");
        const texsyn_light light =
            k < 2 ? whole[1] : txs_match_materials(w, k < 4 ? whole[raised] : txs_no_light(), raised);
        const double cost = txs_light_cost(w, &light) * (k < 2 ? TXS_WHOLE_BONUS : 1);
        if (cost < least) {
            least = cost;
            best = light;
        }
    }
    *out = best;
    return TXM_OK;
}

static int txs_counts(const txm_image *im, const uint8_t *mask, int x, int y) {
    if (mask && !mask[(size_t)y * (size_t)im->width + (size_t)x]) return 0;
    return im->channels % 2 == 1 || txm_image_get(im, x, y, im->channels - 1) >= 0.5f;
}

/* Samples of the pixels that count, evenly spread over them but at random within each stretch. */
static txm_status txs_take_swatches(const txm_image *image, const txm_image *where, const char *name,
                                    txm_arena *arena, txs_swatches *s, txs_cloud *cloud,
                                    txm_env *env) {
    const txm_image im = txm_image_resolve(*image);
    int64_t total = 0, seen = 0;
    uint8_t *mask;
    const txm_status status = txs_read_mask(where, arena, &mask, env);
    if (status != TXM_OK) return status;
    for (int y = 0; y < im.height; y++)
        for (int x = 0; x < im.width; x++) total += txs_counts(&im, mask, x, y);
    if (total < TXS_LEAST_SWATCHES)
        return txm_fail_numbers_at(env, TXM_TOO_SMALL, name,
                                   "fewer than # opaque pixels in the mask", TXS_LEAST_SWATCHES, 0);
    s->count = 0;
    const int most = total < TXS_SWATCHES ? (int)total : TXS_SWATCHES;
    s->rgb = (double(*)[3])txm_arena_alloc(arena, (size_t)most, sizeof *s->rgb);
    s->weight = (double *)txm_arena_alloc(arena, (size_t)most, sizeof(double));
    s->value = (double *)txm_arena_alloc(arena, (size_t)most, sizeof(double));
    s->order = (txm_pair *)txm_arena_alloc(arena, (size_t)most, 2 * sizeof(txm_pair));
    cloud->points = (txs_point *)txm_arena_alloc(arena, (size_t)most, sizeof(txs_point));
    cloud->cluster = (uint8_t *)txm_arena_alloc(arena, (size_t)most, 1);
    if (arena->failed) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for samples");
    txm_rng rng = txm_rng_make(0, 5);
    int64_t next = -1;
    for (int y = 0; y < im.height && s->count < most; y++) {
        for (int x = 0; x < im.width && s->count < most; x++) {
            if (!txs_counts(&im, mask, x, y)) continue;
            if (next < 0) {
                const int64_t from = s->count * total / most, to = (s->count + 1) * total / most;
                next = from + txm_rng_range(&rng, 0, (int)(to - from) - 1);
            }
            if (seen++ != next) continue;
            for (int c = 0; c < 3; c++)
                s->rgb[s->count][c] = (double)txm_image_get(&im, x, y, im.channels < 3 ? 0 : c);
            s->count++;
            next = -1;
        }
    }
    return TXM_OK;
}

static txm_status txs_check_relight(const texsyn_relight_desc *d, txm_env *env) {
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    const txm_image *images[2] = {&d->image, &d->like}, *masks[2] = {&d->mask, &d->like_mask};
    static const char *const names[2] = {"image", "like"};
    static const char *const mask_names[2] = {"mask", "like_mask"};
    for (int k = 0; k < 2; k++) {
        txm_status status = txm_image_check(images[k], names[k], TEXSYN_MAX_PIXELS, env);
        if (status == TXM_OK) status = txs_check_mask(masks[k], images[k], mask_names[k], env);
        if (status != TXM_OK) return status;
        if (!txs_image_is_moderate(images[k]))
            return txm_fail_at(env, TXM_BAD_ARGUMENT, names[k],
                               "has samples that are not finite or beyond a million");
    }
    if (!(d->strength >= 0 && d->strength <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "strength must be 0 (default) to 1");
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_light_learn(const texsyn_relight_desc *desc, txm_env *env,
                                         texsyn_light *out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    txm_status status = txs_check_relight(desc, env);
    if (status != TXM_OK) return status;
    txs_lighting w;
    txm_arena arena;
    texsyn_light light = txs_no_light();
    txm_arena_init(&arena, env);
    if (txm_progress(env, 0, "colours")) status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status == TXM_OK)
        status = txs_take_swatches(&desc->image, &desc->mask, "image", &arena, &w.a, &w.of_a, env);
    if (status == TXM_OK)
        status = txs_take_swatches(&desc->like, &desc->like_mask, "like", &arena, &w.b, &w.of_b, env);
    if (status == TXM_OK) status = txs_choose_light(&w, env, &light);
    txm_arena_free(&arena);
    if (status == TXM_OK) *out = light;
    return status;
}

/* ---- applying a light ------------------------------------------------------------------- */

enum { TXS_LIT_SHARES = 64 }; /* into which a picture is divided for threads */

typedef struct txs_lit {
    const texsyn_light *light;
    txm_image from, to;
    double strength;
} txs_lit;

/* Between -1/2 and 1/2, evenly distributed: noise of one step of 8 bits, so that no bands appear
   where a step becomes several, or several values one. */
static double txs_dither(int x, int y) {
    const uint64_t place = (uint64_t)(uint32_t)y << 32 | (uint32_t)x;
    return ((double)(txm_hash(place + 0x9e3779b97f4a7c15u) >> 40) + 0.5) / 16777216.0 - 0.5;
}

static void txs_light_pixel(const txs_lit *w, int x, int y) {
    const int channels = w->from.channels, colours = channels < 3 ? 1 : 3;
    const double noise = txs_dither(x, y) / 255;
    double from[3], to[3];
    for (int c = 0; c < 3; c++) {
        from[c] = (double)txm_image_get(&w->from, x, y, colours == 1 ? 0 : c);
        if (w->from.sample == TXM_U8) from[c] += noise;
    }
    txs_light_at(w->light, from, to);
    for (int c = 0; c < channels; c++) {
        if (c >= colours) { /* alpha */
            txm_image_set(&w->to, x, y, c, txm_image_get(&w->from, x, y, c));
            continue;
        }
        double v = from[c] + w->strength * (to[c] - from[c]);
        if (w->from.sample != TXM_U8 && w->to.sample == TXM_U8) v += noise;
        txm_image_set(&w->to, x, y, c, txm_float(v));
    }
}

static void txs_light_share(void *context, int share) {
    const txs_lit *w = (const txs_lit *)context;
    const int rows = (w->from.height - 1) / TXS_LIT_SHARES + 1;
    for (int y = share * rows; y < (share + 1) * rows && y < w->from.height; y++) {
        for (int x = 0; x < w->from.width; x++) txs_light_pixel(w, x, y);
    }
}

/* Is this a light that texsyn_light_learn can have made? */
static int txs_is_light(const texsyn_light *l) {
    if (l->knots < 2 || l->knots > TEXSYN_LIGHT_KNOTS || !(l->fade > 0 && l->fade <= 1e6f)) return 0;
    for (int k = 0; k < l->knots; k++) {
        if (!(fabsf(l->from[k]) <= 1e8f && fabsf(l->to[k]) <= 1e8f)) return 0;
        if (!(l->slope[k] >= 0 && l->slope[k] <= 1e6f)) return 0;
        if (k && !(l->from[k] > l->from[k - 1] && l->to[k] >= l->to[k - 1])) return 0;
    }
    for (int k = 0; k < 2; k++) {
        if (!(fabsf(l->gain[k]) <= 1e6f && fabsf(l->cast[k]) <= 1e6f)) return 0;
    }
    return 1;
}

static txm_status txs_check_lit(const txm_image *image, const txm_image *out, txm_env *env) {
    txm_status status = txm_image_check(image, "image", TEXSYN_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(out, "out", TEXSYN_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    const txm_image from = txm_image_resolve(*image), to = txm_image_resolve(*out);
    if (to.width != from.width || to.height != from.height || to.channels != from.channels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "out",
                           "must have the size and the channels of the image");
    if (!txs_image_is_moderate(&from))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image",
                           "has samples that are not finite or beyond a million");
    return TXM_OK;
}

TEXSYN_API txm_status texsyn_light_apply(const texsyn_light *light, float strength,
                                         const txm_image *image, txm_env *env, txm_image out) {
    if (!light) return txm_fail(env, TXM_BAD_ARGUMENT, "light is NULL");
    if (!txs_is_light(light))
        return txm_fail(env, TXM_BAD_ARGUMENT, "light was not made by texsyn_light_learn");
    if (!(strength >= 0 && strength <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "strength must be 0 to 1");
    txm_status status = txs_check_lit(image, &out, env);
    if (status != TXM_OK) return status;
    txs_lit w;
    txm_arena arena;
    txm_arena_init(&arena, env);
    status = txm_image_bled(image, 0, &arena, env, &w.from);
    w.light = light;
    w.to = txm_image_resolve(out);
    w.strength = (double)strength;
    if (status == TXM_OK) txm_parallel_for(env, TXS_LIT_SHARES, txs_light_share, &w);
    txm_arena_free(&arena);
    return status;
}

TEXSYN_API txm_status texsyn_relight(const texsyn_relight_desc *desc, txm_env *env, txm_image out) {
    texsyn_light light;
    txm_status status = txs_check_relight(desc, env);
    if (status == TXM_OK) status = txs_check_lit(&desc->image, &out, env); /* before the work */
    if (status == TXM_OK) status = texsyn_light_learn(desc, env, &light);
    if (status == TXM_OK && txm_progress(env, 0.9f, "apply"))
        status = txm_fail(env, TXM_CANCELLED, "cancelled");
    if (status != TXM_OK) return status;
    return texsyn_light_apply(&light, desc->strength > 0 ? desc->strength : 1.0f, &desc->image, env,
                              out);
}

#endif /* TEXSYN_RELIGHT_H */
