#ifndef TEXINPAINT_OFFSET_H
#define TEXINPAINT_OFFSET_H

#include "assemble.h"

/* ---- coherent completion: few offsets, large pieces ---------------------------------------------

   Patterns repeat at few offsets. They are found by matching the known patches around the hole with
   patches elsewhere; the most frequent offsets (in each pose) become labels, and the hole is put
   together from pieces of these [He and Sun 2012].                                             */

enum {
    TXI_OFFSET_WIDTH = 28, /* pixels: least width of the hole at the level where this is done */
    TXI_OFFSETS = 80,      /* labels                                                          */
    TXI_OFFSET_SWEEPS = 6,
    TXI_OFFSET_LEAST = 8, /* pixels: shorter ones are not told from none                     */
    TXI_OFFSET_PASSES = 3
};

/* A level whose anchors are its known patches near the hole, for matching these. */
static int txi_offset_level(const txi_level *l, int reach, txi_level *known, txm_arena *arena) {
    const int w = l->width, n = l->width * l->height;
    *known = *l;
    int low[2] = {INT_MAX, INT_MAX}, high[2] = {0, 0};
    for (int i = 0; i < l->hole_count; i++) {
        const int x = l->hole[i] % w, y = l->hole[i] / w;
        if (x < low[0]) low[0] = x;
        if (y < low[1]) low[1] = y;
        if (x > high[0]) high[0] = x;
        if (y > high[1]) high[1] = y;
    }
    known->slot = (int32_t *)txm_arena_alloc(arena, (size_t)n, sizeof(int32_t));
    known->anchor = (int32_t *)txm_arena_alloc(arena, (size_t)n, sizeof(int32_t));
    known->anchor_row = (int32_t *)txm_arena_alloc(arena, (size_t)l->height + 1, sizeof(int32_t));
    known->filled = (uint8_t *)txm_arena_alloc(arena, (size_t)n, 1);
    known->want = (uint32_t *)txm_arena_zero(arena, (size_t)n, sizeof(uint32_t));
    if (arena->failed) return 0;
    known->anchor_count = 0;
    for (int p = 0; p < n; p++) {
        const int x = p % w, y = p / w;
        if (x == 0) known->anchor_row[y] = known->anchor_count;
        known->slot[p] = -1;
        if (x < low[0] - reach || y < low[1] - reach || x > high[0] + reach ||
            y > high[1] + reach || l->slot[p] >= 0 || x > w - TXI_PATCH ||
            y > l->height - TXI_PATCH)
            continue;
        int all = 1;
        for (int k = 0; all && k < TXI_PATCH_AREA; k++) {
            const uint8_t state = l->state[p + k / TXI_PATCH * w + k % TXI_PATCH];
            all = state == TXI_KNOWN || state == TXI_FOREIGN;
        }
        if (!all) continue;
        known->slot[p] = known->anchor_count;
        known->filled[known->anchor_count] = TXI_PATCH_AREA;
        known->anchor[known->anchor_count++] = p;
    }
    known->anchor_row[l->height] = known->anchor_count;
    return known->anchor_count > 0;
}

/* The most frequent offsets of the matches, counted over squares of 3x3 offsets.
   pairs  room for 2 per anchor                                                                */
static int txi_offset_peaks(const txi_canvas *t, int32_t *labels, int most, txm_arena *arena) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->anchor_count;
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(arena, n, 2 * sizeof(txm_pair));
    txm_pair *peaks = (txm_pair *)txm_arena_alloc(arena, n, 2 * sizeof(txm_pair));
    if (arena->failed) return 0;
    size_t kinds = 0, count = 0;
    for (size_t a = 0; a < n; a++) {
        const txi_match *m = &t->match[a];
        const int p = l->anchor[a];
        pairs[a].value = 1;
        pairs[a].key = m->pose < 0 || m->cost == UINT32_MAX
                           ? UINT32_MAX
                           : (uint32_t)txi_label(m->pose, m->x - p % l->width, m->y - p / l->width);
    }
    txm_sort_pairs(pairs, pairs + n, n);
    for (size_t i = 0; i < n && pairs[i].key != UINT32_MAX; i++) {
        if (kinds && pairs[kinds - 1].key == pairs[i].key) {
            pairs[kinds - 1].value++;
        } else {
            pairs[kinds].key = pairs[i].key;
            pairs[kinds++].value = 1;
        }
    }
    for (size_t i = 0; i < kinds; i++) { /* the sum over 3x3; a peak is the largest of them */
        uint32_t sum = 0;
        int is_peak = 1;
        for (int dx = -1; dx <= 1; dx++) {
            const uint32_t column = pairs[i].key + (uint32_t)(dx * 8192) - 1;
            size_t low = 0, high = kinds;
            while (low < high) {
                const size_t middle = (low + high) / 2;
                if (pairs[middle].key < column) low = middle + 1;
                else high = middle;
            }
            for (; low < kinds && pairs[low].key <= column + 2; low++) {
                sum += pairs[low].value;
                if (pairs[low].value > pairs[i].value ||
                    (low < i && pairs[low].value == pairs[i].value))
                    is_peak = 0;
            }
        }
        if (!is_peak) continue;
        peaks[count].key = UINT32_MAX - sum;
        peaks[count++].value = pairs[i].key;
    }
    txm_sort_pairs(peaks, peaks + n, count);
    if (count > (size_t)most) count = (size_t)most;
    for (size_t k = 0; k < count; k++) labels[k] = (int32_t)peaks[k].value;
    return (int)count;
}

