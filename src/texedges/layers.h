#ifndef TEXEDGES_LAYERS_H
#define TEXEDGES_LAYERS_H

#include "check.h"

/* ---- from a picture to layers ---------------------------------------------------------- */

/* The gray of each pixel, 0..1. 0 = cancelled, -1 = a sample is not finite, 1 = done. */
static int txe_gray(const txm_image *image, float *gray, txe_progress *bar) {
    const int is_color = image->channels >= 3;
    for (int y = 0; y < image->height; y++) {
        for (int x = 0; x < image->width; x++) {
            double g = txm_image_get(image, x, y, 0);
            if (is_color)
                g = 0.2126 * g + 0.7152 * txm_image_get(image, x, y, 1) +
                    0.0722 * txm_image_get(image, x, y, 2);
            if (!txm_is_finite(g)) return -1;
            *gray++ = txm_float(g < 0 ? 0 : g > 1 ? 1 : g);
            if (txe_advance(bar, 1)) return 0;
        }
    }
    return 1;
}

/* Blur with the weights 1 - |d| / (radius + 1), rows then columns; border pixels are repeated
   outwards. scratch: as large as gray. 0 = cancelled. */
static int txe_blur(float *gray, float *scratch, int width, int height, double radius,
                    txe_progress *bar) {
    const int reach = (int)radius;
    double weight[17] = {1}, sum = 0;
    for (int d = 0; d <= reach; d++) {
        weight[d] = 1 - d / (radius + 1);
        sum += d ? 2 * weight[d] : 1;
    }
    for (int pass = 0; pass < 2; pass++) {
        const float *from = pass ? scratch : gray;
        float *to = pass ? gray : scratch;
        const int last = (pass ? height : width) - 1;
        const size_t w = (size_t)width, step = pass ? w : 1;
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++) {
                const int at = pass ? y : x;
                const size_t i = (size_t)y * w + (size_t)x;
                double g = from[i] * weight[0];
                for (int d = 1; d <= reach; d++) {
                    const int back = d < at ? d : at, ahead = d < last - at ? d : last - at;
                    g += weight[d] *
                         ((double)from[i - (size_t)back * step] + from[i + (size_t)ahead * step]);
                }
                to[i] = txm_float(g / sum);
                if (txe_advance(bar, (size_t)reach + 1)) return 0;
            }
        }
    }
    return 1;
}

/* Thresholds that divide count grays into layers of about the same area.

   In a histogram of 256 bins, cut k lies where k / levels of the area is darker, or within a
   quarter of a layer's area of that, where the two bins next to the cut hold least; in a gap, in
   its middle. If one bin holds too much for that, the cut is on its nearer side. 0 = cancelled. */
static int txe_choose_thresholds(const float *gray, size_t count, int levels, float *thresholds,
                                 txe_progress *bar) {
    size_t bins[256], below[257];
    int previous = 0;
    memset(bins, 0, sizeof bins);
    for (size_t i = 0; i < count; i++) {
        bins[(int)((double)gray[i] * 255 + 0.5)]++;
        if (txe_advance(bar, 1)) return 0;
    }
    below[0] = 0;
    for (int b = 0; b < 256; b++) below[b + 1] = below[b] + bins[b];
    for (int k = 1; k < levels; k++) { /* areas are multiplied by 4 levels, to stay whole */
        const uint64_t target = 4 * (uint64_t)k * count, quarter = count;
        const int most = 256 - (levels - k);
        int best = 0;
        uint64_t best_off = 0, best_held = 0;
        for (int cut = previous + 1; cut <= most; cut++) {
            const uint64_t area = 4 * (uint64_t)levels * below[cut];
            const uint64_t held = bins[cut - 1] + bins[cut];
            const uint64_t off = area > target ? area - target : target - area;
            const int is_near = off <= quarter, best_near = best && best_off <= quarter;
            int better = !best || off < best_off;
            if (is_near || best_near)
                better = is_near && (!best_near || held < best_held || (held == best_held && better));
            if (!better) continue;
            best = cut;
            best_off = off;
            best_held = held;
        }
        int end = best;
        while (end < most && below[end + 1] == below[best] &&
               bins[end] + bins[end + 1] == best_held)
            end++;
        previous = best + (end - best) / 2;
        thresholds[k - 1] = txm_float((previous - 0.5) / 255);
    }
    return 1;
}

/* Steps from a pixel to its neighbour across side 0 = top, 1 = right, 2 = bottom, 3 = left. The
   cracks around a pixel are followed clockwise, so that the pixel lies to the right: along the top
   to the right, and so on. */
static const int txe_step_x[4] = {0, 1, 0, -1}, txe_step_y[4] = {-1, 0, 1, 0};

/* Connected pixels of one layer are a region, in a union-find forest; one of its pixels is its
   root. next links the root and the boundary pixels in a ring; swapping one link of each joins two
   rings. */
