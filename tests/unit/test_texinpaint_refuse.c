/* test_texinpaint_refuse.c - completion: bad input, failing memory, cancelling, trying again
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_refuse && build/tests/unit/test_texinpaint_refuse */
#include "paintkit.h"

/* ---- bad input ------------------------------------------------------------------------------ */

static uint8_t maps_out[4 * PIXELS];

static int is_filled(const uint8_t *bytes, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (bytes[i] != FILL) return 0;
    }
    return 1;
}

enum { BEGIN = 1, HARMONIC = 2, DILATE = 4, ALL = 7 };

/* The calls refuse this with a message, and leave the outputs as they were. */
static void refuse(const texinpaint_desc *d, txm_status expected, int calls) {
    const txm_image out[2] = {view(result, SIDE, SIDE, 3, TXM_U8),
                              view(maps_out, SIDE, SIDE, 4, TXM_U8)};
    memset(result, FILL, sizeof result);
    memset(maps_out, FILL, sizeof maps_out);
    for (int call = 0; call < 4; call++) {
        txm_env env = {0};
        texinpaint_job *job = (texinpaint_job *)&env;
        if (!(calls >> (call ? call - 1 : 0) & 1)) continue;
        const txm_status status = call == 0   ? texinpaint_complete(d, &env, out)
                                  : call == 1 ? texinpaint_begin(d, &env, &job)
                                  : call == 2 ? texinpaint_harmonic(d, &env, out)
                                              : texinpaint_dilate(d, &env, out);
        if (status != expected)
            fail_msg("call %d: %d, not %d: %s", call, status, expected, env.message);
        assert_true(env.message[0] != 0);
        if (call == 1) assert_null(job);
        if (call == 0) assert_int_equal(texinpaint_complete(d, NULL, out), expected);
    }
    assert_true(is_filled(result, sizeof result) && is_filled(maps_out, sizeof maps_out));
}

static texinpaint_desc good_plane(void) {
    texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    plane_of_two();
    draw_plane(picture, 28, 14, 5);
    use_mesh(&d);
    return d;
}

static void test_pictures(void **state) {
    (void)state;
    static float real[4 * PIXELS];
    const texinpaint_desc good = desc_of(picture, 3, TXM_U8);
    texinpaint_desc d = good;
    draw_stripes(picture, 3);
    disk(30, 30, 8);
    refuse(NULL, TXM_BAD_ARGUMENT, ALL);
    d.image.pixels = NULL;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.image.width = 0;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.image.channels = 5;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.image.stride = 3 * SIDE - 1;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.image.width = TEXINPAINT_MAX_SIDE + 1;
    d.image.height = 1;
    refuse(&d, TXM_TOO_LARGE, ALL);
    d.image.width = d.image.height = TEXINPAINT_MAX_SIDE;
    refuse(&d, TXM_TOO_LARGE, ALL);
    static const float bad[4] = {NAN, INFINITY, -INFINITY, 2e30f};
    for (int i = 0; i < 4; i++) {
        d = desc_of(real, 3, TXM_F32);
        real[3 * PIXELS - 1] = bad[i];
        refuse(&d, TXM_BAD_ARGUMENT, ALL);
    }
    /* masks */
    d = good;
    d.mask.pixels = NULL;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN | HARMONIC);
    d = good;
    d.mask.height = SIDE - 1;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.mask.channels = 5;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.source = view(mask, SIDE - 1, SIDE, 1, TXM_U8);
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    d.source = view(mask, SIDE, SIDE, 1, TXM_U8);
    d.source.stride = SIDE - 1;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    d.source = view(real, SIDE, SIDE, 1, TXM_U16); /* black: nothing may be copied */
    refuse(&d, TXM_TOO_SMALL, BEGIN);
    /* nothing to copy from */
    memset(mask, 255, sizeof mask);
    refuse(&good, TXM_TOO_SMALL, ALL);
    disk(30, 30, 8);
    d = good;
    d.source = d.mask; /* only the hole itself */
    refuse(&d, TXM_TOO_SMALL, BEGIN);
}

