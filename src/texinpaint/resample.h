#ifndef TEXINPAINT_RESAMPLE_H
#define TEXINPAINT_RESAMPLE_H

#include "surface.h"

/* ---- resample: between maps and windows ------------------------------------------------------ */

enum {
    TXI_NEAR = 3, /* texels; ours: how far a pixel between charts looks for a texel of its own   */
    TXI_TAPS = 4  /* of the Catmull-Rom spline, per axis                                        */
};

/* A window of this size from the arena: everything void. */
static txm_status txi_window_alloc(txi_window *w, int width, int height, txm_arena *arena,
                                   txm_env *env) {
    const size_t count = (size_t)width * (size_t)height;
    memset(w, 0, sizeof *w);
    w->width = width;
    w->height = height;
    w->state = (uint8_t *)txm_arena_zero(arena, count, 1);
    w->color = (uint8_t *)txm_arena_zero(arena, count, 4);
    w->texel = (txm_vec2 *)txm_arena_zero(arena, count, sizeof(txm_vec2));
    w->place = (txm_vec3 *)txm_arena_zero(arena, count, sizeof(txm_vec3));
    w->normal = (txm_vec3 *)txm_arena_zero(arena, count, sizeof(txm_vec3));
    w->axis = (txm_vec2 *)txm_arena_zero(arena, count, sizeof(txm_vec2));
    w->mirrored = (uint8_t *)txm_arena_zero(arena, count, 1);
    w->face = (uint32_t *)txm_arena_alloc(arena, count, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) w->face[i] = TXI_NO_FACE;
    return TXM_OK;
}

/* The weights of the spline of Catmull and Rom at t, 0..1, for samples at -1, 0, 1, 2. */
static void txi_spline(double t, double weight[TXI_TAPS]) {
    weight[0] = t * (-0.5 + t * (1 - 0.5 * t));
    weight[1] = 1 + t * t * (-2.5 + 1.5 * t);
    weight[2] = t * (0.5 + t * (2 - 1.5 * t));
    weight[3] = t * t * (-0.5 + 0.5 * t);
}


/* May a pixel on this face take texel (x, y), not wrapped yet? Its number, or -1: there is none, or
   it belongs to another chart. */
static int64_t txi_tap(const txi_domain *d, uint32_t face, int x, int y) {
    if (!d->surface) {
        if (x < 0 || y < 0 || x >= d->width || y >= d->height) return -1;
        return (int64_t)y * d->width + x;
    }
    const int64_t i = (int64_t)txi_wrap(y, d->height) * d->width + txi_wrap(x, d->width);
    const uint32_t owner = d->surface->owner[i];
    if (owner == TXI_NO_FACE || face == TXI_NO_FACE) return -1;
    return d->surface->chart[owner] == d->surface->chart[face] ? i : -1;
}

/* The texel nearest to p that a pixel on this face may take, at most TXI_NEAR away, -1 if there is
   none. known: only texels that are not missing. */
static int64_t txi_nearest_tap(const txi_domain *d, uint32_t face, txm_vec2 p, int known) {
    const int cx = (int)floor((double)p.x + 0.5), cy = (int)floor((double)p.y + 0.5);
    int64_t best = -1;
    double least = 0;
    for (int y = cy - TXI_NEAR; y <= cy + TXI_NEAR; y++) {
        for (int x = cx - TXI_NEAR; x <= cx + TXI_NEAR; x++) {
            const int64_t i = txi_tap(d, face, x, y);
            const double dx = (double)x - p.x, dy = (double)y - p.y, apart = dx * dx + dy * dy;
            if (i < 0 || (known && d->missing[i]) || (best >= 0 && apart >= least)) continue;
            best = i;
            least = apart;
        }
    }
    return best;
}

/* The texels around a place and their weights. Where all 16 exist and are known these are those of
   the spline, else those of the known ones among the inner four, else the nearest known one.
   Returns their number. */
