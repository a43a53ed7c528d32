#ifndef TEXSYN_SEGMENT_H
#define TEXSYN_SEGMENT_H

#include "labels.h"
#include "mask.h"

/* ---- segmentation -------------------------------------------------------------------------

   See the picture, name its textons, find regions, decide which of them are one texture, draw the
   boundaries. */

enum {
    TXS_SMALL = 50,         /* a texture covers at least such a part of the picture    */
    TXS_LEAST_COUNTED = 256 /* pixels that must take part                              */
};

/* progress at the end of each stage, by the time it takes */
#define TXS_AT_TEXTONS 0.1f
#define TXS_AT_REGIONS 0.5f
#define TXS_AT_LABELS 0.65f
#define TXS_AT_END 0.95f

typedef struct txs_segmenter {
    const texsyn_segment_desc *desc;
    txm_env *env;
    txm_arena arena;
    txs_scene scene;
    txs_blocks blocks;
    txs_region_set regions;
    txs_partition partition;
    txs_refiner refiner;
    uint32_t *nearest; /* of each pixel of the scene the counted one nearest to it */
    uint8_t *mask;     /* of each pixel of the picture; NULL: all take part         */
} txs_segmenter;

/* Steps to the nearest counted pixel, by two passes; its index for each pixel. */
static void txs_find_nearest(const txs_scene *s, uint32_t *nearest, uint16_t *steps) {
    static const int before[4][2] = {{-1, 0}, {0, -1}, {-1, -1}, {1, -1}};
    const ptrdiff_t w = s->width;
    for (size_t i = 0; i < s->pixels; i++) {
        nearest[i] = (uint32_t)i;
        steps[i] = s->counted[i] ? 0 : UINT16_MAX;
    }
    for (int pass = 0; pass < 4; pass++) { /* the second pair for what lies in a shadow */
        const int sign = pass & 1 ? -1 : 1;
        for (size_t n = 0; n < s->pixels; n++) {
            const size_t i = pass & 1 ? s->pixels - 1 - n : n;
            const int x = (int)(i % (size_t)w), y = (int)(i / (size_t)w);
            for (int k = 0; k < 4; k++) {
                const int u = x + sign * before[k][0], v = y + sign * before[k][1];
                if (u < 0 || u >= s->width || v < 0 || v >= s->height) continue;
                const size_t j = (size_t)(v * w + u);
                if (steps[j] + 1 >= steps[i]) continue;
                steps[i] = (uint16_t)(steps[j] + 1);
                nearest[i] = nearest[j];
            }
        }
    }
}

static txm_status txs_no_memory_to_segment(txm_env *env) {
    return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the segmentation");
}

typedef struct txs_reducer {
    txs_scene *scene;
    txm_image image;
    const uint8_t *mask;
    const txs_colours *tables;
} txs_reducer;

static void txs_reduce_rows(void *context, int share) {
    const txs_reducer *r = (const txs_reducer *)context;
    txs_scene *s = r->scene;
    const int from = (int)((int64_t)s->height * share / TXS_TASKS);
    const int to = (int)((int64_t)s->height * (share + 1) / TXS_TASKS);
    for (int y = from; y < to; y++)
        for (int x = 0; x < s->width; x++) txs_reduce(s, &r->image, r->mask, r->tables, x, y);
}

/* Do enough pixels take part? */
static txm_status txs_check_counted(const txs_segmenter *g, txm_image image) {
    const txs_scene *s = &g->scene;
    size_t whole = 0, counted = 0;
    for (size_t i = 0; i < s->pixels; i++) whole += s->counted[i];
    for (int y = 0; y < image.height && counted < TXS_LEAST_COUNTED; y++)
        for (int x = 0; x < image.width; x++)
            counted += (size_t)txs_takes_part(&image, g->mask, x, y);
    if (counted >= TXS_LEAST_COUNTED && whole > 0) return TXM_OK;
    return txm_fail(g->env, TXM_TOO_SMALL,
                    "fewer than 256 pixels (16 x 16) take part, by mask and alpha");
}

