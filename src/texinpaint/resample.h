#ifndef TEXINPAINT_RESAMPLE_H
#define TEXINPAINT_RESAMPLE_H

#include "raster.h"
#include "surface.h"

/* ---- resample: between maps and windows ------------------------------------------------------ */

enum {
    TXI_NEAR = 3, /* texels; ours: how far a pixel between charts looks for a texel of its own   */
    TXI_NEAR_SOLID = 8, /* pixels; ours: how far a target in void looks for a pixel that is not */
    TXI_GUTTER_WIDTH = 8, /* texels; the default of desc.gutter                             */
    TXI_TAPS = 6, /* of the kernel, per axis                                                    */
    TXI_KERNEL_STEPS = 128 /* ours: places between two samples in the kernel's table            */
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
    w->share = (uint8_t *)txm_arena_zero(arena, count, 1);
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

/* Interpolation is by the kernel of Lanczos with three lobes: from texels to pixels and back it
   keeps three quarters of the energy of fine detail, the spline of Catmull and Rom half of it. Its
   weights for samples at -2 .. 3, for a place t from 0 to below 1, which sum up to 1:

       w(x) = sinc(pi x) sinc(pi x / 3),   x = t + 2 .. t - 3                                   */
static void txi_lanczos(double t, double weight[TXI_TAPS]) {
    /* cosine and sine of i / 3 of a half turn, i = -2 .. 3 */
    static const double c[TXI_TAPS] = {-0.5, 0.5, 1, 0.5, -0.5, -1};
    static const double s[TXI_TAPS] = {-0.86602540378443865, -0.86602540378443865, 0,
                                       0.86602540378443865, 0.86602540378443865, 0};
    double whole, third, across, unused, sum = 0;
    txm_sincos(TXM_PI * t, &whole, &unused);
    txm_sincos(TXM_PI / 3 * t, &third, &across);
    for (int i = 0; i < TXI_TAPS; i++) {
        const double x = t - (i - 2);
        weight[i] = (i % 2 ? -whole : whole) * (third * c[i] - across * s[i]);
        weight[i] = fabs(x) < 1e-5 ? 1 : weight[i] * (3 / (TXM_PI * TXM_PI)) / (x * x);
        sum += weight[i];
    }
    for (int i = 0; i < TXI_TAPS; i++) weight[i] /= sum;
}

/* Its weights for t = 0, 1 / TXI_KERNEL_STEPS, .. 1, as they take longer to compute than to use. */
typedef struct txi_kernel {
    double weight[TXI_KERNEL_STEPS + 1][TXI_TAPS];
} txi_kernel;

static void txi_kernel_init(txi_kernel *kernel) {
    memset(kernel, 0, sizeof *kernel);
    for (int i = 0; i < TXI_KERNEL_STEPS; i++)
        txi_lanczos((double)i / (double)TXI_KERNEL_STEPS, kernel->weight[i]);
    for (int k = 0; k < TXI_TAPS; k++) kernel->weight[TXI_KERNEL_STEPS][k] = k == 3;
}

static void txi_kernel_at(const txi_kernel *kernel, double t, double weight[TXI_TAPS]) {
    const int i = (int)(t * (double)TXI_KERNEL_STEPS);
    const double part = t * (double)TXI_KERNEL_STEPS - i;
    const double *a = kernel->weight[i], *b = kernel->weight[i < TXI_KERNEL_STEPS ? i + 1 : i];
    for (int k = 0; k < TXI_TAPS; k++) weight[k] = a[k] + part * (b[k] - a[k]);
}

/* A value between the four samples around it, in excess of them by at most a quarter of their
   range: the kernel must not ring at hard edges. */
static double txi_limit(double value, double low, double high) {
    const double more = 0.25 * (high - low);
    return value < low - more ? low - more : value > high + more ? high + more : value;
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

/* Texels around a place and their weights, which sum up to 1. */
typedef struct txi_taps {
    int count, is_limited;  /* is_limited: by the inner four */
    int64_t texel[TXI_TAPS * TXI_TAPS], inner[4];
    double weight[TXI_TAPS * TXI_TAPS];
} txi_taps;

/* The known texels around p that a pixel on this face may take: those of the kernel, if the
   inner four are among them and little weight is lost; else those of the inner four, bilinear;
   else the nearest. */
static void txi_taps_at(const txi_domain *d, const txi_kernel *kernel, uint32_t face, txm_vec2 p,
                        int is_label, txi_taps *taps) {
    const double fx = floor((double)p.x), fy = floor((double)p.y), tx = p.x - fx, ty = p.y - fy;
    const int x = (int)fx, y = (int)fy;
    double wx[TXI_TAPS], wy[TXI_TAPS], part = 0, sum = 0;
    taps->count = taps->is_limited = 0;
    for (int k = 0; k < 4 && !is_label; k++) {
        const int64_t i = txi_tap(d, face, x + k % 2, y + k / 2);
        if (i < 0 || d->missing[i]) continue;
        taps->inner[taps->count] = taps->texel[taps->count] = i;
        taps->weight[taps->count] = (k % 2 ? tx : 1 - tx) * (k / 2 ? ty : 1 - ty);
        part += taps->weight[taps->count++];
    }
    if (taps->count == 4) {
        int count = 0;
        txi_kernel_at(kernel, tx, wx);
        txi_kernel_at(kernel, ty, wy);
        for (int k = 0; k < TXI_TAPS * TXI_TAPS; k++) {
            const int i = k % TXI_TAPS, j = k / TXI_TAPS;
            const int64_t texel = txi_tap(d, face, x - 2 + i, y - 2 + j);
            if (texel < 0 || d->missing[texel]) continue;
            taps->texel[count] = texel;
            taps->weight[count] = wx[i] * wy[j];
            sum += taps->weight[count++];
        }
        taps->count = count;
        taps->is_limited = 1;
        for (int k = 0; k < count; k++) taps->weight[k] /= sum;
        if (sum > 0.8) return;
        for (int k = 0; k < 4; k++) { /* too little is left of it */
            taps->texel[k] = taps->inner[k];
            taps->weight[k] = (k % 2 ? tx : 1 - tx) * (k / 2 ? ty : 1 - ty);
        }
        taps->count = 4;
        return;
    }
    for (int k = 0; k < taps->count; k++) taps->weight[k] /= part;
    if (part > 0.05) return;
    taps->texel[0] = txi_nearest_tap(d, face, p, 1);
    taps->weight[0] = 1;
    taps->count = taps->texel[0] >= 0;
}

/* Are the samples of a map labels? */
static int txi_is_label(const txi_domain *d, int map) {
    return map > 0 && d->desc->maps[map - 1].is_label;
}

/* Does a map have colours, which count times their alpha? */
static int txi_has_alpha(const txi_domain *d, int map) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    return !(kind && (kind->is_normal || kind->is_label)) && d->maps[map].channels % 2 == 0;
}

/* Continue the visible colours of all maps into what is transparent in the hole. Known texels stay, to
   the byte. */
static txm_status txi_bleed(const txi_domain *d, txm_env *env) {
    const size_t count = (size_t)d->width * (size_t)d->height;
    txm_status status = TXM_OK;
    txm_arena arena;
    uint8_t *hole = NULL;
    txm_arena_init(&arena, env);
    for (int map = 0; map < d->map_count && status == TXM_OK; map++) {
        if (!txi_has_alpha(d, map)) continue;
        if (!hole) {
            hole = (uint8_t *)txm_arena_alloc(&arena, count, 1);
            if (!hole) status = txi_no_memory(env);
            else txm_mask_read(&d->desc->mask, TXM_MASK_REPLACES, hole);
        }
        if (status == TXM_OK) status = txm_image_bleed_part(&d->maps[map], hole, 0, 1, 1, env);
    }
    txm_arena_free(&arena);
    return status;
}

/* A channel of a texel; colours times their alpha, if has_alpha. */
static double txi_texel_value(const txm_image *image, int has_alpha, int64_t texel, int c) {
    const int x = (int)(texel % image->width), y = (int)(texel / image->width),
              last = image->channels - 1;
    const double value = txm_image_get(image, x, y, c);
    return has_alpha && c < last ? value * txm_clampf(txm_image_get(image, x, y, last), 0, 1)
                                 : value;
}

/* The samples of a row, as they are stored. */
static void txi_load_row(const txm_image *image, int x, int y, int count, double *out) {
    const void *row = (const char *)image->pixels + image->stride * y;
    const size_t first = (size_t)x * (size_t)image->channels;
    if (image->sample == TXM_U8) {
        for (int i = 0; i < count; i++) out[i] = ((const uint8_t *)row + first)[i];
    } else if (image->sample == TXM_U16) {
        for (int i = 0; i < count; i++) out[i] = ((const uint16_t *)row + first)[i];
    } else {
        for (int i = 0; i < count; i++) out[i] = ((const float *)row + first)[i];
    }
}

/* The channels of a map at a place all around which texels are known and of one chart. */
static void txi_read_inside(const txm_image *image, int has_alpha, const txi_kernel *kernel,
                            txm_vec2 p, float *out) {
    enum { N = TXI_TAPS, ROW = N * (int)TXI_MAX_CHANNELS };
    const double fx = floor((double)p.x), fy = floor((double)p.y);
    const int x = (int)fx - 2, y = (int)fy - 2, channels = image->channels;
    const double unit = image->sample == TXM_U8 ? 255 : image->sample == TXM_U16 ? 65535 : 1;
    double wx[N], wy[N], v[N * ROW];
    txi_kernel_at(kernel, p.x - fx, wx);
    txi_kernel_at(kernel, p.y - fy, wy);
    for (int j = 0; j < N; j++) {
        txi_load_row(image, x, y + j, N * channels, v + j * ROW);
        for (int i = 0; i < N * channels && has_alpha; i++) {
            const double alpha = v[j * ROW + i - i % channels + channels - 1] / unit;
            if (i % channels < channels - 1) v[j * ROW + i] *= fmin(fmax(alpha, 0), 1);
        }
    }
    for (int c = 0; c < channels; c++) {
        const double *a = v + 2 * ROW + 2 * channels + c, *b = a + ROW; /* the inner four */
        const double low = fmin(fmin(a[0], a[channels]), fmin(b[0], b[channels]));
        const double high = fmax(fmax(a[0], a[channels]), fmax(b[0], b[channels]));
        double sum = 0;
        for (int j = 0; j < N; j++) {
            const double *row = v + j * ROW + c;
            double line = 0;
            for (int i = 0; i < N; i++) line += wx[i] * row[i * channels];
            sum += wy[j] * line;
        }
        out[c] = txm_float(txi_limit(sum, low, high) / unit);
    }
}

/* Are all texels of the kernel at p known and of the chart of this face? Decided by tiles; 0
   also where that is not enough. */
static int txi_is_inside(const txi_domain *d, uint32_t face, txm_vec2 p) {
    const txi_surface *s = d->surface;
    const int x = (int)floor((double)p.x) - 2, y = (int)floor((double)p.y) - 2, side = TXI_TILE;
    if (x < 0 || y < 0 || x + TXI_TAPS > d->width || y + TXI_TAPS > d->height) return 0;
    for (int k = 0; k < 4; k++) {
        const size_t tx = (size_t)((x + k % 2 * (TXI_TAPS - 1)) / side);
        const size_t ty = (size_t)((y + k / 2 * (TXI_TAPS - 1)) / side);
        if (s->tile[ty * s->tile_stride + tx] != s->chart[face]) return 0;
    }
    for (int j = 0; j < TXI_TAPS; j++) {
        static const uint8_t none[TXI_TAPS] = {0};
        if (memcmp(d->missing + (size_t)(y + j) * (size_t)d->width + (size_t)x, none, TXI_TAPS) !=
            0)
            return 0;
    }
    return 1;
}

/* All channels of a map at pixel i of the window, which is not void; colours times their alpha. */
static void txi_read_pixel(const txi_domain *d, const txi_kernel *kernel, const txi_window *w,
                           int map, size_t i, float *out) {
    const txm_image *image = &d->maps[map];
    const int label = txi_is_label(d, map), has_alpha = txi_has_alpha(d, map);
    txi_taps taps;
    if (!d->surface) { /* pixels of a picture are its texels */
        const int x = (int)w->texel[i].x, y = (int)w->texel[i].y;
        const int64_t texel = (int64_t)y * d->width + x;
        for (int c = 0; c < image->channels; c++)
            out[c] = d->missing[texel] ? 0 : txm_float(txi_texel_value(image, has_alpha, texel, c));
        return;
    }
    if (!label && txi_is_inside(d, w->face[i], w->texel[i])) {
        txi_read_inside(image, has_alpha, kernel, w->texel[i], out);
        return;
    }
    txi_taps_at(d, kernel, w->face[i], w->texel[i], label, &taps);
    for (int c = 0; c < image->channels; c++) {
        double sum = 0, low = 0, high = 0;
        for (int k = 0; k < taps.count; k++)
            sum += taps.weight[k] * txi_texel_value(image, has_alpha, taps.texel[k], c);
        for (int k = 0; k < 4 && taps.is_limited; k++) {
            const double v = txi_texel_value(image, has_alpha, taps.inner[k], c);
            low = k ? fmin(low, v) : v;
            high = k ? fmax(high, v) : v;
        }
        out[c] = txm_float(taps.is_limited ? txi_limit(sum, low, high) : sum);
    }
}

/* ---- resample: values as they are blended ------------------------------------------------------
   Samples of colours are times their alpha, as a transparent texel has no colour. Normals are
   vectors in the directions of the window (x right, y down, z out of the surface), so that they
   keep their direction on the surface across charts of the atlas, and with pieces that are
   turned. */

/* A sample of the texture, its colours already times their alpha, as it is blended. */
static void txi_pack(const txi_domain *d, int map, txm_vec2 axis, int mirrored, float *v) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    if (kind && kind->is_normal) {
        const txm_sample sample = kind->image.sample;
        const double x = txm_normal_decode((double)v[0], sample);
        const double y = txm_normal_decode((double)v[1], sample) * (kind->is_normal == 2 ? 1 : -1) *
                         (mirrored ? -1 : 1);
        v[0] = txm_float(x * (double)axis.x - y * (double)axis.y);
        v[1] = txm_float(x * (double)axis.y + y * (double)axis.x);
        v[2] = txm_float(txm_normal_decode((double)v[2], sample));
    }
}

