/* test_texinpaint_strip.c - strips of texture along lines that are known in pictures made for it
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_strip && build/tests/unit/test_texinpaint_strip */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "texinpaint/lay.h"
#include "testkit.h"

/* ---- pictures with a hole, and curves through it ------------------------------------------- */

enum { SIDE = 160, MOST = 8, POINTS = 400 };

typedef struct scene {
    uint8_t color[4 * SIDE * SIDE], truth[4 * SIDE * SIDE], state[SIDE * SIDE];
    txi_window w;
    txi_curve curves[MOST];
    txm_vec2 points[MOST][POINTS];
    int count;
} scene;

/* RGB of a place */
typedef void paint(double x, double y, double rgb[3]);

static scene *new_scene(paint *of, double radius) {
    scene *s = (scene *)calloc(1, sizeof *s);
    const double middle = 0.5 * (SIDE - 1);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const size_t i = (size_t)(y * SIDE + x);
            const double dx = x - middle, dy = y - middle;
            double sum[3] = {0, 0, 0}, rgb[3];
            for (int k = 0; k < 16; k++) { /* 4 x 4 samples a pixel */
                of(x + (k % 4 - 1.5) / 4, y + (k / 4 - 1.5) / 4, rgb);
                for (int c = 0; c < 3; c++) sum[c] += rgb[c] / 16;
            }
            for (int c = 0; c < 3; c++) s->truth[4 * i + (size_t)c] = (uint8_t)(sum[c] + 0.5);
            s->state[i] = dx * dx + dy * dy < radius * radius ? TXI_HOLE : TXI_KNOWN;
            if (s->state[i] == TXI_KNOWN) memcpy(s->color + 4 * i, s->truth + 4 * i, 4);
            else memset(s->color + 4 * i, 128, 3);
        }
    }
    s->w.width = s->w.height = SIDE;
    s->w.state = s->state;
    s->w.color = s->color;
    return s;
}

/* A curve from its points; joined: both ends are line ends. */
static txi_curve *end_curve(scene *s, int count, int joined) {
    txi_curve *c = &s->curves[s->count];
    c->points = s->points[s->count++];
    c->count = count;
    c->first = count;
    c->last = -1;
    for (int i = 0; i < count; i++) {
        const ptrdiff_t at =
            txi_pixel(SIDE, SIDE, (double)c->points[i].x, (double)c->points[i].y);
        if (at < 0 || s->state[at] != TXI_HOLE) continue;
        if (c->first > i) c->first = i;
        c->last = i;
    }
    c->ends[0] = 0;
    c->ends[1] = joined ? 1 : -1;
    c->strength = 100;
    c->partner = -1;
    return c;
}

/* A straight curve from (x, y), n points in a direction given by a Pythagorean triple. */
static txi_curve *add_line(scene *s, double x, double y, double dx, double dy, int n, int joined) {
    for (int i = 0; i < n; i++)
        s->points[s->count][i] = txm_v2(txm_float(x + i * dx), txm_float(y + i * dy));
    return end_curve(s, n, joined);
}

/* Part of a circle. */
static txi_curve *add_arc(scene *s, double x, double y, double radius, double from, int n) {
    for (int i = 0; i < n; i++) {
        double sine, cosine;
        txm_sincos(from + i / radius, &sine, &cosine);
        s->points[s->count][i] =
            txm_v2(txm_float(x + radius * cosine), txm_float(y + radius * sine));
    }
    return end_curve(s, n, 1);
}

typedef struct laid {
    txm_arena arena;
    txi_plan plan;
} laid;

static laid lay(const scene *s, txm_env *env) {
    laid l;
    txm_arena_init(&l.arena, env);
    assert_int_equal(txi_plan_make(&s->w, NULL, s->curves, s->count, 1, &l.arena, env, &l.plan),
                     TXM_OK);
    return l;
}

/* Mean absolute difference from the truth where the plan pulls at least this much, and how many
   pixels that are. */
static double error_of(const scene *s, const txi_plan *plan, int pull, int *pixels) {
    double sum = 0;
    *pixels = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        if (plan->pull[i] < pull) continue;
        (*pixels)++;
        for (int c = 0; c < 3; c++) sum += abs(plan->color[4 * i + c] - s->truth[4 * i + c]) / 3.0;
    }
    return *pixels ? sum / *pixels : 0;
}

