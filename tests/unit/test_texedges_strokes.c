/* test_texedges_strokes.c - disturbed strokes, their statistics, guides made of them
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texedges_strokes && build/tests/unit/test_texedges_strokes */
#include "edgekit.h"

/* ---- strokes ---------------------------------------------------------------------------- */

/* from a point to the nearest one of a line */
static double distance_to(const txm_vec2 *p, int count, int is_closed, double x, double y) {
    double least = 1e30;
    for (int i = 0; i < count - !is_closed; i++) {
        const txm_vec2 a = p[i], b = p[(i + 1) % count];
        const double dx = (double)b.x - a.x, dy = (double)b.y - a.y, n = dx * dx + dy * dy;
        double t = n > 0 ? ((x - a.x) * dx + (y - a.y) * dy) / n : 0;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        const double ux = a.x + t * dx - x, uy = a.y + t * dy - y;
        if (ux * ux + uy * uy < least) least = ux * ux + uy * uy;
    }
    return sqrt(least);
}

/* from a point to the outline of a stroke: of an open one, to the edge of its band */
static double distance_to_stroke(const texedges_stroke *s, double x, double y) {
    const double d = distance_to(s->points, s->count, s->is_closed, x, y);
    return s->is_closed ? d : fabs(d - 0.5 * (s->width > 0 ? s->width : 8));
}

static int turns(txm_vec2 a, txm_vec2 b, txm_vec2 c) {
    const double d =
        ((double)b.x - a.x) * ((double)c.y - a.y) - ((double)c.x - a.x) * ((double)b.y - a.y);
    return (d > 0) - (d < 0);
}

/* how often a closed line crosses itself */
static int count_crossings(const txm_vec2 *p, size_t n) {
    int found = 0;
    for (size_t i = 0; i < n; i++) {
        const txm_vec2 a = p[i], b = p[(i + 1) % n];
        for (size_t j = i + 2; j < n; j++) {
            const txm_vec2 c = p[j], d = p[(j + 1) % n];
            if (txm_maxf(a.x, b.x) < txm_minf(c.x, d.x) || txm_maxf(c.x, d.x) < txm_minf(a.x, b.x))
                continue;
            found += turns(a, b, c) * turns(a, b, d) < 0 && turns(c, d, a) * turns(c, d, b) < 0;
        }
    }
    return found;
}

/* The exemplar whose roughness the strokes below take on, 4 layers. */
static texedges_set *find_blobs(uint64_t seed, double rough) {
    static uint8_t pixels[SIDE * SIDE];
    draw_blobs(pixels, SIDE, seed, rough);
    texedges_desc d = desc_of(gray(pixels, SIDE, SIDE), 4, NULL);
    d.least = 24;
    return find(&d);
}

