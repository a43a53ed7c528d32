/* fuzz_texedges.c - random pictures, thresholds and strokes into texedges.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   Lines must lie in the picture and results in their rows; after an error they are untouched.   */
#define TEXEDGES_IMPLEMENTATION
#include "texedges.h"

#define FUZZ_BYTES 240
#include "fuzzkit.h"

enum { MOST_SIDE = 90, MOST_STROKES = 4, MOST_POINTS = 12 };

typedef struct input {
    texedges_desc desc;
    float thresholds[TEXEDGES_MAX_LEVELS];
    texedges_control control;
    texedges_stroke strokes[MOST_STROKES];
    txm_vec2 points[MOST_STROKES][MOST_POINTS];
} input;

static void make_desc(input *in, pool *p, source *s) {
    texedges_desc *d = &in->desc;
    memset(in, 0, sizeof *in);
    d->image = any_image(p, s, 1 + pick(s, MOST_SIDE), 1 + pick(s, MOST_SIDE), 1 + pick(s, 4), any_sample(s));
    d->levels = pick(s, 2) ? 0 : pick(s, TEXEDGES_MAX_LEVELS + 2);
    d->smooth = pick(s, 3) ? 0 : (float)pick(s, 40) / 2;
    d->least = pick(s, 2) ? 0 : pick(s, 200) - 1;
    for (int i = 0; i < TEXEDGES_MAX_LEVELS; i++)
        in->thresholds[i] = pick(s, 60) ? (float)(i + 1) / (float)(d->levels ? d->levels : 4) : (float)pick(s, 3);
    if (pick(s, 3) == 0) d->thresholds = in->thresholds;
}

static void make_strokes(input *in, source *s, const texedges_set *set) {
    texedges_control *c = &in->control;
    c->edges = set;
    c->strokes = in->strokes;
    c->stroke_count = pick(s, MOST_STROKES + 1);
    c->background = pick(s, set->levels + 1) - 1;
    c->disturb = pick(s, 3) ? 0 : (float)(pick(s, 6) - 1);
    c->seed = (uint64_t)pick(s, 256);
    for (int i = 0; i < c->stroke_count; i++) {
        const float reach = pick(s, 30) ? 120.0f : 1e6f;
        in->strokes[i].points = in->points[i];
        in->strokes[i].count = pick(s, 30) ? 3 + pick(s, MOST_POINTS - 2) : pick(s, 3);
        in->strokes[i].is_closed = pick(s, 2);
        in->strokes[i].layer = pick(s, set->levels + (pick(s, 20) == 0));
        in->strokes[i].width = pick(s, 2) ? 0 : (float)pick(s, 80);
        for (int k = 0; k < MOST_POINTS; k++) {
            in->points[i][k].x = reach * ((float)pick(s, 1001) / 700 - 0.2f);
            in->points[i][k].y = pick(s, 200) ? reach * ((float)pick(s, 1001) / 700 - 0.2f) : NAN;
        }
    }
}

/* Are the lines of a set whole, and near the picture? */
static void look_at_lines(const texedges_set *set, float reach) {
    size_t points = 0;
    for (size_t i = 0; i < set->line_count; i++) {
        const texedges_polyline *line = &set->lines[i];
        if (line->layer < 0 || line->layer >= set->levels || line->first != points) abort();
        points += line->count;
    }
    if (points != set->point_count) abort();
    for (size_t i = 0; i < points; i++) {
        const txm_vec2 p = set->points[i];
        if (!(p.x >= -reach && p.y >= -reach && p.x <= (float)set->width + reach &&
              p.y <= (float)set->height + reach))
            abort();
    }
}

static void use_strokes(input *in, pool *p, source *s) {
    const int width = 1 + pick(s, 2 * MOST_SIDE), height = 1 + pick(s, 2 * MOST_SIDE);
    texedges_set *disturbed = NULL;
    trouble t;
    txm_env env = troubled(&t, s);
    if (succeeded(texedges_disturb(&in->control, width, height, &env, &disturbed), &t, &env) !=
        (disturbed != NULL))
        abort();
    if (disturbed) {
        const txm_image guide = fresh_image(p, s, width, height, 1, TXM_U8);
        const txm_image mask = fresh_image(p, s, width + (pick(s, 30) == 0), height, 1, TXM_U8);
        look_at_lines(disturbed, 2e6f);
        const txm_status status = texedges_guide(&in->control, disturbed, &env, &guide, &mask);
        const int success = succeeded(status, &t, &env);
        look_at_results(success, &guide, 1);
        look_at_results(success, &mask, 1);
        fuzz_succeeded += success;
    }
    texedges_set_free(disturbed);
    if (t.memory.blocks) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static input in;
    static pool p;
    source s = source_of(data, size);
    texedges_set *set = NULL;
    trouble t;
    make_desc(&in, &p, &s);
    txm_env env = troubled(&t, &s);
    if (succeeded(texedges_find(&in.desc, &env, &set), &t, &env) != (set != NULL)) abort();
    if (set) {
        look_at_lines(set, 0);
        const txm_image layers = fresh_image(&p, &s, set->width, set->height, 1, TXM_U8);
        plan_trouble(&t, &s);
        const int success = succeeded(texedges_layers(&in.desc, set, &env, &layers), &t, &env);
        look_at_results(success, &layers, 1);
        const txm_image over = fresh_image(&p, &s, 1 + pick(&s, 100), 1 + pick(&s, 100), 1 + 2 * pick(&s, 2), TXM_U8);
        plan_trouble(&t, &s);
        const txm_status status = texedges_draw(set, pick(&s, set->levels + 2) - 1, &env, &over);
        look_at_results(succeeded(status, &t, &env), &over, 1);
        make_strokes(&in, &s, set);
        use_strokes(&in, &p, &s);
        fuzz_succeeded += success;
    }
    texedges_set_free(set);
    if (t.memory.blocks) abort();
    drain(&p);
    return 0;
}
