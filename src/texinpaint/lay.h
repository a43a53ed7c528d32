#ifndef TEXINPAINT_LAY_H
#define TEXINPAINT_LAY_H

#include "chain.h"

/* ---- laying the strips --------------------------------------------------------------------------
   Each hole pixel near a completed line belongs to the strip of the nearest line, or of the topmost
   stroke that it lies in; it is copied from the strip's source columns.                          */

enum {
    TXI_LAY_CORE = 3,        /* pixels from a line within which its strip counts fully            */
    TXI_LAY_FADE = 8,        /* columns before the end of a line that ends in the hole            */
    TXI_LAY_TONE = 24,       /* levels; larger differences are none of tone, and not evened out   */
    TXI_GUIDE_TOP = 100,     /* guide channel on a line                                          */
    TXI_GUIDE_RADIUS = 5,    /* pixels; beyond, the guide channel is 0                            */
    TXI_GUIDE_STEPS = 16     /* of its table per pixel                                            */
};
#define TXI_GUIDE_SIGMA 1.5 /* pixels                                                             */
#define TXI_LAY_BARE 1.0    /* the same for strokes that cross others: pixels from their edge     */
#define TXI_LAY_EDGE 1.5    /* pixels inside of such a stroke that its edge reaches               */
#define TXI_LAY_CLAIM 0.5   /* pixels from a line that belong to its strip in any case            */

/* ---- cuts and colours between patches ---- */

/* Colour of row j of the patch's source, `offset` columns from its centre. */
static const uint8_t *txi_patch_color(const txi_strip *s, int patch, int offset, int j) {
    const int column = s->chosen[patch] + offset;
    return s->source_color + 3 * ((size_t)column * (size_t)s->rows + (size_t)j);
}

/* Where patch k ends and the next one begins, row by row: a minimum-error cut through the columns
   between their centres. */
static void txi_patch_cut(const txi_strip *s, int k, int *cut) {
    float error[TXI_STRIP_ROWS * TXI_STRIP_HOP];
    double scratch[TXI_STRIP_ROWS * TXI_STRIP_HOP];
    const int width = s->hop > 1 ? s->hop - 1 : 1;
    for (int j = 0; j < s->rows; j++) {
        for (int m = 0; m < width; m++) {
            const uint8_t *a = txi_patch_color(s, k, m + 1, j);
            const uint8_t *b = txi_patch_color(s, k + 1, m + 1 - s->hop, j);
            int sum = 0;
            for (int c = 0; c < 3; c++) sum += (a[c] - b[c]) * (a[c] - b[c]);
            error[j * width + m] = (float)sum;
        }
    }
    txm_cut(error, s->rows, width, width, 1, cut, scratch);
    for (int j = 0; j < s->rows; j++) cut[j] += s->first + k * s->hop + 1;
}

/* What the colours of row j of a patch lack: against the known part (from = 0), or of the next
   patch against this one in their overlap (1). Mean RGB differences into d; returns a weight, 0..1:
   the share of the row that is compared, less for differences that are no matter of tone. */
static double txi_row_difference(const txi_strip *s, int k, int j, int from, double d[3]) {
    int sum[3] = {0, 0, 0}, hits = 0;
    for (int m = from ? s->hop - s->reach : -s->reach; m <= s->reach; m++) {
        const int column = s->first + k * s->hop + m;
        const uint8_t *mine = txi_patch_color(s, k, m, j), *other;
        if (from) {
            other = txi_patch_color(s, k + 1, m - s->hop, j);
        } else {
            if (column < 0 || column >= s->line.count) continue;
            const size_t at = (size_t)column * (size_t)s->rows + (size_t)j;
            if (!s->known[at]) continue;
            other = s->color + 3 * at;
        }
        for (int c = 0; c < 3; c++) sum[c] += from ? mine[c] - other[c] : other[c] - mine[c];
        hits++;
    }
    double square = 0;
    for (int c = 0; c < 3; c++) {
        d[c] = hits ? (double)sum[c] / hits : 0;
        square += d[c] * d[c] / 3;
    }
    const int whole = from ? 2 * s->reach - s->hop + 1 : 2 * s->reach + 1;
    const double tone = square / (TXI_LAY_TONE * TXI_LAY_TONE);
    return (double)hits / whole / (1 + tone * tone);
}