/* The labels' colours, and as the match of each anchor the most frequent label of its patch that
   can be copied. */
static void txi_offset_apply(txi_canvas *t, const txi_assembly *assembly) {
    const txi_level *l = t->level;
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i], x = p % l->width, y = p / l->width;
        const uint8_t *color = txi_label_color(l, assembly->label[p], x, y);
        if (color) memcpy(t->color + 4 * (size_t)p, color, 3);
    }
    for (int a = 0; a < l->anchor_count; a++) {
        const int p = l->anchor[a];
        txi_match best = t->match[a];
        int most = 0;
        for (int k = 0; k < TXI_PATCH_AREA; k++) {
            const int q = p + k / TXI_PATCH * l->width + k % TXI_PATCH;
            const int32_t label = assembly->label[q];
            int same = 0;
            if (label < 0) continue;
            for (int i = k; i < TXI_PATCH_AREA; i++)
                same += assembly->label[p + i / TXI_PATCH * l->width + i % TXI_PATCH] == label;
            if (same <= most) continue;
            txi_match m;
            memset(&m, 0, sizeof m);
            m.pose = (int16_t)(label >> 26);
            m.x = (int16_t)(p % l->width + (label >> 13 & 8191) - TXI_LABEL_BIAS);
            m.y = (int16_t)(p / l->width + (label & 8191) - TXI_LABEL_BIAS);
            if (!txi_match_mend(l, &m)) continue;
            most = same;
            best = m;
        }
        if (!most) best.pose = -1;
        t->match[a] = best;
    }
    t->fresh = 0;
}

/* Fill the canvas' hole from pieces of the level, and set the matches accordingly. */
static txm_status txi_offset_fill(txi_canvas *t, txm_env *env) {
    const txi_level *l = t->level;
    txm_arena scratch;
    txi_level around;
    txi_canvas known;
    txi_assembly assembly;
    int32_t labels[TXI_OFFSETS];
    txm_status status = TXM_OK;
    txm_arena_init(&scratch, env);
    const int width = txi_level_hole_width(l);
    known = *t;
    known.level = &around;
    known.least = TXI_OFFSET_LEAST;
    known.sweep = 0;
    known.fresh = 0;
    if (!txi_offset_level(l, 3 * width / 2, &around, &scratch) ||
        !txi_assembly_make(&assembly, l, &scratch)) {
        const int failed = scratch.failed;
        txm_arena_free(&scratch);
        return failed ? txi_no_memory(env) : TXM_OK;
    }
    known.match =
        (txi_match *)txm_arena_zero(&scratch, (size_t)around.anchor_count, 2 * sizeof(txi_match));
    if (scratch.failed) status = txi_no_memory(env);
    if (status == TXM_OK) {
        known.old = known.match + around.anchor_count;
        for (int a = 0; a < around.anchor_count; a++) known.match[a].pose = -1;
        for (int k = 0; k < TXI_OFFSET_SWEEPS; k++) txi_search(&known, env);
    }
    const int count =
        status == TXM_OK ? txi_offset_peaks(&known, labels, TXI_OFFSETS, &scratch) : 0;
    if (scratch.failed) status = txi_no_memory(env);
    assembly.color = t->color;
    assembly.drift = 0;
    assembly.price = t->price;
    for (int pass = 0, changed = 1; pass < TXI_OFFSET_PASSES && changed && status == TXM_OK;
         pass++) {
        changed = 0;
        for (int k = 0; k < count && status == TXM_OK; k++) {
            changed += txi_expand(&assembly, labels[k], -1);
            if (txm_progress(env, 0, "pieces")) status = txi_stopped(env);
        }
    }
    txi_offset_apply(t, &assembly);
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_OFFSET_H */
