#ifndef TREEPIECES_BARK_H
#define TREEPIECES_BARK_H

#include "picture.h"

/* ---- bark: sheets of framed tiles --------------------------------------------------------- */

TREEPIECES_API int treepieces_bark_layers(const treepieces_bark_desc *desc) {
    int layers = TREEPIECES_OWN;
    for (int i = 0; desc && desc->classes && i < desc->tile_count; i++)
        if (desc->classes[i] >= layers) layers = desc->classes[i] + 1;
    return layers;
}

static txm_status tpc_check_bark(const treepieces_bark_desc *d, const txm_image *out,
                                 txm_env *env) {
    if (!d || !d->tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "desc or tiles is NULL");
    if (d->tile_count < 1 || d->tile_count > 4096)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tile_count must be 1 to 4096");
    int plain = 0;
    for (int i = 0; i < d->tile_count; i++) {
        const txm_status status = txm_image_check(&d->tiles[i], "a tile", 0, env);
        const int c = d->classes ? d->classes[i] : TREEPIECES_BARK;
        if (status != TXM_OK) return status;
        const txm_image t = txm_image_resolve(d->tiles[i]), first = txm_image_resolve(d->tiles[0]);
        if (t.width != t.height || t.width != first.width || t.channels != first.channels ||
            t.sample != first.sample)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "tiles must be square, of one size, sample type and channel count");
        if (t.width < 4 || t.width > 4096 || t.width % 2)
            return txm_fail(env, TXM_BAD_ARGUMENT,
                            "tiles must be 4 to 4096 pixels wide, an even number");
        if (c != TREEPIECES_BARK && (c < TREEPIECES_OWN || c > 63))
            return txm_fail(env, TXM_BAD_ARGUMENT, "classes must be 0 or 5 to 63");
        plain += c == TREEPIECES_BARK;
    }
    if (!plain) return txm_fail(env, TXM_BAD_ARGUMENT, "no tile is of class 0");
    const txm_status status = txm_image_check(out, "out", 0, env);
    if (status != TXM_OK) return status;
    const txm_image o = txm_image_resolve(*out), t = txm_image_resolve(d->tiles[0]);
    if (o.width != TREEPIECES_SHEET * t.width || o.channels != t.channels || o.sample != t.sample ||
        o.height != TREEPIECES_SHEET * t.width * treepieces_bark_layers(d))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "out must be 8 tiles wide, 8 a layer high, of the tiles' channels and "
                        "samples");
    return TXM_OK;
}

/* A random tile of a class, if possible not one of the two given; -1: there is none. */
static int tpc_pick_tile(const treepieces_bark_desc *d, int tile_class, txm_rng *rng, int unlike,
                         int unlike_too) {
    int best = -1;
    uint32_t most = 0;
    for (int i = 0; i < d->tile_count; i++) {
        if ((d->classes ? d->classes[i] : TREEPIECES_BARK) != tile_class) continue;
        /* others come before those two */
        const uint32_t preferred = i != unlike && i != unlike_too ? 1u << 31 : 1;
        const uint32_t ticket = (txm_rng_next(rng) >> 1) | preferred;
        if (ticket > most) {
            most = ticket;
            best = i;
        }
    }
    return best;
}

/* 1 at x = 0 falling smoothly to 0 at x = 1 and beyond */
static float tpc_fade(float x) {
    const float t = txm_clampf(1 - x, 0, 1);
    return t * t * (3 - 2 * t);
}

/* What is blended into a texel: one of the tile itself, or four of a tile that is shown at half
   size. */
typedef struct tpc_blend {
    const txm_image *from;
    int x, y, side; /* the first of side x side texels */
    float weight;   /* of it; the rest is the texel's own */
} tpc_blend;

/* The blend of texel (x, y) of a cell of the lowest row: towards the south side what the layer
   requires there. lower: four tiles, shown at half size, for HALVING. */