static int txi_taps_at(const txi_domain *d, uint32_t face, txm_vec2 p, int is_label,
                       int64_t texel[16], double weight[16]) {
    const double fx = floor(p.x), fy = floor(p.y);
    const int x = (int)fx, y = (int)fy;
    double wx[TXI_TAPS], wy[TXI_TAPS], sum = 0;
    int count = 0, whole = 1;
    if (!is_label) {
        txi_spline(p.x - fx, wx);
        txi_spline(p.y - fy, wy);
        for (int k = 0; k < 16 && whole; k++) {
            texel[k] = txi_tap(d, face, x - 1 + k % 4, y - 1 + k / 4);
            weight[k] = wx[k % 4] * wy[k / 4];
            whole = texel[k] >= 0 && !d->missing[texel[k]];
        }
        if (whole) return 16;
        for (int k = 0; k < 4; k++) {
            const int64_t i = txi_tap(d, face, x + k % 2, y + k / 2);
            const double u = k % 2 ? p.x - fx : 1 - (p.x - fx), v = k / 2 ? p.y - fy : 1 - (p.y - fy);
            if (i < 0 || d->missing[i] || !(u * v > 0)) continue;
            texel[count] = i;
            weight[count++] = u * v;
            sum += u * v;
        }
        for (int k = 0; k < count; k++) weight[k] /= sum;
        if (sum > 0.05) return count;
    }
    texel[0] = txi_nearest_tap(d, face, p, 1);
    weight[0] = 1;
    return texel[0] >= 0;
}

/* All channels of a map at pixel i of the window. */
static void txi_read_pixel(const txi_domain *d, const txi_window *w, int map, size_t i, float *out) {
    const txm_image *image = &d->maps[map];
    const int label = map > 0 && d->desc->maps[map - 1].is_label;
    int64_t texel[16];
    double weight[16];
    int taps = 0;
    if (w->state[i] != TXI_VOID && d->surface) {
        taps = txi_taps_at(d, w->face[i], w->texel[i], label, texel, weight);
    } else if (w->state[i] != TXI_VOID) { /* pixels of a picture are its texels */
        texel[0] = txi_tap(d, TXI_NO_FACE, (int)w->texel[i].x, (int)w->texel[i].y);
        weight[0] = 1;
        taps = texel[0] >= 0 && !d->missing[texel[0]];
    }
    for (int c = 0; c < image->channels; c++) {
        double sum = 0;
        for (int k = 0; k < taps; k++)
            sum += weight[k] * txm_image_get(image, (int)(texel[k] % d->width),
                                             (int)(texel[k] / d->width), c);
        out[c] = txm_float(sum);
    }
}

/* ---- resample: values as they are blended ------------------------------------------------------
   Samples of colours are times their alpha, as a transparent texel has no colour. Normals are vectors
   in the directions of the window (x right, y down, z out of the surface), so that they keep their
   direction on the surface across charts of the atlas, and with pieces that are turned.          */

/* A sample of the texture as it is blended. */
static void txi_pack(const txi_domain *d, int map, txm_vec2 axis, int mirrored, float *v) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    const int channels = d->maps[map].channels;
    if (kind && kind->is_normal) {
        const double x = 2 * (double)v[0] - 1;
        const double y = (2 * (double)v[1] - 1) * (kind->is_normal == 2 ? 1 : -1) * (mirrored ? -1 : 1);
        v[0] = txm_float(x * (double)axis.x - y * (double)axis.y);
        v[1] = txm_float(x * (double)axis.y + y * (double)axis.x);
        v[2] = txm_float(2 * (double)v[2] - 1);
    } else if (!(kind && kind->is_label) && (channels == 2 || channels == 4)) {
        for (int c = 0; c < channels - 1; c++) v[c] = v[c] * v[channels - 1];
    }
}

/* The reverse; normals get unit length. */
static void txi_unpack(const txi_domain *d, int map, txm_vec2 axis, int mirrored, float *v) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    const int channels = d->maps[map].channels;
    if (kind && kind->is_normal) {
        double x = (double)v[0] * (double)axis.x + (double)v[1] * (double)axis.y;
        double y = (double)v[1] * (double)axis.x - (double)v[0] * (double)axis.y;
        const double length = sqrt(x * x + y * y + (double)v[2] * (double)v[2]);
        const double scale = length > 0 ? 1 / length : 0;
        y *= (kind->is_normal == 2 ? 1 : -1) * (mirrored ? -1 : 1);
        v[0] = txm_float(0.5 * (x * scale + 1));
        v[1] = txm_float(0.5 * (y * scale + 1));
        v[2] = length > 0 ? txm_float(0.5 * ((double)v[2] * scale + 1)) : 1;
    } else if (!(kind && kind->is_label) && (channels == 2 || channels == 4)) {
        const float alpha = v[channels - 1];
        for (int c = 0; c < channels - 1 && alpha > 1e-4f; c++) v[c] = v[c] / alpha;
    }
}