static void test_disturb(void **state) {
    (void)state;
    static uint8_t guide[WIDE * WIDE], mask[WIDE * WIDE];
    texedges_set *blobs = find_blobs(1, 0.3);
    texedges_stroke strokes[3];
    for (int layer = 0; layer < 4; layer++) {
        texedges_control c = control_of(blobs, strokes, draw_strokes(strokes, layer));
        c.background = layer ? 0 : 3;
        c.seed = 1 + (uint64_t)layer;
        texedges_set *lines = disturb(&c, WIDE, WIDE);
        assert_int_equal(lines->line_count, 3);
        assert_true(lines->width == WIDE && lines->height == WIDE && lines->levels == 4);
        assert_memory_equal(lines->thresholds, blobs->thresholds, sizeof lines->thresholds);
        double strays = 0, points = 0;
        for (int i = 0; i < 3; i++) {
            const texedges_polyline *line = &lines->lines[i];
            const txm_vec2 *p = lines->points + line->first;
            assert_int_equal(line->layer, layer);
            assert_int_equal(line->is_hole, 0);
            assert_true(area_of(lines, line) > 0); /* the inside lies to the right */
            double longest = 0;
            for (size_t j = 0; j < line->count; j++) {
                const txm_vec2 q = p[(j + 1) % line->count];
                const double d = distance_to_stroke(&strokes[i], p[j].x, p[j].y);
                if (d > 4) fail_msg("layer %d stroke %d strays by %g", layer, i, d);
                strays += d;
                points += 1;
                const double step = sqrt(((double)q.x - p[j].x) * ((double)q.x - p[j].x) +
                                         ((double)q.y - p[j].y) * ((double)q.y - p[j].y));
                if (step > longest) longest = step;
            }
            assert_true(longest < 3); /* also from the last point to the first */
            assert_int_equal(count_crossings(p, line->count), 0);
        }
        assert_true(strays / points > 0.3); /* and it is disturbed */

        /* the guide's edge is where the strokes are: on both sides of 90 % of their length */
        guide_of(&c, lines, guide, mask);
        for (int i = 0; i < 3; i++) {
            const texedges_stroke *s = &strokes[i];
            int near = 0;
            for (int j = 0; j < s->count; j++) {
                const double reach = 4 + (s->is_closed ? 0 : 0.5 * s->width);
                const txm_vec2 p = s->points[j];
                const int x0 = (int)(p.x - reach - 1), x1 = (int)(p.x + reach + 1);
                const int y0 = (int)(p.y - reach - 1), y1 = (int)(p.y + reach + 1);
                int sides = 0;
                for (int y = y0; y <= y1; y++) {
                    for (int x = x0; x <= x1; x++) {
                        const double dx = x + 0.5 - p.x, dy = y + 0.5 - p.y;
                        if (dx * dx + dy * dy > reach * reach) continue;
                        sides |= guide[y * WIDE + x] == 85 * layer ? 1 : 2;
                    }
                }
                near += sides == 3;
            }
            assert_true(near >= 0.9 * s->count);
        }
        texedges_set_free(lines);
    }
    texedges_set_free(blobs);
}

/* Strokes as people draw them: corners, hairpins, knots, out of the picture, tiny, crossing. */
static void test_disturb_anything(void **state) {
    (void)state;
    tk_wide();
    static uint8_t guide[200 * 160], mask[200 * 160];
    static txm_vec2 points[200];
    texedges_set *blobs = find_blobs(2, 0.5);
    txm_rng rng = txm_rng_make(3, 3);
    double worst = 0;
    for (int i = 0; i < (tk_full() ? 150 : 40); i++) {
        texedges_stroke s;
        memset(&s, 0, sizeof s);
        s.points = points;
        s.is_closed = (int)txm_rng_below(&rng, 2);
        s.count = txm_rng_range(&rng, 2 + s.is_closed, i % 3 ? 6 : 200);
        s.layer = (int)txm_rng_below(&rng, 4);
        s.width = i % 2 ? 0 : 2 + 60 * txm_rng_float(&rng);
        const float span = i % 5 == 0 ? 3.0f : i % 5 == 1 ? 1000.0f : 150.0f;
        for (int j = 0; j < s.count; j++) {
            points[j] = txm_v2(30 + span * txm_rng_float(&rng), 20 + span * txm_rng_float(&rng));
            if (i % 7 == 0) points[j] = txm_v2(floorf(points[j].x), 60); /* back and forth */
            if (i % 7 == 1 && j)
                points[j] = txm_v2(points[j - 1].x + txm_rng_float(&rng) - 0.3f,
                                   points[j - 1].y + txm_rng_float(&rng) - 0.5f);
        }
        points[1].x += 1; /* not all the same */
        texedges_control c = control_of(blobs, &s, 1);
        c.disturb = i % 4 == 3 ? 4.0f : 0;
        c.background = -1;
        texedges_set *lines = disturb(&c, 200, 160);
        assert_int_equal(lines->line_count, 1);
        assert_true(lines->lines[0].count >= 2);
        for (size_t j = 0; j < lines->point_count && s.is_closed; j++) {
            const txm_vec2 p = lines->points[j];
            const txm_vec2 q = lines->points[j + 1 < lines->point_count ? j + 1 : 0];
            for (int k = 0; k < 2; k++) { /* also between the points */
                const double d = distance_to(points, s.count, 1, p.x + 0.5 * k * (q.x - p.x),
                                             p.y + 0.5 * k * (q.y - p.y));
                if (d > worst) worst = d;
            }
        }
        for (size_t j = 0; j < lines->point_count && !s.is_closed; j++) {
            const double half = 0.5 * (s.width > 0 ? s.width : 8);
            const txm_vec2 p = lines->points[j];
            const double d = distance_to(points, s.count, 0, p.x, p.y);
            if (d - half > worst) worst = d - half;
        }
        guide_of(&c, lines, guide, mask);
        texedges_set_free(lines);
    }
    if (!(worst <= 4)) fail_msg("a line strays by %g", worst);
    texedges_set_free(blobs);
}

