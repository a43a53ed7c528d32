#ifndef TEXINPAINT_WINDOW_H
#define TEXINPAINT_WINDOW_H

#include "resample.h"

/* ---- window: parts of plain pictures --------------------------------------------------------- */

enum {
    TXI_BAND_LEAST = 48,       /* pixels around a hole; ours                                   */
    TXI_BAND_MOST = 240,
    TXI_SOURCE_LEAST = 20000,  /* pixels to copy from, if there are any; ours                  */
    TXI_SOURCE_RATIO = 4,      /* ... and times the hole                                       */
    TXI_WINDOW_MOST = 1 << 20, /* pixels of a window; larger holes take several                */
    TXI_WINDOW_GROUP = 400000, /* pixels up to which the windows of near holes are joined      */
    TXI_WINDOW_SIDE = 1000,    /* pixels: side of a window in a hole that is larger            */
    TXI_SIDE_MOST = 4000,      /* pixels: longest diagonal of a window: offsets between places in
                                  it, turned copies included, fit 13 bits (assemble.h), and their
                                  coordinates in 1/65536 pixels an int32_t (pose.h)              */
    TXI_MARGIN = 32            /* pixels: what lies nearer to a cut through a hole is left to the
                                  next window                                                  */
};

/* While a window is laid out, what is missing and has been looked at has one of these marks in
   d->missing, instead of 1. */
enum { TXI_MARK_OURS = 2, TXI_MARK_OTHER = 3 };

typedef struct txi_box {
    int left, top, right, bottom; /* pixels, the last two are one past the end */
} txi_box;

/* numbers of texels; grows */
typedef struct txi_list {
    uint32_t *items;
    size_t count, room;
} txi_list;

static int txi_push(txi_list *list, txm_arena *arena, uint32_t item) {
    if (list->count == list->room) {
        const size_t room = list->room ? 2 * list->room : 1024;
        uint32_t *items = (uint32_t *)txm_arena_alloc(arena, room, sizeof(uint32_t));
        if (!items) return 0;
        if (list->count) memcpy(items, list->items, list->count * sizeof(uint32_t));
        list->items = items;
        list->room = room;
    }
    list->items[list->count++] = item;
    return 1;
}

static size_t txi_box_area(txi_box b) {
    return (size_t)(b.right - b.left) * (size_t)(b.bottom - b.top);
}

/* May a window have these sides? */
static int txi_side_fits(double width, double height) {
    return width * width + height * height <= (double)TXI_SIDE_MOST * (double)TXI_SIDE_MOST;
}
static int txi_box_fits(txi_box b) {
    return txi_side_fits(b.right - b.left, b.bottom - b.top);
}

/* The box with a band around it, within the picture. */
static txi_box txi_box_grow(txi_box b, int band, const txi_domain *d) {
    b.left = b.left > band ? b.left - band : 0;
    b.top = b.top > band ? b.top - band : 0;
    b.right = b.right < d->width - band ? b.right + band : d->width;
    b.bottom = b.bottom < d->height - band ? b.bottom + band : d->height;
    return b;
}

static txi_box txi_box_union(txi_box a, txi_box b) {
    if (b.left < a.left) a.left = b.left;
    if (b.top < a.top) a.top = b.top;
    if (b.right > a.right) a.right = b.right;
    if (b.bottom > a.bottom) a.bottom = b.bottom;
    return a;
}

/* .9 times the diameter of a disk of this area, within limits: how much is laid out around a
   hole */
static int txi_band(size_t area) {
    return txm_clampi((int)(0.9 * 1.13 * sqrt((double)area)), TXI_BAND_LEAST, TXI_BAND_MOST);
}

/* The hole that texel `start` lies in, 8-connected: its texels are added to list and marked. box
   receives its bounding box. 0: no memory. */