/* What must hold for every plan. */
static void check_plan(const scene *s, const laid *l) {
    for (int i = 0; i < SIDE * SIDE; i++) {
        const txi_copy *copy = &l->plan.copies[i];
        assert_true(s->state[i] == TXI_HOLE || (!l->plan.pull[i] && copy->piece < 0));
        assert_true(l->plan.color[4 * i + 3] <= TXI_GUIDE_TOP);
        if (copy->piece < 0) continue;
        assert_true(l->plan.pull[i] > 0);
        assert_in_range(copy->pose, 0, l->plan.pose_count - 1);
        const ptrdiff_t from = txi_pixel(SIDE, SIDE, (double)copy->x, (double)copy->y);
        assert_true(from >= 0 && s->state[from] == TXI_KNOWN);
    }
    for (int i = 0; i < l->plan.pose_count; i++) { /* rotations, perhaps mirrored */
        const txi_pose *p = &l->plan.poses[i];
        assert_true(fabs((double)(p->a * p->a + p->b * p->b) - 1) < 1e-5);
        assert_true(fabs((double)(p->c * p->c + p->d * p->d) - 1) < 1e-5);
        assert_true(fabs((double)(p->a * p->c + p->b * p->d)) < 1e-5);
    }
}

/* ---- what is painted ---- */

/* along and across a line through the middle in direction (.8, .6) */
static double along_of(double x, double y) {
    return 0.8 * (x - 79.5) + 0.6 * (y - 79.5);
}
static double across_of(double x, double y) {
    return 0.8 * (y - 79.5) - 0.6 * (x - 79.5);
}

static void paint_edge(double x, double y, double rgb[3]) {
    const double d = across_of(x, y);
    rgb[0] = d < 0 ? 60 : 200;
    rgb[1] = d < 0 ? 90 : 180;
    rgb[2] = d < 0 ? 120 : 160;
}

/* marks across the edge every 10 pixels along it */
static void paint_ticks(double x, double y, double rgb[3]) {
    const double s = along_of(x, y) + 1000, d = across_of(x, y);
    paint_edge(x, y, rgb);
    if (s - 10 * floor(s / 10) < 4 && d > -8 && d < 0) rgb[0] = rgb[1] = rgb[2] = 0;
}

/* a bar, 12 wide, with bands 16 apart */
static void paint_bar(double x, double y, double rgb[3]) {
    const double s = along_of(x, y) + 1600, d = across_of(x, y);
    rgb[0] = rgb[1] = rgb[2] = 220;
    if (d <= -6 || d >= 6) return;
    rgb[0] = s - 16 * floor(s / 16) < 6 ? 200 : 90;
    rgb[1] = 60;
    rgb[2] = 40;
}

/* brighter towards the right */
static void paint_shaded(double x, double y, double rgb[3]) {
    paint_edge(x, y, rgb);
    for (int c = 0; c < 3; c++) rgb[c] = 0.8 * rgb[c] + 0.3 * x;
}

static void paint_disk(double x, double y, double rgb[3]) {
    const double dx = x - 79.5, dy = y - 160, r = sqrt(dx * dx + dy * dy);
    rgb[0] = r < 80 ? 40 : 210;
    rgb[1] = r < 80 ? 160 : 200;
    rgb[2] = r < 74 ? 40 : r < 80 ? 255 : 190;
}

/* the bar over another one that crosses it at a right angle */
static void paint_cross(double x, double y, double rgb[3]) {
    const double s = along_of(x, y), d = across_of(x, y);
    paint_bar(x, y, rgb);
    if ((d <= -6 || d >= 6) && s > -5 && s < 5) rgb[0] = 20, rgb[1] = 40, rgb[2] = 150;
}

/* ---- single lines ---- */

static void check_line(paint *of, double most) {
    scene *s = new_scene(of, 30);
    int core, all;
    add_line(s, 79.5 - 72, 79.5 - 54, 0.8, 0.6, 181, 1);
    laid l = lay(s, NULL);
    check_plan(s, &l);
    const double error = error_of(s, &l.plan, 255, &core), wide = error_of(s, &l.plan, 1, &all);
    if (error > most || wide > most) fail_msg("error %g within the core, %g of all", error, wide);
    assert_in_range(core, 6 * 60, 8 * 60); /* 3 pixels to each side, over 60 pixels */
    assert_in_range(all, 17 * 56, 20 * 61);
    txm_arena_free(&l.arena);
    free(s);
}