static void test_disturb_seeds(void **state) {
    (void)state;
    texedges_set *blobs = find_blobs(1, 0.3);
    texedges_stroke strokes[3];
    texedges_control c = control_of(blobs, strokes, draw_strokes(strokes, 1));
    texedges_set *a = disturb(&c, WIDE, WIDE), *b = disturb(&c, WIDE, WIDE);
    assert_int_equal(a->point_count, b->point_count);
    assert_memory_equal(a->points, b->points, a->point_count * sizeof *a->points);
    c.seed = 1;
    texedges_set *other = disturb(&c, WIDE, WIDE);
    assert_true(other->point_count != a->point_count ||
                memcmp(other->points, a->points, a->point_count * sizeof *a->points) != 0);
    texedges_set_free(b);
    texedges_set_free(other);

    /* a stroke's line does not depend on the others' layers, nor on how the edges were made */
    c.seed = 0;
    strokes[1].layer = 2;
    b = disturb(&c, WIDE, WIDE);
    assert_int_equal(a->lines[0].count, b->lines[0].count);
    assert_memory_equal(a->points, b->points, a->lines[0].count * sizeof *a->points);
    texedges_set_free(b);

    /* more and less disturbance */
    double stray[3];
    for (int k = 0; k < 3; k++) {
        c.disturb = k == 0 ? 0.25f : k == 1 ? 1.0f : 4.0f;
        b = disturb(&c, WIDE, WIDE);
        stray[k] = 0;
        for (size_t j = 0; j < b->lines[0].count; j++)
            stray[k] += distance_to_stroke(&strokes[0], b->points[j].x, b->points[j].y) /
                        (double)b->lines[0].count;
        texedges_set_free(b);
    }
    assert_true(stray[0] < 0.5 * stray[1] && stray[1] < stray[2]);
    texedges_set_free(a);
    texedges_set_free(blobs);
}

/* Without disturbance, or without edges in the exemplar, the line is the stroke itself. */
static void test_disturb_none(void **state) {
    (void)state;
    static uint8_t plain[64 * 64];
    texedges_set *none = find_numbers(plain, 64, 64, 3), *blobs = find_blobs(1, 0.3);
    const txm_vec2 square[4] = {{10, 10}, {10, 50}, {50, 50}, {50, 10}}; /* counterclockwise */
    const txm_vec2 segment[2] = {{20, 30}, {60, 30}};
    texedges_stroke strokes[2];
    memset(strokes, 0, sizeof strokes);
    strokes[0].points = square;
    strokes[0].count = 4;
    strokes[0].is_closed = 1;
    strokes[0].layer = 2;
    strokes[1].points = segment;
    strokes[1].count = 2;
    strokes[1].layer = 1;
    for (int k = 0; k < 2; k++) {
        texedges_control c = control_of(k ? blobs : none, strokes, 2);
        c.disturb = k ? -1.0f : 0;
        texedges_set *lines = disturb(&c, 80, 60);
        assert_int_equal(lines->lines[0].count, 4);
        for (int j = 0; j < 4; j++)
            assert_memory_equal(&lines->points[j], &square[3 - j], sizeof *square);
        const texedges_polyline *band = &lines->lines[1];
        for (size_t j = 0; j < band->count; j++) {
            const txm_vec2 p = lines->points[band->first + j];
            assert_true(fabs(distance_to(segment, 2, 0, p.x, p.y) - 4) < 1e-3);
        }
        const double expected = 40 * 8 + TXM_PI * 16, area = area_of(lines, band);
        assert_true(fabs(area - expected) < 0.01 * expected);
        texedges_set_free(lines);
    }
    texedges_control c = control_of(blobs, NULL, 0); /* no strokes at all */
    texedges_set *lines = disturb(&c, 80, 60);
    assert_int_equal(lines->line_count, 0);
    assert_int_equal(lines->point_count, 0);
    texedges_set_free(lines);
    texedges_set_free(none);
    texedges_set_free(blobs);
}