/* ---- resample: from maps to windows, from windows to maps ---- */

/* Every channel of a map at the window's pixels: values receives width * height * channels numbers,
   in the units of txm_image_get. Interpolated by the spline of Catmull and Rom from known texels of
   the pixel's own chart; labels are those of the nearest texel. 0 where there is no known texel. */
static void txi_window_read(const txi_domain *d, const txi_window *w, int map, float *values) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const size_t channels = (size_t)d->maps[map].channels;
    for (size_t i = 0; i < count; i++) {
        txi_read_pixel(d, w, map, i, values + i * channels);
        if (w->state[i] != TXI_VOID) txi_pack(d, map, w->axis[i], w->mirrored[i], values + i * channels);
    }
}

/* Is a pixel, that has a surface, known, missing or not to be copied from? A hole if its nearest
   texel is missing, or one that has more than 2 % of the bilinear weight; void without any. */
static uint8_t txi_pixel_state(const txi_domain *d, uint32_t face, txm_vec2 p) {
    const double fx = floor(p.x), fy = floor(p.y);
    double most = 0;
    int64_t nearest = -1;
    for (int k = 0; k < 4; k++) {
        const int64_t i = txi_tap(d, face, (int)fx + k % 2, (int)fy + k / 2);
        const double u = k % 2 ? p.x - fx : 1 - (p.x - fx), v = k / 2 ? p.y - fy : 1 - (p.y - fy);
        if (i < 0 || u * v < 0.02) continue;
        if (d->missing[i]) return TXI_HOLE;
        if (u * v <= most) continue;
        most = u * v;
        nearest = i;
    }
    if (nearest < 0) nearest = txi_nearest_tap(d, face, p, 0);
    if (nearest < 0) return TXI_VOID;
    if (d->missing[nearest]) return TXI_HOLE;
    return d->usable[nearest] ? TXI_KNOWN : TXI_FOREIGN;
}

static uint8_t txi_byte(double unit) {
    return (uint8_t)(unit >= 1 ? 255 : unit > 0 ? unit * 255 + 0.5 : 0.5);
}

/* Fill state, of pixels that are not void, and color from the maps as they are now. */
static void txi_window_colors(const txi_domain *d, txi_window *w) {
    const int channels = d->maps[0].channels, has_alpha = channels == 2 || channels == 4;
    const size_t count = (size_t)w->width * (size_t)w->height;
    for (size_t i = 0; i < count; i++) {
        float v[TXI_MAX_CHANNELS] = {0, 0, 0, 0};
        uint8_t *out = w->color + 4 * i;
        memset(out, 0, 4);
        if (w->state[i] != TXI_VOID) w->state[i] = txi_pixel_state(d, w->face[i], w->texel[i]);
        if (w->state[i] == TXI_VOID) continue;
        txi_read_pixel(d, w, 0, i, v);
        const double alpha = has_alpha ? (double)txm_clampf(v[channels - 1], 0, 1) : 1;
        for (int c = 0; c < 3; c++)
            out[c] = txi_byte(alpha * v[channels >= 3 ? c : 0] + (1 - alpha) * (128 / 255.0));
    }
}

/* The window's values at (x, y): the spline, limited to the range of the four pixels around, so
   that it cannot ring; where a pixel of the sixteen is void, bilinear from those that are not. 0:
   all four are void. */
