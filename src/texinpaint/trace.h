#ifndef TEXINPAINT_TRACE_H
#define TEXINPAINT_TRACE_H

#include "slope.h"

/* ---- lines near a hole ------------------------------------------------------------------------
   The structure of [1, II.A]: points of strong colour gradient near the hole, thinned to lines, and
   the ends of these lines at the border of the hole. A window is almost isometric to the
   surface, so the gradient in the window is the gradient on the surface. */

enum {
    TXI_PROFILE = 21,       /* samples of the colours across a line, half a pixel apart          */
    TXI_MAX_ENDS = 512,     /* the strongest ones are kept; ours                                */
    TXI_TRACE_LEAST = 24,   /* pixels; lines are followed outwards over 0.8 of the width of the */
    TXI_TRACE_MOST = 120,   /* hole, but within these limits; ours                              */
    TXI_INNER = 24,         /* steps towards the hole, from where an end was found; for flat
                               angles                                                            */
    TXI_END_REACHES = 30,   /* squared pixels; a line must come as near to the hole as that       */
    TXI_BENT_FIT = 40,      /* pixels; parabolas are fitted to as much of a line, or half of the
                               width of the hole; ours                                           */
    TXI_CORNER = 12,        /* points next to the hole that may have a direction of their own     */
    TXI_LOOK_AHEAD = 45     /* pixels beyond the hole in which lines are looked for; ours       */
};

/* A point of a thinned line. */
typedef struct txi_thin {
    txm_vec2 place;   /* window pixels                                                          */
    txm_vec2 along;   /* direction of the line, unit, either way                                */
    float strength;   /* gradient, levels per pixel                                             */
} txi_thin;

/* The end of a line at the border of the hole. */
typedef struct txi_end {
    txm_vec2 place;   /* where it enters the hole, window pixels                                */
    txm_vec2 heading; /* unit, into the hole                                                    */
    float curvature;  /* 1 / pixels, positive: it turns to the right (towards (-y, x) of heading) */
    float strength;   /* mean gradient along it, levels per pixel                               */
    float contrast;   /* difference of the colours of both sides, levels                        */
    float length;     /* pixels over which it was followed outwards                             */
    int is_long;      /* long enough to be a line and not grain                                 */
    int first, count; /* its points in txi_lines.points, from the border outwards, 1 pixel apart */
    float profile[TXI_PROFILE][3]; /* RGB across it from left to right, 5 pixels to each side   */
    float fit[6];     /* x = fit[0] + fit[1] s + fit[2] s^2, y with fit[3..5], s = pixels outwards
                         from place                                                             */
    float fit_length; /* over how many pixels that holds                                        */
} txi_end;

/* What is known about the lines of a window. */
typedef struct txi_lines {
    txi_end *ends;
    int end_count;
    txm_vec2 *points; /* of the ends                                                            */
    int point_count;
    txi_thin *thin;   /* all points of lines near the hole                                      */
    int thin_count;
    int32_t *thin_at; /* one per pixel: the point in it, or -1                                  */
    int32_t *away;    /* one per pixel: squared distance to the nearest pixel of the hole        */
    int32_t *depth;   /* one per pixel: squared distance to the nearest pixel outside of the hole */
    txi_slopes field;
    float threshold;  /* least gradient of a line, levels per pixel                             */
    float width;      /* of the hole: twice the radius of the largest disc in it, pixels        */
    float limit;      /* pixels over which lines were followed                                  */
    float share_long; /* share of ends that are long; 0.45 or more: there is structure          */
} txi_lines;

/* ---- following a line -------------------------------------------------------------------- */

/* A place on a line that is being followed. */
typedef struct txi_walk {
    double x, y, dx, dy; /* place, unit direction                                               */
    double change[3];    /* derivative of RGB to the right, levels per pixel, a running mean     */
} txi_walk;

/* Derivative of RGB in direction (rx, ry) at a pixel, levels per pixel. */
static void txi_change_at(const txi_slopes *f, size_t i, double rx, double ry, double change[3]) {
    const int16_t *g = f->gradient + 6 * i;
    for (int c = 0; c < 3; c++)
        change[c] = (g[2 * c] * rx + g[2 * c + 1] * ry) / (double)TXI_GRADIENT_UNIT;
}