/* ---- statistics ------------------------------------------------------------------------- */

enum { BINS = 16 };

/* blur with weights radius + 1 - |d|; with a smaller radius near the ends of open lines */
static void blur(const double *from, double *to, int n, int is_closed, int radius) {
    for (int i = 0; i < n; i++) {
        double sum = 0, weights = 0;
        int r = radius;
        if (!is_closed && r > i) r = i;
        if (!is_closed && r > n - 1 - i) r = n - 1 - i;
        for (int d = -r; d <= r; d++) {
            sum += (r + 1 - abs(d)) * from[((i + d) % n + n) % n];
            weights += r + 1 - abs(d);
        }
        to[i] = sum / weights;
    }
}

/* The histogram of a run of points' direction against that of the run smoothed over 24 pixels: 16
   bins over half a turn. left and right of the middle apart. */
static void count_directions(double *x, double *y, int n, int is_closed, double middle,
                             double bins[2][BINS]) {
    enum { MOST = 40000 };
    static double u[MOST], v[MOST], cu[MOST], cv[MOST];
    if (n < 64 || n > MOST) return;
    blur(x, u, n, is_closed, 2);
    blur(y, v, n, is_closed, 2);
    double length = 0, from = 0;
    for (int i = 1; i < n + is_closed; i++)
        length += hypot(u[i % n] - u[i - 1], v[i % n] - v[i - 1]);
    const int m = (int)(length + 0.5);
    if (m < 64) return;
    for (int k = 0, j = 0; k < m; k++) { /* a point each pixel, into x and y */
        const double at = length * k / m;
        double span = hypot(u[(j + 1) % n] - u[j], v[(j + 1) % n] - v[j]);
        while (at > from + span && j + 1 < n) {
            from += span;
            j++;
            span = hypot(u[(j + 1) % n] - u[j], v[(j + 1) % n] - v[j]);
        }
        const double t = span > 0 ? (at - from) / span : 0;
        x[k] = u[j] + (u[(j + 1) % n] - u[j]) * t;
        y[k] = v[j] + (v[(j + 1) % n] - v[j]) * t;
    }
    blur(x, cu, m, is_closed, 24);
    blur(y, cv, m, is_closed, 24);
    const int trim = is_closed ? 0 : 24;
    for (int i = trim; i < m - trim; i++) {
        const int a = (i + m - 1) % m, b = (i + 1) % m, c = (i + m - 6) % m, d = (i + 6) % m;
        const double dx = x[b] - x[a], dy = y[b] - y[a], cx = cu[d] - cu[c], cy = cv[d] - cv[c];
        const double angle = atan2(cx * dy - cy * dx, cx * dx + cy * dy);
        bins[x[i] >= middle][((int)floor(angle / TXM_PI * BINS + 0.5) + 4 * BINS) % BINS] += 1;
    }
}