static int txi_flood(txi_domain *d, uint32_t start, uint8_t mark, txi_list *list, txm_arena *arena,
                     txi_box *box) {
    const int w = d->width;
    size_t at = list->count;
    if (!txi_push(list, arena, start)) return 0;
    d->missing[start] = mark;
    box->left = box->right = (int)(start % (uint32_t)w);
    box->top = box->bottom = (int)(start / (uint32_t)w);
    for (; at < list->count; at++) {
        const int x = (int)(list->items[at] % (uint32_t)w),
                  y = (int)(list->items[at] / (uint32_t)w);
        const txi_box pixel = {x, y, x, y};
        *box = txi_box_union(*box, pixel);
        for (int k = 0; k < 9; k++) {
            const int nx = x - 1 + k % 3, ny = y - 1 + k / 3;
            const size_t i = (size_t)ny * (size_t)w + (size_t)nx;
            if (nx < 0 || ny < 0 || nx >= w || ny >= d->height || d->missing[i] != 1) continue;
            if (!txi_push(list, arena, (uint32_t)i)) return 0;
            d->missing[i] = mark;
        }
    }
    box->right++;
    box->bottom++;
    return 1;
}

/* The first texel of a hole, in the order of the picture, that has a known neighbour to its left,
   right, above or below; its very first texel if none has. */
static uint32_t txi_rim(const txi_domain *d, const txi_list *hole) {
    const int w = d->width, h = d->height;
    uint32_t first = hole->items[0], best = UINT32_MAX;
    for (size_t k = 0; k < hole->count; k++) {
        const uint32_t i = hole->items[k];
        const int x = (int)(i % (uint32_t)w), y = (int)(i / (uint32_t)w);
        if (i < first) first = i;
        if (i < best && ((x > 0 && !d->missing[i - 1]) || (x + 1 < w && !d->missing[i + 1]) ||
                         (y > 0 && !d->missing[i - (uint32_t)w]) ||
                         (y + 1 < h && !d->missing[i + (uint32_t)w])))
            best = i;
    }
    return best == UINT32_MAX ? first : best;
}

/* Add the holes in a window to ours as long as it does not become too large. box receives the
   bounding box of all. 0: no memory. */
static int txi_gather(txi_domain *d, txi_list *ours, txi_list *others, txm_arena *arena,
                      txi_box *box) {
    for (int grown = 1; grown;) {
        const txi_box window = txi_box_grow(*box, txi_band(ours->count), d);
        grown = 0;
        for (int y = window.top; y < window.bottom && !grown; y++) {
            const size_t row = (size_t)y * (size_t)d->width;
            const uint8_t *at = d->missing + row + window.left,
                          *end = d->missing + row + window.right;
            while (at < end && (at = (const uint8_t *)memchr(at, 1, (size_t)(end - at))) != NULL) {
                const uint32_t start = (uint32_t)(at - d->missing);
                const size_t before = others->count;
                txi_box hole;
                if (!txi_flood(d, start, TXI_MARK_OTHER, others, arena, &hole)) return 0;
                hole = txi_box_union(*box, hole);
                const size_t count = ours->count + others->count - before;
                const txi_box larger = txi_box_grow(hole, txi_band(count), d);
                if (txi_box_area(larger) > TXI_WINDOW_GROUP || !txi_box_fits(larger)) continue;
                for (size_t k = before; k < others->count; k++) {
                    d->missing[others->items[k]] = TXI_MARK_OURS;
                    if (!txi_push(ours, arena, others->items[k])) return 0;
                }
                others->count = before;
                *box = hole;
                grown = 1;
            }
        }
    }
    return 1;
}

/* The window around a hole: with its band, and so much more that there is enough to copy from. */
static txi_box txi_window_box(const txi_domain *d, txi_box hole, size_t area) {
    size_t wanted = area * TXI_SOURCE_RATIO;
    int band = txi_band(area);
    if (wanted < TXI_SOURCE_LEAST) wanted = TXI_SOURCE_LEAST;
    for (;;) {
        const txi_box box = txi_box_grow(hole, band, d);
        size_t usable = 0;
        for (int y = box.top; y < box.bottom; y++) {
            const uint8_t *row = d->usable + (size_t)y * (size_t)d->width;
            for (int x = box.left; x < box.right; x++) usable += row[x] == 1;
        }
        const int next = band + band / 4;
        const txi_box larger = txi_box_grow(hole, next, d);
        if (usable >= wanted || txi_box_area(larger) == txi_box_area(box)) return box;
        if (!txi_box_fits(larger)) return box;
        /* beyond the limit only if there is next to nothing */
        if (txi_box_area(larger) > TXI_WINDOW_MOST && usable >= TXI_SOURCE_LEAST / 64) return box;
        band = next;
    }
}