static void test_lines_are_continued(void **state) {
    (void)state;
    check_line(paint_edge, 1);
    check_line(paint_ticks, 6); /* in phase: out of phase it is 30 */
    check_line(paint_shaded, 5); /* the step is not as high everywhere */
}

static void test_circle_is_continued(void **state) {
    scene *s = new_scene(paint_disk, 26);
    int pixels;
    (void)state;
    add_arc(s, 79.5, 160, 80, -TXM_PI * 0.8, 190);
    laid l = lay(s, NULL);
    check_plan(s, &l);
    assert_true(error_of(s, &l.plan, 1, &pixels) < 3);
    assert_true(pixels > 17 * 50);
    txm_arena_free(&l.arena);
    free(s);
}

/* A line that ends in the hole counts less and less towards its end. */
static void test_open_end_fades(void **state) {
    scene *s = new_scene(paint_edge, 30);
    (void)state;
    txi_curve *c = add_line(s, 79.5 - 72, 79.5 - 54, 0.8, 0.6, 90, 0);
    laid l = lay(s, NULL);
    check_plan(s, &l);
    int last = 255;
    for (int i = c->first + 2; i < c->count; i++) {
        const ptrdiff_t at = txi_pixel(SIDE, SIDE, (double)c->points[i].x, (double)c->points[i].y);
        assert_true(l.plan.pull[at] <= last + 1);
        last = l.plan.pull[at];
    }
    assert_true(last < 64);
    txm_arena_free(&l.arena);
    free(s);
}

/* A line that is off by a pixel on one side of the hole is moved to where the edge is. */
static void test_lines_are_registered(void **state) {
    scene *s = new_scene(paint_edge, 30);
    txm_arena scratch;
    txi_ribbon r;
    (void)state;
    const txi_curve *c = add_line(s, 79.5 - 72, 79.5 - 54, 0.8, 0.6, 181, 1);
    for (int i = 0; i < c->count; i++) { /* -0.5 pixels in front, +0.5 behind */
        const double off = i < c->first ? -0.5 : i > c->last ? 0.5 : 0;
        c->points[i].x = txm_float((double)c->points[i].x - 0.6 * off);
        c->points[i].y = txm_float((double)c->points[i].y + 0.8 * off);
    }
    txm_arena_init(&scratch, NULL);
    assert_int_equal(txi_ribbon_make(c->points, c->count, &scratch, &r, NULL), TXM_OK);
    assert_int_equal(txi_ribbon_register(&s->w, &r, &scratch, NULL), TXM_OK);
    for (int i = 0; i < c->count; i++) {
        if (i > c->first - 12 && i < c->last + 12) continue;
        const double d = across_of((double)r.place[i].x, (double)r.place[i].y);
        if (!(d > -0.2 && d < 0.2)) fail_msg("column %d is off by %g pixels", i, d);
    }
    txm_arena_free(&scratch);
    free(s);
}

/* ---- strokes ---- */

static void add_bar(scene *s, double half, int turned) {
    add_line(s, 79.5 - 72 + 0.6 * half, 79.5 - 54 - 0.8 * half, 0.8, 0.6, 181, 1);
    if (turned)
        add_line(s, 79.5 + 72 - 0.6 * half, 79.5 + 54 + 0.8 * half, -0.8, -0.6, 181, 1);
    else
        add_line(s, 79.5 - 72 - 0.6 * half, 79.5 - 54 + 0.8 * half, 0.8, 0.6, 181, 1);
}

static void test_strokes_are_found(void **state) {
    int partners[MOST];
    float widths[MOST * MOST];
    (void)state;
    for (int turned = 0; turned < 2; turned++) {
        scene *s = new_scene(paint_bar, 30);
        add_bar(s, 6, turned);
        txi_find_strokes(&s->w, s->curves, s->count, partners, widths);
        assert_int_equal(partners[0], 1);
        assert_int_equal(partners[1], 0);
        s->curves[1].ends[turned ? 0 : 1] = -1; /* one of them ends in the hole */
        txi_find_strokes(&s->w, s->curves, s->count, partners, widths);
        assert_int_equal(partners[0], -1);
        free(s);
    }
    scene *s = new_scene(paint_edge, 30); /* nothing like a second side */
    add_bar(s, 6, 0);
    txi_find_strokes(&s->w, s->curves, s->count, partners, widths);
    assert_int_equal(partners[0], -1);
    free(s);
}