/* the edges of a layer, those along the picture's border left out */
static void count_edges(const texedges_set *e, int layer, double bins[2][BINS]) {
    static double x[40000], y[40000];
    memset(bins, 0, 2 * sizeof bins[0]);
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
        const txm_vec2 *p = e->points + line->first;
        const int count = (int)line->count;
        int start = -1, n = 0;
        if (line->layer != layer || count > 39000) continue;
        for (int k = 0; k <= 2 * count; k++) {
            const txm_vec2 a = p[k % count], b = p[(k + 1) % count];
            const int on_border = (a.x == b.x && (a.x == 0 || a.x == (float)e->width)) ||
                                  (a.y == b.y && (a.y == 0 || a.y == (float)e->height));
            if (start < 0 && !on_border && k < count) continue;
            if (start < 0) start = k;
            if (k == count && start == k) break; /* closed: below */
            if (k > start + count) break;
            if (on_border) {
                count_directions(x, y, n, 0, 0.5 * e->width, bins);
                n = 0;
            } else {
                x[n] = 0.5 * (a.x + b.x);
                y[n++] = 0.5 * (a.y + b.y);
            }
        }
        if (start < count) continue;
        for (n = 0; n < count; n++) {
            x[n] = 0.5 * (p[n].x + p[(n + 1) % count].x);
            y[n] = 0.5 * (p[n].y + p[(n + 1) % count].y);
        }
        count_directions(x, y, count, 1, 0.5 * e->width, bins);
    }
}

static double chi_square(const double *a, const double *b) {
    double sum = 0, an = 0, bn = 0;
    for (int i = 0; i < BINS; i++) an += a[i], bn += b[i];
    assert_true(an > 0 && bn > 0);
    for (int i = 0; i < BINS; i++) {
        const double p = a[i] / an, q = b[i] / bn;
        if (p + q > 0) sum += (p - q) * (p - q) / (p + q);
    }
    return sum;
}

/* The directions along disturbed strokes are those along the exemplar's edges: not much farther
   from them than its left half is from its right half. Both of the lines and of the edges that
   are found in the guide. */
static void test_statistics(void **state) {
    (void)state;
    tk_wide();
    static uint8_t guide[WIDE * WIDE], mask[WIDE * WIDE];
    static double x[40000], y[40000];
    for (int round = 0; round < 3; round++) {
        static uint8_t pixels[384 * 384];
        draw_blobs(pixels, 384, 5 + (uint64_t)round, 0.2 + 0.1 * round);
        texedges_desc d = desc_of(gray(pixels, 384, 384), 2, NULL);
        d.least = 24;
        texedges_set *e = find(&d);
        for (int layer = 0; layer < 2; layer++) {
            double halves[2][BINS], all[BINS], lines[BINS] = {0}, drawn[BINS] = {0}, bins[2][BINS];
            texedges_stroke strokes[3];
            count_edges(e, layer, halves);
            for (int b = 0; b < BINS; b++) all[b] = halves[0][b] + halves[1][b];
            texedges_control c = control_of(e, strokes, draw_strokes(strokes, layer));
            c.background = 1 - layer;
            for (c.seed = 0; c.seed < 4; c.seed++) {
                texedges_set *o = disturb(&c, WIDE, WIDE);
                for (size_t i = 0; i < o->line_count; i++) {
                    memset(bins, 0, sizeof bins);
                    for (size_t j = 0; j < o->lines[i].count; j++) {
                        x[j] = o->points[o->lines[i].first + j].x;
                        y[j] = o->points[o->lines[i].first + j].y;
                    }
                    count_directions(x, y, (int)o->lines[i].count, 1, 0, bins);
                    for (int b = 0; b < BINS; b++) lines[b] += bins[1][b];
                }
                guide_of(&c, o, guide, mask);
                const texedges_desc g = desc_of(gray(guide, WIDE, WIDE), 2, NULL);
                texedges_set *found = find(&g);
                count_edges(found, layer, bins);
                for (int b = 0; b < BINS; b++) drawn[b] += bins[0][b] + bins[1][b];
                texedges_set_free(found);
                texedges_set_free(o);
            }
            const double own = chi_square(halves[0], halves[1]);
            const double line = chi_square(lines, all), edge = chi_square(drawn, all);
            if (line > 1.5 * own || edge > 1.5 * own)
                fail_msg("round %d layer %d: halves %.4f, lines %.4f, guide %.4f", round, layer,
                         own, line, edge);
        }
        texedges_set_free(e);
    }
}