typedef struct txe_regions {
    int width, height;
    int32_t *parent, *next;
    int32_t *length; /* of the root: cracks of the region's boundary */
    uint8_t *layer;  /* of the root: what the region shows now       */
} txe_regions;

static int32_t txe_root(const txe_regions *r, int32_t p) {
    while (r->parent[p] != p) p = r->parent[p] = r->parent[r->parent[p]];
    return p;
}

/* Unite the regions of two roots; returns the new root. */
static int32_t txe_unite(txe_regions *r, int32_t a, int32_t b) {
    if (b < a) return txe_unite(r, b, a);
    return r->parent[b] = a;
}

/* the pixel across a side of p, -1: none */
static int32_t txe_neighbour(const txe_regions *r, int32_t p, int side) {
    const int x = p % r->width + txe_step_x[side], y = p / r->width + txe_step_y[side];
    if (x < 0 || y < 0 || x >= r->width || y >= r->height) return -1;
    return p + txe_step_x[side] + txe_step_y[side] * r->width;
}

static int txe_regions_make(txe_regions *r, txe_progress *bar) {
    const int32_t count = (int32_t)r->width * r->height;
    for (int32_t p = 0; p < count; p++) {
        r->parent[p] = r->next[p] = p;
        r->length[p] = 0;
        int32_t root = p;
        for (int side = 3; side >= 0; side -= 3) { /* left and above */
            const int32_t q = txe_neighbour(r, p, side);
            if (q < 0 || r->layer[q] != r->layer[p]) continue;
            const int32_t other = txe_root(r, q);
            if (other != root) root = txe_unite(r, root, other);
        }
        if (txe_advance(bar, 2)) return 0;
    }
    for (int32_t p = 0; p < count; p++) {
        const int32_t root = txe_root(r, p);
        int cracks = 0;
        for (int side = 0; side < 4; side++) {
            const int32_t q = txe_neighbour(r, p, side);
            cracks += q < 0 || r->layer[q] != r->layer[p];
        }
        r->length[root] += cracks;
        if (cracks && p != root) {
            r->next[p] = r->next[root];
            r->next[root] = p;
        }
        if (txe_advance(bar, 2)) return 0;
    }
    return 1;
}

/* Give a region to the layer with which it shares most of its boundary (of equals the darkest) and
   unite it with all regions of that layer around it. Returns the new root, -1 if the region is the
   whole picture. Pixels that are no longer on a boundary are removed from the ring. */
static int32_t txe_dissolve(txe_regions *r, int32_t region, size_t *work) {
    int32_t shared[TEXEDGES_MAX_LEVELS];
    memset(shared, 0, sizeof shared);
    for (int32_t before = region, p = region;;) {
        int inner = 1;
        for (int side = 0; side < 4; side++) {
            const int32_t q = txe_neighbour(r, p, side);
            const int32_t other = q < 0 ? region : txe_root(r, q);
            if (other == region) continue;
            inner = 0;
            shared[r->layer[other]]++;
        }
        ++*work;
        if (inner && p != region) r->next[before] = r->next[p];
        else before = p;
        p = r->next[p];
        if (p == region) break;
    }
    int target = 0;
    for (int k = 1; k < TEXEDGES_MAX_LEVELS; k++) {
        if (shared[k] > shared[target]) target = k;
    }
    if (shared[target] == 0) return -1;
    int32_t root = region, length = r->length[region] - 2 * shared[target];
    for (int32_t p = region, after;; p = after) {
        after = r->next[p]; /* pixels that are linked in behind p are skipped */
        for (int side = 0; side < 4; side++) {
            const int32_t q = txe_neighbour(r, p, side);
            const int32_t other = q < 0 ? root : txe_root(r, q);
            if (other == root || r->layer[other] != target) continue;
            const int32_t link = r->next[p];
            r->next[p] = r->next[other];
            r->next[other] = link;
            length += r->length[other];
            root = txe_unite(r, root, other);
        }
        ++*work;
        if (after == region) break;
    }
    r->layer[root] = (uint8_t)target;
    r->length[root] = length;
    return root;
}

/* Dissolve regions until all have a boundary of at least `least` cracks: first those under 8, then
   under 16 and so on, each time in raster order of the roots. There are O(pixels / n) regions of n
   cracks, so all this takes O(pixels log least). 0 = cancelled. */
static int txe_regions_clean(txe_regions *r, int least, txe_progress *bar) {
    const int32_t count = (int32_t)r->width * r->height;
    for (int bound = 4; bound < least;) {
        bound = bound < least / 2 ? 2 * bound : least;
        for (int32_t p = 0; p < count; p++) {
            int32_t region = r->parent[p] == p ? p : -1;
            while (region >= 0 && r->length[region] < bound) {
                size_t work = 0;
                region = txe_dissolve(r, region, &work);
                if (txe_advance(bar, 8 * work)) return 0;
            }
            if (txe_advance(bar, 1)) return 0;
        }
    }
    for (int32_t p = 0; p < count; p++) {
        r->layer[p] = r->layer[txe_root(r, p)];
        if (txe_advance(bar, 1)) return 0;
    }
    return 1;
}

