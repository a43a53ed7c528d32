/* test_texsyn_alpha.c - the colour of transparent pixels never shows
   SPDX-License-Identifier: MIT OR Unlicense */
#include "synkit.h"

#include <math.h>

enum { SIDE = 72, PIXELS = SIDE * SIDE, BYTES = 4 * PIXELS, OUT = 80, TOLERANCE = 6 };

typedef enum hidden { BLACK, WHITE, NOISE, HIDDEN } hidden;

static uint8_t pictures[HIDDEN][BYTES], others[HIDDEN][BYTES], mask[PIXELS];
static uint8_t results[HIDDEN][4 * OUT * OUT];

/* ---- cutouts ---------------------------------------------------------------------------------- */

/* What nobody sees. */
static void hide(uint8_t *p, int i, hidden how) {
    for (int c = 0; c < 3; c++)
        p[c] = (uint8_t)(how == NOISE ? at_random(i, c, 77) : how == WHITE ? 255 : 0);
}

/* Leaves of greens with soft rims, on nothing. The colours of visible pixels: red 20..60, green
   70..160, blue 10..30. */
static void draw_leaves(uint8_t *p, uint64_t seed, hidden how) {
    memset(p, 0, BYTES);
    for (int k = 0; k < 60; k++) {
        const int cx = at_random(k, 1, (int)seed) % SIDE, cy = at_random(k, 2, (int)seed) % SIDE;
        const int green = 70 + at_random(k, 3, (int)seed) % 80, turned = at_random(k, 4, (int)seed) & 1;
        for (int dy = -9; dy <= 9; dy++) {
            for (int dx = -9; dx <= 9; dx++) {
                const double u = turned ? dx + dy : dx - dy, v = turned ? dx - dy : dx + dy;
                const double cover = (1.1 - u * u / 130 - v * v / 18) * 4;
                const int x = (cx + dx + SIDE) % SIDE, y = (cy + dy + SIDE) % SIDE;
                uint8_t *q = p + 4 * (y * SIDE + x);
                if (cover <= 0) continue;
                const int alpha = cover >= 1 ? 255 : 1 + (int)(cover * 254);
                q[0] = (uint8_t)(20 + green / 4);
                q[1] = (uint8_t)(green + at_random(x, y, 9) % 10);
                q[2] = (uint8_t)(10 + green / 8);
                if (alpha > q[3]) q[3] = (uint8_t)alpha;
            }
        }
    }
    for (int i = 0; i < PIXELS; i++)
        if (p[4 * i + 3] == 0) hide(p + 4 * i, i, how);
}

static void draw_all(void) {
    for (int h = 0; h < HIDDEN; h++) {
        draw_leaves(pictures[h], 5, (hidden)h);
        draw_leaves(others[h], 6, (hidden)h);
    }
}

/* All results are equal, and show no colour that no leaf has, not even where it is hidden. */
static void assert_equal_leaves(size_t bytes) {
    int shows = 0;
    for (int h = 1; h < HIDDEN; h++) assert_memory_equal(results[0], results[h], bytes);
    for (size_t i = 0; i < bytes; i += 4) shows |= results[0][i + 3];
    for (size_t i = 0; i < bytes && shows; i += 4) {
        const uint8_t *p = results[0] + i;
        assert_in_range(p[0], 35 - TOLERANCE, 60 + TOLERANCE);
        assert_in_range(p[1], 70 - 2 * TOLERANCE, 160 + TOLERANCE);
        assert_in_range(p[2], 15 - TOLERANCE, 30 + TOLERANCE);
    }
}

/* Mean and deviation of the green of what is opaque. */
static void measure(const uint8_t *p, int pixels, double *mean, double *deviation, double *share) {
    double sum = 0, square = 0, count = 0;
    for (int i = 0; i < pixels; i++) {
        if (p[4 * i + 3] < 200) continue;
        const double v = p[4 * i + 1];
        sum += v;
        square += v * v;
        count++;
    }
    assert_true(count > 100);
    *mean = sum / count;
    *deviation = sqrt(square / count - *mean * *mean);
    *share = count / pixels;
}

/* ---- learning and synthesis -------------------------------------------------------------------- */

