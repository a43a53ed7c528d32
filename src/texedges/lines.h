#ifndef TEXEDGES_LINES_H
#define TEXEDGES_LINES_H

#include "layers.h"

/* ---- from layers to lines -------------------------------------------------------------- */

/* The map of layers while lines are traced: the lower four bits of a byte are the layer, the upper
   four the sides of the pixel whose cracks have not been followed yet. */
typedef struct txe_map {
    int width, height;
    uint8_t *at;
} txe_map;

/* is the pixel of this layer? */
static int txe_is_layer(const txe_map *m, int x, int y, int layer) {
    if (x < 0 || y < 0 || x >= m->width || y >= m->height) return 0;
    return (m->at[(size_t)y * (size_t)m->width + (size_t)x] & 15) == layer;
}

/* Mark all cracks and count them. shared: cracks between each two layers. 0 = cancelled. */
static int txe_mark_cracks(const txe_map *m, size_t *cracks, size_t (*shared)[TEXEDGES_MAX_LEVELS],
                           txe_progress *bar) {
    const int w = m->width;
    *cracks = 0;
    for (int y = 0; y < m->height; y++) {
        for (int x = 0; x < w; x++) {
            uint8_t *at = m->at + (size_t)y * (size_t)w + (size_t)x;
            const int layer = *at & 15;
            for (int side = 0; side < 4; side++) {
                const int u = x + txe_step_x[side], v = y + txe_step_y[side];
                if (txe_is_layer(m, u, v, layer)) continue;
                *at = (uint8_t)(*at | 16 << side);
                ++*cracks;
                if (u >= 0 && v >= 0 && u < w && v < m->height)
                    shared[layer][m->at[(size_t)v * (size_t)w + (size_t)u] & 15]++;
            }
            if (txe_advance(bar, 4)) return 0;
        }
    }
    return 1;
}

/* Follow the cracks of one line, from side `side` of pixel (x, y), and unmark them.

           l | a      p: the pixel to the right of the line (here upwards, along its left side)
             ^        a: the next pixel on the right side, l: the one across from a
           - | p      a is of another layer: turn right, around p, whatever l is;
                      a and l are both of p's layer: turn left;
                      only a is of p's layer: straight on

   Each crack has one successor and one predecessor, so the line returns to its start.
   points  receives the corners, or NULL; returns their number; 0 = cancelled
   area    receives the area to the right, negative if the line is a hole's                   */
static size_t txe_trace(const txe_map *m, int x, int y, int side, txm_vec2 *points,
                        int64_t *area, txe_progress *bar) {
    const int x0 = x, y0 = y, side0 = side, w = m->width;
    const int layer = m->at[(size_t)y * (size_t)w + (size_t)x] & 15;
    size_t count = 0;
    *area = 0;
    do {
        uint8_t *at = m->at + (size_t)y * (size_t)w + (size_t)x;
        *at = (uint8_t)(*at & ~(16 << side));
        if (points)
            points[count] = txm_v2((float)(x + (side == 1 || side == 2)), (float)(y + (side >= 2)));
        count++;
        if (side == 1) *area += x + 1; /* integral of x dy */
        if (side == 3) *area -= x;
        const int ahead = (side + 1) & 3; /* the side between p and a */
        const int ax = x + txe_step_x[ahead], ay = y + txe_step_y[ahead];
        if (!txe_is_layer(m, ax, ay, layer)) {
            side = ahead;
        } else {
            x = ax;
            y = ay;
            const int lx = ax + txe_step_x[side], ly = ay + txe_step_y[side];
            if (txe_is_layer(m, lx, ly, layer)) {
                x = lx;
                y = ly;
                side = (side + 3) & 3;
            }
        }
        if (txe_advance(bar, 4)) return 0;
    } while (x != x0 || y != y0 || side != side0);
    return count;
}