/* Correlation of two colour changes, -1..1. */
static double txi_agree(const double a[3], const double b[3]) {
    const double aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
    const double bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];
    const double ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : 0;
}

/* Move a place across the direction (rx, ry), by at most 1 pixel, to where the gradient is largest:
   five samples and a parabola. Returns the gradient there. */
static double txi_centre(const txi_slopes *f, double rx, double ry, double *x, double *y) {
    double s[5], best = -1;
    int k = 2;
    static const int order[5] = {2, 1, 3, 0, 4}; /* ties: least movement                         */
    for (int i = 0; i < 5; i++) {
        const double o = 0.5 * (order[i] - 2);
        s[order[i]] = txi_strength_at(f, *x + o * rx, *y + o * ry);
        if (s[order[i]] > best) {
            best = s[order[i]];
            k = order[i];
        }
    }
    double o = 0.5 * (k - 2);
    if (k > 0 && k < 4) {
        const double bend = s[k - 1] + s[k + 1] - 2 * s[k];
        if (bend < 0) o += 0.25 * (s[k - 1] - s[k + 1]) / bend;
    }
    *x += o * rx;
    *y += o * ry;
    return best;
}

/* One step along a line; 0: it ends here. least: gradient below which it ends. */
static int txi_walk_on(const txi_slopes *f, txi_walk *k, double step, double least) {
    double x = k->x + step * k->dx, y = k->y + step * k->dy, nx, ny, change[3];
    const double strength = txi_centre(f, -k->dy, k->dx, &x, &y);
    const ptrdiff_t at = txi_pixel(f->width, f->height, x, y);
    if (strength < least || at < 0 || !f->known[at]) return 0;
    const double clear = txi_across(f, (size_t)at, &nx, &ny);
    double tx = -ny, ty = nx, turn = tx * k->dx + ty * k->dy;
    if (turn < 0) {
        tx = -tx;
        ty = -ty;
        turn = -turn;
    }
    if (clear < 0.3 || turn < 0.5) { /* a junction: straight on                                   */
        tx = k->dx;
        ty = k->dy;
    }
    const txm_vec2 d = txi_unit(tx + k->dx, ty + k->dy);
    txi_change_at(f, (size_t)at, -(double)d.y, d.x, change);
    if (txi_agree(change, k->change) < 0.5) return 0;
    for (int c = 0; c < 3; c++) k->change[c] = 0.85 * k->change[c] + 0.15 * change[c];
    /* it must get on, not slide back and forth                                                   */
    if ((x - k->x) * k->dx + (y - k->y) * k->dy < 0.5 * step) return 0;
    k->x = x;
    k->y = y;
    k->dx = d.x;
    k->dy = d.y;
    return 1;
}

/* ---- points of lines --------------------------------------------------------------------- */

/* The gradient that 98.5 % of the known pixels near the hole do not reach. */
static double txi_strong(const txi_slopes *f, const int32_t *away, int32_t reach) {
    enum { BINS = 4096 };  /* of a quarter level per pixel                                        */
    size_t bins[BINS] = {0}, total = 0, sum = 0;
    const size_t count = (size_t)f->width * (size_t)f->height;
    for (size_t i = 0; i < count; i++) {
        if (!f->known[i] || away[i] > reach) continue;
        bins[txm_clampi((int)(f->strength[i] * 4), 0, BINS - 1)]++;
        total++;
    }
    for (int k = BINS - 1; k > 0; k--) {
        sum += bins[k];
        if (sum * 200 >= total * 3) return 0.25 * k;
    }
    return 0;
}

