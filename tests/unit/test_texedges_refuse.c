/* test_texedges_refuse.c - edges and strokes: bad input, failing memory, cancelling
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texedges_refuse && build/tests/unit/test_texedges_refuse */
#include "edgekit.h"

/* ---- bad input -------------------------------------------------------------------------- */

static texedges_set stale; /* a call that fails sets the pointer to it to NULL */

static void refuse_find(const texedges_desc *d, txm_status expected) {
    txm_env env = {0};
    texedges_set *e = &stale;
    const txm_status status = texedges_find(d, &env, &e);
    if (status != expected) fail_msg("%d, not %d: %s", status, expected, env.message);
    assert_null(e);
    assert_true(env.message[0] != 0);
    assert_int_equal(texedges_find(d, NULL, &e), expected);
}

static void test_find_refuses(void **state) {
    (void)state;
    static uint8_t pixels[16 * 16], layers[16 * 16];
    float floats[4] = {0, 0.5f, NAN, 1}, steep[3] = {0.2f, 0.2f, 0.4f};
    const texedges_desc good = desc_of(gray(pixels, 16, 16), 4, NULL);
    texedges_desc d = good;
    refuse_find(NULL, TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_find(&d, NULL, NULL), TXM_BAD_ARGUMENT);
    d.image.pixels = NULL;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    static const int levels[5] = {1, -1, 17, INT_MAX, INT_MIN};
    for (int i = 0; i < 5; i++) {
        d = good;
        d.levels = levels[i];
        refuse_find(&d, TXM_BAD_ARGUMENT);
    }
    static const float smooth[4] = {-0.5f, 16.5f, NAN, INFINITY};
    for (int i = 0; i < 4; i++) {
        d = good;
        d.smooth = smooth[i];
        refuse_find(&d, TXM_BAD_ARGUMENT);
    }
    d = good;
    d.least = -1;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    d = good;
    d.thresholds = steep;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    steep[1] = NAN;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    steep[1] = 1.5f;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    d = desc_of(view(floats, 2, 2, 1, TXM_F32), 2, NULL);
    refuse_find(&d, TXM_BAD_ARGUMENT);
    floats[2] = -INFINITY;
    refuse_find(&d, TXM_BAD_ARGUMENT);
    d = good;
    d.image.width = 1 << 15;
    d.image.height = 1 << 15;
    refuse_find(&d, TXM_TOO_LARGE);
    d.image.width = (1 << 20) + 1;
    d.image.height = 1;
    refuse_find(&d, TXM_TOO_LARGE);
    d.image.width = INT_MAX;
    d.image.height = INT_MAX;
    refuse_find(&d, TXM_TOO_LARGE);

    /* layers and draw */
    texedges_set *e = find(&good), odd = *e;
    memset(layers, FILL, sizeof layers);
    txm_image to = gray(layers, 16, 16);
    assert_int_equal(texedges_layers(NULL, e, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_layers(&good, NULL, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_layers(&good, e, NULL, NULL), TXM_BAD_ARGUMENT);
    odd.levels = 1;
    assert_int_equal(texedges_layers(&good, &odd, NULL, &to), TXM_BAD_ARGUMENT);
    odd = *e;
    odd.thresholds[1] = NAN;
    assert_int_equal(texedges_layers(&good, &odd, NULL, &to), TXM_BAD_ARGUMENT);
    to.height = 15;
    assert_int_equal(texedges_layers(&good, e, NULL, &to), TXM_BAD_ARGUMENT);
    to = view(layers, 16, 8, 2, TXM_U8);
    assert_int_equal(texedges_layers(&good, e, NULL, &to), TXM_BAD_ARGUMENT);

    to = gray(layers, 16, 16);
    assert_int_equal(texedges_draw(NULL, -1, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_draw(e, -1, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_draw(e, -2, NULL, &to), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_draw(e, 4, NULL, &to), TXM_BAD_ARGUMENT);
    to = view(layers, 8, 8, 4, TXM_U8);
    assert_int_equal(texedges_draw(e, -1, NULL, &to), TXM_BAD_ARGUMENT);
    to = gray(layers, 16, 16);
    odd = *e;
    odd.point_count--;
    assert_int_equal(texedges_draw(&odd, -1, NULL, &to), TXM_BAD_ARGUMENT);
    odd = *e;
    odd.lines = NULL;
    assert_int_equal(texedges_draw(&odd, -1, NULL, &to), TXM_BAD_ARGUMENT);
    odd = *e;
    const txm_vec2 kept = e->points[3];
    e->points[3].x = NAN;
    assert_int_equal(texedges_draw(e, -1, NULL, &to), TXM_BAD_ARGUMENT);
    e->points[3].x = 1e30f;
    assert_int_equal(texedges_draw(e, -1, NULL, &to), TXM_BAD_ARGUMENT);
    e->points[3] = kept;
    assert_true(is_untouched(layers, sizeof layers));
    texedges_set_free(e);
}

static void refuse_control(const texedges_control *c, int width, int height, txm_status expected) {
    txm_env env = {0};
    texedges_set *e = &stale;
    const txm_status status = texedges_disturb(c, width, height, &env, &e);
    if (status != expected) fail_msg("%d, not %d: %s", status, expected, env.message);
    assert_null(e);
    assert_true(env.message[0] != 0);
}

static void test_control_refuses(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64], bytes[2][64 * 64];
    for (int i = 0; i < 64 * 64; i++) pixels[i] = (uint8_t)(i % 64 / 32);
    texedges_set *e = find_numbers(pixels, 64, 64, 2), odd = *e;
    txm_vec2 points[4] = {{5, 5}, {40, 8}, {42, 44}, {9, 40}};
    texedges_stroke good_stroke, s;
    memset(&good_stroke, 0, sizeof good_stroke);
    good_stroke.points = points;
    good_stroke.count = 4;
    good_stroke.is_closed = 1;
    s = good_stroke;
    const texedges_control good = control_of(e, &s, 1);
    texedges_control c = good;

    refuse_control(NULL, 64, 64, TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_disturb(&c, 64, 64, NULL, NULL), TXM_BAD_ARGUMENT);
    refuse_control(&c, 0, 64, TXM_BAD_ARGUMENT);
    refuse_control(&c, 64, -1, TXM_BAD_ARGUMENT);
    refuse_control(&c, INT_MAX, 64, TXM_TOO_LARGE);
    c.edges = NULL;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    c = good;
    c.strokes = NULL;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    c = good;
    c.stroke_count = -1;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    static const float disturbs[5] = {-0.5f, -2, 4.5f, NAN, INFINITY};
    for (int i = 0; i < 5; i++) {
        c = good;
        c.disturb = disturbs[i];
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    }
    for (int k = -2; k <= 2; k += 4) {
        c = good;
        c.background = k;
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    }
    c = good;
    s.points = NULL;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s = good_stroke;
    s.count = 2;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s.is_closed = 0;
    s.count = 1;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s = good_stroke;
    s.layer = 2;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    s.layer = -1;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    static const float widths[5] = {-1, 1.5f, 257, NAN, INFINITY};
    for (int i = 0; i < 5; i++) {
        s = good_stroke;
        s.is_closed = 0;
        s.width = widths[i];
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    }
    s = good_stroke;
    static const float places[4] = {NAN, INFINITY, -INFINITY, 1e7f};
    for (int i = 0; i < 8; i++) {
        const txm_vec2 kept = points[2];
        if (i < 4) points[2].x = places[i];
        else points[2].y = places[i - 4];
        refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
        points[2] = kept;
    }
    const txm_vec2 same[3] = {{7, 7}, {7, 7}, {7, 7}};
    s.points = same;
    s.count = 3;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);

    /* too long */
    static txm_vec2 zigzag[100];
    for (int i = 0; i < 100; i++) zigzag[i] = txm_v2(i % 2 ? 1e6f : -1e6f, (float)i);
    s.points = zigzag;
    s.count = 100;
    refuse_control(&c, 64, 64, TXM_TOO_LARGE);
    s = good_stroke;

    /* edges that were not found */
    odd = *e;
    odd.beside[0] = 9;
    c.edges = &odd;
    refuse_control(&c, 64, 64, TXM_BAD_ARGUMENT);
    odd = *e;
    const txm_vec2 kept = e->points[5];
    e->points[5].x += 0.5f;
    refuse_control(&good, 64, 64, TXM_BAD_ARGUMENT);
    e->points[5] = kept;

    /* the guide */
    texedges_set *lines = disturb(&good, 64, 64);
    memset(bytes, FILL, sizeof bytes);
    txm_image guide = gray(bytes[0], 64, 64), mask = gray(bytes[1], 64, 64);
    assert_int_equal(texedges_guide(NULL, lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_guide(&good, NULL, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_guide(&good, lines, NULL, NULL, &mask), TXM_BAD_ARGUMENT);
    assert_int_equal(texedges_guide(&good, lines, NULL, &guide, NULL), TXM_BAD_ARGUMENT);
    mask.height = 63;
    assert_int_equal(texedges_guide(&good, lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    mask = view(bytes[1], 32, 64, 2, TXM_U8);
    assert_int_equal(texedges_guide(&good, lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    mask = gray(bytes[1], 64, 64);
    lines->lines[0].layer = 1;
    assert_int_equal(texedges_guide(&good, lines, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    lines->lines[0].layer = 0;
    assert_int_equal(texedges_guide(&good, e, NULL, &guide, &mask), TXM_BAD_ARGUMENT);
    assert_true(is_untouched(bytes, sizeof bytes));
    texedges_set_free(lines);
    texedges_set_free(e);
}

/* ---- misfortune ------------------------------------------------------------------------- */

/* One of the five functions on a fixed task. */
typedef struct task {
    int which;
    texedges_desc desc;
    texedges_set *blobs, *lines;
    texedges_stroke strokes[3];
    texedges_control control;
} task;

static uint8_t task_pixels[192 * 192], task_out[2][320 * 320];
static const tk_output task_outputs[1] = {{task_out, sizeof task_out}};

static txm_status run_task(void *context, txm_env *env) {
    task *t = (task *)context;
    texedges_set *e = t->which == 0 || t->which == 3 ? &stale : NULL;
    const int side = 192;
    txm_image to = gray(task_out[0], side, side);
    txm_status status = TXM_OK;
    switch (t->which) {
    case 0: status = texedges_find(&t->desc, env, &e); break;
    case 1: status = texedges_layers(&t->desc, t->blobs, env, &to); break;
    case 2: status = texedges_draw(t->blobs, -1, env, &to); break;
    case 3: status = texedges_disturb(&t->control, 320, 320, env, &e); break;
    default: {
        const txm_image guide = gray(task_out[0], 320, 320), mask = gray(task_out[1], 320, 320);
        status = texedges_guide(&t->control, t->lines, env, &guide, &mask);
    }
    }
    if (status != TXM_OK) assert_null(e);
    texedges_set_free(e);
    return status;
}

static void make_task(task *t) {
    memset(t, 0, sizeof *t);
    draw_blobs(task_pixels, 192, 4, 0.4);
    t->desc = desc_of(gray(task_pixels, 192, 192), 3, NULL);
    t->desc.smooth = 1;
    t->desc.least = 20;
    t->blobs = find(&t->desc);
    t->control = control_of(t->blobs, t->strokes, draw_strokes(t->strokes, 1));
    t->strokes[0].layer = 2;
    t->control.background = -1;
    t->lines = disturb(&t->control, 320, 320);
}

static void test_misfortune(void **state) {
    (void)state;
    task t;
    make_task(&t);
    for (t.which = 0; t.which < 5; t.which++) {
        memset(task_out, FILL, sizeof task_out);
        assert_int_equal(run_task(&t, NULL), TXM_OK);
        assert_true(is_untouched(task_out, sizeof task_out) == (t.which == 0 || t.which == 3));
        for (int kind = 0; kind < 3; kind++)
            assert_true(tk_sweep_outputs(run_task, &t, (tk_kind)kind, task_outputs, 1) > 0);
    }
    texedges_set_free(t.lines);
    texedges_set_free(t.blobs);
}

/* The memory in use, per pixel, is what the header says. */
static void test_memory(void **state) {
    (void)state;
    task t;
    make_task(&t);
    for (t.which = 0; t.which < 5; t.which++) {
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        assert_int_equal(run_task(&t, &env), TXM_OK);
        const double pixels = 192.0 * 192, out = 320.0 * 320, peak = (double)memory.peak_bytes;
        const double held = 8.0 * (double)t.blobs->point_count + 32.0 * (double)t.blobs->line_count;
        if (t.which < 2) assert_true(peak < 13.5 * pixels + held + 2000);
        if (t.which == 2) assert_true(peak < 1.5 * pixels + 1000);
        if (t.which == 4) assert_true(peak < 4 * out + 1000);
    }
    texedges_set_free(t.lines);
    texedges_set_free(t.blobs);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_find_refuses),
        cmocka_unit_test(test_control_refuses),
        cmocka_unit_test(test_misfortune),
        cmocka_unit_test(test_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