static void test_maps(void **state) {
    (void)state;
    texinpaint_map map[TEXINPAINT_MAX_MAPS];
    memset(map, 0, sizeof map);
    draw_stripes(picture, 3);
    disk(30, 30, 8);
    for (int i = 0; i < TEXINPAINT_MAX_MAPS; i++) map[i].image = view(other, SIDE, SIDE, 4, TXM_U8);
    texinpaint_desc good = desc_of(picture, 3, TXM_U8), d;
    good.maps = map;
    good.map_count = 1;
    static const int counts[3] = {-1, TEXINPAINT_MAX_MAPS, INT_MAX};
    for (int i = 0; i < 3; i++) {
        d = good;
        d.map_count = counts[i];
        refuse(&d, TXM_BAD_ARGUMENT, ALL);
    }
    d = good;
    d.maps = NULL;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    map[0].image.width--;
    refuse(&good, TXM_BAD_ARGUMENT, ALL);
    map[0].image.width++;
    map[0].is_normal = 3;
    refuse(&good, TXM_BAD_ARGUMENT, ALL);
    map[0].is_normal = map[0].is_label = 1;
    refuse(&good, TXM_BAD_ARGUMENT, ALL);
    map[0].is_label = 0;
    map[0].image.channels = 2;
    refuse(&good, TXM_BAD_ARGUMENT, ALL);
}

static void test_meshes(void **state) {
    (void)state;
    const texinpaint_desc good = good_plane();
    texinpaint_desc d = good;
    d.uv = NULL;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.uv_count = 0;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.uv_indices = NULL;
    d.uv_count = d.mesh.vertex_count - 1;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.uv_count--;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.mesh.positions = NULL;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.mesh.indices = NULL;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    d = good;
    d.mesh.vertex_count--;
    refuse(&d, TXM_BAD_ARGUMENT, ALL);
    static const float bad[5] = {NAN, INFINITY, -INFINITY, 5000, -5000};
    for (int i = 0; i < 5; i++) {
        const float uv = mesh.uv[7], at = mesh.at[7];
        mesh.uv[7] = bad[i];
        refuse(&good, TXM_BAD_ARGUMENT, ALL);
        mesh.uv[7] = uv;
        mesh.at[7] = bad[i];
        if (i < 3) refuse(&good, TXM_BAD_ARGUMENT, ALL);
        mesh.at[7] = at;
    }
    /* all that the charts cover is missing; or they cover nothing */
    memset(mask, 255, sizeof mask);
    refuse(&good, TXM_TOO_SMALL, BEGIN | HARMONIC);
    disk(30, 30, 8);
    for (size_t i = 0; i < 2 * mesh.entries; i++) mesh.uv[i] = 0.5f;
    refuse(&good, TXM_TOO_SMALL, DILATE);
    complete_bytes(&good, result); /* nothing in a chart is missing */
    assert_memory_equal(result, picture, 3 * PIXELS);
}

static void test_fields(void **state) {
    (void)state;
    float points[9] = {1, 2, 0, 40, 30, 0, 50, 20, 0};
    texinpaint_line line = {points, 3};
    texinpaint_desc good = desc_of(picture, 3, TXM_U8), d;
    draw_stripes(picture, 3);
    disk(30, 30, 8);
    static const int gutters[3] = {-2, TEXINPAINT_MAX_SIDE + 1, INT_MIN};
    static const int kinds[3] = {-1, 4, INT_MAX};
    static const float alphas[4] = {-1, NAN, INFINITY, 2e6f};
    for (int i = 0; i < 4; i++) {
        d = good;
        d.gutter = gutters[i % 3];
        refuse(&d, TXM_BAD_ARGUMENT, ALL);
        d = good;
        d.structure = kinds[i % 3];
        refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
        d = good;
        d.prior = kinds[i % 3];
        refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
        d = good;
        d.alpha = alphas[i];
        refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
        d = good;
        d.beta = i % 2 ? -1 : 5000;
        refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    }
    d = good;
    d.prior = TEXINPAINT_PRIOR_CREST;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    d.prior = TEXINPAINT_PRIOR_LINES;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    d.line_count = 1;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    d.lines = &line;
    d.line_count = -1;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    d.line_count = 1;
    line.count = 1;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    line.count = 3;
    points[8] = NAN;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
    line.points = NULL;
    refuse(&d, TXM_BAD_ARGUMENT, BEGIN);
}