static void test_stroke_is_completed_as_one(void **state) {
    (void)state;
    for (int turned = 0; turned < 2; turned++) {
        scene *s = new_scene(paint_bar, 30);
        int pixels;
        add_bar(s, 6, turned);
        laid l = lay(s, NULL);
        check_plan(s, &l);
        const double error = error_of(s, &l.plan, 255, &pixels);
        if (error > 6) fail_msg("error %g", error);
        assert_in_range(pixels, 17 * 56, 19 * 61);
        txm_arena_free(&l.arena);
        free(s);
    }
}

static void test_strokes_cross(void **state) {
    scene *s = new_scene(paint_cross, 30);
    int pixels;
    (void)state;
    add_bar(s, 6, 0);
    for (int side = -1; side < 2; side += 2) { /* the other bar, less strong */
        txi_curve *c = add_line(s, 79.5 + 54 + 5 * side * 0.8, 79.5 - 72 + 5 * side * 0.6, -0.6, 0.8,
                                181, 1);
        c->strength = 50;
    }
    laid l = lay(s, NULL);
    check_plan(s, &l);
    const double error = error_of(s, &l.plan, 255, &pixels);
    if (error > 8) fail_msg("error %g", error);
    /* in the middle the stronger bar is on top */
    const uint8_t *middle = l.plan.color + 4 * (80 * SIDE + 80);
    assert_true(middle[2] < 80);
    txm_arena_free(&l.arena);
    free(s);
}

/* ---- guide, profiles, degenerate input ---- */

static void test_guide(void **state) {
    scene *s = new_scene(paint_edge, 30);
    (void)state;
    const txi_curve *c = add_line(s, 10, 80, 1, 0, 140, 1);
    for (int i = 0; i < SIDE * SIDE; i++) { /* an edge along that line */
        memset(s->truth + 4 * i, i / SIDE < 80 ? 50 : 200, 3);
        if (s->state[i] == TXI_KNOWN) memcpy(s->color + 4 * i, s->truth + 4 * i, 4);
    }
    laid l = lay(s, NULL);
    for (int i = 5; i < c->count - 5; i++) {
        for (int d = -7; d < 8; d++) { /* the registered line may lie half a pixel off */
            const int value = l.plan.color[4 * ((80 + d) * SIDE + 10 + i) + 3];
            const double most = 100 * exp(-(abs(d) - 0.6) * (abs(d) - 0.6) / 4.5);
            const double least = 100 * exp(-(abs(d) + 0.6) * (abs(d) + 0.6) / 4.5);
            assert_true(value <= (d ? most + 1 : 100));
            assert_true(abs(d) > 3 || value >= least - 2);
        }
    }
    txm_arena_free(&l.arena);
    free(s);
}

static void test_cartoon(void **state) {
    scene *s = new_scene(paint_edge, 30);
    txm_arena arena;
    txi_plan plan;
    int pixels;
    (void)state;
    add_line(s, 79.5 - 72, 79.5 - 54, 0.8, 0.6, 181, 1);
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_cartoon(&s->w, NULL, s->curves, s->count, &arena, NULL, &plan), TXM_OK);
    const double error = error_of(s, &plan, 1, &pixels);
    if (error > 1.5) fail_msg("error %g", error);
    assert_in_range(pixels, 17 * 56, 20 * 61);
    for (int i = 0; i < SIDE * SIDE; i++) assert_int_equal(plan.copies[i].piece, -1);
    txm_arena_free(&arena);
    free(s);
}

/* Too little of a line is known for patches: profiles. */
static void test_short_lines_have_profiles(void **state) {
    scene *s = new_scene(paint_edge, 30);
    int pixels;
    (void)state;
    txi_curve *c = add_line(s, 79.5 - 27.2, 79.5 - 20.4, 0.8, 0.6, 69, 1);
    assert_in_range(c->first, 1, 6);
    laid l = lay(s, NULL);
    check_plan(s, &l);
    assert_int_equal(l.plan.pose_count, 0);
    assert_true(error_of(s, &l.plan, 200, &pixels) < 12);
    assert_true(pixels > 7 * 50);
    txm_arena_free(&l.arena);
    free(s);
}

