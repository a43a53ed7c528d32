#ifndef TEXINPAINT_LAYOUT_H
#define TEXINPAINT_LAYOUT_H

#include "sheet.h"

/* ---- layout: pixels -------------------------------------------------------------------------- */

static void txi_sheet_normals(txi_sheet *l) {
    const txi_disk *disk = &l->disk;
    const double unit = 1 / (l->pixel * l->pixel);
    for (size_t v = 0; v < disk->vertex_count; v++) l->normal[v] = txm_v3(0, 0, 0);
    for (size_t i = 0; i < 3 * disk->face_count; i++) {
        const txm_dvec3 n = txm_d3_scale(txi_face_area2(l->s, disk->faces[i / 3]), unit);
        const txm_vec3 add = txm_v3(txm_float(n.x), txm_float(n.y), txm_float(n.z));
        l->normal[disk->corner[i]] = txm_vec3_add(l->normal[disk->corner[i]], add);
    }
    for (size_t v = 0; v < disk->vertex_count; v++) l->normal[v] = txm_vec3_normalize(l->normal[v]);
}

/* Fill a pixel that lies on face i of the disk. */
static void txi_sheet_pixel(const txi_sheet *l, txi_window *w, size_t pixel, size_t i,
                            const double weight[3], const double right[2], int mirrored) {
    const uint32_t face = l->disk.faces[i], *c = l->disk.corner + 3 * i;
    const txm_vec2 *t = l->s->uv + 3 * (size_t)face;
    double x = 0, y = 0;
    txm_dvec3 p = txm_d3(0, 0, 0);
    txm_vec3 n = txm_v3(0, 0, 0);
    for (int k = 0; k < 3; k++) {
        x += weight[k] * t[k].x;
        y += weight[k] * t[k].y;
        p = txm_d3_mad(p, txm_d3_sub(l->flat.point[c[k]], l->origin), weight[k] / l->pixel);
        n = txm_vec3_add(n, txm_vec3_scale(l->normal[c[k]], txm_float(weight[k])));
    }
    w->state[pixel] = TXI_KNOWN;
    w->face[pixel] = face;
    w->texel[pixel] = txm_v2(txm_float(x), txm_float(y));
    w->place[pixel] = txm_v3(txm_float(p.x), txm_float(p.y), txm_float(p.z));
    w->normal[pixel] = txm_vec3_normalize(n);
    w->axis[pixel] = txi_unit(right[0], right[1]);
    w->mirrored[pixel] = (uint8_t)mirrored;
}

/* Is face i of the disk the right way round in the window, where y runs downwards? */
static int txi_lies_right(const txi_sheet *l, size_t i) {
    const uint32_t *c = l->disk.corner + 3 * i;
    return txi_cross2(l->at[c[0]], l->at[c[1]], l->at[c[2]]) < -1e-9;
}

/* Is face i of the disk laid out with little distortion: its singular values between 1 /
   TXI_STRETCH and TXI_STRETCH? Those of the matrix (a b; c d) are Q + R and |Q - R|, with

       Q = |(a + d, c - b)| / 2,   R = |(a - d, c + b)| / 2.                                   */
static int txi_is_true(const txi_sheet *l, size_t i) {
    const double *shape = l->flat.shape + 3 * i;
    const uint32_t *v = l->disk.corner + 3 * i;
    const double *p = l->flat.xy + 2 * (size_t)v[0], *q = l->flat.xy + 2 * (size_t)v[1];
    const double *r = l->flat.xy + 2 * (size_t)v[2];
    if (!txi_lies_right(l, i)) return 0;
    if (!(shape[0] > 0 && shape[2] > 0)) return 1;
    const double a = (q[0] - p[0]) / shape[0], c = (q[1] - p[1]) / shape[0];
    const double b = (r[0] - p[0] - a * shape[1]) / shape[2],
                 d = (r[1] - p[1] - c * shape[1]) / shape[2];
    const double m = sqrt((a + d) * (a + d) + (c - b) * (c - b)) / 2;
    const double n = sqrt((a - d) * (a - d) + (c + b) * (c + b)) / 2;
    return m + n < TXI_STRETCH && fabs(m - n) > 1 / TXI_STRETCH;
}

