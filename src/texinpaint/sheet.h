#ifndef TEXINPAINT_SHEET_H
#define TEXINPAINT_SHEET_H

#include "flatten.h"
#include "window.h"

/* ---- sheet: a hole and its surroundings, laid out flat --------------------------------------- */

enum {
    TXI_GAP = 24,              /* pixels: holes that are so near are laid out together; ours   */
    TXI_ROUNDS = 6,            /* ... and those near them, so many times                       */
    TXI_SPECKS = 4000,         /* texels: holes of less in all                                 */
    TXI_GROUP_MOST = 150000,   /* pixels of holes that are joined                              */
    TXI_WHOLE_MOST = 300000,   /* pixels of a hole that is tried in one window                 */
    TXI_DISK_MOST = 700000,    /* pixels of a disk                                             */
    TXI_REACH_MOST = 400,      /* pixels: radius of a window at the rim of a larger hole       */
    TXI_REACH_LEAST = 64,      /* ... the smallest that is tried                               */
    TXI_SEAM = 16,             /* pixels: what lies nearer to a cut through the hole is left to the
                                  next window                                                  */
    TXI_FLAT_SIDE = 512,       /* pixels: side of a window of a face that cannot be laid out   */
    TXI_SMALL_HOLE = 400       /* texels: however it is distorted, it is done at once          */
};

/* Faces whose scale differs from 1 by more in any direction are left to the next window. */
#define TXI_STRETCH 1.6

/* A window in the making. Per face or vertex of the surface, all of its memory is scratch. */
typedef struct txi_sheet {
    txi_domain *d;
    const txi_surface *s;
    txm_env *env;
    txm_arena *scratch;
    uint8_t *state;        /* by face: TXI_SHEET_...                                              */
    txi_list group;        /* the faces of the hole that is to be completed                       */
    size_t texels;         /* missing texels of the group                                         */
    double pixel;          /* side of a pixel, in the unit of the surface                         */
    uint32_t centre;       /* face that the disk grows from                                       */
    double *from_hole, *from_centre; /* by vertex: distances                                      */
    double *key, *size, *weight;     /* by face, for txi_growth                                   */
    txi_disk disk;
    txi_flat flat;
    double *rigid;         /* by face of the disk                                                 */
    txm_vec2 *at;          /* by vertex of the disk: where it lies in the window                  */
    uint8_t *shown;        /* by face of the disk: it is in the window                            */
    txm_vec3 *normal;      /* by vertex of the disk                                               */
    int width, height;     /* of the window                                                       */
    int slit;              /* the disk may be slit within the hole                                */
    int reach;             /* pixels around the centre that are laid out; 0: the whole hole       */
    int is_source;         /* not around a hole: only what may be copied from                     */
    txm_dvec3 origin;      /* places are relative to it                                           */
} txi_sheet;

/* what a face of the surface is found to be: known, of a hole, of the hole that is completed, of
   one that is completed along, of one that is left for later */
enum {
    TXI_SHEET_UNSEEN = 0,
    TXI_SHEET_KNOWN,
    TXI_SHEET_HOLE,
    TXI_SHEET_GROUP,
    TXI_SHEET_TAKEN,
    TXI_SHEET_REFUSED
};

/* the missing texels of a face are left[0] .. left[count - 1], among others that are not missing
   any longer */
static const uint32_t *txi_face_texels(const txi_surface *s, uint32_t face, size_t *count) {
    *count = s->hole_first[face + 1] - s->hole_first[face];
    return s->hole + s->hole_first[face];
}

/* Is something missing on a face? Small ones may own no texel: the one at their middle counts. */
static int txi_is_hole(txi_sheet *l, uint32_t face) {
    const txi_domain *d = l->d;
    size_t count;
    if (l->state[face] != TXI_SHEET_UNSEEN) return l->state[face] != TXI_SHEET_KNOWN;
    const uint32_t *texels = txi_face_texels(l->s, face, &count);
    int is_hole = 0;
    for (size_t i = 0; i < count && !is_hole; i++) is_hole = d->missing[texels[i]];
    if (!is_hole) {
        const size_t i = txi_face_texel(d, l->s, face);
        is_hole = d->missing[i] &&
                  (!d->covered[i] || l->s->chart[l->s->owner[i]] == l->s->chart[face]);
    }
    l->state[face] = (uint8_t)(is_hole ? TXI_SHEET_HOLE : TXI_SHEET_KNOWN);
    return is_hole;
}

