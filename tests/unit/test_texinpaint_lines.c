/* test_texinpaint_lines.c - lines that end at a hole, and how they are joined
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_lines && build/tests/unit/test_texinpaint_lines */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "texinpaint/judge.h"

#include "testkit.h"

/* ---- windows ----------------------------------------------------------------------------- */

enum { SIDE = 160, PIXELS = SIDE * SIDE };

/* A flat window with a round hole, and the same picture without one. */
typedef struct scene {
    txi_window w;
    uint8_t state[PIXELS], color[4 * PIXELS], whole[4 * PIXELS];
    txm_vec3 place[PIXELS], normal[PIXELS];
} scene;

static const txm_vec2 centre = {80, 78};

/* how much of a pixel is on the positive side of an edge at that distance */
static double step_at(double distance) {
    return distance < -0.5 ? 0 : distance > 0.5 ? 1 : distance + 0.5;
}

static scene *scene_make(double radius, void (*paint)(double x, double y, double rgb[3])) {
    scene *s = (scene *)calloc(1, sizeof *s);
    s->w.width = s->w.height = SIDE;
    s->w.state = s->state;
    s->w.color = s->color;
    s->w.place = s->place;
    s->w.normal = s->normal;
    for (int i = 0; i < PIXELS; i++) {
        const int column = i % SIDE, line = i / SIDE;
        const double x = column, y = line;
        double rgb[3] = {0, 0, 0};
        paint(x, y, rgb);
        const int hole = hypot(x - centre.x, y - centre.y) < radius;
        s->state[i] = hole ? TXI_HOLE : TXI_KNOWN;
        for (int c = 0; c < 3; c++) {
            s->whole[4 * i + c] = (uint8_t)(rgb[c] + 0.5);
            s->color[4 * i + c] = hole ? 0 : s->whole[4 * i + c];
        }
        s->place[i] = txm_v3((float)x, (float)y, 0);
        s->normal[i] = txm_v3(0, 0, 1);
    }
    return s;
}

/* a bar of a colour over what is there: |distance of (x, y) from the line through (px, py) at that
   angle| < half */
static void bar(double x, double y, double px, double py, double angle, double half,
                const double ink[3], double rgb[3]) {
    const double d = (x - px) * -sin(angle) + (y - py) * cos(angle), k = step_at(half - fabs(d));
    for (int c = 0; c < 3; c++) rgb[c] += k * (ink[c] - rgb[c]);
}

static const double white[3] = {220, 215, 210}, black[3] = {30, 30, 35}, red[3] = {190, 40, 40};

static void paint_bars(double x, double y, double rgb[3]) {
    memcpy(rgb, white, sizeof white);
    bar(x, y, 80, 78, 0.3, 6, red, rgb);
    bar(x, y, 82, 70, 1.7, 4, black, rgb);
}

static void paint_circle(double x, double y, double rgb[3]) {
    const double k = step_at(hypot(x - 80, y - 148) - 70);
    for (int c = 0; c < 3; c++) rgb[c] = black[c] + k * (white[c] - black[c]);
}

static void paint_stripes(double x, double y, double rgb[3]) {
    const double k = 0.5 + 0.5 * sin(0.28 * (x + 12 * sin(0.03 * y)));
    for (int c = 0; c < 3; c++) rgb[c] = black[c] + k * (white[c] - black[c]);
}

static void paint_grain(double x, double y, double rgb[3]) {
    const uint64_t h = txm_hash((uint64_t)(x * 1000 + y) + 1);
    for (int c = 0; c < 3; c++) rgb[c] = 60 + (double)(h >> (8 * c) & 127);
}

static void paint_flat(double x, double y, double rgb[3]) {
    (void)x;
    (void)y;
    memcpy(rgb, white, sizeof white);
}

/* a vertical edge, with a bump of 12 pixels where the hole is */
static double bump(double y) {
    const double t = (y - centre.y) / 24;
    return 80 + 12 * (t > -1 && t < 1 ? (1 - t * t) * (1 - t * t) : 0);
}

