#ifndef TEXINPAINT_POSE_H
#define TEXINPAINT_POSE_H

#include "detail.h"

/* ---- sources: the window turned and mirrored --------------------------------------------------

   Patches are copied from turned copies of the window, too. They are made beforehand, as pictures
   of their own: then the neighbour of a copied patch is again one pixel further, and distances are
   taken between rows of bytes.                                                                */

enum {
    TXI_UNIT = 1 << 16,    /* of txi_source: one pixel                                         */
    TXI_PHASES = 64,       /* per pixel, of the interpolation                                  */
    TXI_MESH_POSES = 16,   /* angles over the full circle                                      */
    TXI_PICTURE_POSES = 14 /* 9 angles within +-20 degrees, 5 within +-10 degrees mirrored     */
};

/* The pose's axes. Pose 0 is the window as it is. */
static void txi_pose_axes(int is_picture, int pose, txi_source *s) {
    /* in 1/16 turns, or degrees; poses that are near pose 0 come first */
    static const int degrees[TXI_PICTURE_POSES] = {0,  5,   -5, 10, -10, 15, -15,
                                                   20, -20, 0,  5,  -5,  10, -10};
    static const int turns[TXI_MESH_POSES] = {0, 1, 15, 2, 14, 3, 13, 4, 12, 5, 11, 6, 10, 7, 9, 8};
    double sine, cosine;
    txm_sincos(is_picture ? degrees[pose] * (TXM_PI / 180) : turns[pose] * (TXM_PI / 8), &sine,
               &cosine);
    const int32_t u = (int32_t)floor(cosine * (double)TXI_UNIT + 0.5);
    const int32_t v = (int32_t)floor(sine * (double)TXI_UNIT + 0.5);
    const int mirrored = is_picture && pose >= 9;
    s->a = mirrored ? -u : u;
    s->b = mirrored ? -v : v;
    s->c = -v;
    s->d = u;
}

/* the place of the source's pixel (i, j) in its level, 1/65536 pixels */
static void txi_source_place(const txi_source *s, int i, int j, int32_t *x, int32_t *y) {
    *x = s->x + s->a * i + s->c * j;
    *y = s->y + s->b * i + s->d * j;
}

/* the source's pixel nearest to a place of its level; may lie outside */
static void txi_source_pixel(const txi_source *s, int32_t x, int32_t y, int *i, int *j) {
    const int64_t dx = (int64_t)x - s->x, dy = (int64_t)y - s->y, one = (int64_t)1 << 32;
    const int64_t u = s->a * dx + s->b * dy, v = s->c * dx + s->d * dy;
    *i = (int)((u + one / 2 + (one << 14)) / one - (1 << 14)); /* floor, also of negatives */
    *j = (int)((v + one / 2 + (one << 14)) / one - (1 << 14));
}

/* Size and place of a source of a level: the level's inner part lies in it. */
static void txi_source_size(txi_source *s, const txi_level *l) {
    int64_t low[2] = {INT64_MAX, INT64_MAX}, high[2] = {INT64_MIN, INT64_MIN};
    const int32_t cx = l->width / 2 * TXI_UNIT, cy = l->height / 2 * TXI_UNIT;
    for (int k = 0; k < 4; k++) {
        const int64_t dx = (int64_t)(k & 1 ? l->width - TXI_EDGE - 1 : TXI_EDGE) * TXI_UNIT - cx;
        const int64_t dy = (int64_t)(k & 2 ? l->height - TXI_EDGE - 1 : TXI_EDGE) * TXI_UNIT - cy;
        const int64_t at[2] = {s->a * dx + s->b * dy, s->c * dx + s->d * dy};
        for (int i = 0; i < 2; i++) {
            if (at[i] < low[i]) low[i] = at[i];
            if (at[i] > high[i]) high[i] = at[i];
        }
    }
    /* whole pixels from the centre, so that turns by right angles resample nothing */
    const int64_t one = (int64_t)1 << 32, bias = one << 14;
    const int i0 = (int)((low[0] + one - 1 + bias) / one - (1 << 14));
    const int j0 = (int)((low[1] + one - 1 + bias) / one - (1 << 14));
    s->width = (int)((high[0] + bias) / one - (1 << 14)) - i0 + 1;
    s->height = (int)((high[1] + bias) / one - (1 << 14)) - j0 + 1;
    s->x = cx + s->a * i0 + s->c * j0;
    s->y = cy + s->b * i0 + s->d * j0;
}

