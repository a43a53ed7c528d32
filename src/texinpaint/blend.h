#ifndef TEXINPAINT_BLEND_H
#define TEXINPAINT_BLEND_H

#include "window.h"

/* ---- Poisson blending [1, III.B] -------------------------------------------------------------
   The pixels of a hole are copies; pieces of them meet at seams, and at the rim of the hole they
   meet the known pixels. With v the copied values, a correction c of low frequency makes the jumps
   at seams and rim vanish, and leaves the detail inside of the pieces as it is:

       minimise  sum w(p, q) (c(q) - c(p) + j(p, q))^2 + sum w(p) (v(p) + c(p) - known(p))^2
                 + lambda sum c(p)^2

   over neighbours p, q. Inside of a piece j = 0, w = 1. Across a seam j is what the step v(q) - v(p)
   is more than the mean of the steps at the same places in the two sources; at the rim, where
   c(q) = 0, more than the step in the source of p. A large j is no error of tone but an edge, which
   is not to be smeared (an occluding stroke): w falls with it, to 0 (Tukey's weight).

   Pixels of a window lie between texels. One with missing texels among those around it is a hole, though
   most of it may be known: then known(p) is the colour of that part, and w(p) grows with its share.
   Without this term, what is next to the rim would not be looked at, and the jump at the rim stays. */

enum {
    TXI_BLEND_SWEEPS = 80, /* of successive over-relaxation; see docs/choices.md                  */
    TXI_BLEND_CHUNK = 4096 /* unknowns of one call of the parallel loop                           */
};
#define TXI_BLEND_SCREEN 0.02 /* lambda: corrections fade out within some 7 pixels                */
#define TXI_BLEND_OMEGA 1.7   /* over-relaxation, 1..2                                            */
#define TXI_BLEND_JUMP 0.14   /* of the range of values: 0.8 of the weight across a seam; none from
                                 three times that on                                            */
#define TXI_RIM_JUMP 0.28     /* the same at the rim                                              */
#define TXI_RIM_WEIGHT 1.5    /* w(p, q) of a small jump at the rim; ours                         */
#define TXI_SHARE_LEAST 0.2   /* of a pixel that is known, from which on it counts; ours          */
#define TXI_SHARE_WEIGHT 8.0  /* w(p) of a pixel that is known but for next to nothing; ours      */
#define TXI_SHARE_JUMP 0.45   /* as TXI_RIM_JUMP, for v(p) - known(p)                             */
#define TXI_LAYER_JUMP 0.05   /* the same at the edges and ends of strokes that cross others, which known
                                 strokes may cover there                                         */

/* One map of a window while it is blended. */
typedef struct txi_blend {
    const txi_window *w;
    const txi_copy *copies;
    const txi_pose *poses;
    const float *known; /* channels per window pixel                                             */
    int channels, is_label;
    int is_normal;       /* the first two are a direction in the window                          */
    float low[TXI_MAX_CHANNELS], high[TXI_MAX_CHANNELS]; /* range of the known values            */
    size_t count, reds;  /* unknowns; the first `reds` of them lie on one colour of a chess board */
    int32_t *pixel;      /* window pixel of each unknown                                         */
    int32_t *unknown;    /* of each window pixel, or -1                                          */
    int32_t *side;       /* 4 per unknown: unknown to the right, left, below, above; -1          */
    float *weight;       /* 4 per unknown; 0: none                                               */
    double *diagonal;    /* lambda + sum of weights                                              */
    float *value;        /* channels per unknown: v                                              */
    double *load, *c;    /* channels per unknown                                                 */
    size_t first, last;  /* of a half sweep                                                      */
} txi_blend;

static int txi_is_known(const txi_window *w, int x, int y) {
    if (x < 0 || y < 0 || x >= w->width || y >= w->height) return 0;
    const uint8_t s = w->state[(size_t)y * (size_t)w->width + (size_t)x];
    return s == TXI_KNOWN || s == TXI_FOREIGN;
}