/* What is to be added to the colours of row j in each patch, so that patches meet without a step
   and the ends meet the known part: the offsets e minimise

       sum over k of v(k) (e(k+1) - e(k) - d(k))^2 + w(k) (e(k) - g(k))^2 + 0.001 e(k)^2

   d: mean difference of neighbours in their overlap, g: of the known part; v, w: their weights. The
   matrix has three diagonals and is solved by elimination. e: 4 doubles per patch, RGB and a
   factor. */
static void txi_row_offsets(const txi_strip *s, int j, double *e, float *offsets) {
    const int n = s->node_count;
    double before[3] = {0, 0, 0}, v_before = 0;
    for (int k = 0; k < n; k++) {
        double g[3], d[3] = {0, 0, 0}, v = 0;
        const double w = txi_row_difference(s, k, j, 0, g);
        if (k + 1 < n) v = txi_row_difference(s, k, j, 1, d);
        double diagonal = 0.001 + w + v + v_before;
        if (k) diagonal -= v_before * e[4 * (k - 1) + 3]; /* e(k-1) = e[k-1] + factor e(k) */
        for (int c = 0; c < 3; c++) {
            const double earlier = k ? e[4 * (k - 1) + c] : 0;
            e[4 * k + c] =
                (w * g[c] - v * d[c] + v_before * (before[c] + earlier)) / diagonal;
            before[c] = d[c];
        }
        e[4 * k + 3] = v / diagonal;
        v_before = v;
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int c = 0; c < 3; c++) {
            if (k + 1 < n) e[4 * k + c] += e[4 * k + 3] * e[4 * (k + 1) + c];
            offsets[(size_t)k * 3 * TXI_STRIP_ROWS + (size_t)(3 * j + c)] = txm_float(e[4 * k + c]);
        }
    }
}