/* Where texel i lies in a face that owns it, in texels that are not wrapped, and its weights
   there. */
static void txi_texel_weights(const txi_domain *d, uint32_t face, uint32_t texel,
                              double weight[3]) {
    const txm_vec2 *t = d->surface->uv + 3 * (size_t)face;
    const int x = (int)(texel % (uint32_t)d->width), y = (int)(texel / (uint32_t)d->width);
    double least_x = t[0].x, least_y = t[0].y, most_x = t[0].x, most_y = t[0].y, best = -1e300;
    weight[0] = weight[1] = weight[2] = 1.0 / 3;
    for (int k = 1; k < 3; k++) {
        least_x = fmin(least_x, t[k].x);
        least_y = fmin(least_y, t[k].y);
        most_x = fmax(most_x, t[k].x);
        most_y = fmax(most_y, t[k].y);
    }
    const int from_x = (int)ceil((least_x - x - 0.5) / d->width);
    const int from_y = (int)ceil((least_y - y - 0.5) / d->height);
    const int to_x = (int)floor((most_x - x + 0.5) / d->width);
    const int to_y = (int)floor((most_y - y + 0.5) / d->height);
    for (int j = from_y; j <= to_y && best < -1e-5; j++) {
        for (int i = from_x; i <= to_x && best < -1e-5; i++) {
            double w[3];
            if (!txi_weights(t, x + (double)i * d->width, y + (double)j * d->height, w)) return;
            const double least = fmin(w[0], fmin(w[1], w[2]));
            if (least <= best) continue;
            best = least;
            memcpy(weight, w, sizeof w);
        }
    }
}

/* where the texel lies on the surface */
static txm_dvec3 txi_texel_point(const txi_domain *d, uint32_t face, uint32_t texel) {
    double w[3];
    txm_dvec3 p = txm_d3(0, 0, 0);
    txi_texel_weights(d, face, texel, w);
    for (uint32_t k = 0; k < 3; k++)
        p = txm_d3_mad(p, txi_corner_point(d->surface, 3 * face + k), w[k]);
    return p;
}

static size_t txi_missing_count(const txi_domain *d, uint32_t face) {
    size_t count, missing = 0;
    const uint32_t *texels = txi_face_texels(d->surface, face, &count);
    for (size_t i = 0; i < count; i++) missing += d->missing[texels[i]] != 0;
    return missing;
}

/* ---- sheet: the hole ------------------------------------------------------------------------ */

/* Add to list the hole that a face belongs to, connected across sides; its faces get this state.
   Faces outside the disk, if there is one, end it: 0. -1: no memory. */
static int txi_flood_faces(txi_sheet *l, uint32_t face, uint8_t state, const txi_disk *disk,
                           txi_list *list) {
    size_t at = list->count;
    int inside = 1;
    if (!txi_push(list, l->scratch, face)) return -1;
    l->state[face] = state;
    for (; at < list->count; at++) {
        const uint32_t f = list->items[at];
        if (disk && disk->slot[f] == TXI_NO_FACE) inside = 0;
        for (uint32_t k = 0; k < 3 && inside; k++) {
            const uint32_t o = l->s->opposite[3 * f + k];
            if (o == TXM_NO_SIDE || !txi_is_hole(l, o / 3) || l->state[o / 3] != TXI_SHEET_HOLE)
                continue;
            if (!txi_push(list, l->scratch, o / 3)) return -1;
            l->state[o / 3] = state;
        }
    }
    return inside;
}

/* The side of a pixel: that of a texel in the hole, in the mean. 0 if it has no area. */
static void txi_measure(txi_sheet *l) {
    double area = 0;
    l->texels = 0;
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        const size_t missing = txi_missing_count(l->d, f);
        const txm_vec2 *t = l->s->uv + 3 * (size_t)f;
        if (!missing) continue;
        area += (double)missing * txm_d3_len(txi_face_area2(l->s, f)) /
                fabs(txi_cross2(t[0], t[1], t[2]));
        l->texels += missing;
    }
    l->pixel = l->texels ? sqrt(area / (double)l->texels) : 0;
}