static void test_outputs(void **state) {
    (void)state;
    texinpaint_job *job = NULL;
    const texinpaint_desc d = desc_of(picture, 3, TXM_U8);
    draw_stripes(picture, 3);
    disk(30, 30, 8);
    memset(result, FILL, sizeof result);
    txm_image wrong[5];
    for (int i = 0; i < 5; i++) wrong[i] = view(result, SIDE, SIDE, 3, TXM_U8);
    wrong[0].pixels = NULL;
    wrong[1].width--;
    wrong[2].channels = 4;
    wrong[3].sample = TXM_U16;
    wrong[4].stride = 10;
    assert_int_equal(texinpaint_begin(&d, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_begin(&d, NULL, &job), TXM_OK);
    assert_int_equal(texinpaint_step(NULL, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_step(job, NULL, NULL), TXM_OK);
    for (int i = 0; i < 6; i++) {
        const txm_image *out = i < 5 ? &wrong[i] : NULL;
        txm_env env = {0};
        assert_int_equal(texinpaint_complete(&d, &env, out), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_int_equal(texinpaint_harmonic(&d, NULL, out), TXM_BAD_ARGUMENT);
        assert_int_equal(texinpaint_dilate(&d, NULL, out), TXM_BAD_ARGUMENT);
        assert_int_equal(texinpaint_draw(job, 0, NULL, out), TXM_BAD_ARGUMENT);
    }
    const txm_image out = view(result, SIDE, SIDE, 3, TXM_U8);
    assert_int_equal(texinpaint_draw(NULL, 0, NULL, &out), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_draw(job, -1, NULL, &out), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_draw(job, 1, NULL, &out), TXM_BAD_ARGUMENT);
    assert_true(is_filled(result, sizeof result));
    texinpaint_free(job);
    texinpaint_free(NULL);
    texinpaint_crests_free(NULL);
}

/* ---- misfortune --------------------------------------------------------------------------------- */

/* A plane in two charts, with a map of labels and crest lines; or a picture with stripes. */
typedef struct task {
    int is_mesh;
    texinpaint_desc desc;
    texinpaint_map map;
} task;

static uint8_t labels[PIXELS];
static const tk_output task_outputs[2] = {{result, 3 * PIXELS}, {maps_out, PIXELS}};

static void begin_task(task *t, int is_mesh) {
    memset(t, 0, sizeof *t);
    t->is_mesh = is_mesh;
    if (is_mesh) {
        t->desc = good_plane();
        t->desc.prior = TEXINPAINT_PRIOR_CREST;
    } else {
        draw_stripes(picture, 3);
        disk(30, 32, 6);
        t->desc = desc_of(picture, 3, TXM_U8);
    }
    for (int i = 0; i < PIXELS; i++) labels[i] = (uint8_t)(picture[3 * i] / 64);
    t->map.image = view(labels, SIDE, SIDE, 1, TXM_U8);
    t->map.is_label = 1;
    t->desc.maps = &t->map;
    t->desc.map_count = 1;
}

static txm_status run_task(void *context, txm_env *env) {
    const task *t = (const task *)context;
    const txm_image out[2] = {view(result, SIDE, SIDE, 3, TXM_U8),
                              view(maps_out, SIDE, SIDE, 1, TXM_U8)};
    return texinpaint_complete(&t->desc, env, out);
}

/* A run takes half a second. Each stage is swept by the test of its own parts, place by place; here it is
   what a whole completion does when one of them fails, so with FULL=1 a thinned sweep will do. */
enum { ALLOCATION_STRIDE = 23, ONWARD_STRIDE = 97, REPORT_STRIDE = 5 };

static long sweep(task *t, tk_kind kind, int stride) {
    return tk_sweep_thinned(run_task, t, kind, task_outputs, 2, stride);
}

static void test_faults(void **state) {
    (void)state;
    static task t;
    for (int is_mesh = 0; is_mesh < 2; is_mesh++) {
        begin_task(&t, is_mesh);
        if (is_mesh || tk_full()) assert_true(sweep(&t, TK_ALLOCATION, ALLOCATION_STRIDE) > 100);
        if (tk_full()) assert_true(sweep(&t, TK_ONWARD, ONWARD_STRIDE) > 100);
        if (!is_mesh || tk_full()) assert_true(sweep(&t, TK_CANCEL, REPORT_STRIDE) > 10);
    }
}

/* All steps, each of them failing first, at ever later places; what comes out is the same. */
static void test_steps_tried_again(void **state) {
    (void)state;
    static task t;
    static uint8_t wanted[3 * PIXELS];
    const txm_image out[2] = {view(result, SIDE, SIDE, 3, TXM_U8),
                              view(maps_out, SIDE, SIDE, 1, TXM_U8)};
    for (int is_mesh = 0; is_mesh < 2; is_mesh++) {
        tk_memory memory;
        tk_progress progress;
        texinpaint_job *job = NULL;
        int more = 1;
        memset(&memory, 0, sizeof memory);
        memset(&progress, 0, sizeof progress);
        txm_env env = tk_env(&memory, &progress);
        begin_task(&t, is_mesh);
        complete(&t.desc, out);
        memcpy(wanted, result, sizeof wanted);
        assert_int_equal(texinpaint_begin(&t.desc, &env, &job), TXM_OK);
        while (more) {
            txm_status status = TXM_OUT_OF_MEMORY;
            long place = 1;
            for (int round = 0; status != TXM_OK && place < 5000; round++) {
                const int cancels = round % 2;
                memory.fail_at = cancels ? 0 : memory.calls + place;
                progress.cancel_at = cancels ? progress.calls + place : 0;
                progress.last = 0;
                progress.late = 0;
                status = texinpaint_step(job, &env, &more);
                if (status != TXM_OK)
                    assert_int_equal(status, cancels ? TXM_CANCELLED : TXM_OUT_OF_MEMORY);
                if (cancels) place = place * (tk_full() ? 2 : 3) + 1;
            }
            assert_int_equal(status, TXM_OK);
            assert_int_equal(progress.errors, 0);
        }
        assert_int_equal(texinpaint_draw(job, 0, NULL, &out[0]), TXM_OK);
        assert_memory_equal(result, wanted, sizeof wanted);
        texinpaint_free(job);
        assert_int_equal(tk_leaks(&memory), 0);
    }
}

/* Progress rises to 1 at most, and its stages have names: tk_sweep looks at that, here with crest lines. */
static void test_progress(void **state) {
    (void)state;
    static task t;
    tk_progress progress;
    memset(&progress, 0, sizeof progress);
    txm_env env = tk_env(NULL, &progress);
    begin_task(&t, 1);
    assert_int_equal(run_task(&t, &env), TXM_OK);
    assert_int_equal(progress.errors, 0);
    assert_true(progress.calls > 10 && progress.last > 0.9f);
}

/* stops what is under way once pieces are joined */
static int stop_at_joining(void *user, float fraction, const char *stage) {
    (void)user;
    (void)fraction;
    return strcmp(stage, "joining") == 0;
}

static void test_joining_can_be_cancelled(void **state) {
    enum { WIDE = 48 };
    static uint8_t picture[WIDE * WIDE], mask[WIDE * WIDE], out[WIDE * WIDE];
    texinpaint_desc desc;
    txm_env env;
    (void)state;
    memset(&desc, 0, sizeof desc);
    memset(&env, 0, sizeof env);
    for (int i = 0; i < WIDE * WIDE; i++) {
        const int x = i % WIDE - WIDE / 2, y = i / WIDE - WIDE / 2;
        picture[i] = (uint8_t)(txm_hash((uint64_t)i) & 255);
        mask[i] = (uint8_t)(x * x + y * y < 64 ? 255 : 0);
    }
    desc.image.pixels = picture;
    desc.image.width = desc.image.height = WIDE;
    desc.image.channels = 1;
    desc.mask = desc.image;
    desc.mask.pixels = mask;
    desc.structure = TEXINPAINT_TEXTURE;
    txm_image made = desc.image;
    made.pixels = out;
    assert_int_equal(texinpaint_complete(&desc, &env, &made), TXM_OK);
    env.progress = stop_at_joining;
    assert_int_equal(texinpaint_complete(&desc, &env, &made), TXM_CANCELLED);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_maps),
        cmocka_unit_test(test_meshes),
        cmocka_unit_test(test_fields),
        cmocka_unit_test(test_outputs),
        cmocka_unit_test(test_faults),
        cmocka_unit_test(test_progress),
        cmocka_unit_test(test_steps_tried_again),
        cmocka_unit_test(test_joining_can_be_cancelled),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