/* The value at a place of the window, from known pixels only. 0: none is known there. */
static int txi_sample(const txi_blend *b, double x, double y, double *values) {
    const double bx = floor(x), by = floor(y);
    double wx[4], wy[4], sum = 0;
    if (!(bx > -4 && by > -4 && bx < b->w->width + 4 && by < b->w->height + 4)) return 0;
    txi_cubic(x - bx, wx);
    txi_cubic(y - by, wy);
    if (b->is_label) { /* the nearest pixel */
        for (int k = 0; k < 4; k++) wx[k] = k == (x - bx < 0.5 ? 1 : 2);
        for (int k = 0; k < 4; k++) wy[k] = k == (y - by < 0.5 ? 1 : 2);
    }
    for (int c = 0; c < b->channels; c++) values[c] = 0;
    for (int k = 0; k < 16; k++) {
        const int px = (int)bx - 1 + k % 4, py = (int)by - 1 + k / 4;
        const double weight = wx[k % 4] * wy[k / 4];
        if (weight == 0 || !txi_is_known(b->w, px, py)) continue;
        const float *from = b->known + ((size_t)py * (size_t)b->w->width + (size_t)px) *
                                           (size_t)b->channels;
        for (int c = 0; c < b->channels; c++) values[c] += weight * (double)from[c];
        sum += weight;
    }
    if (sum < 0.2) return 0;
    for (int c = 0; c < b->channels; c++) values[c] /= sum;
    return 1;
}

/* The value that the source of pixel p has a step (dx, dy) of the target beyond p. */
static int txi_sample_step(const txi_blend *b, int32_t p, int dx, int dy, double *values) {
    const txi_copy *copy = &b->copies[p];
    const txi_pose *pose = &b->poses[copy->pose];
    if (!txi_sample(b, (double)copy->x + dx * (double)pose->a + dy * (double)pose->c,
                    (double)copy->y + dx * (double)pose->b + dy * (double)pose->d, values))
        return 0;
    if (b->is_normal) { /* the piece is turned, and the direction with it */
        const double vx = values[0], vy = values[1];
        values[0] = (double)pose->a * vx + (double)pose->b * vy;
        values[1] = (double)pose->c * vx + (double)pose->d * vy;
    }
    return 1;
}

/* What the step v(q) - v(p) is more than in the source of p (from = 0) or of q (1); q lies a step
   (dx, dy) from p. 0: that source does not go on there. */
static int txi_excess(const txi_blend *b, int32_t p, int32_t q, int dx, int dy, int from,
                      const float *vp, const float *vq, double *excess) {
    double there[TXI_MAX_CHANNELS];
    if (from == 0) {
        if (!txi_sample_step(b, p, dx, dy, there)) return 0;
        for (int c = 0; c < b->channels; c++) excess[c] = (double)vq[c] - there[c];
    } else {
        if (!txi_sample_step(b, q, -dx, -dy, there)) return 0;
        for (int c = 0; c < b->channels; c++) excess[c] = there[c] - (double)vp[c];
    }
    return 1;
}

/* The weight of a jump whose square is so many times that of the allowed one [Tukey]. */
static double txi_blend_weight(double square) {
    return square < 9 ? (1 - square / 9) * (1 - square / 9) : 0;
}

/* Couple unknown i with what is known of its pixel. */
static void txi_blend_share(txi_blend *b, size_t i) {
    const size_t n = (size_t)b->channels, p = (size_t)b->pixel[i];
    const double share = b->w->share ? b->w->share[p] / 255.0 : 0;
    double square = 0;
    if (!(share > TXI_SHARE_LEAST)) return;
    for (size_t c = 0; c < n; c++) {
        const double range = (double)b->high[c] - (double)b->low[c];
        const double jump = ((double)b->known[p * n + c] - (double)b->value[i * n + c]) / TXI_SHARE_JUMP;
        if (range > 0) square += jump * jump / (range * range);
    }
    const double weight = TXI_SHARE_WEIGHT * (share - TXI_SHARE_LEAST) / (1 - TXI_SHARE_LEAST) *
                          txi_blend_weight(square / b->channels);
    b->diagonal[i] += weight;
    for (size_t c = 0; c < n; c++)
        b->load[i * n + c] += weight * ((double)b->known[p * n + c] - (double)b->value[i * n + c]);
}