static tpc_blend tpc_blend_at(const txm_image *tile, const txm_image *const lower[4], int layer,
                              int x, int y) {
    const int last = tile->width - 1, size = tile->width;
    const float rise = (float)(last - y) / (float)size; /* from the south side, in tiles */
    tpc_blend b = {tile, x, y, 1, 0};
    if (layer == TREEPIECES_FOLD) { /* half of its mirror image: then it is symmetric */
        b.weight = 0.5f * tpc_fade(4 * rise);
        b.x = last - x;
    } else if (layer == TREEPIECES_TURN_LEFT) { /* its west side, turned to the south */
        b.weight = tpc_fade(2 * rise);
        b.x = last - y;
        b.y = x;
    } else if (layer == TREEPIECES_TURN_RIGHT) { /* its east side */
        b.weight = tpc_fade(2 * rise);
        b.x = y;
        b.y = last - x;
    } else if (layer == TREEPIECES_HALVING) {
        b.weight = tpc_fade(rise);
        b.from = lower[(2 * x >= size) + 2 * (2 * y >= size)];
        b.x = 2 * x % size;
        b.y = 2 * y % size;
        b.side = 2;
    }
    return b;
}

/* One channel of it, where all texels are opaque. */
static float tpc_blend_channel(const txm_image *tile, const tpc_blend *b, int x, int y, int c) {
    float other = txm_image_get(b->from, b->x, b->y, c);
    if (b->side == 2)
        other = 0.25f * ((other + txm_image_get(b->from, b->x + 1, b->y, c)) +
                         (txm_image_get(b->from, b->x, b->y + 1, c) +
                          txm_image_get(b->from, b->x + 1, b->y + 1, c)));
    return txm_lerpf(txm_image_get(tile, x, y, c), other, b->weight);
}

/* All channels: colours count as much as they show. */
static void tpc_blend_texel(const txm_image *tile, const tpc_blend *b, int x, int y, float *texel) {
    const int count = b->side * b->side, channels = tile->channels;
    txm_mean mean = txm_mean_of(channels);
    float other[4][4];
    txm_image_pixel(tile, x, y, texel);
    int is_opaque = !txm_image_has_alpha(tile) || texel[channels - 1] >= 1;
    for (int k = 0; k < count; k++) {
        txm_image_pixel(b->from, b->x + k % 2, b->y + k / 2, other[k]);
        is_opaque &= !txm_image_has_alpha(tile) || other[k][channels - 1] >= 1;
    }
    for (int c = 0; c < channels && is_opaque; c++)
        texel[c] = tpc_blend_channel(tile, b, x, y, c);
    if (is_opaque) return;
    txm_mean_add(&mean, texel, 1 - (double)b->weight);
    for (int k = 0; k < count; k++) txm_mean_add(&mean, other[k], (double)b->weight / count);
    txm_mean_get(&mean, texel);
}

static void tpc_draw_cell(const txm_image *out, int column, int top, const txm_image *tile,
                          const txm_image *const lower[4], int layer, int is_lowest) {
    const size_t texel = (size_t)tile->channels * txm_sample_bytes(tile->sample);
    for (int y = 0; y < tile->width; y++) {
        char *row = (char *)txm_image_row(out, top + y) + (size_t)(column * tile->width) * texel;
        if (!is_lowest || layer == TREEPIECES_BARK) {
            memcpy(row, txm_image_row_const(tile, y), (size_t)tile->width * texel);
            continue;
        }
        for (int x = 0; x < tile->width; x++) {
            const tpc_blend blend = tpc_blend_at(tile, lower, layer, x, y);
            float color[4];
            tpc_blend_texel(tile, &blend, x, y, color);
            for (int c = 0; c < tile->channels; c++)
                txm_image_set(out, column * tile->width + x, top + y, c, color[c]);
        }
    }
}