/* Is pixel (x, y) a maximum of the gradient across the edge? Writes the point. */
static int txi_thin_pixel(const txi_slopes *f, int x, int y, double least, txi_thin *out) {
    const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
    double nx, ny;
    if (f->strength[i] < least) return 0;
    const double clear = txi_across(f, i, &nx, &ny);
    const ptrdiff_t a = txi_pixel(f->width, f->height, x + nx, y + ny);
    const ptrdiff_t b = txi_pixel(f->width, f->height, x - nx, y - ny);
    if (clear < 0.3 || a < 0 || b < 0 || !f->known[a] || !f->known[b]) return 0;
    const double s = f->strength[i], before = txi_strength_at(f, x - nx, y - ny);
    const double after = txi_strength_at(f, x + nx, y + ny);
    if (before > s || after > s || (before >= s && after >= s)) return 0;
    const double bend = before + after - 2 * s, o = bend < 0 ? 0.5 * (before - after) / bend : 0;
    out->place = txm_v2(txm_float(x + o * nx), txm_float(y + o * ny));
    out->along = txm_v2(txm_float(-ny), txm_float(nx));
    out->strength = f->strength[i];
    return 1;
}

/* All points of lines near the hole, in raster order. */
static txm_status txi_thin_all(txi_lines *l, int32_t reach, txm_arena *arena, txm_env *env) {
    const txi_slopes *f = &l->field;
    const size_t count = (size_t)f->width * (size_t)f->height;
    l->thin_at = (int32_t *)txm_arena_alloc(arena, count, sizeof *l->thin_at);
    if (arena->failed) return txi_no_memory(env);
    for (int pass = 0; pass < 2; pass++) { /* count, then keep                                    */
        int n = 0;
        for (int y = 0; y < f->height; y++) {
            for (int x = 0; x < f->width; x++) {
                const size_t i = (size_t)y * (size_t)f->width + (size_t)x;
                txi_thin point;
                l->thin_at[i] = -1;
                if (!f->known[i] || l->away[i] > reach) continue;
                if (!txi_thin_pixel(f, x, y, l->threshold, &point)) continue;
                if (pass) {
                    l->thin[n] = point;
                    l->thin_at[i] = n;
                }
                n++;
            }
        }
        l->thin_count = n;
        if (pass || n == 0) continue;
        l->thin = (txi_thin *)txm_arena_alloc(arena, (size_t)n, sizeof *l->thin);
        if (arena->failed) return txi_no_memory(env);
    }
    return TXM_OK;
}

/* ---- ends of lines ----------------------------------------------------------------------- */

/* The direction into the hole at a place outside of it: against the gradient of the distance,
   averaged over some pixels. */
static txm_vec2 txi_inwards(const txi_lines *l, int x, int y) {
    const int w = l->field.width, h = l->field.height;
    double gx = 0, gy = 0;
    for (int j = -4; j <= 4; j++) {
        for (int i = -4; i <= 4; i++) {
            const int px = x + i, py = y + j;
            if (px < 0 || py < 0 || px >= w || py >= h) continue;
            const size_t at = (size_t)py * (size_t)w + (size_t)px;
            const double k = l->depth[at] > 0 ? 1 : 0;
            gx += k * i;
            gy += k * j;
        }
    }
    return txi_unit(gx, gy);
}

/* Follow a line from a point near the border both ways: points from the border outwards. Returns
   how many; walk receives the direction inwards at the first point. */
static int txi_follow(const txi_lines *l, const txi_thin *from, txm_vec2 inwards, txm_vec2 *points,
                      int capacity, double *strength) {
    const txi_slopes *f = &l->field;
    const double least = 0.5 * l->threshold > 0.25 * from->strength ? 0.5 * l->threshold
                                                                     : 0.25 * from->strength;
    txm_vec2 back[TXI_INNER];
    int n = 0, inner = 0, steps = 0;
    double sum = 0;
    for (int way = 0; way < 2; way++) {
        txi_walk k;
        const double side = (double)from->along.x * inwards.x + (double)from->along.y * inwards.y;
        const double sign = (side < 0) == (way == 0) ? -1 : 1; /* way 0: inwards                  */
        const ptrdiff_t at = txi_pixel(f->width, f->height, from->place.x, from->place.y);
        k.x = from->place.x;
        k.y = from->place.y;
        k.dx = sign * from->along.x;
        k.dy = sign * from->along.y;
        if (at < 0) return 0;
        txi_change_at(f, (size_t)at, -k.dy, k.dx, k.change);
        if (way == 1) {
            TXM_ASSERT(inner < capacity);
            while (inner > 0) points[n++] = back[--inner];
            points[n++] = from->place;
        }
        while (way == 0 ? inner < TXI_INNER : n < capacity) {
            if (!txi_walk_on(f, &k, 1, least)) break;
            const ptrdiff_t i = txi_pixel(f->width, f->height, k.x, k.y);
            if (way == 0) {
                if (l->away[i] < 2) break;
                if (l->away[i] > 36) return 0; /* it passes by                                    */
                back[inner++] = txm_v2(txm_float(k.x), txm_float(k.y));
            } else {
                /* back at the border of the hole: it does not lead away from it                  */
                if (l->away[i] < 4) break;
                points[n++] = txm_v2(txm_float(k.x), txm_float(k.y));
                sum += f->strength[i];
                steps++;
            }
        }
    }
    *strength = steps ? sum / steps : from->strength;
    return n;
}