static int txi_window_value(const txi_window *w, int channels, int is_label, const float *values,
                            double x, double y, float out[TXI_MAX_CHANNELS]) {
    const double fx = floor(x), fy = floor(y);
    const int left = (int)fx, up = (int)fy;
    double wx[TXI_TAPS], wy[TXI_TAPS], bilinear[4], sum = 0, best = 0;
    size_t at[16];
    int solid[16], whole = 1, nearest = -1;
    for (int k = 0; k < 16; k++) {
        const int px = left - 1 + k % 4, py = up - 1 + k / 4;
        solid[k] = px >= 0 && py >= 0 && px < w->width && py < w->height;
        at[k] = solid[k] ? (size_t)py * (size_t)w->width + (size_t)px : 0;
        solid[k] = solid[k] && w->state[at[k]] != TXI_VOID;
        whole &= solid[k];
    }
    for (int k = 0; k < 4; k++) {
        const int tap = 5 + k % 2 + 4 * (k / 2);
        const double u = k % 2 ? x - fx : 1 - (x - fx), v = k / 2 ? y - fy : 1 - (y - fy);
        bilinear[k] = solid[tap] ? u * v : 0;
        sum += bilinear[k];
        if (!(bilinear[k] > best)) continue;
        best = bilinear[k];
        nearest = tap;
    }
    if (nearest < 0) return 0;
    txi_spline(x - fx, wx);
    txi_spline(y - fy, wy);
    for (int c = 0; c < channels; c++) {
        double value = 0, low = 0, high = 0;
        if (is_label) {
            out[c] = values[at[nearest] * (size_t)channels + (size_t)c];
            continue;
        }
        if (!whole) {
            for (int k = 0; k < 4; k++) {
                const size_t i = at[5 + k % 2 + 4 * (k / 2)];
                value += bilinear[k] / sum * values[i * (size_t)channels + (size_t)c];
            }
            out[c] = txm_float(value);
            continue;
        }
        for (int k = 0; k < 16; k++) {
            const double v = values[at[k] * (size_t)channels + (size_t)c];
            const int is_inner = (k % 4 == 1 || k % 4 == 2) && (k / 4 == 1 || k / 4 == 2);
            value += wx[k % 4] * wy[k / 4] * v;
            if (is_inner && (k == 5 || v < low)) low = v;
            if (is_inner && (k == 5 || v > high)) high = v;
        }
        out[c] = txm_float(value < low ? low : value > high ? high : value);
    }
    return 1;
}

/* The pixel nearest to (x, y) that is not void, -1 if there is none within 8 pixels. */
static int64_t txi_solid_near(const txi_window *w, double x, double y) {
    const int cx = (int)floor(x + 0.5), cy = (int)floor(y + 0.5);
    int64_t best = -1;
    double least = 0;
    for (int py = cy - 8; py <= cy + 8; py++) {
        for (int px = cx - 8; px <= cx + 8; px++) {
            if (px < 0 || py < 0 || px >= w->width || py >= w->height) continue;
            const int64_t i = (int64_t)py * w->width + px;
            const double dx = px - x, dy = py - y, apart = dx * dx + dy * dy;
            if (w->state[i] == TXI_VOID || (best >= 0 && apart >= least)) continue;
            best = i;
            least = apart;
        }
    }
    return best;
}

/* Write values, laid out as txi_window_read gives them, to the window's targets in a map. No other
   texel changes. */
static void txi_window_write(txi_domain *d, const txi_window *w, int map, const float *values) {
    const txm_image *image = &d->maps[map];
    const int channels = image->channels, label = map > 0 && d->desc->maps[map - 1].is_label;
    for (size_t i = 0; i < w->target_count; i++) {
        const txi_target *t = &w->targets[i];
        const int x = (int)(t->texel % (uint32_t)d->width), y = (int)(t->texel / (uint32_t)d->width);
        float value[TXI_MAX_CHANNELS] = {0, 0, 0, 0};
        if (!txi_window_value(w, channels, label, values, t->x, t->y, value)) {
            const int64_t pixel = txi_solid_near(w, t->x, t->y);
            for (int c = 0; c < channels && pixel >= 0; c++)
                value[c] = values[pixel * channels + c];
        }
        txi_unpack(d, map, t->axis, t->mirrored, value);
        for (int c = 0; c < channels; c++) txm_image_set(image, x, y, c, value[c]);
    }
}

/* The targets are not missing any longer. They may be copied from unless the caller has said where
   texture may be taken from. */
static void txi_window_done(txi_domain *d, const txi_window *w) {
    for (size_t i = 0; i < w->target_count; i++) {
        d->missing[w->targets[i].texel] = 0;
        if (!d->desc->source.pixels) d->usable[w->targets[i].texel] = 1;
    }
}

/* ---- resample: gutters ----------------------------------------------------------------------- */

/* The nearest texel with a mark, of equally near ones the first in its row, then the upper one.

   First the nearest mark in each column; then along each row the lower envelope of the parabolas
   (x - i)^2 + dy(i)^2: those of the columns that come first somewhere are kept on a stack.

   nearest  receives one texel number for each, -1 without any marks
   cost     O(width * height); 4 bytes for each texel of a row and each row               */