/* Go through the pixels whose centres face i of the disk covers. With fill they are filled
   unless another face has been there first, the one nearer to the hole. Returns how many others
   cover within it. */
static size_t txi_sheet_face(const txi_sheet *l, txi_window *w, size_t i, int fill) {
    txm_vec2 t[3];
    double right[2] = {1, 0}, down[2] = {0, 1}, weight[3];
    size_t taken = 0;
    for (size_t k = 0; k < 3; k++) t[k] = l->at[l->disk.corner[3 * i + k]];
    txi_texel_steps(l, i, right, down);
    const int mirrored = right[0] * down[1] - right[1] * down[0] < 0;
    const float top = txm_minf(t[0].y, txm_minf(t[1].y, t[2].y));
    const float bottom = txm_maxf(t[0].y, txm_maxf(t[1].y, t[2].y));
    const float from = txm_minf(t[0].x, txm_minf(t[1].x, t[2].x));
    const float to = txm_maxf(t[0].x, txm_maxf(t[1].x, t[2].x));
    const int x0 = txm_clampi((int)ceil((double)from - 1e-4), 0, w->width - 1);
    const int x1 = txm_clampi((int)floor((double)to + 1e-4), 0, w->width - 1);
    const int y0 = txm_clampi((int)ceil((double)top - 1e-4), 0, w->height - 1);
    const int y1 = txm_clampi((int)floor((double)bottom + 1e-4), 0, w->height - 1);
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            const size_t pixel = (size_t)y * (size_t)w->width + (size_t)x;
            if (!txi_weights(t, x, y, weight)) continue;
            const double least = fmin(weight[0], fmin(weight[1], weight[2]));
            if (least < -1e-6) continue;
            if (w->face[pixel] != TXI_NO_FACE) taken += least > 1e-3;
            else if (fill) txi_sheet_pixel(l, w, pixel, i, weight, right, mirrored);
        }
    }
    return taken;
}

/* Fill the pixels that the disk covers. Left out is what is known but lies badly: faces that are
   much distorted or lie over others, and those that were added behind them.
   shown  receives 1 per face of the disk                                                      */
static void txi_sheet_pixels(const txi_sheet *l, txi_window *w, uint8_t *shown) {
    w->spacing = l->pixel;
    w->origin = l->origin;
    for (size_t i = 0; i < l->disk.face_count; i++) {
        shown[i] = (uint8_t)txi_lies_right(l, i);
        if (shown[i] && l->state[l->disk.faces[i]] != TXI_SHEET_GROUP)
            shown[i] = txi_is_true(l, i) && (i == 0 || shown[l->disk.grown_from[i]]) &&
                       txi_sheet_face(l, w, i, 0) == 0;
        if (shown[i]) txi_sheet_face(l, w, i, 1);
    }
}

/* ---- layout: targets ------------------------------------------------------------------------- */

/* Mark the pixels along the border of the disk where the surface goes on: all of it, or only
   where it goes through the hole. Returns how many sides that were. */
static size_t txi_mark_cuts(txi_sheet *l, const txi_window *w, int only_holes, uint8_t *marks) {
    uint32_t side = l->disk.border;
    size_t count = 0;
    for (size_t k = 0; k < l->disk.loop; k++, side = l->disk.next[side]) {
        const uint32_t here = txi_surface_side(&l->disk, side), beyond = l->s->opposite[here];
        if (beyond == TXM_NO_SIDE) continue;
        if (only_holes && (!txi_is_hole(l, here / 3) || !txi_is_hole(l, beyond / 3))) continue;
        const txm_vec2 a = l->at[l->disk.corner[side]],
                       b = l->at[l->disk.corner[txi_next_corner(side)]];
        const double dx = (double)b.x - a.x, dy = (double)b.y - a.y;
        const int steps = (int)(2 * sqrt(dx * dx + dy * dy)) + 1;
        for (int i = 0; i <= steps; i++) {
            const int x = txm_clampi((int)(a.x + dx * i / steps + 0.5), 0, w->width - 1);
            const int y = txm_clampi((int)(a.y + dy * i / steps + 0.5), 0, w->height - 1);
            marks[(size_t)y * (size_t)w->width + (size_t)x] = 1;
        }
        count++;
    }
    return count;
}