/* All lines in raster order of their first points: traced once to count them, once to keep them. */
static txm_status txe_trace_all(const txe_map *m, txe_progress *bar, texedges_set *e,
                                txm_env *env) {
    size_t shared[TEXEDGES_MAX_LEVELS][TEXEDGES_MAX_LEVELS], cracks;
    for (int pass = 0; pass < 2; pass++) {
        size_t lines = 0, points = 0;
        memset(shared, 0, sizeof shared);
        if (!txe_mark_cracks(m, &cracks, shared, bar)) return txe_stopped(env);
        if (pass == 1) {
            e->lines =
                (texedges_polyline *)txm_arena_alloc(&e->memory, e->line_count, sizeof *e->lines);
            e->points = (txm_vec2 *)txm_arena_alloc(&e->memory, cracks, sizeof *e->points);
            if (e->memory.failed) return txe_no_memory(env);
        }
        for (int y = 0; y < m->height; y++) {
            for (int x = 0; x < m->width; x++) {
                const uint8_t *at = m->at + (size_t)y * (size_t)m->width + (size_t)x;
                for (int side = 0; side < 4; side++) {
                    if (!(*at & 16 << side)) continue;
                    int64_t area;
                    const size_t count =
                        txe_trace(m, x, y, side, pass ? e->points + points : NULL, &area, bar);
                    if (!count) return txe_stopped(env);
                    if (pass) {
                        e->lines[lines].layer = *at & 15;
                        e->lines[lines].is_hole = area < 0;
                        e->lines[lines].first = points;
                        e->lines[lines].count = count;
                    }
                    points += count;
                    lines++;
                }
                if (txe_advance(bar, 1)) return txe_stopped(env);
            }
        }
        e->line_count = lines;
        e->point_count = points;
    }
    for (int k = 0; k < e->levels; k++) {
        int best = -1;
        for (int j = 0; j < e->levels; j++) {
            if (shared[k][j] > (best < 0 ? 0 : shared[k][best])) best = j;
        }
        e->beside[k] = best;
    }
    return TXM_OK;
}

static txm_status txe_find(const texedges_desc *desc, txe_progress *bar, txm_arena *layers,
                           txm_arena *scratch, texedges_set *e, txm_env *env) {
    txe_map map;
    const size_t count = (size_t)e->width * (size_t)e->height;
    map.width = e->width;
    map.height = e->height;
    for (int k = 0; k < e->levels - 1 && desc->thresholds; k++)
        e->thresholds[k] = desc->thresholds[k];
    map.at = (uint8_t *)txm_arena_alloc(layers, count, 1);
    if (!map.at) return txe_no_memory(env);
    const txm_status status = txe_layers_find(desc, e->levels, desc->thresholds != NULL,
                                              e->thresholds, map.at, 0.7, bar, scratch, env);
    if (status != TXM_OK) return status;
    txe_stage(bar, "lines", 1, (double)count * 14);
    return txe_trace_all(&map, bar, e, env);
}

TEXEDGES_API txm_status texedges_find(const texedges_desc *desc, txm_env *env, texedges_set **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    txm_status status = txe_check_desc(desc, env);
    if (status != TXM_OK) return status;
    if (desc->levels && (desc->levels < 2 || desc->levels > TEXEDGES_MAX_LEVELS))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "levels",
                           "must be 0 or 2 to TEXEDGES_MAX_LEVELS");
    const int levels = desc->levels ? desc->levels : 4;
    if (desc->thresholds && !txe_thresholds_are_good(desc->thresholds, levels))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "thresholds", "must rise and lie within 0 to 1");

    txm_arena layers, scratch;
    txe_progress bar = txe_progress_of(env);
    texedges_set *set = txe_set_make(levels, desc->image.width, desc->image.height, env);
    if (!set) return txe_no_memory(env);
    txm_arena_init(&layers, env);
    txm_arena_init(&scratch, env);
    status = txe_find(desc, &bar, &layers, &scratch, set, env);
    txm_arena_free(&scratch);
    txm_arena_free(&layers);
    if (status == TXM_OK) *out = set;
    else texedges_set_free(set);
    return status;
}