/* ---- the guide -------------------------------------------------------------------------- */

static int64_t fixed(float x) {
    return (int64_t)floor(x * 256.0 + 0.5);
}

/* winding number of a closed line in 256ths of a pixel around a pixel's centre */
static int winding_of(const txm_vec2 *p, int count, int x, int y) {
    const int64_t cx = 256 * (int64_t)x + 128, cy = 256 * (int64_t)y + 128;
    int sum = 0;
    for (int i = 0; i < count; i++) {
        const txm_vec2 a = p[i], b = p[(i + 1) % count];
        const int64_t ax = fixed(a.x), ay = fixed(a.y), bx = fixed(b.x), by = fixed(b.y);
        const int64_t side = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay); /* < 0: to the right */
        if ((ay <= cy) == (by <= cy)) continue;
        if (ay < by ? side <= 0 : side >= 0) sum += ay < by ? 1 : -1;
    }
    return sum;
}

static void test_guide_fill(void **state) {
    (void)state;
    enum { W = 70, H = 50 };
    static uint8_t guide[W * H], mask[W * H], plain[16 * 16];
    static txm_vec2 points[4][40];
    texedges_set *none = find_numbers(plain, 16, 16, 5);
    txm_rng rng = txm_rng_make(8, 8);
    for (int i = 0; i < 200; i++) {
        texedges_stroke strokes[4];
        memset(strokes, 0, sizeof strokes);
        for (int k = 0; k < 4; k++) {
            strokes[k].points = points[k];
            strokes[k].count = txm_rng_range(&rng, 3, i % 2 ? 40 : 5);
            strokes[k].is_closed = 1;
            strokes[k].layer = (int)txm_rng_below(&rng, 5);
            for (int j = 0; j < strokes[k].count; j++) { /* also on centres, corners, outside */
                float x = 90 * txm_rng_float(&rng) - 10, y = 70 * txm_rng_float(&rng) - 10;
                if (i % 3) x = floorf(2 * x) / 2, y = floorf(2 * y) / 2;
                points[k][j] = txm_v2(x, y);
            }
            points[k][0].x = 30.25f;
        }
        texedges_control c = control_of(none, strokes, 4);
        c.background = (int)txm_rng_below(&rng, 5);
        texedges_set *lines = disturb(&c, W, H);
        guide_of(&c, lines, guide, mask);
        for (int p = 0; p < W * H; p++) {
            int layer = c.background;
            for (int k = 0; k < 4; k++) {
                const txm_vec2 *at = lines->points + lines->lines[k].first;
                if (winding_of(at, strokes[k].count, p % W, p / W)) layer = strokes[k].layer;
            }
            assert_int_equal(guide[p], (int)(255.0 * layer / 4 + 0.5));
            assert_int_equal(mask[p], 255);
        }
        texedges_set_free(lines);
    }

    /* two squares that share a side through pixel centres: each pixel belongs to one of them */
    const txm_vec2 left[4] = {{4.5f, 4.5f}, {20.5f, 4.5f}, {20.5f, 20.5f}, {4.5f, 20.5f}};
    const txm_vec2 right[4] = {{20.5f, 4.5f}, {36.5f, 4.5f}, {36.5f, 20.5f}, {20.5f, 20.5f}};
    texedges_stroke strokes[2];
    memset(strokes, 0, sizeof strokes);
    int counts[5] = {0};
    for (int k = 0; k < 2; k++) {
        strokes[k].points = k ? right : left;
        strokes[k].count = 4;
        strokes[k].is_closed = 1;
        strokes[k].layer = k + 1;
    }
    texedges_control c = control_of(none, strokes, 2);
    texedges_set *lines = disturb(&c, W, H);
    guide_of(&c, lines, guide, mask);
    for (int p = 0; p < W * H; p++) counts[(guide[p] + 32) / 64]++;
    assert_int_equal(counts[1], 256);
    assert_int_equal(counts[2], 256);
    assert_int_equal(guide[4 * W + 4], 64);
    assert_int_equal(guide[20 * W + 20], 0);
    texedges_set_free(lines);
    texedges_set_free(none);
}