/* The distance of a place in the window from the nearest mark. */
static double txi_from_marks(const txi_window *w, const int32_t *nearest, double x, double y) {
    const int px = txm_clampi((int)(x + 0.5), 0, w->width - 1);
    const int py = txm_clampi((int)(y + 0.5), 0, w->height - 1);
    const int32_t at = nearest[(size_t)py * (size_t)w->width + (size_t)px];
    const int column = at % w->width, row = at / w->width;
    const double dx = column - x, dy = row - y;
    return at < 0 ? 1e30 : sqrt(dx * dx + dy * dy);
}

/* The target for a texel on face i of the disk. */
static txi_target txi_make_target(const txi_sheet *l, size_t i, uint32_t texel) {
    txi_target t;
    double right[2] = {1, 0}, down[2] = {0, 1}, x, y;
    txi_sheet_texel(l, i, texel, &x, &y);
    txi_texel_steps(l, i, right, down);
    t.texel = texel;
    t.x = txm_float(x);
    t.y = txm_float(y);
    t.axis = txi_unit(right[0], right[1]);
    t.mirrored = right[0] * down[1] - right[1] * down[0] < 0;
    return t;
}

/* Does the window show the target where it is, and not another part of the disk that lies over
   it? */
static int txi_is_shown(const txi_sheet *l, const txi_window *w, size_t i, const txi_target *t) {
    const int x = txm_clampi((int)((double)t->x + 0.5), 0, w->width - 1);
    const int y = txm_clampi((int)((double)t->y + 0.5), 0, w->height - 1);
    const size_t pixel = (size_t)y * (size_t)w->width + (size_t)x;
    if (!l->shown[i] || t->x < 0 || t->y < 0 || t->x > (float)(w->width - 1) ||
        t->y > (float)(w->height - 1))
        return 0;
    if (w->face[pixel] == TXI_NO_FACE || w->face[pixel] == l->disk.faces[i]) return 1;
    const txm_dvec3 p = txm_d3_scale(txm_d3_sub(txi_texel_point(l->d, l->disk.faces[i], t->texel),
                                                l->origin), 1 / l->pixel);
    const txm_vec3 q = w->place[pixel];
    return txm_d3_dist(p, txm_d3(q.x, q.y, q.z)) < 4;
}

/* Collect the targets of the hole: those that lie well away from cuts through it, are hardly
   distorted and not covered; all if that is none. Returns 0 if that is too few and a smaller
   part of the hole should be tried. marks, nearest: scratch, 1 per pixel. */
static int txi_sheet_targets(txi_sheet *l, txi_window *w, uint8_t *marks, int32_t *nearest,
                           txm_status *status) {
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    size_t total = 0, good = 0, bent = 0;
    double deepest = 0;
    memset(marks, 0, pixels);
    const size_t cuts = txi_mark_cuts(l, w, 1, marks);
    if (cuts) *status = txi_nearest(marks, w->width, w->height, l->env, nearest);
    if (*status != TXM_OK) return 1;
    for (size_t i = 0; i < l->disk.face_count; i++) {
        const uint32_t f = l->disk.faces[i];
        size_t count;
        const uint32_t *texels = txi_face_texels(l->s, f, &count);
        if (l->state[f] != TXI_SHEET_GROUP) continue;
        for (size_t k = 0; k < count; k++) {
            if (!l->d->missing[texels[k]]) continue;
            const txi_target t = txi_make_target(l, i, texels[k]);
            w->targets[total++] = t;
            if (cuts) deepest = fmax(deepest, txi_from_marks(w, nearest, t.x, t.y));
        }
    }
    const int margin = l->reach ? (int)TXI_MARGIN : (int)TXI_SEAM;
    const double seam = cuts ? fmin(margin, 0.4 * deepest) : 0;
    size_t at = 0;
    for (size_t i = 0; i < l->disk.face_count; i++) {
        const uint32_t f = l->disk.faces[i];
        if (l->state[f] != TXI_SHEET_GROUP) continue;
        const int is_true = txi_is_true(l, i);
        for (size_t n = txi_missing_count(l->d, f); n > 0; n--) {
            const txi_target t = w->targets[at++];
            const int is_away = !cuts || txi_from_marks(w, nearest, t.x, t.y) >= seam;
            const int is_fine = is_true && txi_is_shown(l, w, i, &t);
            bent += is_away && !is_fine;
            /* the refused ones are swapped behind the others */
            if (!is_away || !is_fine) continue;
            w->targets[at - 1] = w->targets[good];
            w->targets[good++] = t;
        }
    }
    w->target_count = good;
    if (!cuts && (total <= TXI_SMALL_HOLE || 10 * bent <= total)) w->target_count = total;
    if (5 * w->target_count >= 2 * total) return 1;
    if (l->reach != TXI_REACH_LEAST && total > TXI_SMALL_HOLE) return 0;
    if (2 * good < total) w->target_count = total;
    return 1;
}