static txm_status txs_see_scene(txs_segmenter *g) {
    txs_scene *s = &g->scene;
    const txm_image *im = &g->desc->image;
    txm_arena arena;
    txm_status status = TXM_OK;
    s->factor = 1;
    while (((int64_t)im->width + s->factor - 1) / s->factor *
               (((int64_t)im->height + s->factor - 1) / s->factor) >
           TXS_WORK)
        s->factor++;
    s->width = (im->width + s->factor - 1) / s->factor;
    s->height = (im->height + s->factor - 1) / s->factor;
    s->pixels = (size_t)s->width * (size_t)s->height;
    s->counted = (uint8_t *)txm_arena_alloc(&g->arena, s->pixels, 3);
    s->lab[0] = (int16_t *)txm_arena_alloc(&g->arena, s->pixels, 3 * sizeof(int16_t));
    g->nearest = (uint32_t *)txm_arena_alloc(&g->arena, s->pixels, sizeof(uint32_t));
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    s->colour = s->counted + s->pixels;
    s->shape = s->colour + s->pixels;
    memset(s->colour, 0, 2 * s->pixels);
    s->lab[1] = s->lab[0] + s->pixels;
    s->lab[2] = s->lab[1] + s->pixels;

    txm_arena_init(&arena, g->env);
    txs_colours *tables = (txs_colours *)txm_arena_alloc(&arena, 1, sizeof *tables);
    uint16_t *steps = (uint16_t *)txm_arena_alloc(&arena, s->pixels, sizeof *steps);
    if (arena.failed) {
        status = txs_no_memory_to_segment(g->env);
    } else {
        txs_colour_tables(tables);
        txs_reducer r = {s, txm_image_resolve(*im), g->mask, tables};
        txm_parallel_for(g->env, TXS_TASKS, txs_reduce_rows, &r);
        status = txs_check_counted(g, r.image);
    }
    if (status == TXM_OK) {
        txs_find_nearest(s, g->nearest, steps);
        for (size_t i = 0; i < s->pixels; i++)
            for (int c = 0; c < 3; c++) s->lab[c][i] = s->lab[c][g->nearest[i]];
    }
    txm_arena_free(&arena);
    return status;
}

static txm_status txs_make_textons(txs_segmenter *g) {
    txs_scene *s = &g->scene;
    txm_arena arena;
    txs_features f;
    memset(&f, 0, sizeof f);
    f.scene = s;
    txm_arena_init(&arena, g->env);
    const int longest = s->width > s->height ? s->width : s->height;
    const int room = longest + 64 * (1 << (TXS_SCALES - 1));
    int16_t *lines = (int16_t *)txm_arena_alloc(&arena, (size_t)room, TXS_TASKS * sizeof *lines);
    int16_t *planes = (int16_t *)txm_arena_alloc(&arena, s->pixels, 5 * sizeof *planes);
    int8_t *answers = (int8_t *)txm_arena_alloc(&arena, s->pixels, TXS_FILTERS);
    int *samples = (int *)txm_arena_alloc(&arena, TXS_TRAINING, TXS_MOST_AXES * sizeof *samples);
    int64_t *far_ = (int64_t *)txm_arena_alloc(&arena, TXS_TRAINING, sizeof *far_);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txs_no_memory_to_segment(g->env);
    }
    for (int c = 0; c < 3; c++) {
        f.smooth[c] = planes + (size_t)c * s->pixels;
        memcpy(f.smooth[c], s->lab[c], s->pixels * sizeof(int16_t));
        txs_blur_plane(s, f.smooth[c], 1, lines, room, g->env);
    }
    int16_t *light = planes + 3 * s->pixels, *raw = planes + 4 * s->pixels;
    memcpy(light, f.smooth[0], s->pixels * sizeof(int16_t));
    for (int k = 0; k < TXS_FILTERS; k++) {
        f.answers[k] = answers + (size_t)k * s->pixels;
        if (k && k % 3 == 0) txs_blur_plane(s, light, 1 << k / 3, lines, room, g->env);
        txs_run_filter(s, light, k % 3, 1 << k / 3, raw, f.answers[k], lines, room, g->env);
    }
    txs_find_textons(&f, samples, far_, g->desc->seed);
    txm_parallel_for(g->env, TXS_TASKS, txs_name_textons, &f);
    txm_arena_free(&arena);
    return TXM_OK;
}