/* Distances of the vertices from the missing texels of the group. */
static txm_status txi_measure_from_hole(txi_sheet *l, double limit) {
    const size_t count = 3 * l->group.count;
    for (size_t v = 0; v < l->s->vertex_count; v++) l->from_hole[v] = TXI_UNREACHED;
    if (!count) return TXM_OK;
    uint32_t *sources = (uint32_t *)txm_arena_alloc(l->scratch, count, sizeof(uint32_t));
    double *start = (double *)txm_arena_alloc(l->scratch, count, sizeof(double));
    if (!sources || !start) return txi_no_memory(l->env);
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        size_t texels;
        const uint32_t *texel = txi_face_texels(l->s, f, &texels);
        double *least = start + 3 * i;
        least[0] = least[1] = least[2] = TXI_UNREACHED;
        for (size_t k = 0; k < texels; k++) {
            if (!l->d->missing[texel[k]]) continue;
            const txm_dvec3 p = txi_texel_point(l->d, f, texel[k]);
            for (uint32_t c = 0; c < 3; c++)
                least[c] = fmin(least[c], txm_d3_dist(p, txi_corner_point(l->s, 3 * f + c)));
        }
        for (uint32_t c = 0; c < 3; c++) {
            sources[3 * i + c] = l->s->vertex[3 * f + c];
            if (least[c] >= TXI_UNREACHED) least[c] = 0; /* a face without texels */
        }
    }
    return txi_geodesic(l->s, sources, start, count, limit, l->env, l->from_hole);
}

/* The first hole, and those within TXI_GAP of it or of one another. */
static txm_status txi_find_group(txi_sheet *l, uint32_t seed) {
    txm_status status = TXM_OK;
    txi_is_hole(l, seed);
    if (txi_flood_faces(l, seed, TXI_SHEET_GROUP, NULL, &l->group) < 0)
        return txi_no_memory(l->env);
    txi_measure(l);
    for (int round = 0, grown = 1; round < TXI_ROUNDS && grown && l->pixel > 0; round++) {
        /* small groups are joined with holes that are twice as far away */
        const int gap = l->texels < TXI_SPECKS ? 2 * TXI_GAP : TXI_GAP;
        grown = 0;
        status = txi_measure_from_hole(l, gap * l->pixel);
        for (uint32_t v = 0; v < l->s->vertex_count && status == TXM_OK; v++) {
            if (l->from_hole[v] >= TXI_UNREACHED) continue;
            for (uint32_t i = l->s->first[v]; i < l->s->first[v + 1]; i++) {
                const uint32_t f = l->s->corners[i] / 3;
                const size_t before = l->group.count;
                if (!txi_is_hole(l, f) || l->state[f] != TXI_SHEET_HOLE) continue;
                if (txi_flood_faces(l, f, TXI_SHEET_GROUP, NULL, &l->group) < 0)
                    return txi_no_memory(l->env);
                size_t more = l->texels;
                for (size_t k = before; k < l->group.count; k++)
                    more += txi_missing_count(l->d, l->group.items[k]);
                if (more > TXI_GROUP_MOST) { /* too large: left to a later window */
                    for (size_t k = before; k < l->group.count; k++)
                        l->state[l->group.items[k]] = TXI_SHEET_REFUSED;
                    l->group.count = before;
                    continue;
                }
                l->texels = more;
                grown = 1;
            }
        }
        if (status != TXM_OK) return status;
        txi_measure(l);
    }
    return TXM_OK;
}

/* The face that the disk grows from: in the middle of the hole, or, if only a part of it is laid
   out, at its rim. */
static void txi_find_centre(txi_sheet *l) {
    txm_dvec3 middle = txm_d3(0, 0, 0);
    double count = 0, least = 0;
    int found = 0;
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        const double n = (double)txi_missing_count(l->d, f);
        for (uint32_t k = 0; k < 3; k++)
            middle = txm_d3_mad(middle, txi_corner_point(l->s, 3 * f + k), n / 3);
        count += n;
    }
    middle = txm_d3_scale(middle, 1 / count);
    for (size_t i = 0; i < l->group.count; i++) {
        const uint32_t f = l->group.items[i];
        txm_dvec3 p = txm_d3(0, 0, 0);
        int is_rim = 0;
        if (!txi_missing_count(l->d, f)) continue;
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t o = l->s->opposite[3 * f + k];
            p = txm_d3_mad(p, txi_corner_point(l->s, 3 * f + k), 1.0 / 3);
            is_rim |= o != TXM_NO_SIDE && !txi_is_hole(l, o / 3);
        }
        const double apart = l->reach ? (is_rim ? 0 : 1) : txm_d3_dist2(p, middle);
        if (found && apart >= least) continue;
        found = 1;
        least = apart;
        l->centre = f;
    }
}