static void test_synthesis(void **state) {
    (void)state;
    static uint8_t bytes[HIDDEN][1 << 16];
    size_t size[HIDDEN];
    draw_all();
    for (int h = 0; h < HIDDEN; h++) {
        texsyn_learn_desc learn;
        texsyn_synth_desc synth;
        texsyn_model *model = NULL;
        memset(&learn, 0, sizeof learn);
        learn.example = view_bytes(pictures[h], SIDE, SIDE, 4);
        assert_int_equal(texsyn_learn(&learn, NULL, &model), TXM_OK);
        assert_int_equal(texsyn_save(model, NULL, bytes[h], sizeof bytes[h], &size[h]), TXM_OK);
        memset(&synth, 0, sizeof synth);
        synth.model = model;
        synth.width = synth.height = OUT;
        assert_int_equal(texsyn_synthesize(&synth, NULL, view_bytes(results[h], OUT, OUT, 4)), TXM_OK);
        texsyn_model_free(model);
        assert_int_equal(size[h], size[0]);
        assert_memory_equal(bytes[h], bytes[0], size[0]);
    }
    assert_equal_leaves(sizeof results[0]);
    double mean[2], deviation[2], share[2];
    measure(pictures[0], PIXELS, &mean[0], &deviation[0], &share[0]);
    measure(results[0], OUT * OUT, &mean[1], &deviation[1], &share[1]);
    assert_true(fabs(mean[0] - mean[1]) < 4);
    assert_true(fabs(deviation[0] - deviation[1]) < 0.25 * deviation[0]);
    assert_true(fabs(share[0] - share[1]) < 0.1);
}

/* With a mask, of few visible pixels, of none at all. */
static void test_scarce(void **state) {
    (void)state;
    tk_wide();
    for (int kind = 0; kind < 3; kind++) {
        for (int h = 0; h < HIDDEN; h++) {
            texsyn_learn_desc learn;
            texsyn_synth_desc synth;
            texsyn_model *model = NULL;
            draw_leaves(pictures[h], 5, (hidden)h);
            for (int i = 0; i < PIXELS; i++) {
                uint8_t *p = pictures[h] + 4 * i;
                mask[i] = i % SIDE > 20 ? 255 : 0;
                if (kind == 0 || (kind == 1 && i % 997 == 0)) continue;
                p[3] = 0;
                hide(p, i, (hidden)h);
            }
            memset(&learn, 0, sizeof learn);
            learn.example = view_bytes(pictures[h], SIDE, SIDE, 4);
            if (kind == 0) learn.mask = view_bytes(mask, SIDE, SIDE, 1);
            learn.max_types = 8;
            assert_int_equal(texsyn_learn(&learn, NULL, &model), TXM_OK);
            memset(&synth, 0, sizeof synth);
            synth.model = model;
            synth.width = synth.height = OUT;
            synth.quality = -2;
            synth.tileable = 1;
            assert_int_equal(texsyn_synthesize(&synth, NULL, view_bytes(results[h], OUT, OUT, 4)),
                             TXM_OK);
            texsyn_model_free(model);
        }
        if (kind < 2) assert_equal_leaves(sizeof results[0]);
        for (int h = 1; h < HIDDEN; h++)
            assert_memory_equal(results[0], results[h], sizeof results[0]);
    }
}

/* ---- holes and borders ------------------------------------------------------------------------- */

/* In the hole all results are equal; outside each has the bytes of its picture. Then hidden colours of
   the pictures are made equal, for the other checks. */
static void assert_filled(void) {
    for (int h = 0; h < HIDDEN; h++) {
        for (int i = 0; i < PIXELS; i++) {
            const uint8_t *other = mask[i] ? results[0] : pictures[h];
            assert_memory_equal(results[h] + 4 * i, other + 4 * i, 4);
        }
    }
    for (int h = 0; h < HIDDEN; h++)
        assert_int_equal(txm_image_bleed((const txm_image[]){view_bytes(results[h], SIDE, SIDE, 4)}, 0, NULL),
                         TXM_OK);
}

/* What is visible outside the zone, or hole, is that of the cutout. */
static void assert_kept(const uint8_t *from) {
    for (int i = 0; i < PIXELS; i++) {
        if (mask[i] || !from[4 * i + 3]) continue;
        assert_memory_equal(results[0] + 4 * i, from + 4 * i, 4);
    }
}

static void test_fill(void **state) {
    (void)state;
    draw_all();
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE, y = i / SIDE;
        mask[i] = x > 20 && x < 52 && y > 25 && y < 50 ? 255 : 0;
    }
    for (int h = 0; h < HIDDEN; h++) {
        texsyn_fill_desc fill;
        memset(&fill, 0, sizeof fill);
        fill.image = view_bytes(pictures[h], SIDE, SIDE, 4);
        fill.mask = view_bytes(mask, SIDE, SIDE, 1);
        assert_int_equal(texsyn_fill(&fill, NULL, view_bytes(results[h], SIDE, SIDE, 4)), TXM_OK);
    }
    assert_filled();
    assert_equal_leaves(BYTES);
    assert_kept(pictures[0]);
}

