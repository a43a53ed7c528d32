#ifndef TEXTILES_REPAIR_H
#define TEXTILES_REPAIR_H

#include "tile.h"

/* ---- repair ------------------------------------------------------------------------------ */

#define TXT_FAINT 0.125 /* alpha up to which a repaired colour says too little, and ...            */
#define TXT_CLEAR 0.5   /* ... from which on it is taken as it is                                  */

/* Memory for txm_poisson from one block, so that threads do not call the allocator. */
typedef struct txt_pool {
    uint8_t *block;
    size_t used, size;
} txt_pool;

static void *txt_pool_take(void *user, size_t bytes) {
    txt_pool *p = (txt_pool *)user;
    bytes = (bytes + 63) / 64 * 64;
    if (bytes > p->size - p->used) return NULL;
    p->used += bytes;
    return p->block + p->used - bytes;
}

static void txt_pool_give(void *user, void *block) {
    (void)user;
    (void)block; /* the next repair frees all at once */
}

/* bytes that are enough for txm_poisson with any mask of a tile */
static size_t txt_pool_bytes(size_t texels, size_t side) {
    return texels * (6 * sizeof(double) + 4 * sizeof(int32_t) + 4 * sizeof(float)) +
           side * sizeof(int32_t) + 4096;
}

/* the value of a map at a texel of the sheets */
static float txt_sheet_value(const txt_build *b, int map, int32_t t, int channel) {
    const txt_sheet *s = &b->sheets[txt_sheet_of(b->set, t)];
    const int at = t - s->first;
    return txm_image_get(&s->maps[map], at % s->width, at / s->width, channel);
}

/* The same as it is repaired: colours as much as they show. */
static float txt_repair_value(const txt_build *b, int map, int32_t t, int channel) {
    const int last = b->set->maps[map].channels - 1;
    const float value = txt_sheet_value(b, map, t, channel);
    if (!b->set->maps[map].has_alpha || channel == last) return value;
    const float alpha = txm_clampf(txt_sheet_value(b, map, t, last), 0, 1);
    return txm_float((double)value * (double)alpha);
}

/* The straight colour and the alpha of a repaired texel. Opaque texels stay opaque and transparent
   ones transparent; the less shows, the more the colour is that of the exemplar. */
static void txt_repair_shown(const txt_build *b, int map, int32_t t, float *pixel) {
    const int last = b->set->maps[map].channels - 1;
    const double alpha = (double)txm_clampf(txt_sheet_value(b, map, t, last), 0, 1);
    const double shown = (double)pixel[last], least = shown < alpha ? shown : alpha;
    const double trust = (least - TXT_FAINT) / (TXT_CLEAR - TXT_FAINT);
    for (int c = 0; c < last; c++) {
        const float own = txt_sheet_value(b, map, t, c);
        const float repaired = trust > 0 ? txm_float((double)pixel[c] / shown) : own;
        pixel[c] = trust >= 1 ? repaired : txm_lerpf(own, repaired, txm_float(trust > 0 ? trust : 0));
    }
    pixel[last] = txm_float(alpha + (shown - alpha) * 4 * alpha * (1 - alpha));
}

typedef struct txt_repair {
    float *image, *target; /* side * side * 4 */
    uint8_t *mask;
    txt_pool pool;
} txt_repair;

/* Spread the steps at the cuts of a tile over the texels near them [9]: differences are those of
   the exemplar, across a cut the mean of those that its two layers have there. */
static void txt_repair_tile(const txt_canvas *c, txt_repair *r) {
    const txt_build *b = c->b;
    textiles_set *set = b->set;
    const int side = c->side, reach = 5;
    const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    int any = 0;
    memset(r->mask, 0, (size_t)side * (size_t)side);
    for (int y = 0; y + 1 < side; y++) {
        for (int x = 0; x + 1 < side; x++) {
            const int p = y * side + x;
            if (!c->inside[p]) continue;
            const int right = c->inside[p + 1] && c->label[p] != c->label[p + 1];
            const int below = c->inside[p + side] && c->label[p] != c->label[p + side];
            if (!right && !below) continue;
            for (int v = txm_clampi(y - reach, 0, side); v < txm_clampi(y + reach + 2, 0, side); v++) {
                for (int u = txm_clampi(x - reach, 0, side); u < txm_clampi(x + reach + 2, 0, side); u++) {
                    const int q = v * side + u;
                    if (c->inside[q] && !c->locked[q]) r->mask[q] = 255, any = 1;
                }
            }
        }
    }
    if (!any) return;
    for (int m = 0; m < set->map_count; m++) {
        const int n = set->maps[m].channels, has_alpha = set->maps[m].has_alpha;
        txm_poisson_desc desc;
        txm_env env;
        memset(&desc, 0, sizeof desc);
        memset(&env, 0, sizeof env);
        env.allocate = txt_pool_take;
        env.release = txt_pool_give;
        env.memory_user = &r->pool;
        r->pool.used = 0;
        for (int p = 0; p < side * side; p++) {
            for (int k = 0; k < n; k++) {
                r->image[p * n + k] = c->inside[p] ? txt_repair_value(b, m, c->shows[p], k) : 0.0f;
                r->target[p * n + k] = 0;
            }
        }
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < side; x++) {
                const int p = y * side + x;
                if (!r->mask[p]) continue;
                for (int d = 0; d < 4; d++) {
                    const int qx = x + dx[d], qy = y + dy[d], q = qy * side + qx;
                    if (qx < 0 || qy < 0 || qx >= side || qy >= side || !c->inside[q]) continue;
                    const int32_t pq = txt_shown(b, &c->layers[c->label[p]], qx, qy);
                    const int32_t qp = txt_shown(b, &c->layers[c->label[q]], x, y);
                    for (int k = 0; k < n; k++) {
                        const double here = r->image[p * n + k], there = r->image[q * n + k];
                        double sum = 0, count = 0;
                        if (pq >= 0) {
                            sum += txt_repair_value(b, m, pq, k) - here;
                            count += 1;
                        }
                        if (qp >= 0) {
                            sum += there - txt_repair_value(b, m, qp, k);
                            count += 1;
                        }
                        const double step = count > 0 ? sum / count : there - here;
                        r->target[p * n + k] = txm_float(r->target[p * n + k] + step);
                    }
                }
            }
        }
        desc.image.pixels = r->image;
        desc.image.width = desc.image.height = side;
        desc.image.channels = n;
        desc.image.sample = TXM_F32;
        desc.target = desc.image;
        desc.target.pixels = r->target;
        desc.mask = desc.image;
        desc.mask.pixels = r->mask;
        desc.mask.channels = 1;
        desc.mask.sample = TXM_U8;
        desc.tolerance = 1e-3f;
        if (txm_poisson(&desc, &env) != TXM_OK) continue; /* cannot be: the pool is enough */
        const txm_image out = {txt_texel(set, m, c->tile, 0, 0), side, side, n,
                               set->maps[m].sample, 0};
        for (int p = 0; p < side * side; p++) {
            if (r->mask[p] && has_alpha) txt_repair_shown(b, m, c->shows[p], r->image + p * n);
            for (int k = 0; k < n && r->mask[p]; k++)
                txm_image_set(&out, p % side, p / side, k, r->image[p * n + k]);
        }
    }
}

#endif /* TEXTILES_REPAIR_H */