/* The reverse; normals get unit length. */
static void txi_unpack(const txi_domain *d, int map, txm_vec2 axis, int mirrored, float *v) {
    const texinpaint_map *kind = map ? &d->desc->maps[map - 1] : NULL;
    const int channels = d->maps[map].channels;
    if (kind && kind->is_normal) {
        const txm_sample sample = kind->image.sample;
        double x = (double)v[0] * (double)axis.x + (double)v[1] * (double)axis.y;
        double y = (double)v[1] * (double)axis.x - (double)v[0] * (double)axis.y;
        const double length = sqrt(x * x + y * y + (double)v[2] * (double)v[2]);
        const double scale = length > 0 ? 1 / length : 0;
        y *= (kind->is_normal == 2 ? 1 : -1) * (mirrored ? -1 : 1);
        const double z = length > 0 ? (double)v[2] * scale : 1;
        v[0] = txm_float(txm_normal_encode(x * scale, sample));
        v[1] = txm_float(txm_normal_encode(y * scale, sample));
        v[2] = txm_float(txm_normal_encode(z, sample));
    } else if (txi_has_alpha(d, map)) {
        const float alpha = txm_minf(v[channels - 1], 1);
        for (int c = 0; c < channels - 1 && alpha > 1e-4f; c++) v[c] = v[c] / alpha;
    }
}