static txm_status txs_make_regions(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_blocks *b = &g->blocks;
    txs_region_set *r = &g->regions;
    const int side = s->width < s->height ? s->width : s->height;
    b->size = txm_clampi(side / TXS_BLOCKS_ACROSS, TXS_SMALLEST_BLOCK, TXS_BLOCK);
    for (;; b->size++) { /* a long strip has more of them */
        b->width = (s->width + b->size - 1) / b->size;
        b->height = (s->height + b->size - 1) / b->size;
        b->count = b->width * b->height;
        if (b->count <= TXS_MOST_BLOCKS) break;
    }
    const size_t n = (size_t)b->count;
    r->words = (b->count + 63) / 64;
    const size_t row = sizeof(uint16_t) * TXS_BINS_OF_BLOCK;
    b->sums = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_zero(&g->arena, n, row);
    b->wide = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_zero(&g->arena, n, row);
    b->clear = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_zero(&g->arena, n, row);
    b->weight = (int *)txm_arena_zero(&g->arena, n, sizeof(int));
    b->log_table = (int32_t *)txm_arena_alloc(&g->arena, 2 * TXS_BLOCK_TOTAL + 1, sizeof(int32_t));
    r->of = (int *)txm_arena_alloc(&g->arena, n, sizeof(int));
    r->sum = (uint64_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, 4 * row);
    r->mean = (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, row);
    r->area = (int64_t *)txm_arena_alloc(&g->arena, n, sizeof(int64_t));
    r->touches = (uint64_t *)txm_arena_zero(&g->arena, n, sizeof(uint64_t) * (size_t)r->words);
    r->partner = (int *)txm_arena_alloc(&g->arena, n, sizeof(int));
    r->cost = (int64_t *)txm_arena_alloc(&g->arena, n, sizeof(int64_t));
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    r->blocks = b;
    txs_log_table(b->log_table);
    txs_count_blocks(s, b);
    for (int y = 0; y < b->height; y++)
        for (int x = 0; x < b->width; x++) txs_widen(b, x, y);
    txs_clear_mixtures(b, r->partner);
    txs_first_regions(r);
    txs_join_neighbours(r, TXS_PIECES);
    return TXM_OK;
}

/* Every region a group of its own: raw histograms, distances, boundaries. */
static void txs_first_groups(txs_segmenter *g, uint64_t (*sum)[TXS_BINS_OF_BLOCK],
                             uint16_t (*mean)[TXS_BINS_OF_BLOCK]) {
    const txs_blocks *b = &g->blocks;
    const txs_region_set *r = &g->regions;
    txs_partition *p = &g->partition;
    const size_t square = (size_t)p->regions * (size_t)p->regions;
    p->count = p->regions;
    memset(p->border, 0, square * sizeof *p->border);
    memset(p->area, 0, (size_t)p->regions * sizeof *p->area);
    memset(sum, 0, (size_t)p->regions * sizeof *sum);
    for (int k = 0; k < b->count; k++) {
        const int a = r->of[k], beside[2] = {k % b->width ? k - 1 : -1, k - b->width};
        if (a < 0) continue;
        for (int i = 0; i < TXS_BINS_OF_BLOCK; i++) sum[a][i] += b->sums[k][i];
        p->area[a] += b->weight[k];
        for (int i = 0; i < 2; i++) {
            const int c = beside[i] < 0 ? -1 : r->of[beside[i]];
            if (c < 0 || c == a) continue;
            ++*txs_border_at(p, a, c);
            ++*txs_border_at(p, c, a);
        }
    }
    for (int a = 0; a < p->regions; a++) {
        txs_normalise_bins(sum[a], mean[a]);
        p->group[a] = a;
    }
    for (int a = 0; a < p->regions; a++)
        for (int c = 0; c < p->regions; c++)
            *txs_unlike_at(p, a, c) = txs_unlike(b->log_table, mean[a], mean[c]);
}

/* Regions are numbered in the order of their names. */
static void txs_number_regions(txs_region_set *r) {
    const int blocks = r->blocks->count;
    int *number = r->partner, next = 0; /* partners are not needed any more */
    for (int k = 0; k < blocks; k++)
        if (r->of[k] == k) number[k] = next++;
    TEXSYN_ASSERT(next == r->count);
    for (int k = 0; k < blocks; k++)
        if (r->of[k] >= 0) r->of[k] = number[r->of[k]];
}