/* Fit x = a + b s + c s^2 by weighted least squares to points 0..n-1, s their distances along the
   line from the first, weights 1 / (1 + s / 16); degree 1: c = 0. Returns the root mean square
   distance. */
static double txi_fit_line(const txm_vec2 *points, int n, int degree, double fit[6]) {
    double m[5] = {0}, v[2][3] = {{0}}, error = 0, s = 0, total = 0;
    const double scale = n > 1 ? n - 1 : 1; /* s / scale is about 0..1                            */
    for (int i = 0; i < n; i++) {
        if (i) s += txi_distance(points[i], points[i - 1]);
        const double t = s / scale, w = 1 / (1 + s / 16);
        const double p[2] = {points[i].x - (double)points[0].x, points[i].y - (double)points[0].y};
        double power = w;
        for (int k = 0; k < 5; k++, power *= t) {
            m[k] += power;
            if (k < 3) {
                v[0][k] += power * p[0];
                v[1][k] += power * p[1];
            }
        }
    }
    for (int d = 0; d < 2; d++) {
        const double *r = v[d];
        const double a = m[2] - m[1] * m[1] / m[0], b = m[3] - m[1] * m[2] / m[0];
        const double c = m[4] - m[2] * m[2] / m[0];
        const double q = r[1] - m[1] * r[0] / m[0], u = r[2] - m[2] * r[0] / m[0];
        const double det = a * c - b * b;
        const double c2 = degree > 1 && det > 1e-12 ? (a * u - b * q) / det : 0;
        const double c1 = a > 1e-12 ? (q - b * c2) / a : 0;
        fit[3 * d] = (r[0] - m[1] * c1 - m[2] * c2) / m[0] + (d ? points[0].y : points[0].x);
        fit[3 * d + 1] = c1 / scale;
        fit[3 * d + 2] = c2 / (scale * scale);
    }
    s = 0;
    for (int i = 0; i < n; i++) {
        if (i) s += txi_distance(points[i], points[i - 1]);
        const double w = 1 / (1 + s / 16);
        const double x = fit[0] + fit[1] * s + fit[2] * s * s - points[i].x;
        const double y = fit[3] + fit[4] * s + fit[5] * s * s - points[i].y;
        error += w * (x * x + y * y);
        total += w;
    }
    return sqrt(error / total);
}

/* How far a fitted line is from the first 8 points, root of the mean square. */
static double txi_fit_start(const txm_vec2 *points, int n, const double fit[6]) {
    double s = 0, error = 0;
    int i = 0;
    for (; i < n && i < 8; i++) {
        if (i) s += txi_distance(points[i], points[i - 1]);
        const double x = fit[0] + fit[1] * s + fit[2] * s * s - points[i].x;
        const double y = fit[3] + fit[4] * s + fit[5] * s * s - points[i].y;
        error += x * x + y * y;
    }
    return sqrt(error / i);
}

/* The curve of the first of count points, as in txi_end.fit with s = 0 at the first point. Returns
   to how many points it was fitted. */
