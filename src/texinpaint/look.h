#ifndef TEXINPAINT_LOOK_H
#define TEXINPAINT_LOOK_H

#include "fill.h"

/* ---- a look at a completion ---------------------------------------------------------------------

   What a completion to half resolution will look like at the full one: its matches propose colours
   of the window itself, which are as sharp as the known part. Half the resolution enlarged would
   not do, as thin lines are lost on it.                                                         */

enum {
    TXI_LOOK_STEP = 2, /* pixels of the level between the patches that propose; ours            */
    TXI_LOOK_ROW = TXI_PATCH / TXI_LOOK_STEP, /* of them in a row over a pixel                  */
    TXI_LOOK_MOST = TXI_LOOK_ROW * TXI_LOOK_ROW
};

/* What is looked at. */
typedef struct txi_look {
    const txi_filler *filler;
    const txi_field *field;
    const txi_plan *plan; /* or NULL */
    uint8_t *color;       /* 4 per pixel of the window */
} txi_look;

/* Bilinear colour of the known pixels around (x, y), in units of 2^-8 pixels of the window. 0: none
   of them is known. */
static int txi_look_read(const txi_window *w, int64_t x, int64_t y, uint8_t *color) {
    const int fx = (int)(x & 255), fy = (int)(y & 255);
    int sum[3] = {0, 0, 0}, total = 0;
    for (int k = 0; k < 4; k++) {
        const int64_t px = x / 256 + (k & 1), py = y / 256 + (k >> 1);
        const int weight = (k & 1 ? fx : 256 - fx) * (k >> 1 ? fy : 256 - fy);
        if (px >= w->width || py >= w->height || weight == 0) continue;
        const size_t p = (size_t)py * (size_t)w->width + (size_t)px;
        if (w->state[p] != TXI_KNOWN) continue;
        total += weight;
        for (int c = 0; c < 3; c++) sum[c] += weight * w->color[4 * p + (size_t)c];
    }
    for (int c = 0; c < 3 && total; c++) color[c] = (uint8_t)((sum[c] + total / 2) / total);
    return total > 0;
}

/* What the match of an anchor proposes for pixel (x, y) of the window. 0: nothing. */
static int txi_look_propose(const txi_look *v, int anchor, int x, int y, uint8_t *color) {
    const txi_level *l = &v->filler->level[v->field->level];
    const txi_match *m = &v->field->match[anchor];
    if (m->pose < 0) return 0;
    const txi_source *s = &l->source[m->pose];
    const int n = 1 << v->field->level, corner = l->anchor[anchor];
    /* of the source, in 1 / 2n of its pixels                                                   */
    const int64_t i = 2 * n * (m->x - corner % l->width + TXI_EDGE) + 2 * x + 1 - n;
    const int64_t j = 2 * n * (m->y - corner / l->width + TXI_EDGE) + 2 * y + 1 - n;
    /* of the window, in 1 / 2 TXI_UNIT of its pixels                                           */
    const int64_t edge = (int64_t)TXI_UNIT * (n - 1 - 2 * n * TXI_EDGE);
    const int64_t px = 2 * n * (int64_t)s->x + s->a * i + s->c * j + edge;
    const int64_t py = 2 * n * (int64_t)s->y + s->b * i + s->d * j + edge;
    const int64_t unit = 2 * TXI_UNIT / 256;
    return txi_look_read(v->filler->window, px < 0 ? 0 : px / unit, py < 0 ? 0 : py / unit, color);
}

/* The colour of pixel (x, y): of the proposals the one nearest to their mean, as in a vote. */
static void txi_look_pixel(const txi_look *v, int x, int y) {
    const txi_level *l = &v->filler->level[v->field->level];
    const int scale = v->field->level;
    const size_t at = (size_t)y * (size_t)v->filler->window->width + (size_t)x;
    const int p = ((y >> scale) + TXI_EDGE) * l->width + (x >> scale) + TXI_EDGE;
    uint8_t list[TXI_LOOK_MOST][4], *out = v->color + 4 * at;
    int count = 0, best = INT_MAX, mean[3] = {0, 0, 0};
    if (v->plan && v->plan->pull && v->plan->pull[at] >= TXI_PULL_KEPT) { /* the strip itself */
        memcpy(out, v->plan->color + 4 * at, 3);
        return;
    }
    for (int k = 0; k < TXI_LOOK_MOST; k++) {
        const int dx = k % TXI_LOOK_ROW * TXI_LOOK_STEP + 1;
        const int dy = k / TXI_LOOK_ROW * TXI_LOOK_STEP + 1;
        const int anchor = l->slot[p - dy * l->width - dx];
        if (anchor >= 0) count += txi_look_propose(v, anchor, x, y, list[count]);
    }
    if (count == 0) memcpy(out, v->field->color + 4 * (size_t)p, 3);
    for (int pass = 0; pass < 2 && count; pass++) {
        double sum[3] = {0, 0, 0}, total = 0;
        for (int k = 0; k < count; k++) {
            const double weight = pass ? 1.0 / (txi_color_distance(list[k], mean) + 64) : 1;
            total += weight;
            for (int c = 0; c < 3; c++) sum[c] += weight * list[k][c];
        }
        for (int c = 0; c < 3; c++) mean[c] = (int)(sum[c] / total + 0.5);
    }
    for (int k = 0; k < count; k++) {
        const int d = txi_color_distance(list[k], mean);
        if (d >= best) continue;
        best = d;
        memcpy(out, list[k], 3);
    }
}

static void txi_look_row(void *context, int y) {
    const txi_look *v = (const txi_look *)context;
    const txi_window *w = v->filler->window;
    for (int x = 0; x < w->width; x++) {
        if (w->state[(size_t)y * (size_t)w->width + (size_t)x] == TXI_HOLE) txi_look_pixel(v, x, y);
    }
}

/* A picture of a field, and a measure of how good it is.
   plan    that it was completed with, or NULL
   color   4 per pixel of the window, whose hole pixels receive RGB
   return  mean of log(detail / expected detail) of the patches                                 */
static double txi_look_at(const txi_filler *f, const txi_field *field, const txi_plan *plan,
                          uint8_t *color, txm_env *env) {
    const txi_level *l = &f->level[field->level];
    const double unit = (double)l->clamp * (double)TXI_PATCH_AREA / (double)TXI_WORTH_MOST;
    txi_look v;
    double ratio = 0;
    int count = 0;
    for (int a = 0; a < l->anchor_count; a++) {
        const txi_match *m = &field->match[a];
        if (m->pose < 0) continue;
        const txi_source *s = &l->source[m->pose];
        const int worth = s->worth[(size_t)m->y * (size_t)s->width + (size_t)m->x] - 1;
        ratio += log((worth * unit + (double)TXI_WANT_FLOOR) /
                     (l->want[a] * unit + (double)TXI_WANT_FLOOR));
        count++;
    }
    v.filler = f;
    v.field = field;
    v.plan = plan;
    v.color = color;
    txm_parallel_for(env, f->window->height, txi_look_row, &v);
    return count ? ratio / count : 0;
}

#endif /* TEXINPAINT_LOOK_H */