/* ---- sheet: the disk ------------------------------------------------------------------------ */

/* Is the middle of a face texture that may be copied? */
static int txi_is_usable_face(const txi_domain *d, uint32_t face) {
    return d->usable[txi_face_texel(d, d->surface, face)];
}

static double txi_mean_of(const txi_surface *s, uint32_t face, const double *value) {
    const uint32_t *v = s->vertex + 3 * (size_t)face;
    return (value[v[0]] + value[v[1]] + value[v[2]]) / 3;
}
static double txi_least_of(const txi_surface *s, uint32_t face, const double *value) {
    const uint32_t *v = s->vertex + 3 * (size_t)face;
    return fmin(value[v[0]], fmin(value[v[1]], value[v[2]]));
}

/* Grow the disk: the hole from its centre, then what is known around it; or everything around
   the centre up to l->reach. */
static txm_status txi_sheet_disk(txi_sheet *l) {
    const txi_surface *s = l->s;
    const double pixel = l->pixel, band = txi_band(l->texels) * pixel;
    txi_growth g;
    double start[3], extent = 0;
    const txm_dvec3 a = txi_corner_point(s, 3 * l->centre);
    const txm_dvec3 b = txi_corner_point(s, 3 * l->centre + 1),
                    c = txi_corner_point(s, 3 * l->centre + 2);
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(txm_d3_add(a, b), c), 1.0 / 3);
    start[0] = txm_d3_dist(a, middle);
    start[1] = txm_d3_dist(b, middle);
    start[2] = txm_d3_dist(c, middle);
    for (size_t i = 0; i < 3 * l->group.count; i++) {
        const uint32_t corner = 3 * l->group.items[i / 3] + (uint32_t)(i % 3);
        extent = fmax(extent, txm_d3_dist(middle, txi_corner_point(s, corner)));
    }
    const double limit = l->reach ? 1.5 * l->reach * pixel : 2 * extent + pixel;
    txm_status status = txi_geodesic(s, s->vertex + 3 * (size_t)l->centre, start, 3, limit, l->env,
                                     l->from_centre);
    if (status == TXM_OK) status = txi_measure_from_hole(l, 4 * band);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < s->vertex_count; v++) {
        if (l->from_centre[v] >= TXI_UNREACHED)
            l->from_centre[v] = limit + txm_d3_dist(s->point[v], middle);
        l->from_hole[v] = fmin(l->from_hole[v], 4 * band);
    }
    const double outside = 4 * (limit + extent); /* above all keys of the hole's faces */
    for (uint32_t f = 0; f < s->face_count; f++) {
        const int is_group = l->state[f] == TXI_SHEET_GROUP;
        l->weight[f] = txm_d3_len(txi_face_area2(s, f)) / (2 * pixel * pixel);
        l->size[f] = !is_group && txi_is_usable_face(l->d, f) ? l->weight[f] : 0;
        if (l->is_source && !txi_is_usable_face(l->d, f)) {
            l->key[f] = TXI_UNREACHED;
            continue;
        }
        l->key[f] = l->reach || is_group ? txi_mean_of(s, f, l->from_centre)
                                         : outside + txi_least_of(s, f, l->from_hole);
    }
    const double wanted = 1.5 * (double)l->texels;
    g.key = l->key;
    g.size = l->size;
    g.weight = l->weight;
    g.most = TXI_DISK_MOST;
    g.stop_least = l->reach ? l->reach * pixel : outside + band;
    g.stop = l->reach ? l->reach * pixel : outside + 3 * band;
    g.wanted = l->reach ? 1e300 : wanted > 8000 ? wanted : 8000;
    l->disk.depth = l->slit ? l->from_centre : l->from_hole;
    l->disk.slit_from = (double)(l->slit ? TXI_GAP : TXI_SEAM) * pixel;
    return txi_disk_grow(&l->disk, s, l->centre, &g, l->env);
}