static int txi_fit_points(const txi_lines *l, const txm_vec2 *points, int count, double fit[6]) {
    const int bent = l->width > 2 * TXI_BENT_FIT ? (int)(0.5f * l->width) : TXI_BENT_FIT;
    double line[6] = {0};
    int n = count;
    for (;;) {
        /* a straight line unless a bent one is clearly better: the direction is more exact. Over
           long pieces a parabola is no arc */
        const double straight = txi_fit_line(points, n, 1, line);
        const double rms = txi_fit_line(points, n, 2, fit);
        const int is_straight = n <= 8 || straight < 1.25 * rms + 0.03;
        if (is_straight) memcpy(fit, line, sizeof line);
        if (n <= 8) break;
        if ((is_straight ? straight : rms) < 0.5 && txi_fit_start(points, n, fit) < 0.3 &&
            (is_straight || n <= bent))
            break;
        n = n * 3 / 4;
    }
    /* a corner near the hole: the first points alone are straight, in another direction          */
    if (n > TXI_CORNER && txi_fit_line(points, TXI_CORNER, 1, line) < 0.12) {
        const txm_vec2 p = txi_unit(line[1], line[4]), q = txi_unit(fit[1], fit[4]);
        if (fabs((double)p.x * q.y - (double)p.y * q.x) > 0.15) {
            memcpy(fit, line, sizeof line);
            n = TXI_CORNER;
        }
    }
    return n;
}

/* Fit the line, find where it enters the hole, its direction and curvature there. 0: it does
   not. */
static int txi_fit_end(const txi_window *w, const txi_lines *l, const txm_vec2 *points,
                       txi_end *e) {
    double fit[6] = {0}, s = 0;
    int found = 0;
    const int n = txi_fit_points(l, points, e->count, fit);
    for (int i = 0; i < 80 && !found; i++) { /* out of the picture in quarter pixels, 20 pixels   */
        s = -0.25 * i;
        const ptrdiff_t at = txi_pixel(w->width, w->height, fit[0] + fit[1] * s + fit[2] * s * s,
                                       fit[3] + fit[4] * s + fit[5] * s * s);
        if (at < 0 || w->state[at] == TXI_VOID) return 0;
        found = w->state[at] == TXI_HOLE;
    }
    if (!found) return 0;
    const double dx = fit[1] + 2 * fit[2] * s, dy = fit[4] + 2 * fit[5] * s;
    const double speed = sqrt(dx * dx + dy * dy);
    if (speed < 0.1) return 0;
    for (int d = 0; d < 2; d++) { /* from now on s = 0 is the border                              */
        double *p = fit + 3 * d;
        p[0] += p[1] * s + p[2] * s * s;
        p[1] += 2 * p[2] * s;
    }
    for (int k = 0; k < 6; k++) e->fit[k] = txm_float(fit[k]);
    e->fit_length = txm_float(n - s);
    e->place = txm_v2(e->fit[0], e->fit[3]);
    e->heading = txi_unit(-dx, -dy);
    e->curvature = txm_float(-2 * (fit[1] * fit[5] - fit[4] * fit[2]) / (speed * speed * speed));
    return 1;
}

/* Colours across the line, a mean over its first pixels. Samples that fall into unknown pixels are
   left out; where there are none the next one towards the line counts. */
static void txi_profile(const txi_window *w, const txi_lines *l, txi_end *e) {
    const txm_vec2 *p = l->points + e->first;
    const int mid = TXI_PROFILE / 2;
    double sum[TXI_PROFILE][3] = {{0}}, side[2][3] = {{0}};
    int hits[TXI_PROFILE] = {0};
    for (int i = 0; i < e->count && i < 12; i++) {
        const int a = i > 2 ? i - 2 : 0, b = i + 2 < e->count ? i + 2 : e->count - 1;
        const txm_vec2 d = txi_unit((double)p[a].x - p[b].x, (double)p[a].y - p[b].y);
        for (int k = 0; k < TXI_PROFILE; k++) {
            const double o = 0.5 * (k - mid), x = p[i].x - o * d.y, y = p[i].y + o * d.x;
            const ptrdiff_t at = txi_pixel(w->width, w->height, x, y);
            if (at < 0 || !l->field.known[at]) continue;
            for (int c = 0; c < 3; c++) sum[k][c] += w->color[4 * at + c];
            hits[k]++;
        }
    }
    for (int o = 0; o <= mid; o++) {
        for (int s = -1; s < 2; s += 2) {
            const int k = mid + s * o, inner = o ? k - s : k;
            for (int c = 0; c < 3; c++) {
                const double outer = hits[k] ? sum[k][c] / hits[k] : o ? e->profile[inner][c] : 128;
                e->profile[k][c] = txm_float(outer);
                if (o >= 2 && o <= 6) side[s > 0][c] += outer / 5;
            }
        }
    }
    double difference = 0;
    for (int c = 0; c < 3; c++) difference += (side[0][c] - side[1][c]) * (side[0][c] - side[1][c]);
    e->contrast = txm_float(sqrt(difference / 3));
}