/* Cuts and offsets of all strips; the offsets are smoothed across the rows. */
static txm_status txi_strips_finish(txi_strips *all, txm_arena *arena, txm_env *env) {
    const size_t nodes = (size_t)all->node_count;
    all->cuts = (int *)txm_arena_zero(arena, nodes + 1, TXI_STRIP_ROWS * sizeof *all->cuts);
    all->offsets =
        (float *)txm_arena_zero(arena, nodes + 1, 3 * TXI_STRIP_ROWS * sizeof *all->offsets);
    double *e = (double *)txm_arena_alloc(arena, nodes + 1, 4 * sizeof *e);
    if (arena->failed) return txi_no_memory(env);
    for (int i = 0; i < all->count; i++) {
        const txi_strip *s = &all->strips[i];
        float *offsets = all->offsets + (size_t)s->node * 3 * TXI_STRIP_ROWS;
        for (int k = 0; k + 1 < s->node_count; k++)
            txi_patch_cut(s, k, all->cuts + (size_t)(s->node + k) * TXI_STRIP_ROWS);
        for (int j = 0; j < s->rows && s->node_count; j++) txi_row_offsets(s, j, e, offsets);
        for (int k = 0; k < s->node_count; k++) {
            float *row = offsets + (size_t)k * 3 * TXI_STRIP_ROWS;
            float smooth[3 * TXI_STRIP_ROWS] = {0};
            for (int j = 0; j < 3 * s->rows; j++)
                smooth[j] = txm_float(txi_running_mean(row + j % 3, s->rows, 3, j / 3, 2));
            memcpy(row, smooth, (size_t)(3 * s->rows) * sizeof *row);
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* ---- pixels ---- */

/* RGB at a place, Catmull-Rom, or bilinear where not all of its 16 pixels may be copied from; 0 if
   not even that is possible. */
static int txi_lay_pixel(const txi_window *w, double x, double y, double rgb[3]) {
    int coarse[3];
    double wx[4], wy[4];
    if (txi_strip_pixel(w, x, y, coarse) != 2) return 0;
    const int bx = (int)floor(x), by = (int)floor(y);
    for (int c = 0; c < 3; c++) rgb[c] = coarse[c];
    if (bx < 1 || by < 1 || bx + 2 >= w->width || by + 2 >= w->height) return 1;
    const size_t corner = (size_t)(by - 1) * (size_t)w->width + (size_t)(bx - 1);
    for (int k = 0; k < 16; k++) {
        if (w->state[corner + (size_t)(k / 4) * (size_t)w->width + (size_t)(k % 4)] != TXI_KNOWN)
            return 1;
    }
    txi_cubic(x - bx, wx);
    txi_cubic(y - by, wy);
    for (int c = 0; c < 3; c++) {
        rgb[c] = 0;
        for (int k = 0; k < 16; k++)
            rgb[c] += wx[k % 4] * wy[k / 4] *
                      w->color[4 * (corner + (size_t)(k / 4) * (size_t)w->width + (size_t)(k % 4)) +
                               (size_t)c];
    }
    return 1;
}

/* What a pixel on the edge of a bare stroke is where another stroke lies under it: a piece of its
   inside. */
typedef struct txi_lay_edge {
    float x, y;       /* where that is copied from                                               */
    uint8_t color[3];
    uint8_t is_used;
} txi_lay_edge;

/* Which columns of a strip the pixels near it belong to. Arrays of one item per window pixel. */
typedef struct txi_lay {
    txi_strips *all;
    txi_plan *plan;
    txi_pose *poses;
    float *squares;   /* squared distance to the nearest column of the current strip              */
    int32_t *columns; /* that column, or -1                                                      */
    txi_lay_edge *edges; /* NULL: no stroke is bare                                               */
    float *claims;    /* distance to the core of the strip that has the pixel; large: none        */
} txi_lay;

/* The pixels within `radius` of a place, clipped to the window: x0, y0, x1, y1, inclusive. */
static void txi_lay_around(const txi_window *w, txm_vec2 p, int radius, int box[4]) {
    box[0] = txm_clampi((int)p.x - radius, 0, w->width - 1);
    box[1] = txm_clampi((int)p.y - radius, 0, w->height - 1);
    box[2] = txm_clampi((int)p.x + radius + 1, 0, w->width - 1);
    box[3] = txm_clampi((int)p.y + radius + 1, 0, w->height - 1);
}

/* For each hole pixel near a strip its nearest column; -1 for all others in the box of the
   strip. */
static void txi_lay_nearest(txi_lay *lay, const txi_strip *s, int box[4]) {
    const txi_window *w = lay->all->w;
    float widest = 0;
    int b[4];
    box[0] = w->width, box[1] = w->height, box[2] = box[3] = -1;
    for (int i = 0; i < s->line.count; i++) widest = txm_maxf(widest, s->line.half[i]);
    const int radius = (int)widest + TXI_STRIP_MARGIN + 2;
    for (int i = s->first; i <= s->last; i++) {
        txi_lay_around(w, s->line.place[i], radius, b);
        for (int k = 0; k < 2; k++) {
            box[k] = b[k] < box[k] ? b[k] : box[k];
            box[k + 2] = b[k + 2] > box[k + 2] ? b[k + 2] : box[k + 2];
        }
    }
    for (int y = box[1]; y <= box[3]; y++)
        for (int x = box[0]; x <= box[2]; x++)
            lay->columns[(size_t)y * (size_t)w->width + (size_t)x] = -1;
    for (int i = s->first; i <= s->last; i++) {
        const txm_vec2 p = s->line.place[i];
        txi_lay_around(w, p, radius, b);
        for (int y = b[1]; y <= b[3]; y++) {
            for (int x = b[0]; x <= b[2]; x++) {
                const size_t at = (size_t)y * (size_t)w->width + (size_t)x;
                const double dx = x - (double)p.x, dy = y - (double)p.y;
                const float square = txm_float(dx * dx + dy * dy);
                if (w->state[at] != TXI_HOLE ||
                    (lay->columns[at] >= 0 && square >= lay->squares[at]))
                    continue;
                lay->squares[at] = square;
                lay->columns[at] = i;
            }
        }
    }
}

/* The patch that has a place of the strip. */
static int txi_lay_patch(const txi_lay *lay, const txi_strip *s, double column, int row) {
    const int k = txm_clampi((int)((column - s->first) / s->hop), 0, s->node_count - 1);
    if (k + 1 == s->node_count) return k;
    const int *cut = lay->all->cuts + (size_t)(s->node + k) * TXI_STRIP_ROWS;
    return column >= cut[row] ? k + 1 : k;
}

/* How much a strip's colours count, 0..255: fully within the core, not at all at the margin's end,
   and less towards the end of a line that ends in the hole. */
static int txi_lay_pull(const txi_strip *s, double away, int column) {
    const double core = s->is_bare ? TXI_LAY_BARE : (double)TXI_LAY_CORE;
    const double margin = s->is_bare ? TXI_LAY_BARE + 1 : (double)TXI_STRIP_MARGIN;
    double pull = away <= core ? 1 : (margin - away) / (margin - core);
    if (s->is_open && s->line.count - 1 - column < TXI_LAY_FADE)
        pull *= (double)(s->line.count - column) / (TXI_LAY_FADE + 1);
    return pull <= 0 ? 0 : (int)(255 * pull + 0.5);
}

/* Where a pixel lies in the strip, in the frame of its nearest column. 0: beyond the strip's ends
   or at its side. */
typedef struct txi_strip_spot {
    double column, row, across, away, half;
    float claim;
} txi_strip_spot;

static int txi_lay_spot(const txi_lay *lay, const txi_strip *s, int x, int y, size_t at,
                        txi_strip_spot *o) {
    const int i = lay->columns[at];
    const txm_vec2 t = s->line.along[i], p = s->line.place[i];
    const double dx = x - (double)p.x, dy = y - (double)p.y;
    const double ahead = dx * t.x + dy * t.y;
    o->half = s->line.half[i];
    o->across = dy * t.x - dx * t.y;
    o->away = (o->across < 0 ? -o->across : o->across) - o->half;
    o->column = i + ahead;
    o->row = txi_offset_row(o->across, s->inside, o->half);
    const double core = s->is_bare ? 0 : TXI_LAY_CLAIM;
    o->claim = o->away > core ? txm_float(o->away - core) : 0;
    return ahead <= 1.5 && ahead >= -1.5 && o->away < (double)TXI_STRIP_MARGIN;
}

static uint8_t txi_lay_round(double value) {
    return (uint8_t)(value < 0 ? 0 : value > 254.5 ? 255 : (int)(value + 0.5));
}

/* What a pixel of a bare stroke would be if another stroke lay under it: if it is on the edge, the
   nearest place inside.
   from    the source column that the pixel is copied from
   offset  what is added to its colours                                                        */
static void txi_lay_edge_at(txi_lay *lay, const txi_strip *s, const txi_strip_spot *o,
                            const txi_column *from, const float *offset, size_t at) {
    txi_lay_edge *edge = &lay->edges[at];
    double rgb[3];
    edge->is_used = 0;
    if (!s->is_bare || o->away <= -TXI_LAY_EDGE || o->half <= 2 * TXI_LAY_EDGE) return;
    const double across = o->half - TXI_LAY_EDGE;
    const double inner = txi_offset_row(o->across < 0 ? -across : across, s->inside, o->half);
    const txm_vec2 p =
        txi_column_place(from, txi_row_offset(inner, s->inside, (double)from->half));
    if (!txi_lay_pixel(lay->all->w, (double)p.x, (double)p.y, rgb)) return;
    edge->is_used = 1;
    for (int c = 0; c < 3; c++) edge->color[c] = txi_lay_round(rgb[c] + (double)offset[c]);
    edge->x = p.x;
    edge->y = p.y;
}

/* The colour of a pixel by the patch that has it, and where that is copied from. 0: the source is
   not known there. */
static int txi_lay_patch_at(txi_lay *lay, const txi_strip *s, const txi_strip_spot *o, size_t at) {
    const int j = txm_clampi((int)(o->row + 0.5), 0, s->rows - 1);
    const int k = txi_lay_patch(lay, s, o->column, j), centre = s->first + k * s->hop;
    const txi_column from = txi_column_at(s, s->chosen[k], o->column - centre);
    const txm_vec2 p =
        txi_column_place(&from, txi_row_offset(o->row, s->inside, (double)from.half));
    const float *offset = lay->all->offsets + (size_t)(s->node + k) * 3 * TXI_STRIP_ROWS + 3 * j;
    const int forward = o->column >= centre;
    const int next = forward ? (k + 1 < s->node_count ? 1 : 0) : k > 0 ? -1 : 0;
    const double mix = (forward ? o->column - centre : centre - o->column) / s->hop;
    double rgb[3];
    if (!txi_lay_pixel(lay->all->w, (double)p.x, (double)p.y, rgb)) return 0;
    if (s->is_bare &&
        o->away > 0) { /* what lies beside the source is not always the usual background */
        uint8_t beside[3];
        for (int c = 0; c < 3; c++) beside[c] = txi_lay_round(rgb[c]);
        if (txi_typical_distance(s, j, beside) > (double)s->tolerance) return 0;
    }
    for (int c = 0; c < 3; c++) { /* offsets run linearly from centre to centre */
        const double here = (double)offset[c],
                     there = (double)offset[c + next * 3 * TXI_STRIP_ROWS];
        lay->plan->color[4 * at + (size_t)c] = txi_lay_round(rgb[c] + here + (there - here) * mix);
    }
    if (lay->edges) txi_lay_edge_at(lay, s, o, &from, offset, at);
    lay->plan->copies[at].x = p.x;
    lay->plan->copies[at].y = p.y;
    lay->plan->copies[at].piece = lay->plan->copies[at].pose = s->node + k;
    lay->plan->copies[at].layer = s->is_bare ? s->node + 1 : 0;
    return 1;
}

/* A stroke lies under the one that has a pixel: at the edge of that there is no background to be
   seen. */
static void txi_lay_over(txi_lay *lay, size_t at) {
    txi_lay_edge *edge = &lay->edges[at];
    if (!edge->is_used) return;
    edge->is_used = 0;
    memcpy(lay->plan->color + 4 * at, edge->color, 3);
    lay->plan->copies[at].x = edge->x;
    lay->plan->copies[at].y = edge->y;
}

/* One pixel of a strip. */
static void txi_lay_at(txi_lay *lay, const txi_strip *s, int x, int y) {
    const size_t at = (size_t)y * (size_t)lay->all->w->width + (size_t)x;
    txi_strip_spot o;
    if (!txi_lay_spot(lay, s, x, y, at, &o)) return;
    if (o.claim >= lay->claims[at]) { /* it is another strip's */
        if (s->is_bare && o.away < 0) txi_lay_over(lay, at);
        return;
    }
    const int pull = txi_lay_pull(s, o.away, lay->columns[at]);
    if (!pull) return;
    if (s->node_count) {
        if (!txi_lay_patch_at(lay, s, &o, at)) return;
    } else {
        double rgb[3];
        txi_strip_profile_at(s, o.column, o.row, rgb);
        for (int c = 0; c < 3; c++) lay->plan->color[4 * at + (size_t)c] = txi_lay_round(rgb[c]);
        lay->plan->copies[at].piece = -1;
        lay->plan->copies[at].layer = 0;
    }
    lay->claims[at] = o.claim;
    lay->plan->pull[at] = (uint8_t)pull;
}

/* The pose of a patch: both frames at its centre. */
static txi_pose txi_lay_pose(const txi_strip *s, int k) {
    const int column = s->first + k * s->hop;
    const txm_vec2 t = s->line.along[column < s->line.count ? column : s->line.count - 1];
    const txi_column *from = &s->sources[s->chosen[k]];
    const txm_vec2 u = from->along;
    const txm_vec2 v = txm_v2(-u.y * from->side, u.x * from->side);
    txi_pose pose; /* to the right is t.x along the line and -t.y across it; down t.y and t.x */
    pose.a = txm_float((double)t.x * u.x - (double)t.y * v.x);
    pose.b = txm_float((double)t.x * u.y - (double)t.y * v.y);
    pose.c = txm_float((double)t.y * u.x + (double)t.x * v.x);
    pose.d = txm_float((double)t.y * u.y + (double)t.x * v.y);
    return pose;
}

static void txi_lay_all(txi_lay *lay) {
    for (int k = 0; k < lay->all->count; k++) {
        const txi_strip *s = &lay->all->strips[lay->all->order[k]];
        int box[4];
        if (!s->node_count && !s->profile) continue;
        for (int n = 0; n < s->node_count; n++) lay->poses[s->node + n] = txi_lay_pose(s, n);
        txi_lay_nearest(lay, s, box);
        for (int y = box[1]; y <= box[3]; y++) {
            for (int x = box[0]; x <= box[2]; x++) {
                const ptrdiff_t at = (ptrdiff_t)y * lay->all->w->width + x;
                if (lay->all->w->state[at] == TXI_HOLE && lay->columns[at] >= 0)
                    txi_lay_at(lay, s, x, y);
            }
        }
    }
}

/* ---- the guide channel ---- */

/* Raise the guide channel near a place on a line, in the hole or outside of it. */
static void txi_guide_at(const txi_window *w, txi_plan *plan, const uint8_t *table, double px,
                         double py, int in_hole) {
    const int r = TXI_GUIDE_RADIUS;
    if (!(px > -r && py > -r && px < w->width + r && py < w->height + r)) return;
    const int cx = (int)(px + 0.5 + r) - r, cy = (int)(py + 0.5 + r) - r;
    for (int y = cy > r ? cy - r : 0; y <= cy + r && y < w->height; y++) {
        for (int x = cx > r ? cx - r : 0; x <= cx + r && x < w->width; x++) {
            const size_t at = (size_t)y * (size_t)w->width + (size_t)x;
            const double dx = x - px, dy = y - py, distance = sqrt(dx * dx + dy * dy);
            if ((w->state[at] == TXI_HOLE) != in_hole || distance >= r) continue;
            const uint8_t value = table[(int)(distance * (double)TXI_GUIDE_STEPS + 0.5)];
            if (plan->color[4 * at + 3] < value) plan->color[4 * at + 3] = value;
        }
    }
}

/* 100 exp(-d^2 / (2 * 1.5^2)) near known lines, outside of the hole, and near the completed
   ones. */
static void txi_guide(const txi_strips *all, const txi_lines *lines, txi_plan *plan) {
    uint8_t table[TXI_GUIDE_RADIUS * TXI_GUIDE_STEPS + 1];
    const txi_window *w = all->w;
    for (int i = 0; i <= TXI_GUIDE_RADIUS * TXI_GUIDE_STEPS; i++) {
        const double d = (double)i / ((double)TXI_GUIDE_STEPS * (double)TXI_GUIDE_SIGMA);
        table[i] =
            (uint8_t)((double)TXI_GUIDE_TOP * txm_exp2(-0.5 * TXI_LOG2_E * d * d) + 0.5);
    }
    for (int i = 0; lines && i < lines->thin_count; i++)
        txi_guide_at(w, plan, table, (double)lines->thin[i].place.x, (double)lines->thin[i].place.y,
                     0);
    for (int k = 0; k < all->count; k++) {
        const txi_ribbon *r = &all->strips[k].line;
        for (int i = 0; i < r->count; i++) {
            const double half = r->half[i], nx = -r->along[i].y, ny = r->along[i].x;
            for (int side = half > 0 ? -1 : 1; side < 2; side += 2) {
                const double x = (double)r->place[i].x + side * half * nx;
                const double y = (double)r->place[i].y + side * half * ny;
                txi_guide_at(w, plan, table, x, y, 1);
                txi_guide_at(w, plan, table, x, y, 0);
            }
        }
    }
}

/* ---- the plan ---- */

/* Arrays of the plan, and what is needed to lay it. 0: no memory. */
static int txi_lay_make(txi_lay *lay, txi_strips *all, txi_plan *plan, txm_arena *arena,
                        txm_arena *scratch) {
    const size_t pixels = (size_t)all->w->width * (size_t)all->w->height;
    int bare = 0;
    for (int i = 0; i < all->count; i++) bare |= all->strips[i].is_bare;
    memset(lay, 0, sizeof *lay);
    lay->all = all;
    lay->plan = plan;
    lay->squares = (float *)txm_arena_alloc(scratch, pixels, sizeof *lay->squares);
    lay->columns = (int32_t *)txm_arena_alloc(scratch, pixels, sizeof *lay->columns);
    lay->claims = (float *)txm_arena_alloc(scratch, pixels, sizeof *lay->claims);
    if (bare) lay->edges = (txi_lay_edge *)txm_arena_zero(scratch, pixels, sizeof *lay->edges);
    lay->poses =
        (txi_pose *)txm_arena_alloc(arena, (size_t)all->node_count + 1, sizeof *lay->poses);
    plan->color = (uint8_t *)txm_arena_zero(arena, pixels, 4);
    plan->pull = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    plan->copies = (txi_copy *)txm_arena_zero(arena, pixels, sizeof *plan->copies);
    if (arena->failed || scratch->failed) return 0;
    for (size_t i = 0; i < pixels; i++) {
        lay->claims[i] = TXI_STRIP_MARGIN;
        plan->copies[i].piece = -1;
    }
    plan->poses = lay->poses;
    plan->pose_count = all->node_count;
    return 1;
}

/* How the strips of a plan get their colours. */
enum { TXI_LAY_TEXTURE, TXI_LAY_PROFILES };

static txm_status txi_plan_strips(const txi_window *w, int way, const txi_lines *lines,
                                  const txi_curve *curves, int count, uint64_t seed,
                                  txm_arena *arena, txm_env *env, txi_plan *plan) {
    txi_strips all;
    txi_lay lay;
    txm_arena scratch;
    memset(&all, 0, sizeof all);
    memset(plan, 0, sizeof *plan);
    txm_arena_init(&scratch, env);
    txm_status status = txi_strips_make(w, curves, count, &all, &scratch, env);
    if (status == TXM_OK) status = txi_strips_order(&all, curves, &scratch, env);
    if (status == TXM_OK)
        status = txi_strips_graph(&all, way == TXI_LAY_PROFILES, lines, curves, &scratch, env);
    if (status == TXM_OK) status = txi_strips_choose(&all, seed, &scratch, env);
    if (status == TXM_OK) status = txi_strips_finish(&all, &scratch, env);
    if (status == TXM_OK && !txi_lay_make(&lay, &all, plan, arena, &scratch))
        status = txi_no_memory(env);
    if (status == TXM_OK) {
        txi_lay_all(&lay);
        txi_guide(&all, lines, plan);
        if (txm_progress(env, 0, "strips")) status = txi_stopped(env);
    }
    txm_arena_free(&scratch);
    if (status != TXM_OK) memset(plan, 0, sizeof *plan);
    return status;
}

/* Lay strips of texture along the completed lines of a window [1, III.A].

   lines   of the window: other lines to take texture from, and the known lines of the guide
           channel; NULL: none
   curves  the completed lines, count of them; may be none
   arena   holds the plan
   plan    receives the strips: color and pull in the hole, the guide channel near all lines.
           Copies have one piece and one pose per patch
   return  TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED; after a failure the plan is all zero
   cost    per curve of n columns and m source columns O(m^2 + n m) times the rows, 32 to 61 */
static txm_status txi_plan_make(const txi_window *w, const txi_lines *lines,
                                const txi_curve *curves, int count, uint64_t seed, txm_arena *arena,
                                txm_env *env, txi_plan *plan) {
    return txi_plan_strips(w, TXI_LAY_TEXTURE, lines, curves, count, seed, arena, env, plan);
}

/* The same without texture: the colours across each line are the mean ones of its known ends,
   blended along it. plan->copies has no pieces. */
static txm_status txi_cartoon(const txi_window *w, const txi_lines *lines, const txi_curve *curves,
                              int count, txm_arena *arena, txm_env *env, txi_plan *plan) {
    return txi_plan_strips(w, TXI_LAY_PROFILES, lines, curves, count, 0, arena, env, plan);
}

/* Draw a plan over the colours of the window: strips, paler where they count less. rgb: 3 per
   pixel. */
static void txi_draw_strips(const txi_window *w, const txi_plan *plan, uint8_t *rgb) {
    for (size_t i = 0; i < (size_t)w->width * (size_t)w->height; i++) {
        for (size_t c = 0; c < 3; c++) {
            const int laid =
                (plan->color[4 * i + c] * plan->pull[i] + 90 * (255 - plan->pull[i])) / 255;
            rgb[3 * i + c] = w->state[i] == TXI_VOID ? 0
                             : w->state[i] == TXI_HOLE ? (uint8_t)laid
                                                       : w->color[4 * i + c];
        }
    }
}

#endif /* TEXINPAINT_LAY_H */