/* Lay the disk out. The hole is kept rigid, what is known gives way the more the farther it is. */
static txm_status txi_sheet_flat(txi_sheet *l) {
    const size_t faces = l->disk.face_count;
    uint32_t *number =
        (uint32_t *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(uint32_t));
    txm_dvec3 *point =
        (txm_dvec3 *)txm_arena_alloc(l->scratch, l->disk.vertex_count, sizeof(txm_dvec3));
    l->rigid = (double *)txm_arena_alloc(l->scratch, faces, sizeof(double));
    if (!number || !point || !l->rigid) return txi_no_memory(l->env);
    txi_disk_finish(&l->disk, l->s, number, point);
    for (size_t i = 0; i < faces; i++) {
        const uint32_t f = l->disk.faces[i];
        const double apart = txi_mean_of(l->s, f, l->from_hole) / (40 * l->pixel);
        l->rigid[i] = 1;
        if (!l->reach && l->state[f] != TXI_SHEET_GROUP)
            l->rigid[i] = 0.02 + 0.98 * txm_exp2(-fmin(apart * apart, 100) * TXI_LOG2_E);
    }
    txm_status status = txi_flat_init(&l->flat, l->s, &l->disk, point, l->scratch, l->env);
    if (status == TXM_OK) status = txi_flatten(&l->flat, l->rigid, 0.02 * l->pixel, l->env);
    return status;
}

/* The step in the window, y downwards, for a step of one texel to the right and one down, on
   face i of the disk. 0: the face has no area in the atlas. */
static int txi_texel_steps(const txi_sheet *l, size_t i, double right[2], double down[2]) {
    const txm_vec2 *t = l->s->uv + 3 * (size_t)l->disk.faces[i];
    const uint32_t *c = l->disk.corner + 3 * i;
    const double area = txi_cross2(t[0], t[1], t[2]);
    if (!(fabs(area) > 1e-12)) return 0;
    const double u1 = (double)t[1].x - t[0].x, v1 = (double)t[1].y - t[0].y;
    const double u2 = (double)t[2].x - t[0].x, v2 = (double)t[2].y - t[0].y;
    for (int axis = 0; axis < 2; axis++) {
        const double p0 = axis ? l->at[c[0]].y : l->at[c[0]].x;
        const double p1 = (axis ? l->at[c[1]].y : l->at[c[1]].x) - p0;
        const double p2 = (axis ? l->at[c[2]].y : l->at[c[2]].x) - p0;
        right[axis] = (p1 * v2 - p2 * v1) / area;
        down[axis] = (p2 * u1 - p1 * u2) / area;
    }
    return 1;
}

/* The chart that has most of the missing texels. */
static uint32_t txi_main_chart(const txi_sheet *l, uint32_t *counts) {
    uint32_t best = l->s->chart[l->centre];
    memset(counts, 0, l->s->face_count * sizeof *counts);
    for (size_t i = 0; i < l->group.count; i++)
        counts[l->s->chart[l->group.items[i]]] +=
            (uint32_t)txi_missing_count(l->d, l->group.items[i]);
    for (uint32_t c = 0; c < l->s->face_count; c++) {
        if (counts[c] > counts[best]) best = c;
    }
    return best;
}

/* A box of places in the window. */
typedef struct txi_bounds {
    double left, top, right, bottom;
} txi_bounds;

static void txi_bounds_add(txi_bounds *b, double x, double y) {
    b->left = fmin(b->left, x);
    b->top = fmin(b->top, y);
    b->right = fmax(b->right, x);
    b->bottom = fmax(b->bottom, y);
}

/* Where a texel lies in the window, on face i of the disk. */
static void txi_sheet_texel(const txi_sheet *l, size_t i, uint32_t texel, double *x, double *y) {
    double w[3];
    *x = *y = 0;
    txi_texel_weights(l->d, l->disk.faces[i], texel, w);
    for (size_t k = 0; k < 3; k++) {
        *x += w[k] * l->at[l->disk.corner[3 * i + k]].x;
        *y += w[k] * l->at[l->disk.corner[3 * i + k]].y;
    }
}