/* Is there an end already that is the same line? */
static int txi_end_exists(const txi_lines *l, const txi_end *e) {
    for (int i = 0; i < l->end_count; i++) {
        const txi_end *o = &l->ends[i];
        if (txi_distance(e->place, o->place) > 2.5) continue;
        const double d = (double)e->heading.x * o->heading.x + (double)e->heading.y * o->heading.y;
        double a[3], b[3];
        for (int c = 0; c < 3; c++) {
            a[c] = (double)e->profile[12][c] - e->profile[8][c];
            b[c] = (double)o->profile[12][c] - o->profile[8][c];
        }
        if (d > 0.5 && txi_agree(a, b) > 0.3) return 1;
        if (txi_distance(e->place, o->place) < 1 && d > 0.5) return 1;
    }
    return 0;
}

/* Try a point of a line as the end of that line. room: points of one end */
static void txi_try_end(const txi_window *w, txi_lines *l, const txi_thin *t, int room) {
    txi_end *e = &l->ends[l->end_count];
    const txm_vec2 in = txi_inwards(l, (int)(t->place.x + 0.5f), (int)(t->place.y + 0.5f));
    double strength;
    if (fabs((double)in.x * t->along.x + (double)in.y * t->along.y) < 0.12) return;
    e->first = l->point_count;
    e->count = txi_follow(l, t, in, l->points + e->first, room, &strength);
    if (e->count < 5) return;
    const txm_vec2 p = l->points[e->first];
    const ptrdiff_t at = txi_pixel(w->width, w->height, p.x, p.y);
    if (at < 0 || l->away[at] > TXI_END_REACHES || !txi_fit_end(w, l, l->points + e->first, e))
        return;
    e->strength = txm_float(strength);
    e->length = (float)e->count;
    e->is_long = e->length >= (float)TXI_TRACE_LEAST || e->length >= 0.8f * l->limit;
    txi_profile(w, l, e);
    if (txi_end_exists(l, e)) return;
    l->point_count += e->count;
    l->end_count++;
}

/* Ends from points near the hole: 2.6 to 4.2 pixels from it, then up to 6 pixels, for lines that
   are lost on their last pixels; the strongest first. */
static txm_status txi_find_ends(const txi_window *w, txi_lines *l, txm_arena *arena,
                                txm_arena *scratch, txm_env *env) {
    const int room = (int)l->limit + TXI_INNER;
    txm_pair *order =
        (txm_pair *)txm_arena_alloc(scratch, (size_t)l->thin_count, 2 * sizeof *order);
    if (l->thin_count == 0) return TXM_OK;
    l->ends = (txi_end *)txm_arena_zero(arena, TXI_MAX_ENDS, sizeof *l->ends);
    l->points = (txm_vec2 *)txm_arena_alloc(arena, TXI_MAX_ENDS * (size_t)room, sizeof *l->points);
    if (arena->failed || scratch->failed) return txi_no_memory(env);
    for (int pass = 0; pass < 2; pass++) {
        size_t count = 0;
        for (int i = 0; i < l->thin_count; i++) {
            const txm_vec2 p = l->thin[i].place;
            const ptrdiff_t at = txi_pixel(w->width, w->height, p.x, p.y);
            if (at < 0 || l->away[at] < (pass ? 18 : 7) || l->away[at] > (pass ? 36 : 17)) continue;
            order[count].key = ~txm_sort_key(l->thin[i].strength);
            order[count++].value = (uint32_t)i;
        }
        txm_sort_pairs(order, order + l->thin_count, count);
        for (size_t k = 0; k < count && l->end_count < TXI_MAX_ENDS; k++)
            txi_try_end(w, l, &l->thin[order[k].value], room);
    }
    return TXM_OK;
}