/* Other holes that lie wholly in the disk, well away from its border, are completed along. */
static txm_status txi_sheet_others(txi_sheet *l, txi_window *w, uint8_t *marks, int32_t *nearest,
                                 size_t room) {
    txi_list hole;
    int ready = 0;
    txm_status status = TXM_OK;
    memset(&hole, 0, sizeof hole);
    for (size_t i = 0; i < l->disk.face_count && status == TXM_OK; i++) {
        const uint32_t f = l->disk.faces[i];
        const size_t before = w->target_count;
        if (!txi_is_hole(l, f) || l->state[f] != TXI_SHEET_HOLE) continue;
        if (!ready) {
            memset(marks, 0, (size_t)w->width * (size_t)w->height);
            txi_mark_cuts(l, w, 0, marks);
            status = txi_nearest(marks, w->width, w->height, l->env, nearest);
            if (status != TXM_OK) return status;
            ready = 1;
        }
        hole.count = 0;
        int good = txi_flood_faces(l, f, TXI_SHEET_TAKEN, &l->disk, &hole);
        if (good < 0) return txi_no_memory(l->env);
        for (size_t k = 0; k < hole.count && good; k++) {
            const uint32_t slot = l->disk.slot[hole.items[k]];
            size_t count;
            const uint32_t *texels = txi_face_texels(l->s, hole.items[k], &count);
            good = txi_is_true(l, slot);
            for (size_t n = 0; n < count && good; n++) {
                if (!l->d->missing[texels[n]]) continue;
                const txi_target t = txi_make_target(l, slot, texels[n]);
                good = w->target_count < room && txi_is_shown(l, w, slot, &t) &&
                       txi_from_marks(w, nearest, t.x, t.y) >= (double)TXI_GAP;
                if (good) w->targets[w->target_count++] = t;
            }
        }
        if (!good) w->target_count = before;
    }
    return status;
}

/* ---- layout: one window ---------------------------------------------------------------------- */

/* The window of a face that cannot be laid out, as neither it nor what is around it has an area:
   its part of the atlas. */