/* What the window should show: the disk, but not more than three bands around the missing
   texels, as faces may be much larger than the hole. */
static txi_bounds txi_sheet_bounds(const txi_sheet *l) {
    txi_bounds all = {1e300, 1e300, -1e300, -1e300}, hole = all;
    const double wide = 3 * txi_band(l->texels);
    for (size_t i = 0; i < l->disk.face_count; i++) {
        size_t count;
        const uint32_t *texels = txi_face_texels(l->s, l->disk.faces[i], &count);
        for (size_t k = 0; k < 3; k++) {
            const txm_vec2 p = l->at[l->disk.corner[3 * i + k]];
            txi_bounds_add(&all, p.x, p.y);
        }
        if (l->state[l->disk.faces[i]] != TXI_SHEET_GROUP) continue;
        for (size_t k = 0; k < count; k++) {
            double x, y;
            if (!l->d->missing[texels[k]]) continue;
            txi_sheet_texel(l, i, texels[k], &x, &y);
            txi_bounds_add(&hole, x, y);
        }
    }
    if (hole.left > hole.right) return all;
    all.left = fmax(all.left, hole.left - wide);
    all.top = fmax(all.top, hole.top - wide);
    all.right = fmin(all.right, hole.right + wide);
    all.bottom = fmin(all.bottom, hole.bottom + wide);
    return all;
}

/* Place the disk in the window: pixels as large as texels of the hole, turned and moved so that
   on the main chart texels and pixels coincide as well as they can, so that little is lost by
   interpolation. 0: it is not finite, or too large for a window. */
static int txi_sheet_place(txi_sheet *l, uint32_t *counts) {
    const txi_disk *disk = &l->disk;
    const uint32_t chart = txi_main_chart(l, counts);
    double c = 0, s = 0, off[2] = {0, 0};
    int64_t reference = -1;
    for (size_t v = 0; v < disk->vertex_count; v++) {
        const double x = l->flat.xy[2 * v] / l->pixel, y = -l->flat.xy[2 * v + 1] / l->pixel;
        if (!(fabs(x) < 1e6 && fabs(y) < 1e6)) return 0;
        l->at[v] = txm_v2(txm_float(x), txm_float(y));
    }
    for (size_t i = 0; i < disk->face_count; i++) {
        double u[2], v[2];
        const double n = l->is_source ? l->weight[disk->faces[i]]
                                      : (double)txi_missing_count(l->d, disk->faces[i]);
        if (l->s->chart[disk->faces[i]] != chart || !(n > 0) || !txi_texel_steps(l, i, u, v))
            continue;
        c += n * u[0];
        s += n * u[1];
        if (reference < 0 && !l->is_source) reference = (int64_t)i;
    }
    const double length = sqrt(c * c + s * s);
    c = length > 0 ? c / length : 1;
    s = length > 0 ? s / length : 0;
    for (size_t v = 0; v < disk->vertex_count; v++) {
        const double x = c * l->at[v].x + s * l->at[v].y, y = c * l->at[v].y - s * l->at[v].x;
        l->at[v] = txm_v2(txm_float(x), txm_float(y));
    }
    const txi_bounds box = txi_sheet_bounds(l);
    if (!txi_side_fits(box.right - box.left + 4, box.bottom - box.top + 4) ||
        (box.right - box.left + 4) * (box.bottom - box.top + 4) > (double)TXI_WINDOW_MOST)
        return 0;
    if (reference >= 0) { /* a missing texel of it comes to lie on a pixel */
        size_t count, k = 0;
        const uint32_t *texels = txi_face_texels(l->s, disk->faces[reference], &count);
        while (k + 1 < count && !l->d->missing[texels[k]]) k++;
        txi_sheet_texel(l, (size_t)reference, texels[k], &off[0], &off[1]);
    }
    off[0] += floor(box.left - off[0]) - 1;
    off[1] += floor(box.top - off[1]) - 1;
    for (size_t v = 0; v < disk->vertex_count; v++)
        l->at[v] = txm_v2(txm_float(l->at[v].x - off[0]), txm_float(l->at[v].y - off[1]));
    l->width = (int)(box.right - off[0]) + 3;
    l->height = (int)(box.bottom - off[1]) + 3;
    return 1;
}

#endif /* TEXINPAINT_SHEET_H */