/* The part of the picture in the box as a window. Targets: the marked texels, but for those within
   margin of the box where it does not end with the picture. */
static txm_status txi_cut_out(const txi_domain *d, txi_box box, int margin, const txi_list *ours,
                              txm_arena *arena, txm_env *env, txi_window *w) {
    const txm_status status =
        txi_window_alloc(w, box.right - box.left, box.bottom - box.top, arena, env);
    if (status != TXM_OK) return status;
    w->spacing = 1;
    w->targets = (txi_target *)txm_arena_alloc(arena, ours->count, sizeof(txi_target));
    if (!w->targets) return txi_no_memory(env);
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            const size_t i = (size_t)y * (size_t)w->width + (size_t)x;
            w->state[i] = TXI_KNOWN;
            w->texel[i] = txm_v2((float)(x + box.left), (float)(y + box.top));
            w->place[i] = txm_v3((float)(x + box.left), (float)(y + box.top), 0);
            w->normal[i] = txm_v3(0, 0, 1);
            w->axis[i] = txm_v2(1, 0);
        }
    }
    const int left = box.left > 0 ? box.left + margin : 0, top = box.top > 0 ? box.top + margin : 0;
    const int right = box.right < d->width ? box.right - margin : d->width;
    const int bottom = box.bottom < d->height ? box.bottom - margin : d->height;
    for (size_t k = 0; k < ours->count; k++) {
        const int x = (int)(ours->items[k] % (uint32_t)d->width);
        const int y = (int)(ours->items[k] / (uint32_t)d->width);
        if (x < left || x >= right || y < top || y >= bottom) continue;
        txi_target *t = &w->targets[w->target_count++];
        t->texel = ours->items[k];
        t->x = (float)(x - box.left);
        t->y = (float)(y - box.top);
        t->axis = txm_v2(1, 0);
        t->mirrored = 0;
    }
    return TXM_OK;
}

/* The next window of a plain picture: the first hole and those near it; of a hole that is too large
   for one window, a part at its rim. */
static txm_status txi_picture_window(txi_domain *d, txm_arena *arena, txm_env *env, txi_window *w,
                                     int *found) {
    const size_t count = (size_t)d->width * (size_t)d->height;
    const uint8_t *first = (const uint8_t *)memchr(d->missing, 1, count);
    txm_status status = TXM_OK;
    txm_arena scratch;
    txi_list ours, others;
    txi_box box = {0, 0, 0, 0}, window = box;
    int margin = 0;
    *found = first != NULL;
    if (!first) return TXM_OK;
    memset(&ours, 0, sizeof ours);
    memset(&others, 0, sizeof others);
    txm_arena_init(&scratch, env);
    if (!txi_flood(d, (uint32_t)(first - d->missing), TXI_MARK_OURS, &ours, &scratch, &box) ||
        !txi_gather(d, &ours, &others, &scratch, &box))
        status = txi_no_memory(env);
    if (status == TXM_OK &&
        (txi_box_area(txi_box_grow(box, TXI_BAND_LEAST, d)) > TXI_WINDOW_MOST ||
         !txi_box_fits(txi_box_grow(box, txi_band(ours.count), d)))) {
        const uint32_t rim = txi_rim(d, &ours);
        const int x = (int)(rim % (uint32_t)d->width), y = (int)(rim / (uint32_t)d->width);
        const txi_box pixel = {x, y, x + 1, y + 1};
        window = txi_box_grow(pixel, TXI_WINDOW_SIDE / 2, d);
        margin = TXI_MARGIN;
    } else if (status == TXM_OK) {
        window = txi_window_box(d, box, ours.count);
    }
    for (size_t k = 0; k < ours.count; k++) d->missing[ours.items[k]] = 1;
    for (size_t k = 0; k < others.count; k++) d->missing[others.items[k]] = 1;
    if (status == TXM_OK) status = txi_cut_out(d, window, margin, &ours, arena, env, w);
    if (status == TXM_OK) txi_window_colors(d, w);
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_WINDOW_H */