static txm_status txi_sheet_alone(txi_sheet *l, txm_arena *arena, txi_window *w) {
    const txm_vec2 *t = l->s->uv + 3 * (size_t)l->centre;
    size_t count, k = 0;
    double weight[3], x = 0, y = 0;
    const uint32_t *texels = txi_face_texels(l->s, l->centre, &count);
    while (k + 1 < count && !l->d->missing[texels[k]]) k++;
    txi_texel_weights(l->d, l->centre, texels[k], weight);
    for (int i = 0; i < 3; i++) {
        x += weight[i] * t[i].x;
        y += weight[i] * t[i].y;
    }
    /* the window's pixels are texels, the first of the missing ones lies within */
    const double half = 0.5 * (double)TXI_FLAT_SIDE;
    txi_bounds box = {x - half, y - half, x + half, y + half};
    box.left = fmax(box.left, (double)txm_minf(t[0].x, txm_minf(t[1].x, t[2].x)) - 1);
    box.top = fmax(box.top, (double)txm_minf(t[0].y, txm_minf(t[1].y, t[2].y)) - 1);
    box.right = fmin(box.right, (double)txm_maxf(t[0].x, txm_maxf(t[1].x, t[2].x)) + 1);
    box.bottom = fmin(box.bottom, (double)txm_maxf(t[0].y, txm_maxf(t[1].y, t[2].y)) + 1);
    const int left = (int)floor(box.left), top = (int)floor(box.top);
    const int width = (int)ceil(box.right) - left + 1, height = (int)ceil(box.bottom) - top + 1;
    txm_status status = txi_window_alloc(w, width, height, arena, l->env);
    if (status == TXM_OK)
        w->targets = (txi_target *)txm_arena_alloc(arena, count, sizeof(txi_target));
    if (!w->targets) return txi_no_memory(l->env);
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        const int px = left + (int)(i % (size_t)width), py = top + (int)(i / (size_t)width);
        if (!txi_weights(t, px, py, weight)) continue;
        if (weight[0] < -1e-6 || weight[1] < -1e-6 || weight[2] < -1e-6) continue;
        w->state[i] = TXI_KNOWN;
        w->face[i] = l->centre;
        w->texel[i] = txm_v2((float)px, (float)py);
        w->place[i] = txm_v3((float)px, (float)py, 0);
        w->normal[i] = txm_v3(0, 0, 1);
        w->axis[i] = txm_v2(1, 0);
    }
    for (size_t n = 0; n < count; n++) {
        txi_target target;
        if (!l->d->missing[texels[n]]) continue;
        txi_texel_weights(l->d, l->centre, texels[n], weight);
        x = weight[0] * t[0].x + weight[1] * t[1].x + weight[2] * t[2].x - left;
        y = weight[0] * t[0].y + weight[1] * t[1].y + weight[2] * t[2].y - top;
        if (!(x >= 0 && y >= 0 && x <= width - 1 && y <= height - 1)) continue;
        target.texel = texels[n];
        target.x = txm_float(x);
        target.y = txm_float(y);
        target.axis = txm_v2(1, 0);
        target.mirrored = 0;
        TXM_ASSERT(w->target_count < count);
        w->targets[w->target_count++] = target;
    }
    return TXM_OK;
}

/* Lay the disk around l->centre out in the plane. *fits: it is small enough for a window. */
static txm_status txi_sheet_spread(txi_sheet *l, int *fits) {
    txm_status status = txi_disk_init(&l->disk, l->s, l->s->face_count, l->scratch, l->env);
    if (status == TXM_OK) status = txi_sheet_disk(l);
    if (status == TXM_OK) status = txi_sheet_flat(l);
    if (status != TXM_OK) return status;
    l->at = (txm_vec2 *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(txm_vec2));
    l->normal = (txm_vec3 *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(txm_vec3));
    uint32_t *counts = (uint32_t *)txm_arena_alloc(l->scratch, l->s->face_count, sizeof(uint32_t));
    l->shown = (uint8_t *)txm_arena_alloc(l->scratch, l->disk.face_count, 1);
    if (l->scratch->failed) return txi_no_memory(l->env);
    if (!l->is_source) l->origin = l->flat.point[0];
    *fits = txi_sheet_place(l, counts);
    return TXM_OK;
}

/* Lay out the hole with l->reach, in a window of scratch memory. *again: it should be tried
   otherwise. */
static txm_status txi_sheet_try(txi_sheet *l, txi_window *w, int *again) {
    int fits = 0;
    *again = 0;
    txi_find_centre(l);
    txm_status status = txi_sheet_spread(l, &fits);
    if (status != TXM_OK) return status;
    if (!fits) {
        if (l->reach == TXI_REACH_LEAST) return txi_sheet_alone(l, l->scratch, w);
        *again = 1;
        return TXM_OK;
    }
    const size_t pixels = (size_t)l->width * (size_t)l->height;
    size_t room = 0;
    for (size_t i = 0; i < l->disk.face_count; i++)
        room += txi_missing_count(l->d, l->disk.faces[i]);
    uint8_t *marks = (uint8_t *)txm_arena_alloc(l->scratch, pixels, 1);
    int32_t *nearest = (int32_t *)txm_arena_alloc(l->scratch, pixels, sizeof(int32_t));
    status = txi_window_alloc(w, l->width, l->height, l->scratch, l->env);
    if (status == TXM_OK)
        w->targets = (txi_target *)txm_arena_alloc(l->scratch, room, sizeof(txi_target));
    if (l->scratch->failed) return txi_no_memory(l->env);
    txi_sheet_normals(l);
    txi_sheet_pixels(l, w, l->shown);
    *again = !txi_sheet_targets(l, w, marks, nearest, &status);
    if (status == TXM_OK && !*again) status = txi_sheet_others(l, w, marks, nearest, room);
    return status;
}