/* A layer of one of the caller's classes: each tile on 2 x 2 cells, extended by its border. */
static void tpc_draw_own(const treepieces_bark_desc *d, const txm_image *out, int layer,
                         txm_rng *rng) {
    const int size = txm_image_resolve(d->tiles[0]).width, first = layer * TREEPIECES_SHEET * size;
    for (int b = 0; b < 16; b++) {
        const int number = tpc_pick_tile(d, layer, rng, -1, -1);
        const txm_image tile = txm_image_resolve(d->tiles[number < 0 ? 0 : number]);
        for (int y = 0; y < 2 * size; y++)
            for (int x = 0; x < 2 * size; x++)
                for (int c = 0; c < tile.channels; c++) {
                    const int from_x = txm_clampi(x - size / 2, 0, size - 1);
                    const int from_y = txm_clampi(y - size / 2, 0, size - 1);
                    txm_image_set(out, b % 4 * 2 * size + x, first + b / 4 * 2 * size + y, c,
                                  txm_image_get(&tile, from_x, from_y, c));
                }
    }
}

static void tpc_draw_layer(const treepieces_bark_desc *d, const txm_image *out, int layer) {
    enum { SIDE = TREEPIECES_SHEET };
    int chosen[SIDE][SIDE];
    txm_rng rng = txm_rng_make(d->seed, (uint64_t)layer);
    if (layer >= TREEPIECES_OWN) {
        tpc_draw_own(d, out, layer, &rng);
        return;
    }
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const int left = x ? chosen[y][x - 1] : -1, above = y ? chosen[y - 1][x] : -1;
            const txm_image *lower[4];
            txm_image halves[4];
            chosen[y][x] = tpc_pick_tile(d, TREEPIECES_BARK, &rng, left, above);
            for (int k = 0; k < 4; k++) {
                const int number = tpc_pick_tile(d, TREEPIECES_BARK, &rng, chosen[y][x], -1);
                halves[k] = txm_image_resolve(d->tiles[number]);
                lower[k] = &halves[k];
            }
            const txm_image tile = txm_image_resolve(d->tiles[chosen[y][x]]);
            tpc_draw_cell(out, x, (layer * SIDE + y) * tile.width, &tile, lower, layer,
                          y == SIDE - 1);
        }
    }
}

TREEPIECES_API txm_status treepieces_bark(const treepieces_bark_desc *desc, txm_env *env,
                                          txm_image out) {
    txm_status status = tpc_check_bark(desc, &out, env);
    if (status != TXM_OK) return status;
    const txm_image o = txm_image_resolve(out);
    txm_image picture = o;
    const int layers = treepieces_bark_layers(desc), has_alpha = txm_image_has_alpha(&o);
    txm_arena arena;
    txm_arena_init(&arena, env);
    if (has_alpha) status = tpc_new_picture(&o, &arena, env, &picture);
    for (int layer = 0; layer < layers && status == TXM_OK; layer++)
        tpc_draw_layer(desc, &picture, layer);
    if (has_alpha && status == TXM_OK) status = tpc_deliver(&picture, &o, env);
    txm_arena_free(&arena);
    return status;
}

TREEPIECES_API int treepieces_quad_uv(const treepieces_quad *quad, uint32_t bands, int cell,
                                      int pixels, int corner, float uv[2]) {
    const uint32_t band = bands >> (8 * quad->band) & 255u;
    const int is_own = quad->tile_class >= TREEPIECES_OWN;
    const int across = is_own ? 1 : 1 << (band & 7), along = is_own ? 1 : 1 << (band >> 3 & 3);
    const int east = corner >= 2, south = corner == 1 || corner == 2;
    const float shift = is_own ? 0.5f : 0, half = 0.5f / (float)pixels;
    uv[0] = ((float)((cell & 7) + (east ? across : 0)) + shift) / (float)TREEPIECES_SHEET;
    uv[1] = ((float)((cell >> 3) + (south ? along : 0)) + shift) / (float)TREEPIECES_SHEET;
    uv[1] += south ? -half : half; /* layers lie one under the other */
    if (quad->tile_class == TREEPIECES_BARK && (band & 32)) return TREEPIECES_HALVING;
    return quad->tile_class;
}

/* ---- bark: drawn ---------------------------------------------------------------------------- */