/* ---- resample: from maps to windows, from windows to maps ---- */

/* Every channel of a map at the window's pixels: values receives width * height * channels numbers,
   in the units of txm_image_get. Interpolated from known texels of the pixel's own chart; labels
   are those of the nearest texel. 0 where there is no known texel. */
static void txi_window_read(const txi_domain *d, const txi_window *w, int map, float *values) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const size_t channels = (size_t)d->maps[map].channels;
    txi_kernel kernel;
    txi_kernel_init(&kernel);
    for (size_t i = 0; i < count; i++) {
        float *v = values + i * channels;
        if (w->state[i] == TXI_VOID) {
            memset(v, 0, channels * sizeof *v);
        } else {
            txi_read_pixel(d, &kernel, w, map, i, v);
            txi_pack(d, map, w->axis[i], w->mirrored[i], v);
        }
    }
}

/* Is a pixel, that has a surface, known, missing or not to be copied from? A hole if its nearest
   texel is missing, or one that has more than 2 % of the bilinear weight; void without any. */
static uint8_t txi_pixel_state(const txi_domain *d, uint32_t face, txm_vec2 p) {
    const double fx = floor((double)p.x), fy = floor((double)p.y);
    double most = 0;
    int64_t nearest = -1;
    if (d->surface && txi_is_inside(d, face, p))
        return d->usable[(size_t)floor((double)p.y + 0.5) * (size_t)d->width +
                         (size_t)floor((double)p.x + 0.5)]
                   ? TXI_KNOWN
                   : TXI_FOREIGN;
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

/* The bilinear weight of the known texels around a place, 0..255. */
static uint8_t txi_known_share(const txi_domain *d, uint32_t face, txm_vec2 p) {
    const double fx = floor((double)p.x), fy = floor((double)p.y);
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        const int64_t i = txi_tap(d, face, (int)fx + k % 2, (int)fy + k / 2);
        const double u = k % 2 ? p.x - fx : 1 - (p.x - fx), v = k / 2 ? p.y - fy : 1 - (p.y - fy);
        if (i >= 0 && !d->missing[i]) sum += u * v;
    }
    return (uint8_t)(255 * sum + 0.5);
}