/* The layer of each pixel. is_given: thresholds holds levels - 1 of them, else it receives them.
   to: the progress of the call when this is done. */
static txm_status txe_layers_find(const texedges_desc *desc, int levels, int is_given,
                                  float *thresholds, uint8_t *layer, double to, txe_progress *bar,
                                  txm_arena *arena, txm_env *env) {
    const int width = desc->image.width, height = desc->image.height;
    const size_t count = (size_t)width * (size_t)height;
    const double smooth = desc->smooth;
    float *gray = (float *)txm_arena_alloc(arena, count, sizeof(float));
    float *scratch = smooth > 0 ? (float *)txm_arena_alloc(arena, count, sizeof(float)) : NULL;
    txm_image shown; /* hidden colours are those of visible neighbours */
    if (arena->failed) return txe_no_memory(env);
    const txm_status status = txm_image_bled(&desc->image, 0, arena, env, &shown);
    if (status != TXM_OK) return status;
    txe_stage(bar, "layers", desc->least > 4 ? to / 2 : to, (double)count * (4 + 2 * smooth));
    const int good = txe_gray(&shown, gray, bar);
    if (good < 0)
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "image", "a sample is not finite");
    if (!good || (smooth > 0 && !txe_blur(gray, scratch, width, height, smooth, bar)) ||
        (!is_given && !txe_choose_thresholds(gray, count, levels, thresholds, bar)))
        return txe_stopped(env);
    for (size_t i = 0; i < count; i++) {
        int k = 0;
        while (k < levels - 1 && gray[i] >= thresholds[k]) k++;
        layer[i] = (uint8_t)k;
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    txm_arena_free(arena);
    if (desc->least <= 4) return TXM_OK; /* no boundary is shorter */

    txe_regions r;
    r.width = width;
    r.height = height;
    r.layer = layer;
    r.parent = (int32_t *)txm_arena_alloc(arena, count, 3 * sizeof(int32_t));
    if (!r.parent) return txe_no_memory(env);
    r.next = r.parent + count;
    r.length = r.next + count;
    txe_stage(bar, "regions", to, (double)count * 12);
    if (!txe_regions_make(&r, bar) || !txe_regions_clean(&r, desc->least, bar))
        return txe_stopped(env);
    txm_arena_free(arena);
    return TXM_OK;
}

/* Replace the number of each pixel's layer by its gray. 0 = cancelled. */
static int txe_layers_to_gray(uint8_t *layer, size_t count, int levels, txe_progress *bar) {
    uint8_t gray[TEXEDGES_MAX_LEVELS] = {0};
    for (int k = 0; k < levels; k++)
        gray[k] = (uint8_t)((2 * 255 * k + levels - 1) / (2 * (levels - 1)));
    for (size_t i = 0; i < count; i++) {
        layer[i] = gray[layer[i]];
        if (txe_advance(bar, 1)) return 0;
    }
    return 1;
}

TEXEDGES_API txm_status texedges_layers(const texedges_desc *desc,
                                        const texedges_set *edges, txm_env *env,
                                        const txm_image *layers) {
    txe_progress bar = txe_progress_of(env);
    txm_status status = txe_check_desc(desc, env);
    if (status == TXM_OK) status = txe_check_image(layers, "layers", 1, env);
    if (status == TXM_OK &&
        (layers->width != desc->image.width || layers->height != desc->image.height))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "layers", "must have the size of the image");
    if (status == TXM_OK && (!edges || edges->levels < 2 || edges->levels > TEXEDGES_MAX_LEVELS ||
                             !txe_thresholds_are_good(edges->thresholds, edges->levels)))
        return txm_fail_at(env, TXM_BAD_ARGUMENT, "edges", "is not as texedges_find made it");
    if (status != TXM_OK) return status;

    float thresholds[TEXEDGES_MAX_LEVELS];
    txm_arena map, scratch;
    txm_arena_init(&map, env);
    txm_arena_init(&scratch, env);
    memcpy(thresholds, edges->thresholds, sizeof thresholds);
    const size_t width = (size_t)layers->width;
    uint8_t *layer = (uint8_t *)txm_arena_alloc(&map, width, (size_t)layers->height);
    const int levels = edges->levels;
    const size_t count = width * (size_t)layers->height;
    status = layer ? txe_layers_find(desc, levels, 1, thresholds, layer, 1, &bar, &scratch, env)
                   : txe_no_memory(env);
    if (status == TXM_OK && !txe_layers_to_gray(layer, count, levels, &bar))
        status = txe_stopped(env);
    for (int y = 0; y < layers->height && status == TXM_OK; y++)
        memcpy(txm_image_row(layers, y), layer + (size_t)y * width, width);
    txm_arena_free(&scratch);
    txm_arena_free(&map);
    return status;
}

#endif /* TEXEDGES_LAYERS_H */