/* ---- all of it --------------------------------------------------------------------------- */

/* known pixels, distances, the width of the hole */
static txm_status txi_lines_begin(const txi_window *w, txm_arena *arena, txm_arena *scratch,
                                  txm_env *env, txi_lines *l) {
    const size_t count = (size_t)w->width * (size_t)w->height;
    const int longer = w->width > w->height ? w->width : w->height;
    int32_t deepest = 0;
    uint8_t *mark = (uint8_t *)txm_arena_alloc(scratch, count, 1);
    int32_t *row = (int32_t *)txm_arena_alloc(scratch, (size_t)longer, 3 * sizeof *row);
    l->field.width = w->width;
    l->field.height = w->height;
    l->field.color = w->color;
    l->field.known = (uint8_t *)txm_arena_alloc(arena, count, 1);
    l->field.gap = (int32_t *)txm_arena_alloc(scratch, count, sizeof *l->field.gap);
    l->away = (int32_t *)txm_arena_alloc(arena, count, sizeof *l->away);
    l->depth = (int32_t *)txm_arena_alloc(arena, count, sizeof *l->depth);
    if (arena->failed || scratch->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) {
        l->field.known[i] = w->state[i] == TXI_KNOWN || w->state[i] == TXI_FOREIGN;
        mark[i] = !l->field.known[i];
    }
    txi_distances(mark, w->width, w->height, row, l->field.gap);
    for (size_t i = 0; i < count; i++) mark[i] = w->state[i] == TXI_HOLE;
    txi_distances(mark, w->width, w->height, row, l->away);
    for (size_t i = 0; i < count; i++) mark[i] = w->state[i] != TXI_HOLE;
    txi_distances(mark, w->width, w->height, row, l->depth);
    for (size_t i = 0; i < count; i++) {
        if (l->depth[i] > deepest && l->depth[i] < TXI_FAR) deepest = l->depth[i];
    }
    l->width = txm_float(2 * sqrt((double)deepest));
    l->limit = txm_clampf(0.8f * l->width, TXI_TRACE_LEAST, TXI_TRACE_MOST);
    return TXM_OK;
}

/* Find the lines that end at the hole of a window.

   arena  holds the results
   return TXM_OK, also if there are none; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost   O(pixels) + O(length of lines); 46 bytes per pixel while it runs, 30 after              */
static txm_status txi_trace(const txi_window *w, txm_arena *arena, txm_env *env, txi_lines *lines) {
    txm_arena scratch;
    int longs = 0;
    txm_arena_init(&scratch, env);
    memset(lines, 0, sizeof *lines);
    txm_status status = txi_lines_begin(w, arena, &scratch, env, lines);
    const int reach = (int)lines->limit + TXI_LOOK_AHEAD;
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK)
        status = txi_slopes_make(&lines->field, lines->away, reach * reach, arena, &scratch, env);
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK) {
        const double strong = 0.3 * txi_strong(&lines->field, lines->away, reach * reach);
        lines->threshold = txm_float(strong > 6 ? strong : 6);
        status = txi_thin_all(lines, reach * reach, arena, env);
    }
    if (status == TXM_OK && txm_progress(env, 0, "lines")) status = txi_stopped(env);
    if (status == TXM_OK) status = txi_find_ends(w, lines, arena, &scratch, env);
    for (int i = 0; i < lines->end_count && status == TXM_OK; i++) longs += lines->ends[i].is_long;
    if (lines->end_count && status == TXM_OK)
        lines->share_long = (float)longs / (float)lines->end_count;
    lines->field.gap = lines->field.tensor = NULL; /* they were in scratch                        */
    txm_arena_free(&scratch);
    return status;
}

#endif /* TEXINPAINT_TRACE_H */
