#ifndef TEXINPAINT_JUDGE_H
#define TEXINPAINT_JUDGE_H

#include "join.h"

/* ---- what a result keeps of the lines ---------------------------------------------------- */

enum { TXI_GO_ON = 8 }; /* pixels inside of the hole over which a line should go on               */

/* Over how many of 8 pixels inside of the hole a line of the result follows the continuation of an
   end: no farther than 2.5 pixels, within 25 degrees, with the same polarity and 0.45 to 2.2 times
   the strength. */
static int txi_goes_on(const txi_window *w, const txi_slopes *f, const txi_end *e) {
    txi_walk k;
    int n = 0;
    k.x = (double)e->fit[0] + 2.0 * e->fit[1] + 4.0 * e->fit[2];
    k.y = (double)e->fit[3] + 2.0 * e->fit[4] + 4.0 * e->fit[5];
    const txm_vec2 d = txi_unit(-e->fit[1] - 4.0 * e->fit[2], -e->fit[4] - 4.0 * e->fit[5]);
    k.dx = d.x;
    k.dy = d.y;
    txi_centre(f, -k.dy, k.dx, &k.x, &k.y);
    const ptrdiff_t from = txi_pixel(w->width, w->height, k.x, k.y);
    if (from < 0) return 0;
    txi_change_at(f, (size_t)from, -k.dy, k.dx, k.change);
    for (int i = 0; i < 12 && n < TXI_GO_ON; i++) {
        if (!txi_walk_on(f, &k, 1, 0.45 * e->strength)) break;
        const ptrdiff_t at = txi_pixel(w->width, w->height, k.x, k.y);
        if (w->state[at] != TXI_HOLE) continue;
        const double s = -(n + 0.5), dx = -(e->fit[1] + 2 * e->fit[2] * s);
        const double dy = -(e->fit[4] + 2 * e->fit[5] * s), speed = sqrt(dx * dx + dy * dy);
        const double ox = k.x - (e->fit[0] + e->fit[1] * s + e->fit[2] * s * s);
        const double oy = k.y - (e->fit[3] + e->fit[4] * s + e->fit[5] * s * s);
        if (speed <= 0 || fabs(ox * dy - oy * dx) > 2.5 * speed) break;
        if (k.dx * dx + k.dy * dy < 0.906 * speed || f->strength[at] > 2.2f * e->strength) break;
        n++;
    }
    return n;
}

/* The mean share of 8 pixels over which the line ends go on in a picture of the window with its
   hole filled; 1 if there are no ends.
   color  4 per pixel
   share  receives 0..1
   cost   O(pixels)                                                                            */
static txm_status txi_continued(const txi_window *w, const txi_lines *l, const uint8_t *color,
                                txm_env *env, double *share) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const int longer = w->width > w->height ? w->width : w->height;
    txi_slopes f;
    txm_arena arena;
    double sum = 0;
    txm_arena_init(&arena, env);
    memset(&f, 0, sizeof f);
    f.width = w->width;
    f.height = w->height;
    f.color = color;
    f.known = (uint8_t *)txm_arena_alloc(&arena, count, 1);
    f.gap = (int32_t *)txm_arena_alloc(&arena, count, sizeof *f.gap);
    int32_t *from = (int32_t *)txm_arena_alloc(&arena, count, sizeof *from);
    int32_t *row = (int32_t *)txm_arena_alloc(&arena, (size_t)longer, 3 * sizeof *row);
    uint8_t *mark = (uint8_t *)txm_arena_alloc(&arena, count, 1);
    txm_status status = arena.failed ? txi_no_memory(env) : TXM_OK;
    if (status == TXM_OK) {
        for (size_t i = 0; i < count; i++) {
            f.known[i] = w->state[i] != TXI_VOID;
            mark[i] = !f.known[i];
            from[i] = w->state[i] == TXI_HOLE ? l->depth[i] : l->away[i];
        }
        txi_distances(mark, w->width, w->height, row, f.gap);
        status = txi_slopes_make(&f, from, 15 * 15, &arena, &arena, env);
    }
    for (int i = 0; i < l->end_count && status == TXM_OK; i++)
        sum += txi_goes_on(w, &f, &l->ends[i]) / (double)TXI_GO_ON;
    *share = l->end_count && status == TXM_OK ? sum / l->end_count : 1;
    txm_arena_free(&arena);
    return status;
}

/* The share of 8 pixels over which the known lines go on as a fit to the rest of them says, 8
   pixels farther out than the hole: what can be asked of a completion. About 1 for stripes, less
   for lines that meander; 1 if no line is long enough to tell. */