/* Couple unknown i with the pixel on its side k (right, left, below, above). */
static void txi_blend_link(txi_blend *b, size_t i, int k) {
    static const int dx[4] = {1, -1, 0, 0}, dy[4] = {0, 0, 1, -1};
    const int32_t p = b->pixel[i];
    const int x = p % b->w->width + dx[k], y = p / b->w->width + dy[k];
    double jump[TXI_MAX_CHANNELS] = {0}, other[TXI_MAX_CHANNELS], square = 0, scale;
    const float *vp = b->value + i * (size_t)b->channels, *vq;
    int both = 0;
    b->side[4 * i + (size_t)k] = -1;
    b->weight[4 * i + (size_t)k] = 0;
    if (x < 0 || y < 0 || x >= b->w->width || y >= b->w->height) return;
    const int32_t q = y * b->w->width + x;
    const int32_t j = b->unknown[q];
    if (j < 0 && !txi_is_known(b->w, x, y)) return;
    vq = j < 0 ? b->known + (size_t)q * (size_t)b->channels : b->value + (size_t)j * (size_t)b->channels;
    scale = j < 0 ? TXI_RIM_JUMP : TXI_BLEND_JUMP;
    const int32_t mine_layer = b->copies[p].layer, other_layer = j < 0 ? 0 : b->copies[q].layer;
    if (mine_layer != other_layer) {
        if (mine_layer && other_layer) return; /* one stroke covers the other */
        scale = TXI_LAYER_JUMP;
    }
    if (j < 0 || b->copies[p].piece != b->copies[q].piece) {
        const int mine = txi_excess(b, p, q, dx[k], dy[k], 0, vp, vq, jump);
        both = mine;
        if (j >= 0 && txi_excess(b, p, q, dx[k], dy[k], 1, vp, vq, other)) {
            for (int c = 0; c < b->channels; c++)
                jump[c] = mine ? 0.5 * (jump[c] + other[c]) : other[c];
            both = 1;
        }
        if (!both) { /* neither source goes on: no step at all */
            for (int c = 0; c < b->channels; c++) jump[c] = (double)vq[c] - (double)vp[c];
        }
        for (int c = 0; c < b->channels; c++) {
            const double range = (double)b->high[c] - (double)b->low[c];
            if (range > 0) square += jump[c] * jump[c] / (range * range * scale * scale);
        }
        square /= b->channels;
    }
    const double weight = (j < 0 ? TXI_RIM_WEIGHT : 1) * txi_blend_weight(square);
    b->side[4 * i + (size_t)k] = j;
    b->weight[4 * i + (size_t)k] = txm_float(weight);
    b->diagonal[i] += (double)b->weight[4 * i + (size_t)k];
    for (int c = 0; c < b->channels; c++)
        b->load[i * (size_t)b->channels + (size_t)c] += (double)b->weight[4 * i + (size_t)k] * jump[c];
}

/* body of the parallel loop: v of a chunk of unknowns */
static void txi_blend_values(void *context, int chunk) {
    txi_blend *b = (txi_blend *)context;
    size_t i = (size_t)chunk * TXI_BLEND_CHUNK;
    for (const size_t end = i + TXI_BLEND_CHUNK; i < end && i < b->count; i++) {
        double values[TXI_MAX_CHANNELS] = {0};
        if (!txi_sample_step(b, b->pixel[i], 0, 0, values)) {
            for (int c = 0; c < b->channels; c++)
                values[c] = 0.5 * ((double)b->low[c] + (double)b->high[c]);
        }
        for (int c = 0; c < b->channels; c++)
            b->value[i * (size_t)b->channels + (size_t)c] = txm_float(values[c]);
    }
}

/* body of the parallel loop: the links of a chunk of unknowns */
static void txi_blend_links(void *context, int chunk) {
    txi_blend *b = (txi_blend *)context;
    size_t i = (size_t)chunk * TXI_BLEND_CHUNK;
    for (const size_t end = i + TXI_BLEND_CHUNK; i < end && i < b->count; i++) {
        b->diagonal[i] = TXI_BLEND_SCREEN;
        for (int k = 0; k < 4; k++) txi_blend_link(b, i, k);
        txi_blend_share(b, i);
    }
}

/* body of the parallel loop: a chunk of a half sweep, over unknowns of one colour */
static void txi_blend_sweep(void *context, int chunk) {
    txi_blend *b = (txi_blend *)context;
    const size_t channels = (size_t)b->channels;
    size_t i = b->first + (size_t)chunk * TXI_BLEND_CHUNK;
    for (const size_t end = i + TXI_BLEND_CHUNK; i < end && i < b->last; i++) {
        double *c = b->c + i * channels;
        const double *load = b->load + i * channels;
        const int32_t *side = b->side + 4 * i;
        const float *weight = b->weight + 4 * i;
        for (size_t k = 0; k < channels; k++) {
            double sum = load[k];
            for (int s = 0; s < 4; s++) {
                if (side[s] >= 0)
                    sum += (double)weight[s] * b->c[(size_t)side[s] * channels + k];
            }
            c[k] += TXI_BLEND_OMEGA * (sum / b->diagonal[i] - c[k]);
        }
    }
}