/* Smooth value noise, 0..1, on the unit torus with columns x rows cells. */
static float tpc_noise(float x, float y, int columns, int rows, uint64_t seed) {
    const float u = x * (float)columns, v = y * (float)rows;
    const int i = (int)u, j = (int)v;
    const float s = tpc_fade(1 - (u - (float)i)), t = tpc_fade(1 - (v - (float)j));
    float corner[4];
    for (int k = 0; k < 4; k++) {
        const uint64_t a = (uint64_t)((i + (k & 1)) % columns);
        const uint64_t b = (uint64_t)((j + (k >> 1)) % rows);
        corner[k] = (float)(txm_hash(seed ^ (a << 40) ^ (b << 20)) >> 40) / 16777216.0f;
    }
    return txm_lerpf(txm_lerpf(corner[0], corner[1], s), txm_lerpf(corner[2], corner[3], s), t);
}

/* Noise for tile `number`: its own inside, one that all tiles share at the border. The blend is
   scaled so that its contrast is that of either. */
static float tpc_framed_noise(float x, float y, int columns, int rows, uint64_t seed, int number) {
    const float border = txm_minf(txm_minf(x, 1 - x), txm_minf(y, 1 - y));
    const float inside = 1 - tpc_fade((border - 0.03f) * 5), outside = 1 - inside;
    if (!(inside > 0)) return tpc_noise(x, y, columns, rows, seed);
    const float frame = outside > 0 ? tpc_noise(x, y, columns, rows, seed) - 0.5f : 0;
    const float own = tpc_noise(x, y, columns, rows, seed + 1 + (uint64_t)number) - 0.5f;
    return 0.5f + (outside * frame + inside * own) / sqrtf(inside * inside + outside * outside);
}

/* A place of a tile of bark that is being drawn. */
typedef struct tpc_bark_place {
    float x, y; /* in the tile, 0..1 */
    uint64_t seed;
    int number; /* of the tile */
} tpc_bark_place;

/* -1/2..1/2; salt: which of the noises of a bark */
static float tpc_bark_noise(const tpc_bark_place *p, int columns, int rows, uint64_t salt) {
    return tpc_framed_noise(p->x, p->y, columns, rows, p->seed + salt, p->number) - 0.5f;
}

/* Brightness of bark, about 1: ridges between fissures along the stem, grain on them. A fissure crosses
   the frame in the middle of a tile, at the same place in all, and wanders and ends in between, so that
   the frame is not visible. Plates: wider ones, with cracks all round, of different height. */
static float tpc_furrowed_bark(const tpc_bark_place *p, int is_plates) {
    const float slow = tpc_bark_noise(p, 3, 2, 1000), quick = tpc_bark_noise(p, 9, 6, 2000);
    const float grain = tpc_bark_noise(p, 26, 8, 3000), fine = tpc_bark_noise(p, 40, 24, 3500);
    const float across = 1.5f + p->x + 0.75f * slow + 0.16f * quick + 0.07f * grain;
    const int ridge = (int)across;
    const float f = across - (float)ridge, edge = txm_minf(f, 1 - f);
    const float border = txm_minf(txm_minf(p->x, 1 - p->x), txm_minf(p->y, 1 - p->y));
    const float inside = 1 - tpc_fade((border - 0.03f) * 4);
    const float gap = (is_plates ? 0.09f : 0.13f) + 0.42f * inside * tpc_bark_noise(p, 4, 3, 4000);
    /* cracks across a ridge, half a tile higher on every second one */
    const float bend = tpc_bark_noise(p, 3, 3, 5000);
    const float along = 1 + p->y + 0.5f * (float)(ridge & 1) + 0.7f * bend + 0.1f * quick;
    const float g = along - (float)(int)along;
    const float open = is_plates ? 1 : 2.4f * (tpc_bark_noise(p, 3, 3, 6000) + 0.02f);
    const float crack = inside * tpc_fade(txm_minf(g, 1 - g) / 0.07f) * txm_clampf(open, 0, 1);
    const float fissure = gap > 0.02f ? tpc_fade(edge / gap) : 0;
    const float depth = txm_maxf(fissure, (is_plates ? 0.9f : 0.6f) * crack);
    /* a ridge is lit from one side; layers that flake off have edges */
    const float flake = is_plates ? 0.22f * tpc_fade(fabsf(slow + 0.4f * quick) * 12) : 0;
    const float top = 0.60f + 0.22f * (0.5f - f) + 0.22f * slow + 0.2f * quick - flake;
    return 0.45f + top * (1 - 0.85f * depth) + (0.34f - 0.2f * depth) * grain + 0.16f * fine;
}