static void paint_bump(double x, double y, double rgb[3]) {
    const double k = step_at(x - bump(y));
    for (int c = 0; c < 3; c++) rgb[c] = black[c] + k * (white[c] - black[c]);
}

typedef struct result {
    txm_arena arena;
    txi_lines lines;
    txi_curve *curves;
    int count;
} result;

static void join(const scene *s, const txi_prior *prior, int structure, result *r) {
    txm_arena_init(&r->arena, NULL);
    assert_int_equal(txi_trace(&s->w, &r->arena, NULL, &r->lines), TXM_OK);
    assert_int_equal(txi_join(&s->w, &r->lines, prior, structure, 0, 0, 1, &r->arena, NULL, &r->curves,
                              &r->count),
                     TXM_OK);
}

static double bar_distance(txm_vec2 p, double px, double py, double angle, double half) {
    return fabs(fabs((p.x - px) * -sin(angle) + (p.y - py) * cos(angle)) - half);
}

/* ---- distances --------------------------------------------------------------------------- */

static void test_distances_are_exact(void **state) {
    (void)state;
    enum { W = 37, H = 23 };
    uint8_t of[W * H];
    int32_t row[3 * W], out[W * H];
    for (int round = 0; round < 30; round++) {
        txm_rng rng = txm_rng_make((uint64_t)round, 0);
        for (int i = 0; i < W * H; i++) of[i] = txm_rng_below(&rng, 1 + 4u * (uint32_t)round) == 0;
        if (round == 29) memset(of, 0, sizeof of);
        txi_distances(of, W, H, row, out);
        for (int i = 0; i < W * H; i++) {
            int best = TXI_FAR;
            for (int j = 0; j < W * H; j++) {
                const int dx = i % W - j % W, dy = i / W - j / W;
                if (of[j] && dx * dx + dy * dy < best) best = dx * dx + dy * dy;
            }
            assert_int_equal(out[i], best);
        }
    }
}

/* ---- ends -------------------------------------------------------------------------------- */

static void test_ends_of_bars(void **state) {
    (void)state;
    scene *s = scene_make(30, paint_bars);
    result r;
    join(s, NULL, TEXINPAINT_PICTURE, &r);
    assert_int_equal(r.lines.end_count, 8);
    assert_true(r.lines.share_long > 0.99f);
    assert_true(fabsf(r.lines.width - 60) < 4);
    for (int i = 0; i < 8; i++) {
        const txi_end *e = &r.lines.ends[i];
        const double d0 = bar_distance(e->place, 80, 78, 0.3, 6);
        const double d1 = bar_distance(e->place, 82, 70, 1.7, 4);
        const double angle = d0 < d1 ? 0.3 : 1.7;
        assert_true(d0 < 0.4 || d1 < 0.4);
        assert_true(fabs(e->heading.x * cos(angle) + e->heading.y * sin(angle)) > 0.9995);
        assert_true(hypot(e->place.x - centre.x, e->place.y - centre.y) > 28.5);
        assert_true(e->heading.x * (centre.x - e->place.x) + e->heading.y * (centre.y - e->place.y) > 0);
        assert_true(fabs((double)e->curvature) < 0.004);
        assert_true(e->contrast > 90);
    }
    txm_arena_free(&r.arena);
    free(s);
}

static void test_no_lines_where_there_are_none(void **state) {
    (void)state;
    scene *grain = scene_make(30, paint_grain), *flat = scene_make(30, paint_flat);
    result r;
    join(grain, NULL, TEXINPAINT_PICTURE, &r);
    assert_true(r.lines.share_long < 0.45f); /* it does not count as structure                    */
    txm_arena_free(&r.arena);
    /* the border of the hole and that of the surface are no lines                                 */
    for (int i = 0; i < PIXELS; i++) {
        if (i % SIDE < 60 && i / SIDE > 40) flat->state[i] = TXI_VOID;
    }
    join(flat, NULL, TEXINPAINT_PATTERN, &r);
    assert_int_equal(r.lines.thin_count, 0);
    assert_int_equal(r.lines.end_count, 0);
    assert_int_equal(r.count, 0);
    txm_arena_free(&r.arena);
    free(grain);
    free(flat);
}