/* A model of a cutout fills another one in another light. */
static void test_fill_relit(void **state) {
    (void)state;
    tk_wide();
    draw_all();
    for (int i = 0; i < PIXELS; i++) mask[i] = i % SIDE > 40 ? 255 : 0;
    for (int h = 0; h < HIDDEN; h++) {
        texsyn_learn_desc learn;
        texsyn_fill_desc fill;
        texsyn_model *model = NULL;
        memset(&learn, 0, sizeof learn);
        learn.example = view_bytes(others[h], SIDE, SIDE, 4);
        learn.max_types = 8;
        for (int i = 0; i < PIXELS; i++) /* darker and redder */
            for (int c = 0; c < 3 && others[h][4 * i + 3]; c++)
                others[h][4 * i + c] = (uint8_t)(c ? others[h][4 * i + c] / 2 : others[h][4 * i]);
        assert_int_equal(texsyn_learn(&learn, NULL, &model), TXM_OK);
        memset(&fill, 0, sizeof fill);
        fill.image = view_bytes(pictures[h], SIDE, SIDE, 4);
        fill.mask = view_bytes(mask, SIDE, SIDE, 1);
        fill.model = model;
        fill.relight = 1;
        assert_int_equal(texsyn_fill(&fill, NULL, view_bytes(results[h], SIDE, SIDE, 4)), TXM_OK);
        texsyn_model_free(model);
    }
    assert_filled();
    double mean[2], deviation[2], share[2];
    measure(pictures[0], PIXELS, &mean[0], &deviation[0], &share[0]);
    measure(results[0], PIXELS, &mean[1], &deviation[1], &share[1]);
    assert_true(fabs(mean[0] - mean[1]) < 8);
}

static void test_knit(void **state) {
    (void)state;
    draw_all();
    for (int i = 0; i < PIXELS; i++) mask[i] = i % SIDE > 36 ? 255 : 0;
    for (int likeness = TEXSYN_LIKENESS_AUTO; likeness <= TEXSYN_LIKENESS_DIFFERENT; likeness++) {
        for (int h = 0; h < HIDDEN; h++) {
            texsyn_knit_desc knit;
            memset(&knit, 0, sizeof knit);
            knit.a = view_bytes(pictures[h], SIDE, SIDE, 4);
            knit.b = view_bytes(others[HIDDEN - 1 - h], SIDE, SIDE, 4);
            knit.layout = view_bytes(mask, SIDE, SIDE, 1);
            knit.likeness = (texsyn_likeness)likeness;
            if (likeness == TEXSYN_LIKENESS_DIFFERENT) {
                knit.border = view_bytes(pictures[h], SIDE, SIDE, 4);
                knit.border_layout = knit.layout;
            }
            assert_int_equal(texsyn_knit(&knit, NULL, view_bytes(results[h], SIDE, SIDE, 4)),
                             TXM_OK);
        }
        assert_equal_leaves(BYTES);
    }
}

/* ---- composites and segments ------------------------------------------------------------------- */

/* Two textures, one of which is a cutout, or both are; or nothing of one is visible. */
static void test_composite(void **state) {
    (void)state;
    tk_wide();
    static uint8_t labels[PIXELS], drawn[OUT * OUT];
    for (int i = 0; i < PIXELS; i++) labels[i] = i / SIDE > 30;
    for (int i = 0; i < OUT * OUT; i++) drawn[i] = i % OUT > 30;
    for (int kind = 0; kind < 3; kind++) {
        draw_all();
        for (int h = 0; h < HIDDEN; h++) {
            texsyn_composite_learn_desc learn;
            texsyn_composite_desc synth;
            texsyn_composite *made = NULL;
            for (int i = 0; i < PIXELS; i++) {
                uint8_t *p = pictures[h] + 4 * i;
                if (!labels[i] || kind == 0) continue;
                if (kind == 1) { /* opaque */
                    p[0] = 50;
                    p[1] = (uint8_t)(100 + i % 7);
                    p[2] = 20;
                    p[3] = 255;
                } else {
                    p[3] = 0;
                    hide(p, i, (hidden)h);
                }
            }
            memset(&learn, 0, sizeof learn);
            learn.example = view_bytes(pictures[h], SIDE, SIDE, 4);
            learn.labels = view_bytes(labels, SIDE, SIDE, 1);
            assert_int_equal(texsyn_composite_learn(&learn, NULL, &made), TXM_OK);
            memset(&synth, 0, sizeof synth);
            synth.composite = made;
            synth.width = synth.height = OUT;
            synth.layout = view_bytes(drawn, OUT, OUT, 1);
            synth.quality = -1;
            assert_int_equal(
                texsyn_composite_synthesize(&synth, NULL, view_bytes(results[h], OUT, OUT, 4)),
                TXM_OK);
            texsyn_composite_free(made);
        }
        assert_equal_leaves(sizeof results[0]);
    }
}

