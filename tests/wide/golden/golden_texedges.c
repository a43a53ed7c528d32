/* golden_texedges.c - hashes of layers, their boundaries and control edges; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#define TEXEDGES_IMPLEMENTATION
#include "texedges.h"

#include "golden.h"

enum { SIDE = 96, WIDTH = 160, HEIGHT = 128 };
static uint8_t exemplar[SIDE * SIDE * 3], out[WIDTH * HEIGHT * 3];

static uint64_t edges_hash(const texedges_set *edges, uint64_t hash) {
    const int numbers[3] = {edges->levels, edges->width, edges->height};
    hash = golden_hash(hash, numbers, sizeof numbers, 4);
    hash = golden_hash(hash, edges->thresholds, (size_t)(edges->levels - 1) * sizeof(float), 4);
    hash = golden_hash(hash, edges->beside, (size_t)edges->levels * sizeof(int), 4);
    for (size_t i = 0; i < edges->line_count; i++) {
        const uint64_t line[4] = {(uint64_t)edges->lines[i].layer, (uint64_t)edges->lines[i].is_hole,
                                  edges->lines[i].first, edges->lines[i].count};
        hash = golden_hash(hash, line, sizeof line, 8);
    }
    return golden_hash(hash, edges->points, edges->point_count * sizeof *edges->points, 4);
}

static texedges_desc describe(int channels) {
    texedges_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.image = golden_image(exemplar, SIDE, SIDE, channels, TXM_U8);
    return desc;
}

static uint64_t find(txm_env *env) {
    texedges_set *edges;
    golden_noise(exemplar, SIDE, SIDE, 1);
    const texedges_desc desc = describe(1);
    golden_need(texedges_find(&desc, env, &edges), "find", env);
    const uint64_t hash = edges_hash(edges, 0);
    texedges_set_free(edges);
    return hash;
}

static uint64_t find_smooth(txm_env *env) {
    texedges_set *edges;
    golden_noise(exemplar, SIDE, SIDE, 3);
    texedges_desc desc = describe(3);
    desc.levels = 6;
    desc.smooth = 2.5f;
    desc.least = 24;
    golden_need(texedges_find(&desc, env, &edges), "find", env);
    const uint64_t hash = edges_hash(edges, 0);
    texedges_set_free(edges);
    return hash;
}

static uint64_t layers(txm_env *env) {
    static const float thresholds[2] = {0.3f, 0.62f};
    texedges_set *edges;
    golden_blobs(exemplar, SIDE, SIDE, 3);
    texedges_desc desc = describe(3);
    desc.levels = 3;
    desc.thresholds = thresholds;
    desc.least = 30;
    golden_need(texedges_find(&desc, env, &edges), "find", env);
    uint64_t hash = edges_hash(edges, 0);
    const txm_image image = golden_image(out, SIDE, SIDE, 1, TXM_U8);
    golden_need(texedges_layers(&desc, edges, env, &image), "layers", env);
    hash = tk_hash(hash, out, SIDE * SIDE);
    texedges_set_free(edges);
    return hash;
}

static uint64_t drawn(txm_env *env) {
    texedges_set *edges;
    uint64_t hash = 0;
    golden_blobs(exemplar, SIDE, SIDE, 1);
    const texedges_desc desc = describe(1);
    golden_need(texedges_find(&desc, env, &edges), "find", env);
    for (int layer = -1; layer < 2; layer++) {
        const int channels = layer < 0 ? 3 : 1;
        const txm_image image = golden_image(out, SIDE, SIDE, channels, TXM_U8);
        memset(out, 40, sizeof out);
        golden_need(texedges_draw(edges, layer, env, &image), "draw", env);
        hash = tk_hash(hash, out, (size_t)(SIDE * SIDE * channels));
    }
    texedges_set_free(edges);
    return hash;
}

/* Strokes disturbed like the edges of an exemplar, and the guide that they make. */
static uint64_t control(int background, float disturb, txm_env *env) {
    static const txm_vec2 bent[4] = {{10, 20}, {60, 50}, {110, 25}, {150, 90}};
    static const txm_vec2 ring[5] = {{40, 60}, {80, 66}, {96, 96}, {60, 118}, {30, 100}};
    static const txm_vec2 outside[3] = {{-20, 110}, {90, 120}, {200, 60}};
    texedges_set *edges, *lines;
    texedges_stroke strokes[3];
    texedges_control c;
    golden_blobs(exemplar, SIDE, SIDE, 1);
    const texedges_desc desc = describe(1);
    golden_need(texedges_find(&desc, env, &edges), "find", env);
    memset(strokes, 0, sizeof strokes);
    memset(&c, 0, sizeof c);
    strokes[0].points = bent;
    strokes[0].count = 4;
    strokes[0].layer = 3;
    strokes[0].width = 14;
    strokes[1].points = ring;
    strokes[1].count = 5;
    strokes[1].is_closed = 1;
    strokes[1].layer = 1;
    strokes[2].points = outside;
    strokes[2].count = 3;
    strokes[2].layer = 2;
    c.edges = edges;
    c.strokes = strokes;
    c.stroke_count = 3;
    c.background = background;
    c.disturb = disturb;
    c.seed = 4;
    golden_need(texedges_disturb(&c, WIDTH, HEIGHT, env, &lines), "disturb", env);
    uint64_t hash = edges_hash(lines, 0);
    const txm_image guide = golden_image(out, WIDTH, HEIGHT, 1, TXM_U8);
    const txm_image mask = golden_image(out + WIDTH * HEIGHT, WIDTH, HEIGHT, 1, TXM_U8);
    golden_need(texedges_guide(&c, lines, env, &guide, &mask), "guide", env);
    hash = tk_hash(hash, out, 2 * WIDTH * HEIGHT);
    texedges_set_free(lines);
    texedges_set_free(edges);
    return hash;
}

static uint64_t control_free(txm_env *env) {
    return control(-1, 0, env);
}

static uint64_t control_strong(txm_env *env) {
    return control(0, 2.5f, env);
}

static uint64_t control_plain(txm_env *env) {
    return control(2, -1, env);
}

static const golden_case cases[] = {{"find", find},
                                    {"find-smooth", find_smooth},
                                    {"layers", layers},
                                    {"drawn", drawn},
                                    {"control-free", control_free},
                                    {"control-strong", control_strong},
                                    {"control-plain", control_plain}};
GOLDEN_MAIN("texedges")