/* Mark the pixels along a line with layer + 1: those under points half a pixel to its right, two
   points a pixel. 0 = cancelled. */
static int txe_draw_line(const texedges_set *e, const texedges_polyline *line, uint8_t *marks,
                         int width, int height, txe_progress *bar) {
    const txm_vec2 *points = e->points + line->first;
    for (size_t j = 0; j < line->count; j++) {
        const txm_vec2 p = points[j], q = points[j + 1 < line->count ? j + 1 : 0];
        const double dx = (double)q.x - p.x, dy = (double)q.y - p.y;
        const double length = sqrt(dx * dx + dy * dy);
        const int steps = 2 * (int)length + 1;
        if (txe_advance(bar, 1)) return 0;
        for (int i = 0; i < steps && length > 0; i++) {
            const double t = (i + 0.5) / steps;
            const double x = p.x + t * dx - 0.5 * dy / length, y = p.y + t * dy + 0.5 * dx / length;
            if (x >= 0 && y >= 0 && x < width && y < height)
                marks[(size_t)y * (size_t)width + (size_t)x] = (uint8_t)(line->layer + 1);
            if (txe_advance(bar, 2)) return 0;
        }
    }
    return 1;
}

/* The colour of a layer, on a ramp from black over purple, red and yellow to white; the darkest
   layer is not quite black. One channel: gray. */
static uint8_t txe_color(int layer, int levels, int channels, int channel) {
    static const int ramp[5][3] = {
        {0, 0, 0}, {112, 0, 144}, {224, 48, 48}, {240, 192, 32}, {255, 255, 255}};
    const int t = 1024 * (layer + 1) / levels; /* 0..1024: four spans of 256 */
    if (channels == 1) return (uint8_t)((255 * (layer + 1) + levels / 2) / levels);
    const int span = t < 1024 ? t / 256 : 3, rest = t - 256 * span;
    return (uint8_t)((ramp[span][channel] * (256 - rest) + ramp[span + 1][channel] * rest) / 256);
}

TEXEDGES_API txm_status texedges_draw(const texedges_set *edges, int layer, txm_env *env,
                                      const txm_image *image) {
    txe_progress bar = txe_progress_of(env);
    txe_stage(&bar, "edges", 0.5, edges ? (double)edges->point_count : 0);
    txm_status status = txe_check_image(image, "image", 0, env);
    if (status != TXM_OK) return status;
    const int channels = image->channels ? image->channels : 1;
    if (image->sample != TXM_U8 || (channels != 1 && channels != 3))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "must be TXM_U8 with 1 or 3 channels");
    status = txe_check_edges(edges, "edges", 0, &bar, env);
    if (status != TXM_OK) return status;
    if (layer < -1 || layer >= edges->levels)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "layer", "must be -1 to levels - 1");

    const int width = image->width, height = image->height;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint8_t *marks = (uint8_t *)txm_arena_zero(&arena, (size_t)width, (size_t)height);
    if (!marks) return txe_no_memory(env);
    txe_stage(&bar, "edges", 1, 7 * (double)edges->point_count);
    for (size_t i = 0; i < edges->line_count && status == TXM_OK; i++) {
        const texedges_polyline *line = &edges->lines[i];
        if (layer >= 0 && line->layer != layer) continue;
        if (!txe_draw_line(edges, line, marks, width, height, &bar)) status = txe_stopped(env);
    }
    for (int y = 0; y < height && status == TXM_OK; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(image, y);
        for (int x = 0; x < width; x++) {
            const int mark = marks[(size_t)y * (size_t)width + (size_t)x];
            for (int c = 0; c < channels && mark; c++)
                row[x * channels + c] = txe_color(mark - 1, edges->levels, channels, c);
        }
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXEDGES_LINES_H */