/* Fill state, of pixels that are not void, share and color from the maps as they are now. */
static void txi_window_colors(const txi_domain *d, txi_window *w) {
    const int channels = d->maps[0].channels, has_alpha = txi_has_alpha(d, 0);
    const size_t count = (size_t)w->width * (size_t)w->height;
    txi_kernel kernel;
    txi_kernel_init(&kernel);
    for (size_t i = 0; i < count; i++) {
        float v[TXI_MAX_CHANNELS] = {0, 0, 0, 0};
        uint8_t *out = w->color + 4 * i;
        memset(out, 0, 4);
        if (w->state[i] != TXI_VOID) w->state[i] = txi_pixel_state(d, w->face[i], w->texel[i]);
        w->share[i] = w->state[i] == TXI_HOLE ? txi_known_share(d, w->face[i], w->texel[i]) : 0;
        if (w->state[i] == TXI_VOID) continue;
        txi_read_pixel(d, &kernel, w, 0, i, v);
        const double alpha = has_alpha ? (double)txm_clampf(v[channels - 1], 0, 1) : 1;
        for (int c = 0; c < 3; c++)
            out[c] = txi_byte(v[channels >= 3 ? c : 0] + (1 - alpha) * (128 / 255.0));
    }
}

/* The window's values at (x, y): by the kernel; where one of its pixels is void, bilinear from
   those of the four around that are not. 0: all four are void. */