static double txi_foreseen(const txi_lines *l) {
    enum { SKIPPED = 2, FITTED = 12 }; /* points: near the hole, and to fit to at least          */
    double sum = 0;
    int count = 0;
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *e = &l->ends[i];
        const txm_vec2 *p = l->points + e->first;
        const int from = (int)SKIPPED + TXI_GO_ON;
        double fit[6] = {0};
        int n = 0;
        if (e->count < from + FITTED) continue;
        txi_fit_points(l, p + from, e->count - from, fit);
        for (; n < TXI_GO_ON; n++) {
            const double s = -(n + 1);
            const double dx = -(fit[1] + 2 * fit[2] * s), dy = -(fit[4] + 2 * fit[5] * s);
            const txm_vec2 at = p[from - 1 - n], before = p[from - n], after = p[from - 2 - n];
            const txm_vec2 d = txi_unit((double)after.x - before.x, (double)after.y - before.y);
            const double ox = at.x - (fit[0] + fit[1] * s + fit[2] * s * s);
            const double oy = at.y - (fit[3] + fit[4] * s + fit[5] * s * s);
            const double speed = sqrt(dx * dx + dy * dy);
            if (speed <= 0 || fabs(ox * dy - oy * dx) > 2.5 * speed) break;
            if (d.x * dx + d.y * dy < 0.906 * speed) break;
        }
        sum += n / (double)TXI_GO_ON;
        count++;
    }
    return count ? sum / count : 1;
}

/* The bending energy of the part of a curve in the hole: the squared angle for an arc. */
static double txi_curve_bend(const txi_curve *c) {
    double length, bend;
    txm_vec2 coarse[TXI_STEPS + 1];
    const int n = c->last - c->first;
    if (n < 2) return 0;
    for (int i = 0; i <= TXI_STEPS; i++) /* coarse, so that steps of a pixel do not count         */
        coarse[i] = c->points[c->first + (n * i + TXI_STEPS / 2) / TXI_STEPS];
    if (n <= TXI_STEPS) txi_bend(c->points + c->first, n + 1, &length, &bend);
    else txi_bend(coarse, TXI_STEPS + 1, &length, &bend);
    return bend;
}

/* Share of the line ends on curves that are nearly straight (bending energy below 0.15); 0 without
   ends. */
static double txi_straight_share(const txi_lines *l, const txi_curve *curves, int count) {
    int ends = 0;
    for (int i = 0; i < count; i++) {
        if (txi_curve_bend(&curves[i]) < 0.15) ends += 1 + (curves[i].ends[1] >= 0);
    }
    return l->end_count ? (double)ends / l->end_count : 0;
}

/* The mean bending energy of the curves, each counted as at most 4; 0 without curves. */
static double txi_mean_bend(const txi_curve *curves, int count) {
    double sum = 0;
    for (int i = 0; i < count; i++) {
        const double b = txi_curve_bend(&curves[i]);
        sum += b < 4 ? b : 4;
    }
    return count ? sum / count : 0;
}

/* ---- pictures ---------------------------------------------------------------------------- */

static void txi_dot(const txi_window *w, int scale, double x, double y, const uint8_t ink[3],
                    uint8_t *rgb) {
    const double px = (x + 0.5) * scale, py = (y + 0.5) * scale;
    const int width = w->width * scale;
    if (!(px >= 0 && py >= 0 && px < width && py < w->height * scale)) return;
    memcpy(rgb + 3 * ((size_t)(int)py * (size_t)width + (size_t)(int)px), ink, 3);
}

/* Draw what was found over the colours of the window, enlarged scale times: points of lines in
   orange; the traced ends in cyan (long) or yellow; curves in green, in red where they end in the
   hole.
   rgb  3 * width * height * scale^2 bytes                                                      */
static void txi_draw_lines(const txi_window *w, const txi_lines *l, const txi_curve *curves,
                           int count, int scale, uint8_t *rgb) {
    static const uint8_t orange[3] = {255, 150, 0}, cyan[3] = {0, 220, 255};
    static const uint8_t yellow[3] = {255, 255, 0};
    static const uint8_t green[3] = {0, 255, 0}, red[3] = {255, 0, 0};
    for (int y = 0; y < w->height * scale; y++) {
        for (int x = 0; x < w->width * scale; x++) {
            const size_t i = (size_t)(y / scale) * (size_t)w->width + (size_t)(x / scale);
            uint8_t *p = rgb + 3 * ((size_t)y * (size_t)w->width * (size_t)scale + (size_t)x);
            for (int c = 0; c < 3; c++)
                p[c] = w->state[i] == TXI_VOID ? 0 : w->color[4 * i + (size_t)c];
        }
    }
    for (int i = 0; i < l->thin_count; i++)
        txi_dot(w, scale, l->thin[i].place.x, l->thin[i].place.y, orange, rgb);
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *e = &l->ends[i];
        for (int k = 0; k < e->count; k++) {
            const txm_vec2 p = l->points[e->first + k];
            txi_dot(w, scale, p.x, p.y, e->is_long ? cyan : yellow, rgb);
        }
    }
    for (int i = 0; i < count; i++) {
        for (int k = curves[i].first; k < curves[i].last; k++) {
            for (int s = 0; s < 2 * scale; s++) {
                const txm_vec2 p = txi_between(curves[i].points[k], curves[i].points[k + 1],
                                               0.5 * s / scale);
                txi_dot(w, scale, p.x, p.y, curves[i].ends[1] < 0 ? red : green, rgb);
            }
        }
    }
}

#endif /* TEXINPAINT_JUDGE_H */