/* ---- joins ------------------------------------------------------------------------------- */

static void test_bars_cross(void **state) {
    (void)state;
    scene *s = scene_make(30, paint_bars);
    result r;
    join(s, NULL, TEXINPAINT_PICTURE, &r);
    assert_int_equal(r.count, 4);
    for (int i = 0; i < 4; i++) {
        const txi_curve *c = &r.curves[i];
        assert_true(c->ends[0] >= 0 && c->ends[1] >= 0 && c->first > 0 && c->last < c->count - 1);
        const int red_bar = bar_distance(c->points[c->first], 80, 78, 0.3, 6) < 1;
        for (int k = 0; k < c->count; k++) {
            const txm_vec2 p = c->points[k];
            const int inside = s->state[(int)(p.y + 0.5f) * SIDE + (int)(p.x + 0.5f)] == TXI_HOLE;
            assert_true(red_bar ? bar_distance(p, 80, 78, 0.3, 6) < 0.8
                                : bar_distance(p, 82, 70, 1.7, 4) < 0.8);
            assert_int_equal(inside, k >= c->first && k <= c->last);
            if (k) assert_true(txi_distance(p, c->points[k - 1]) < 1.6);
        }
        assert_true(c->cost < 1.5f);
        assert_true(txi_curve_bend(c) < 0.02);
    }
    assert_true(txi_straight_share(&r.lines, r.curves, r.count) > 0.99);
    txm_arena_free(&r.arena);
    free(s);
}

static void test_circle_goes_on(void **state) {
    (void)state;
    scene *s = scene_make(30, paint_circle);
    result r;
    join(s, NULL, TEXINPAINT_PATTERN, &r);
    assert_int_equal(r.lines.end_count, 2);
    assert_int_equal(r.count, 1);
    for (int i = 0; i < 2; i++) assert_true(fabs(fabs((double)r.lines.ends[i].curvature) - 1 / 70.0) < 0.003);
    for (int k = 0; k < r.curves[0].count; k++) {
        const txm_vec2 p = r.curves[0].points[k];
        assert_true(fabs(hypot(p.x - 80, p.y - 148) - 70) < 0.7);
    }
    txm_arena_free(&r.arena);
    free(s);
}

static void test_stripes(void **state) {
    (void)state;
    scene *s = scene_make(36, paint_stripes);
    for (int structure = TEXINPAINT_PICTURE; structure <= TEXINPAINT_PATTERN; structure++) {
        result r;
        join(s, NULL, structure, &r);
        assert_true(r.lines.end_count >= 10);
        assert_true(2 * r.count >= r.lines.end_count - 2);
        for (int i = 0; i < r.count; i++) {
            const txi_curve *c = &r.curves[i];
            for (int k = c->first; k <= c->last; k++) { /* on an edge, where the sine is 0           */
                const txm_vec2 p = c->points[k];
                assert_true(fabs(sin(0.28 * (p.x + 12 * sin(0.03 * p.y)))) < 0.75);
            }
        }
        txm_arena_free(&r.arena);
    }
    free(s);
}

/* A prior line that runs as the edge does, which nothing around the hole tells. */
static void test_prior_attracts(void **state) {
    (void)state;
    scene *s = scene_make(28, paint_bump);
    txm_vec2 points[SIDE];
    int starts[2] = {0, SIDE};
    txi_prior prior;
    double worst[2] = {0, 0};
    for (int i = 0; i < SIDE; i++) points[i] = txm_v2((float)bump(i) + 2, (float)i);
    prior.points = points;
    prior.starts = starts;
    prior.line_count = 1;
    for (int with = 0; with < 2; with++) {
        result r;
        join(s, with ? &prior : NULL, TEXINPAINT_PICTURE, &r);
        assert_int_equal(r.count, 1);
        for (int k = 0; k < r.curves[0].count; k++) {
            const txm_vec2 p = r.curves[0].points[k];
            worst[with] = fmax(worst[with], fabs(p.x - bump(p.y)));
        }
        txm_arena_free(&r.arena);
    }
    assert_true(worst[0] > 10);
    assert_true(worst[1] < 2.5);
    free(s);
}