static int txi_window_value(const txi_window *w, const txi_kernel *kernel, int channels,
                            int is_label, const float *values, double x, double y,
                            float out[TXI_MAX_CHANNELS]) {
    enum { N = TXI_TAPS };
    const double fx = floor(x), fy = floor(y);
    const int left = (int)fx - 2, up = (int)fy - 2;
    double wx[N], wy[N], bilinear[4], sum = 0, best = 0;
    size_t at[N * N];
    int solid[N * N], whole = 1, nearest = -1;
    for (int k = 0; k < N * N; k++) {
        const int px = left + k % N, py = up + k / N;
        solid[k] = px >= 0 && py >= 0 && px < w->width && py < w->height;
        at[k] = solid[k] ? (size_t)py * (size_t)w->width + (size_t)px : 0;
        solid[k] = solid[k] && w->state[at[k]] != TXI_VOID;
        whole &= solid[k];
        at[k] *= (size_t)channels;
    }
    for (int k = 0; k < 4; k++) {
        const int tap = (2 + k / 2) * N + 2 + k % 2;
        const double u = k % 2 ? x - fx : 1 - (x - fx), v = k / 2 ? y - fy : 1 - (y - fy);
        bilinear[k] = solid[tap] ? u * v : 0;
        sum += bilinear[k];
        if (!(bilinear[k] > best)) continue;
        best = bilinear[k];
        nearest = tap;
    }
    if (nearest < 0) return 0;
    txi_kernel_at(kernel, x - fx, wx);
    txi_kernel_at(kernel, y - fy, wy);
    for (int c = 0; c < channels; c++) {
        const float *value = values + c;
        double total = 0, low = value[at[nearest]], high = low;
        for (int k = 0; k < 4; k++) {
            const double v = value[at[(2 + k / 2) * N + 2 + k % 2]];
            if (bilinear[k] > 0) total += bilinear[k] / sum * v;
            if (bilinear[k] > 0 || whole) low = fmin(low, v);
            if (bilinear[k] > 0 || whole) high = fmax(high, v);
        }
        if (whole) {
            total = 0;
            for (int k = 0; k < N * N; k++) total += wx[k % N] * wy[k / N] * value[at[k]];
            total = txi_limit(total, low, high);
        }
        out[c] = is_label ? value[at[nearest]] : txm_float(total);
    }
    return 1;
}