static void test_guide_free(void **state) {
    (void)state;
    enum { W = 90, H = 60 };
    static uint8_t guide[W * H], mask[W * H], layer[96 * 96];
    for (int i = 0; i < 96 * 96; i++) layer[i] = (uint8_t)(i % 96 / 24); /* bars 0 1 2 3 */
    for (int i = 0; i < 96 * 48; i++) layer[i] = layer[i] == 1 ? 3 : layer[i];
    texedges_set *e = find_numbers(layer, 96, 96, 4);
    const txm_vec2 a[4] = {{10, 10}, {30, 12}, {32, 30}, {12, 28}};
    const txm_vec2 b[4] = {{44, 6}, {80, 6}, {84, 50}, {70, 54}};
    texedges_stroke strokes[2];
    memset(strokes, 0, sizeof strokes);
    for (int k = 0; k < 2; k++) {
        strokes[k].points = k ? b : a;
        strokes[k].count = 4;
        strokes[k].is_closed = 1;
        strokes[k].layer = k ? 2 : 0;
    }
    texedges_control c = control_of(e, strokes, 2);
    c.background = -1;
    texedges_set *lines = disturb(&c, W, H);
    guide_of(&c, lines, guide, mask);
    assert_true(e->beside[0] >= 0 && e->beside[0] != 0 && e->beside[2] >= 0 && e->beside[2] != 2);
    for (int p = 0; p < W * H; p++) {
        const int x = p % W, y = p / W;
        int own = -1, near[2] = {1000, 1000};
        for (int q = 0; q < W * H; q++) { /* squares of distances to pixels of either stroke */
            const int d = (q % W - x) * (q % W - x) + (q / W - y) * (q / W - y);
            if (d > 64) continue;
            for (int k = 0; k < 2; k++) {
                const texedges_polyline *line = &lines->lines[k];
                if (d >= near[k]) continue;
                if (winding_of(lines->points + line->first, (int)line->count, q % W, q / W))
                    near[k] = d;
            }
        }
        for (int k = 0; k < 2; k++) own = near[k] == 0 ? strokes[k].layer : own;
        assert_int_equal(mask[p], near[0] <= 64 || near[1] <= 64 ? 255 : 0);
        if (!mask[p]) continue;
        if (own >= 0) assert_int_equal(guide[p], 85 * own);
        else if (near[0] < near[1]) assert_int_equal(guide[p], 85 * e->beside[0]);
        else if (near[1] < near[0]) assert_int_equal(guide[p], 85 * e->beside[2]);
        else assert_true(guide[p] == 85 * e->beside[0] || guide[p] == 85 * e->beside[2]);
    }
    texedges_set_free(lines);

    c.stroke_count = 0; /* no strokes: the guide counts nowhere */
    lines = disturb(&c, W, H);
    guide_of(&c, lines, guide, mask);
    for (int p = 0; p < W * H; p++) assert_int_equal(mask[p], 0);
    texedges_set_free(lines);
    texedges_set_free(e);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_disturb),
        cmocka_unit_test(test_disturb_anything),
        cmocka_unit_test(test_disturb_seeds),
        cmocka_unit_test(test_disturb_none),
        cmocka_unit_test(test_statistics),
        cmocka_unit_test(test_guide_fill),
        cmocka_unit_test(test_guide_free),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