/* Copy the pixels of one window to another, from column left on. */
static void txi_window_paste(txi_window *to, const txi_window *from, int left) {
    const size_t n = (size_t)from->width;
    for (int y = 0; y < from->height; y++) {
        const size_t a = (size_t)y * n, b = (size_t)y * (size_t)to->width + (size_t)left;
        memcpy(to->state + b, from->state + a, n);
        memcpy(to->color + 4 * b, from->color + 4 * a, 4 * n);
        memcpy(to->share + b, from->share + a, n);
        memcpy(to->texel + b, from->texel + a, n * sizeof *to->texel);
        memcpy(to->place + b, from->place + a, n * sizeof *to->place);
        memcpy(to->normal + b, from->normal + a, n * sizeof *to->normal);
        memcpy(to->axis + b, from->axis + a, n * sizeof *to->axis);
        memcpy(to->mirrored + b, from->mirrored + a, n);
        memcpy(to->face + b, from->face + a, n * sizeof *to->face);
    }
}

/* The window in memory of the arena: a copy, with another beside it unless that is NULL. */
static txm_status txi_window_join(txi_window *w, const txi_window *hole, const txi_window *source,
                                  txm_arena *arena, txm_env *env) {
    const int left = hole->width + TXI_GAP;
    const int width = source ? left + source->width : hole->width;
    const int height = source && source->height > hole->height ? source->height : hole->height;
    const txm_status status = txi_window_alloc(w, width, height, arena, env);
    if (status != TXM_OK) return status;
    w->targets = (txi_target *)txm_arena_alloc(arena, hole->target_count, sizeof(txi_target));
    if (!w->targets) return txi_no_memory(env);
    memcpy(w->targets, hole->targets, hole->target_count * sizeof(txi_target));
    w->target_count = hole->target_count;
    w->spacing = hole->spacing;
    w->origin = hole->origin;
    txi_window_paste(w, hole, 0);
    if (source) txi_window_paste(w, source, left);
    return TXM_OK;
}

/* The face that lies deepest in what may be copied from: farthest from all that may not. 0:
   there is none. */
static int txi_find_source(txi_sheet *l, txm_status *status) {
    const txi_surface *s = l->s;
    uint32_t *sources =
        (uint32_t *)txm_arena_alloc(l->scratch, s->face_count, 3 * sizeof(uint32_t));
    size_t count = 0;
    double deepest = -1;
    if (!sources) {
        *status = txi_no_memory(l->env);
        return 0;
    }
    for (uint32_t f = 0; f < s->face_count; f++) {
        for (uint32_t k = 0; k < 3 && !txi_is_usable_face(l->d, f); k++)
            sources[count++] = s->vertex[3 * f + k];
    }
    *status = txi_geodesic(s, sources, NULL, count, 0.5 * TXI_UNREACHED, l->env, l->from_centre);
    for (uint32_t f = 0; f < s->face_count && *status == TXM_OK; f++) {
        const double depth = txi_mean_of(s, f, l->from_centre);
        if (txi_is_flat_face(s, f) || !txi_is_usable_face(l->d, f) || depth <= deepest) continue;
        deepest = depth;
        l->centre = f;
    }
    return deepest >= 0;
}

/* Lay out a part of what may be copied from that is not around the hole. *found: there is one. */
static txm_status txi_sheet_source(txi_sheet *l, size_t wanted, txi_window *w, int *found) {
    txm_status status = TXM_OK;
    *found = 0;
    l->group.count = l->texels = 0;
    l->is_source = l->slit = 1;
    l->reach = txm_clampi((int)sqrt((double)wanted), TXI_REACH_LEAST, TXI_REACH_MOST);
    if (!txi_find_source(l, &status)) return status;
    for (; status == TXM_OK && !*found && l->reach >= TXI_REACH_LEAST / 2; l->reach /= 2)
        status = txi_sheet_spread(l, found);
    if (status != TXM_OK || !*found) return status;
    status = txi_window_alloc(w, l->width, l->height, l->scratch, l->env);
    if (status != TXM_OK) return status;
    txi_sheet_normals(l);
    txi_sheet_pixels(l, w, l->shown);
    txi_window_colors(l->d, w);
    return TXM_OK;
}