static txm_status txi_nearest(const uint8_t *marks, int width, int height, txm_env *env,
                              int32_t *nearest) {
    txm_arena scratch;
    const size_t w = (size_t)width;
    txm_arena_init(&scratch, env);
    int32_t *row = (int32_t *)txm_arena_alloc(&scratch, w, sizeof(int32_t)); /* row of the mark */
    int *stack = (int *)txm_arena_alloc(&scratch, w, sizeof(int));
    int *from = (int *)txm_arena_alloc(&scratch, w, sizeof(int)); /* where each becomes nearest  */
    if (scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    for (int x = 0; x < width; x++) {
        int32_t last = -1;
        for (int y = 0; y < height; y++) {
            if (marks[(size_t)y * w + (size_t)x]) last = y;
            nearest[(size_t)y * w + (size_t)x] = last;
        }
        last = -1;
        for (int y = height - 1; y >= 0; y--) {
            int32_t *n = &nearest[(size_t)y * w + (size_t)x];
            if (marks[(size_t)y * w + (size_t)x]) last = y;
            if (last >= 0 && (*n < 0 || last - y < y - *n)) *n = last;
        }
    }
    for (int y = 0; y < height; y++) {
        int count = 0;
        memcpy(row, nearest + (size_t)y * w, w * sizeof *row);
        for (int x = 0; x < width; x++) {
            const int64_t dy = row[x] - y;
            if (row[x] < 0) continue;
            int begin = 0;
            while (count > 0) { /* first place at which x is nearer than the top of the stack */
                const int i = stack[count - 1];
                const int64_t di = row[i] - y;
                const int64_t sum = (int64_t)x * x + dy * dy - (int64_t)i * i - di * di;
                const int64_t place = sum < 0 ? 0 : sum / (2 * (int64_t)(x - i)) + 1;
                if (place > from[count - 1]) {
                    begin = place < width ? (int)place : width;
                    break;
                }
                count--;
            }
            if (begin >= width) continue;
            stack[count] = x;
            from[count++] = begin;
        }
        for (int x = 0, k = 0; x < width; x++) {
            while (k + 1 < count && from[k + 1] <= x) k++;
            nearest[(size_t)y * w + (size_t)x] =
                count ? (int32_t)((size_t)row[stack[k]] * w + (size_t)stack[k]) : -1;
        }
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

/* Copy all maps from one texel to another. */
static void txi_copy_texel(const txi_domain *d, size_t from, size_t to) {
    const size_t w = (size_t)d->width;
    for (int m = 0; m < d->map_count; m++) {
        const txm_image *image = &d->maps[m];
        const size_t bytes = (size_t)image->channels * txm_sample_bytes(image->sample);
        memcpy((uint8_t *)txm_image_row(image, (int)(to / w)) + to % w * bytes,
               (const uint8_t *)txm_image_row_const(image, (int)(from / w)) + from % w * bytes, bytes);
    }
}

/* Missing texels outside the charts, at most desc->gutter from a texel in a chart, get the values of
   the nearest one in all maps. They are not missing any longer. */
static txm_status txi_gutter(txi_domain *d, txm_arena *arena, txm_env *env) {
    const int gutter = d->desc->gutter == 0 ? 8 : d->desc->gutter;
    const size_t count = (size_t)d->width * (size_t)d->height;
    if (!d->surface || gutter < 0) return TXM_OK;
    int32_t *nearest = (int32_t *)txm_arena_alloc(arena, count, sizeof(int32_t));
    uint8_t *known = (uint8_t *)txm_arena_alloc(arena, count, 1);
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) known[i] = d->covered[i] && !d->missing[i];
    const txm_status status = txi_nearest(known, d->width, d->height, env, nearest);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < count; i++) {
        if (!d->missing[i] || d->covered[i] || nearest[i] < 0) continue;
        const int64_t dx = (int64_t)(i % (size_t)d->width) - nearest[i] % d->width;
        const int64_t dy = (int64_t)(i / (size_t)d->width) - nearest[i] / d->width;
        if (dx * dx + dy * dy > (int64_t)gutter * gutter) continue;
        txi_copy_texel(d, (size_t)nearest[i], i);
        d->missing[i] = 0;
    }
    return TXM_OK;
}

#endif /* TEXINPAINT_RESAMPLE_H */