/* Which regions are one texture? */
static txm_status txs_group_regions(txs_segmenter *g) {
    txs_partition *p = &g->partition;
    const size_t n = (size_t)g->regions.count;
    const int forced = g->desc->segments;
    p->regions = g->regions.count;
    p->block = g->blocks.size;
    p->unlike = (int *)txm_arena_alloc(&g->arena, n * n, 2 * sizeof(int));
    p->area = (int64_t *)txm_arena_alloc(&g->arena, n, sizeof(int64_t));
    p->group = (int *)txm_arena_alloc(&g->arena, n, sizeof(int));
    uint64_t(*sum)[TXS_BINS_OF_BLOCK] =
        (uint64_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, sizeof *sum);
    uint16_t(*mean)[TXS_BINS_OF_BLOCK] =
        (uint16_t(*)[TXS_BINS_OF_BLOCK])txm_arena_alloc(&g->arena, n, sizeof *mean);
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    p->border = p->unlike + n * n;
    txs_number_regions(&g->regions);
    txs_first_groups(g, sum, mean);
    if (forced) {
        if (forced > p->count)
            return txm_fail_numbers(g->env, TXM_TOO_SMALL,
                                    "segments: the picture has only # regions; ask for fewer",
                                    (uint64_t)p->count, 0);
        txs_find_cliques(p, &txs_strict, forced, forced);
        return TXM_OK;
    }
    int64_t all = 0;
    for (int a = 0; a < p->regions; a++) all += p->area[a];
    txs_find_cliques(p, &txs_strict, 1, TXS_MOST_LABELS);
    txs_join_least(p, all / TXS_SMALL);
    if (p->count > 1) return TXM_OK;
    txs_first_groups(g, sum, mean); /* one texture; or several that are not very unlike? */
    txs_find_cliques(p, &txs_fine, 1, TXS_MOST_LABELS);
    txs_join_least(p, all / TXS_SMALL);
    return TXM_OK;
}

/* Each block's label to its pixels. */
static void txs_spread_labels(const txs_segmenter *g, uint8_t *label) {
    const txs_scene *s = &g->scene;
    const txs_blocks *b = &g->blocks;
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const int region = g->regions.of[y / b->size * b->width + x / b->size];
            label[(size_t)y * (size_t)s->width + (size_t)x] =
                (uint8_t)(region < 0 ? 0 : g->partition.group[region]);
        }
    }
}

/* Has each label a pixel that takes part? */
static int txs_all_labels_live(const txs_refiner *r) {
    const txs_scene *s = r->scene;
    size_t area[TXS_MOST_LABELS] = {0};
    for (size_t i = 0; i < s->pixels; i++) area[r->label[i]] += s->counted[i];
    for (int k = 0; k < r->count; k++)
        if (!area[k]) return 0;
    return 1;
}

static txm_status txs_find_labels(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_refiner *r = &g->refiner;
    r->scene = s;
    r->count = g->partition.count;
    TEXSYN_ASSERT(r->count >= 1 && r->count <= TXS_MOST_LABELS);
    const size_t n = (size_t)r->count;
    r->label = (uint8_t *)txm_arena_alloc(&g->arena, s->pixels, 1);
    r->colour_cost = (int32_t *)txm_arena_alloc(&g->arena, n, TXS_COLOURS * sizeof(int32_t));
    r->shape_cost = (int32_t *)txm_arena_alloc(&g->arena, n, TXS_GRAINS * sizeof(int32_t));
    r->cost = (int16_t *)txm_arena_alloc(&g->arena, s->pixels, n * sizeof(int16_t));
    r->share = (uint8_t *)txm_arena_alloc(&g->arena, s->pixels, n);
    r->work = (int32_t *)txm_arena_alloc(&g->arena, (size_t)s->width, 2 * n * sizeof(int32_t));
    r->counted_around = (uint16_t *)txm_arena_alloc(&g->arena, s->pixels, sizeof(uint16_t));
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    txs_spread_labels(g, r->label);
    if (r->count < 2) return TXM_OK;
    const txm_status status = txs_refine_labels(r, g->env, TXS_AT_LABELS, TXS_AT_END);
    if (status == TXM_OK && g->desc->segments && !txs_all_labels_live(r))
        txs_spread_labels(g, r->label); /* rather coarse boundaries than a label less */
    return status;
}

/* Specks and, if wanted, transitions; then labels also where nothing counts. */
static txm_status txs_tidy_labels(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_refiner *r = &g->refiner;
    const int wants = g->desc->transition;
    const int transition = wants ? (int)TEXSYN_TRANSITION : -1;
    const txs_cleaner cleaner = {s->width, s->height, r->label, r->share,
                                 (uint32_t *)txm_arena_alloc(&g->arena, s->pixels, 4)};
    if (g->arena.failed) return txs_no_memory_to_segment(g->env);
    if (wants && r->count > 1) {
        r->reach = TXS_REACH;
        txs_count_around(r);
        for (int k = 0; k < r->count; k++) txs_mark_thin(r, k, TEXSYN_TRANSITION);
    }
    for (size_t i = 0; i < s->pixels; i++) r->label[i] = r->label[g->nearest[i]];
    txs_clean_labels(&cleaner, s->pixels / TXS_SPECK, transition);
    return TXM_OK;
}