/* weights of the four taps of Catmull-Rom interpolation at k / 64, in 1/1024 */
static void txi_cubic_weights(int k, int *w) {
    /* (-t^3 + 2 t^2 - t) / 2, (3 t^3 - 5 t^2 + 2) / 2, ..., t = k / 64, in 1/2^19, then rounded */
    const int t = k, tt = t * t, ttt = tt * t;
    w[0] = (-ttt + 2 * 64 * tt - 4096 * t) / 512;
    w[2] = (-3 * ttt + 4 * 64 * tt + 4096 * t) / 512;
    w[3] = (ttt - 64 * tt) / 512;
    w[1] = 1024 - w[0] - w[2] - w[3];
}

/* The level's colour at a place, by taps taps a direction. */
static void txi_level_sample(const txi_level *l, size_t p, int fx, int fy, int taps, uint8_t *out) {
    int wx[4], wy[4];
    const size_t pitch = 4 * (size_t)l->width;
    if (taps == TXI_TAP_CUBIC) {
        txi_cubic_weights(fx, wx);
        txi_cubic_weights(fy, wy);
    } else {
        wx[0] = wx[3] = wy[0] = wy[3] = 0;
        wx[2] = fx * (1024 / TXI_PHASES);
        wy[2] = fy * (1024 / TXI_PHASES);
        wx[1] = 1024 - wx[2];
        wy[1] = 1024 - wy[2];
    }
    int sum[3] = {0, 0, 0};
    const uint8_t *row = l->color + 4 * p - pitch - 4;
    for (int y = 0; y < 4; y++, row += pitch) {
        for (int c = 0; c < 3; c++) {
            const int line =
                row[c] * wx[0] + row[4 + c] * wx[1] + row[8 + c] * wx[2] + row[12 + c] * wx[3];
            sum[c] += line / 16 * wy[y];
        }
    }
    for (int c = 0; c < 3; c++)
        out[c] = (uint8_t)txm_clampi((sum[c] + (1 << 15)) / (1 << 16), 0, 255);
}

/* Make the picture of a source. */
static void txi_source_draw(const txi_level *l, txi_source *s) {
    for (int j = 0; j < s->height; j++) {
        for (int i = 0; i < s->width; i++) {
            const size_t q = (size_t)j * (size_t)s->width + (size_t)i;
            int32_t x, y;
            txi_source_place(s, i, j, &x, &y);
            x += TXI_UNIT / TXI_PHASES / 2; /* rounded to a phase */
            y += TXI_UNIT / TXI_PHASES / 2;
            s->usable[q] = 0;
            memset(s->color + 4 * q, 0, 4);
            if (x < 0 || y < 0) continue;
            const int px = x / TXI_UNIT, py = y / TXI_UNIT;
            if (px < TXI_EDGE || py < TXI_EDGE || px >= l->width - TXI_EDGE ||
                py >= l->height - TXI_EDGE)
                continue;
            const size_t p = (size_t)py * (size_t)l->width + (size_t)px;
            const int fx = x % TXI_UNIT / (TXI_UNIT / TXI_PHASES);
            const int fy = y % TXI_UNIT / (TXI_UNIT / TXI_PHASES);
            const int taps = l->taps[p];
            if (taps == TXI_TAP_NONE || ((fx || fy) && taps == TXI_TAP_ONE)) continue;
            s->usable[q] = 1;
            if (fx || fy) txi_level_sample(l, p, fx, fy, taps, s->color + 4 * q);
            else memcpy(s->color + 4 * q, l->color + 4 * p, 3);
        }
    }
}