/* The window as the caller gets it: with something to copy from beside it, if around the hole
   there is next to nothing. */
static txm_status txi_sheet_finish(txi_sheet *l, txi_window *hole, txm_arena *arena,
                                   txi_window *w) {
    const size_t pixels = (size_t)hole->width * (size_t)hole->height;
    size_t usable = 0, wanted = TXI_SOURCE_RATIO * hole->target_count;
    txi_window source;
    txm_status status = TXM_OK;
    int found = 0;
    if (wanted < TXI_SOURCE_LEAST) wanted = TXI_SOURCE_LEAST;
    txi_window_colors(l->d, hole);
    for (size_t i = 0; i < pixels; i++) usable += hole->state[i] == TXI_KNOWN;
    if (10 * usable < wanted && l->pixel > 0) status = txi_sheet_source(l, wanted, &source, &found);
    if (status != TXM_OK) return status;
    if (found) { /* if both together are not too large for a window */
        const int height = source.height > hole->height ? source.height : hole->height;
        found = txi_side_fits(hole->width + TXI_GAP + source.width, height);
    }
    return txi_window_join(w, hole, found ? &source : NULL, arena, l->env);
}

/* Lay out the hole of a face: all of it in one window if that can be done; else with cuts
   through it; else a disk at its rim, smaller and smaller until it lies flat enough. */
static txm_status txi_sheet_window(txi_domain *d, uint32_t seed, txm_arena *scratch,
                                   txm_arena *arena, txm_env *env, txi_window *w) {
    const txi_surface *s = d->surface;
    txi_sheet l;
    txi_window hole;
    int again = 1;
    memset(&l, 0, sizeof l);
    l.d = d;
    l.s = s;
    l.env = env;
    l.scratch = scratch;
    l.state = (uint8_t *)txm_arena_zero(scratch, s->face_count, 1);
    l.from_hole = (double *)txm_arena_alloc(scratch, s->vertex_count, sizeof(double));
    l.from_centre = (double *)txm_arena_alloc(scratch, s->vertex_count, sizeof(double));
    l.key = (double *)txm_arena_alloc(scratch, s->face_count, sizeof(double));
    l.size = (double *)txm_arena_alloc(scratch, s->face_count, sizeof(double));
    l.weight = (double *)txm_arena_alloc(scratch, s->face_count, sizeof(double));
    if (scratch->failed) return txi_no_memory(env);
    txm_status status = txi_find_group(&l, seed);
    if (status == TXM_OK && l.texels > TXI_WHOLE_MOST) l.reach = TXI_REACH_MOST;
    while (status == TXM_OK && again) {
        txm_arena inner;
        txm_arena_init(&inner, env);
        l.scratch = &inner;
        if (l.pixel > 0) {
            status = txi_sheet_try(&l, &hole, &again);
        } else {
            again = 0;
            l.centre = seed;
            status = txi_sheet_alone(&l, &inner, &hole);
        }
        if (status == TXM_OK && !again) status = txi_sheet_finish(&l, &hole, arena, w);
        txm_arena_free(&inner);
        if (again && l.slit) {
            l.reach = l.reach ? l.reach / 2 : (int)(0.75 * sqrt((double)l.texels));
            l.reach = txm_clampi(l.reach, TXI_REACH_LEAST, TXI_REACH_MOST);
        }
        l.slit = 1;
    }
    return status;
}

/* Lay out the next window with missing texels: of the first hole, in the order of the texture,
   or of a part of it. found receives 0 if none are left; else the window has one target or more.
   Its memory is the arena's; states and colours are set. */
static txm_status txi_windows_next(txi_domain *d, txm_arena *arena, txm_env *env, txi_window *w,
                                   int *found) {
    txi_surface *s = d->surface;
    const size_t texels = (size_t)d->width * (size_t)d->height;
    txm_arena scratch;
    if (!s) return txi_picture_window(d, arena, env, w, found);
    while (s->cursor < texels && !(d->missing[s->cursor] && d->covered[s->cursor])) s->cursor++;
    *found = s->cursor < texels;
    if (!*found) return TXM_OK;
    txm_arena_init(&scratch, env);
    const txm_status status = txi_sheet_window(d, s->owner[s->cursor], &scratch, arena, env, w);
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_LAYOUT_H */