static void test_segment(void **state) {
    (void)state;
    static uint8_t labels[HIDDEN][PIXELS];
    draw_all();
    for (int h = 0; h < HIDDEN; h++) {
        texsyn_segment_desc segment;
        int count;
        memset(&segment, 0, sizeof segment);
        segment.image = view_bytes(pictures[h], SIDE, SIDE, 4);
        segment.segments = 2;
        assert_int_equal(
            texsyn_segment(&segment, NULL, view_bytes(labels[h], SIDE, SIDE, 1), &count), TXM_OK);
        assert_memory_equal(labels[h], labels[0], PIXELS);
    }
}

/* ---- light and erosion ------------------------------------------------------------------------- */

static void test_relight(void **state) {
    (void)state;
    draw_all();
    for (int h = 0; h < HIDDEN; h++) {
        texsyn_relight_desc relight;
        memset(&relight, 0, sizeof relight);
        relight.image = view_bytes(pictures[h], SIDE, SIDE, 4);
        relight.like = view_bytes(others[h], SIDE, SIDE, 4);
        assert_int_equal(texsyn_relight(&relight, NULL, view_bytes(results[h], SIDE, SIDE, 4)),
                         TXM_OK);
    }
    assert_equal_leaves(BYTES);
}

static void test_erosion(void **state) {
    (void)state;
    draw_all();
    for (int h = 0; h < HIDDEN; h++) {
        texsyn_erosion_desc desc;
        texsyn_erosion *erosion = NULL;
        memset(&desc, 0, sizeof desc);
        desc.weathered = view_bytes(pictures[h], SIDE, SIDE, 4);
        desc.width = desc.height = SIDE;
        assert_int_equal(texsyn_erosion_make(&desc, NULL, &erosion), TXM_OK);
        const txm_image from = view_bytes(others[h], SIDE, SIDE, 4);
        assert_int_equal(
            texsyn_erosion_draw(erosion, 0.5f, NULL, &from, NULL, view_bytes(results[h], SIDE, SIDE, 4)),
            TXM_OK);
        texsyn_erosion_free(erosion);
        assert_memory_equal(results[h], results[0], BYTES);
    }
}

/* ---- memory ------------------------------------------------------------------------------------ */

/* Draw a job that is done; out is untouched after an error. */
static txm_status try_draw(void *context, txm_env *env) {
    static uint8_t out[4 * OUT * OUT], before[4 * OUT * OUT];
    memset(out, 99, sizeof out);
    memset(before, 99, sizeof before);
    const txm_status status = texsyn_draw((texsyn_job *)context, env, view_bytes(out, OUT, OUT, 4));
    if (status != TXM_OK) assert_memory_equal(out, before, sizeof out);
    return status;
}

static void test_memory(void **state) {
    (void)state;
    texsyn_learn_desc learn;
    texsyn_synth_desc synth;
    texsyn_model *model = NULL;
    texsyn_job *job = NULL;
    draw_all();
    memset(&learn, 0, sizeof learn);
    learn.example = view_bytes(pictures[0], SIDE, SIDE, 4);
    learn.max_types = 6;
    assert_int_equal(texsyn_learn(&learn, NULL, &model), TXM_OK);
    memset(&synth, 0, sizeof synth);
    synth.model = model;
    synth.width = synth.height = OUT;
    synth.quality = -2;
    assert_int_equal(texsyn_begin(&synth, NULL, &job), TXM_OK);
    assert_true(tk_sweep(try_draw, job, TK_ALLOCATION) > 2);
    texsyn_free(job);
    texsyn_model_free(model);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_synthesis), cmocka_unit_test(test_scarce),
        cmocka_unit_test(test_fill),      cmocka_unit_test(test_fill_relit),
        cmocka_unit_test(test_knit),      cmocka_unit_test(test_composite),
        cmocka_unit_test(test_segment),   cmocka_unit_test(test_relight),
        cmocka_unit_test(test_erosion),   cmocka_unit_test(test_memory),
    };
    return cmocka_run_group_tests_name("texsyn_alpha", tests, NULL, NULL);
}