/* Detail of the source's patches, and which may be copied. numbers: 2 per pixel. */
static void txi_source_worth(const txi_level *l, txi_source *s, uint32_t *numbers,
                             int32_t *columns) {
    const size_t n = (size_t)s->width * (size_t)s->height;
    uint32_t *e = numbers, *sums = numbers + n;
    txi_detail(s->color, s->usable, s->width, s->height, columns, e);
    for (size_t q = 0; q < n; q++) { /* the number of usable pixels goes into the high bits */
        const uint64_t limited = e[q] < l->clamp ? e[q] : l->clamp;
        e[q] = (uint32_t)(limited * TXI_WORTH_MOST / l->clamp / TXI_PATCH_AREA);
        if (s->usable[q]) e[q] += 1u << 20;
    }
    txi_patch_sums(e, s->width, s->height, (uint32_t *)(void *)columns, sums);
    for (size_t q = 0; q < n; q++)
        s->worth[q] =
            (uint16_t)(sums[q] >> 20 == TXI_PATCH_AREA
                           ? 1 + ((sums[q] & 0xfffff) < 65534 ? (sums[q] & 0xfffff) : 65534)
                           : 0);
}

/* One source per call of the body. Each has its own scratch memory, allocated before. */
typedef struct txi_sources_task {
    txi_level *level;
    int pose[TXI_MAX_POSES];
    uint32_t *numbers[TXI_MAX_POSES];
    int32_t *columns[TXI_MAX_POSES];
} txi_sources_task;

static void txi_sources_body(void *context, int index) {
    const txi_sources_task *t = (const txi_sources_task *)context;
    txi_source *s = &t->level->source[t->pose[index]];
    txi_source_draw(t->level, s);
    txi_source_worth(t->level, s, t->numbers[index], t->columns[index]);
}

/* Make those sources of a level whose wanted[pose] is not 0 and that are not there yet. */
static int txi_level_sources(txi_level *l, int is_picture, int pose_count, const uint8_t *wanted,
                             txm_arena *arena, txm_env *env) {
    txi_sources_task task;
    txm_arena scratch;
    int count = 0;
    txm_arena_init(&scratch, env);
    memset(&task, 0, sizeof task);
    task.level = l;
    for (int pose = 0; pose < pose_count; pose++) {
        txi_source *s = &l->source[pose];
        if (!wanted[pose] || s->color) continue;
        txi_pose_axes(is_picture, pose, s);
        txi_source_size(s, l);
        const size_t n = (size_t)s->width * (size_t)s->height;
        s->color = (uint8_t *)txm_arena_alloc(arena, n, 4);
        s->usable = (uint8_t *)txm_arena_alloc(arena, n, 1);
        s->worth = (uint16_t *)txm_arena_alloc(arena, n, sizeof(uint16_t));
        TXM_ASSERT(count < TXI_MAX_POSES);
        task.pose[count] = pose;
        task.numbers[count] = (uint32_t *)txm_arena_alloc(&scratch, n, 2 * sizeof(uint32_t));
        task.columns[count++] =
            (int32_t *)txm_arena_alloc(&scratch, (size_t)s->width, 4 * sizeof(int32_t));
        l->built[l->built_count++] = pose;
    }
    const int ok = !arena->failed && !scratch.failed;
    if (ok) txm_parallel_for(env, count, txi_sources_body, &task);
    for (int k = 0; k < count && !ok; k++) { /* as before, for another try */
        l->source[task.pose[k]].color = NULL;
        l->built_count--;
    }
    txm_arena_free(&scratch);
    return ok;
}

/* patches that may be copied from a source */
static int txi_source_patches(const txi_source *s) {
    int count = 0;
    const size_t n = (size_t)s->width * (size_t)s->height;
    for (size_t q = 0; q < n; q++) count += s->worth[q] != 0;
    return count;
}

#endif /* TEXINPAINT_POSE_H */