/* Smooth bark: spots, and fine wrinkles across the stem. */
static float tpc_smooth_bark(const tpc_bark_place *p) {
    const float spots = tpc_bark_noise(p, 3, 4, 6000), wrinkle = tpc_bark_noise(p, 4, 22, 6500);
    const float fine = tpc_bark_noise(p, 24, 40, 7000);
    return 0.95f + 0.2f * spots + 0.2f * wrinkle + 0.1f * fine;
}

/* Smooth bark with lenticels across it: dark ones on pale bark, as of birches, else paler ones. None
   lie on the frame, where their repetition would be visible. */
static float tpc_lenticel_bark(const tpc_bark_place *p, int is_pale) {
    const float border = txm_minf(txm_minf(p->x, 1 - p->x), txm_minf(p->y, 1 - p->y));
    const float inside = 1 - tpc_fade((border - 0.03f) * 5);
    const uint64_t own = p->seed + 5000 + (uint64_t)p->number;
    const float mark = tpc_noise(p->x, p->y, 2, 13, own);
    const float wide = tpc_noise(p->x, p->y, 1, 6, own + 1000);
    const float shade = tpc_bark_noise(p, 3, 5, 6000), grain = tpc_bark_noise(p, 20, 40, 7000);
    const float marks = inside * (0.55f * tpc_fade((0.88f - mark) * 8) + 0.5f * tpc_fade((0.93f - wide) * 8));
    return (is_pale ? 0.98f - marks : 0.92f + 0.6f * marks) + 0.1f * grain + 0.12f * shade;
}

static float tpc_bark_relief(const treepieces_species *species, const tpc_bark_place *p) {
    const float *color = species->bark_color;
    switch (species->bark_kind) {
    case TREEPIECES_BARK_SMOOTH: return tpc_smooth_bark(p);
    case TREEPIECES_BARK_LENTICELS: return tpc_lenticel_bark(p, color[0] + color[1] + color[2] > 1.5f);
    default: return tpc_furrowed_bark(p, species->bark_kind == TREEPIECES_BARK_PLATES);
    }
}

TREEPIECES_API txm_status treepieces_draw_bark(const treepieces_species *species, uint64_t seed,
                                               txm_env *env, const txm_image *tiles,
                                               int tile_count) {
    if (!species || !tiles || tile_count < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "species or tiles is NULL, or tile_count below 1");
    for (int i = 0; i < tile_count; i++) {
        const txm_status status = txm_image_check(&tiles[i], "a tile", 0, env);
        if (status != TXM_OK) return status;
        if (tiles[i].width != tiles[i].height || txm_image_resolve(tiles[i]).channels < 3)
            return txm_fail(env, TXM_BAD_ARGUMENT, "tiles must be square, of 3 or 4 channels");
    }
    const float *color = species->bark_color;
    for (int i = 0; i < tile_count; i++) {
        const txm_image t = txm_image_resolve(tiles[i]);
        for (int y = 0; y < t.height; y++) {
            for (int x = 0; x < t.width; x++) {
                const tpc_bark_place p = {((float)x + 0.5f) / (float)t.width,
                                          ((float)y + 0.5f) / (float)t.height, seed, i};
                const float relief = tpc_bark_relief(species, &p);
                const float moss = tpc_bark_noise(&p, 4, 4, 8000);
                const float tint[4] = {1 - 0.08f * moss, 1 + 0.05f * moss, 1 - 0.1f * moss, 1};
                for (int c = 0; c < t.channels; c++)
                    txm_image_set(&t, x, y, c,
                                  c == 3 ? 1 : txm_clampf(color[c] * relief * tint[c], 0, 1));
            }
        }
    }
    return TXM_OK;
}

#endif /* TREEPIECES_BARK_H */