/* The pixel nearest to (x, y) that is not void, -1 if there is none within TXI_NEAR_SOLID. */
static int64_t txi_solid_near(const txi_window *w, double x, double y) {
    const int cx = (int)floor(x + 0.5), cy = (int)floor(y + 0.5);
    int64_t best = -1;
    double least = 0;
    for (int py = cy - TXI_NEAR_SOLID; py <= cy + TXI_NEAR_SOLID; py++) {
        for (int px = cx - TXI_NEAR_SOLID; px <= cx + TXI_NEAR_SOLID; px++) {
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
    const int channels = image->channels, label = txi_is_label(d, map);
    txi_kernel kernel;
    txi_kernel_init(&kernel);
    for (size_t i = 0; i < w->target_count; i++) {
        const txi_target *t = &w->targets[i];
        const int x = (int)(t->texel % (uint32_t)d->width),
                  y = (int)(t->texel / (uint32_t)d->width);
        float value[TXI_MAX_CHANNELS] = {0, 0, 0, 0};
        if (!txi_window_value(w, &kernel, channels, label, values, t->x, t->y, value)) {
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

/* Copy all maps from one texel to another. */
static void txi_copy_texel(const txi_domain *d, size_t from, size_t to) {
    const size_t w = (size_t)d->width;
    for (int m = 0; m < d->map_count; m++) {
        const txm_image *image = &d->maps[m];
        const size_t bytes = (size_t)image->channels * txm_sample_bytes(image->sample);
        memcpy((uint8_t *)txm_image_row(image, (int)(to / w)) + to % w * bytes,
               (const uint8_t *)txm_image_row_const(image, (int)(from / w)) + from % w * bytes,
               bytes);
    }
}

/* Missing texels outside the charts, at most desc->gutter from a texel in a chart, get the
   values of the nearest one in all maps. They are not missing any longer. filled receives how
   many. */
static txm_status txi_gutter(txi_domain *d, txm_arena *arena, txm_env *env, size_t *filled) {
    const int gutter = d->desc->gutter == 0 ? TXI_GUTTER_WIDTH : d->desc->gutter;
    const size_t count = (size_t)d->width * (size_t)d->height;
    *filled = 0;
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
        ++*filled;
    }
    return TXM_OK;
}

#endif /* TEXINPAINT_RESAMPLE_H */