static int txi_chunks(size_t count) {
    return (int)((count + TXI_BLEND_CHUNK - 1) / TXI_BLEND_CHUNK);
}

/* Number the unknowns, those of one colour of the chess board first, and find the range of what is
   known. */
static void txi_blend_number(txi_blend *b) {
    const txi_window *w = b->w;
    for (int c = 0; c < b->channels; c++) {
        b->low[c] = TXI_MOST_SAMPLE;
        b->high[c] = -TXI_MOST_SAMPLE;
    }
    b->count = 0;
    for (int color = 0; color < 2; color++) {
        for (int y = 0; y < w->height; y++) {
            for (int x = (y + color) % 2; x < w->width; x += 2) {
                const int32_t p = y * w->width + x;
                b->unknown[p] = -1;
                if (w->state[p] == TXI_HOLE && b->copies[p].piece >= 0) {
                    b->unknown[p] = (int32_t)b->count;
                    b->pixel[b->count++] = p;
                } else if (txi_is_known(w, x, y)) {
                    for (int c = 0; c < b->channels; c++) {
                        const float v = b->known[(size_t)p * (size_t)b->channels + (size_t)c];
                        b->low[c] = txm_minf(b->low[c], v);
                        b->high[c] = txm_maxf(b->high[c], v);
                    }
                }
            }
        }
        if (color == 0) b->reds = b->count;
    }
}

/* The values of the hole pixels of one map.

   values    channels per window pixel; in: what is known; out: the hole as well
   is_label  values are taken from the nearest source pixel and not corrected
   is_normal the first two channels are a direction in the window: turned with the pieces
   cost      O(hole pixels), some 2 us each                                                    */
static txm_status txi_blend_map(const txi_window *w, const txi_copy *copies, const txi_pose *poses,
                                float *values, int channels, int is_label, int is_normal,
                                txm_env *env) {
    const size_t pixels = (size_t)w->width * (size_t)w->height, n = (size_t)channels;
    size_t holes = 0;
    txi_blend b;
    txm_arena arena;
    txm_arena_init(&arena, env);
    memset(&b, 0, sizeof b);
    for (size_t i = 0; i < pixels; i++) holes += w->state[i] == TXI_HOLE;
    b.w = w;
    b.copies = copies;
    b.poses = poses;
    b.known = values;
    b.channels = channels;
    b.is_label = is_label;
    b.is_normal = is_normal;
    if (holes == 0) return TXM_OK;
    b.unknown = (int32_t *)txm_arena_alloc(&arena, pixels, sizeof *b.unknown);
    b.pixel = (int32_t *)txm_arena_alloc(&arena, holes, sizeof *b.pixel);
    b.side = (int32_t *)txm_arena_alloc(&arena, holes, 4 * sizeof *b.side);
    b.weight = (float *)txm_arena_alloc(&arena, holes, 4 * sizeof *b.weight);
    b.diagonal = (double *)txm_arena_alloc(&arena, holes, sizeof *b.diagonal);
    b.value = (float *)txm_arena_alloc(&arena, holes, n * sizeof *b.value);
    b.load = (double *)txm_arena_zero(&arena, holes, n * sizeof *b.load);
    b.c = (double *)txm_arena_zero(&arena, holes, n * sizeof *b.c);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txi_no_memory(env);
    }
    txi_blend_number(&b);
    txm_parallel_for(env, txi_chunks(b.count), txi_blend_values, &b);
    if (!is_label) txm_parallel_for(env, txi_chunks(b.count), txi_blend_links, &b);
    const int sweeps = is_label || (TXI_LEFT_OUT & TXI_POISSON) != 0 ? 0 : TXI_BLEND_SWEEPS;
    for (int sweep = 0; sweep < sweeps; sweep++) {
        for (int color = 0; color < 2; color++) {
            b.first = color ? b.reds : 0;
            b.last = color ? b.count : b.reds;
            txm_parallel_for(env, txi_chunks(b.last - b.first), txi_blend_sweep, &b);
        }
    }
    for (size_t i = 0; i < b.count; i++) {
        for (size_t c = 0; c < n; c++) {
            const double v = (double)b.value[i * n + c] + b.c[i * n + c];
            values[(size_t)b.pixel[i] * n + c] =
                is_label ? b.value[i * n + c] : txm_clampf(txm_float(v), b.low[c], b.high[c]);
        }
    }
    txm_arena_free(&arena);
    return TXM_OK;
}

#endif /* TEXINPAINT_BLEND_H */