/* Labels by area, the largest 0; without those that no pixel has. */
static int txs_order_labels(txs_segmenter *g) {
    const txs_scene *s = &g->scene;
    txs_refiner *r = &g->refiner;
    size_t area[256] = {0};
    uint8_t name[256] = {0};
    int count = 0;
    for (size_t i = 0; i < s->pixels; i++) area[r->label[i]] += s->counted[i];
    for (;; count++) {
        int best = -1;
        for (int c = 0; c < r->count; c++)
            if (area[c] && (best < 0 || area[c] > area[best])) best = c;
        if (best < 0) break;
        name[best] = (uint8_t)count;
        area[best] = 0;
    }
    name[TEXSYN_TRANSITION] = TEXSYN_TRANSITION;
    for (size_t i = 0; i < s->pixels; i++) r->label[i] = name[r->label[i]];
    return count;
}

typedef struct txs_writer {
    const txs_segmenter *job;
    const txm_image *out;
} txs_writer;

static void txs_write_labels(void *context, int share) {
    const txs_writer *w = (const txs_writer *)context;
    const txs_scene *s = &w->job->scene;
    const txm_image im = txm_image_resolve(w->job->desc->image), *out = w->out;
    const uint8_t *mask = w->job->mask;
    const int from = (int)((int64_t)out->height * share / TXS_TASKS);
    const int to = (int)((int64_t)out->height * (share + 1) / TXS_TASKS);
    for (int y = from; y < to; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(out, y);
        for (int x = 0; x < out->width; x++)
            row[x] = txs_takes_part(&im, mask, x, y) ? txs_vote(s, w->job->refiner.label, x, y)
                                                      : (uint8_t)TEXSYN_NO_LABEL;
    }
}

/* ---- public: segmentation ------------------------------------------------------------------ */

static txm_status txs_segment_check(const texsyn_segment_desc *d, const txm_image *out,
                                    const int *count, txm_env *env) {
    txm_status status;
    if (!d || !count) return txm_fail(env, TXM_BAD_ARGUMENT, "segment: desc or count is NULL");
    if ((status = txm_image_check(&d->image, "image", TEXSYN_MAX_PIXELS, env)) != TXM_OK)
        return status;
    if (d->image.channels == 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "image: 2 channels; give 1, 3 or 4");
    if (d->image.width < 16 || d->image.height < 16)
        return txm_fail(env, TXM_TOO_SMALL, "image: both sides must be at least 16 pixels");
    if (!txs_image_is_moderate(&d->image))
        return txm_fail(env, TXM_BAD_ARGUMENT, "image: a sample is NaN or beyond a million");
    if ((status = txs_check_mask(&d->mask, &d->image, "mask", env)) != TXM_OK) return status;
    if (d->segments < 0 || d->segments > TEXSYN_MAX_SEGMENTS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "segments must be 1 to 16, or 0");
    if ((status = txm_image_check(out, "out", 0, env)) != TXM_OK) return status;
    if (out->width != d->image.width || out->height != d->image.height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must be as large as the image");
    if (out->channels > 1 || out->sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: must have one 8-bit channel");
    return TXM_OK;
}

static txm_status txs_report_stage(const txs_segmenter *g, float fraction, const char *stage) {
    return txm_progress(g->env, fraction, stage) ? txm_fail(g->env, TXM_CANCELLED, "cancelled")
                                                 : TXM_OK;
}

TEXSYN_API txm_status texsyn_segment(const texsyn_segment_desc *desc, txm_env *env, txm_image out,
                                     int *count) {
    txm_status status = txs_segment_check(desc, &out, count, env);
    if (status != TXM_OK) return status;
    txs_segmenter g;
    memset(&g, 0, sizeof g);
    g.desc = desc;
    g.env = env;
    txm_arena_init(&g.arena, env);
    status = txs_read_mask(&desc->mask, &g.arena, &g.mask, env);
    if (status == TXM_OK) status = txs_see_scene(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_TEXTONS, "textons");
    if (status == TXM_OK) status = txs_make_textons(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_REGIONS, "regions");
    if (status == TXM_OK) status = txs_make_regions(&g);
    if (status == TXM_OK) status = txs_group_regions(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_LABELS, "labels");
    if (status == TXM_OK) status = txs_find_labels(&g);
    if (status == TXM_OK) status = txs_tidy_labels(&g);
    if (status == TXM_OK) status = txs_report_stage(&g, TXS_AT_END, "labels");
    if (status == TXM_OK) {
        const txs_writer writer = {&g, &out};
        *count = txs_order_labels(&g);
        txm_parallel_for(env, TXS_TASKS, txs_write_labels, (void *)&writer);
    }
    txm_arena_free(&g.arena);
    return status;
}

#endif /* TEXSYN_SEGMENT_H */