static void test_nothing_to_lay(void **state) {
    scene *s = new_scene(paint_edge, 30);
    (void)state;
    for (int with = 0; with < 3; with++) {
        s->count = 0;
        if (with == 1) add_line(s, 5, 5, 1, 0, 100, 1); /* beside the hole */
        if (with == 2) add_line(s, 79, 79, 1, 0, 1, 0);  /* a point in the hole */
        laid l = lay(s, NULL);
        assert_int_equal(l.plan.pose_count, 0);
        for (int i = 0; i < SIDE * SIDE; i++)
            assert_true(l.plan.pull[i] == 0 && l.plan.copies[i].piece == -1);
        txm_arena_free(&l.arena);
    }
    free(s);
}

/* ---- the same bytes, faults ---- */

static uint64_t hash_of(const scene *s, txm_env *env) {
    laid l = lay(s, env);
    uint64_t h = tk_hash(0, l.plan.color, 4 * SIDE * SIDE);
    h = tk_hash(h, l.plan.pull, SIDE * SIDE);
    h = tk_hash(h, l.plan.copies, SIDE * SIDE * sizeof *l.plan.copies);
    h = tk_hash(h, l.plan.poses, (size_t)l.plan.pose_count * sizeof *l.plan.poses);
    txm_arena_free(&l.arena);
    return h;
}

static void add_cross(scene *s) {
    add_bar(s, 6, 0);
    add_line(s, 79.5 + 54, 79.5 - 72, -0.6, 0.8, 181, 1);
}

static void test_order_does_not_matter(void **state) {
    scene *s = new_scene(paint_cross, 30);
    txm_env env;
    (void)state;
    add_cross(s);
    memset(&env, 0, sizeof env);
    const uint64_t serial = hash_of(s, &env);
    env.parallel_for = tk_parallel_reverse;
    assert_true(hash_of(s, &env) == serial);
    free(s);
}

static txm_status run_plan(void *context, txm_env *env) {
    const scene *s = (const scene *)context;
    txm_arena arena;
    txi_plan plan;
    txm_arena_init(&arena, env);
    const txm_status status =
        txi_plan_make(&s->w, NULL, s->curves, s->count, 1, &arena, env, &plan);
    if (status != TXM_OK) {
        assert_true(!plan.color && !plan.pull && !plan.copies);
        assert_true(!plan.poses && !plan.pose_count);
    }
    txm_arena_free(&arena);
    return status;
}

static txm_status run_cartoon(void *context, txm_env *env) {
    const scene *s = (const scene *)context;
    txm_arena arena;
    txi_plan plan;
    txm_arena_init(&arena, env);
    const txm_status status = txi_cartoon(&s->w, NULL, s->curves, s->count, &arena, env, &plan);
    if (status != TXM_OK) assert_true(!plan.color && !plan.pull && !plan.copies);
    txm_arena_free(&arena);
    return status;
}

static void test_faults(void **state) {
    scene *s = new_scene(paint_cross, 14);
    (void)state;
    add_cross(s);
    assert_true(tk_sweep(run_plan, s, TK_ALLOCATION) > 40);
    assert_true(tk_sweep(run_plan, s, TK_ONWARD) > 40);
    assert_true(tk_sweep(run_plan, s, TK_CANCEL) > 8);
    assert_true(tk_sweep(run_cartoon, s, TK_ALLOCATION) > 20);
    assert_true(tk_sweep(run_cartoon, s, TK_CANCEL) > 3);
    free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines_are_continued),
        cmocka_unit_test(test_circle_is_continued),
        cmocka_unit_test(test_open_end_fades),
        cmocka_unit_test(test_lines_are_registered),
        cmocka_unit_test(test_strokes_are_found),
        cmocka_unit_test(test_stroke_is_completed_as_one),
        cmocka_unit_test(test_strokes_cross),
        cmocka_unit_test(test_guide),
        cmocka_unit_test(test_cartoon),
        cmocka_unit_test(test_short_lines_have_profiles),
        cmocka_unit_test(test_nothing_to_lay),
        cmocka_unit_test(test_order_does_not_matter),
        cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