/* ---- what a result keeps ----------------------------------------------------------------- */

static void test_continued(void **state) {
    (void)state;
    scene *s = scene_make(30, paint_bars);
    uint8_t *gray = (uint8_t *)malloc(4 * PIXELS);
    result r;
    double whole, lost;
    join(s, NULL, TEXINPAINT_PICTURE, &r);
    memcpy(gray, s->whole, 4 * PIXELS);
    for (int i = 0; i < PIXELS; i++) {
        if (s->state[i] == TXI_HOLE) memset(gray + 4 * i, 190, 4);
    }
    assert_int_equal(txi_continued(&s->w, &r.lines, s->whole, NULL, &whole), TXM_OK);
    assert_int_equal(txi_continued(&s->w, &r.lines, gray, NULL, &lost), TXM_OK);
    assert_true(whole > 0.85);
    assert_true(lost < 0.2);
    txm_arena_free(&r.arena);
    free(gray);
    free(s);
}

/* ---- same bytes, faults ------------------------------------------------------------------ */

static uint64_t hash_curves(const result *r) {
    uint64_t h = 0;
    for (int i = 0; i < r->count; i++)
        h = tk_hash(h, r->curves[i].points, (size_t)r->curves[i].count * sizeof(txm_vec2));
    return h;
}

static void test_threads_do_not_matter(void **state) {
    (void)state;
    scene *s = scene_make(36, paint_stripes);
    result a, b;
    txm_env env = {0};
    join(s, NULL, TEXINPAINT_PICTURE, &a);
    env.parallel_for = tk_parallel_reverse;
    txm_arena_init(&b.arena, NULL);
    assert_int_equal(txi_trace(&s->w, &b.arena, &env, &b.lines), TXM_OK);
    assert_int_equal(txi_join(&s->w, &b.lines, NULL, TEXINPAINT_PICTURE, 0, 0, 99, &b.arena, &env,
                              &b.curves, &b.count),
                     TXM_OK);
    assert_true(hash_curves(&a) == hash_curves(&b)); /* nor does the seed, here                     */
    txm_arena_free(&a.arena);
    txm_arena_free(&b.arena);
    free(s);
}

static txm_status trace_and_join(void *context, txm_env *env) {
    const scene *s = (const scene *)context;
    result r;
    double share;
    txm_arena_init(&r.arena, env);
    txm_status status = txi_trace(&s->w, &r.arena, env, &r.lines);
    if (status == TXM_OK)
        status = txi_join(&s->w, &r.lines, NULL, TEXINPAINT_PICTURE, 0, 0, 1, &r.arena, env, &r.curves,
                          &r.count);
    if (status == TXM_OK) status = txi_continued(&s->w, &r.lines, s->whole, env, &share);
    txm_arena_free(&r.arena);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    scene *s = scene_make(30, paint_bars);
    assert_true(tk_sweep(trace_and_join, s, TK_ALLOCATION) > 20);
    assert_true(tk_sweep(trace_and_join, s, TK_CANCEL) > 4);
    free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_distances_are_exact),
        cmocka_unit_test(test_ends_of_bars),
        cmocka_unit_test(test_no_lines_where_there_are_none),
        cmocka_unit_test(test_bars_cross),
        cmocka_unit_test(test_circle_goes_on),
        cmocka_unit_test(test_stripes),
        cmocka_unit_test(test_prior_attracts),
        cmocka_unit_test(test_continued),
        cmocka_unit_test(test_threads_do_not_matter),
        cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
