/* fuzz_textiles.c - random exemplars, tiles, grids and meshes into textiles.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   Sets are cut or, which is quicker, imported; then atlases, planes, tilings and coverings are made of
   them. Tiles must be tiles of the set, tilings must match, results lie in their rows; after an error they
   are untouched.                                                                                    */
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"

#define FUZZ_BYTES 300
#include "fuzzkit.h"

enum { MOST_MAPS = 3, MOST_TILES = 600, MOST_CELLS = 400, MOST_FACES = 60, UNTOUCHED = -77 };

static int classes[6][4], edge_exemplars[4];
static trouble kept; /* a set that is cut releases with it */

static textiles_desc make_desc(source *s) {
    textiles_desc d;
    memset(&d, 0, sizeof d);
    d.kind = (textiles_kind)pick(s, pick(s, 40) ? 4 : 6);
    d.size = pick(s, 30) ? 32 + pick(s, 12) : pick(s, 3) * 150; /* 32 tiles of 700 take minutes */
    d.colors = pick(s, 30) ? 1 + pick(s, 3) : pick(s, 8) - 1;
    d.variants = pick(s, 30) ? pick(s, 4) : pick(s, 30);
    d.reduced = pick(s, 3) == 0;
    for (int k = 0; k < 24; k++) classes[k / 4][k % 4] = pick(s, d.colors < 1 ? 2 : d.colors) + (pick(s, 200) == 0);
    if (d.kind == TEXTILES_FRAME && pick(s, 2)) {
        d.classes = (const int(*)[4])classes;
        d.class_count = pick(s, 40) ? 1 + pick(s, 6) : 0;
    }
    d.repair = (textiles_repair)pick(s, 3);
    d.seed = (uint64_t)pick(s, 256);
    return d;
}

static textiles_set *cut(pool *p, source *s) {
    textiles_exemplar exemplars[2];
    txm_image maps[2][MOST_MAPS];
    textiles_desc d = make_desc(s);
    textiles_set *set = NULL;
    trouble t;
    const int map_count = 1 + pick(s, MOST_MAPS), channels = 1 + pick(s, 4);
    const txm_sample sample = any_sample(s);
    if (d.variants > 2) d.variants = 2; /* what takes long is no stranger */
    if (d.colors > 2) d.colors = 2;
    d.exemplars = exemplars;
    d.exemplar_count = 1 + pick(s, 4) / 3;
    for (int e = 0; e < d.exemplar_count; e++) {
        const int width = (pick(s, 30) ? 64 : 50) + pick(s, 20), height = 64 + pick(s, 20);
        for (int m = 0; m < map_count; m++)
            maps[e][m] = any_image(p, s, width, height + (pick(s, 90) == 0), channels, sample);
        exemplars[e].maps = maps[e];
        exemplars[e].map_count = map_count;
    }
    for (int c = 0; c < 4; c++) edge_exemplars[c] = pick(s, d.exemplar_count + (pick(s, 60) == 0));
    if (pick(s, 4) == 0) d.edge_exemplars = edge_exemplars;
    txm_env env = troubled(&t, s);
    kept = t;
    env.memory_user = &kept.memory;
    env.progress_user = &kept;
    if (succeeded(textiles_make(&d, &env, &set), &kept, &env) != (set != NULL)) abort();
    return set;
}

static textiles_set *import(pool *p, source *s) {
    static txm_image tiles[MOST_TILES * MOST_MAPS];
    textiles_desc d = make_desc(s);
    textiles_set *set = NULL;
    txm_env env;
    const int map_count = 1 + pick(s, MOST_MAPS), colors = d.colors ? d.colors : 2;
    const int variants = d.variants ? d.variants : 1, triangle = d.kind == TEXTILES_TRIANGLE;
    int count = colors * colors, channels[MOST_MAPS];
    txm_sample samples[MOST_MAPS];
    memset(&env, 0, sizeof env);
    if (d.kind == TEXTILES_FRAME) count = d.classes ? d.class_count : colors;
    else if (triangle) count = (8 * colors * colors * colors + 4 * colors) / 3 / (d.reduced ? 2 : 1);
    else count *= d.reduced && d.kind == TEXTILES_WANG ? 2 : colors * colors;
    count = txm_clampi(count * variants + (pick(s, 40) == 0), 1, MOST_TILES);
    for (int m = 0; m < map_count; m++) {
        channels[m] = 1 + pick(s, 4);
        samples[m] = any_sample(s);
    }
    const int size = (d.size ? txm_clampi(d.size, 1, 64) : 128) + triangle;
    for (int m = 0; m < map_count; m++) { /* all tiles show one of three pictures */
        txm_image some[3];
        for (int k = 0; k < 3; k++) some[k] = any_image(p, s, size, size, channels[m], samples[m]);
        for (int i = 0; i < count; i++) tiles[i * map_count + m] = some[i % 3];
    }
    const txm_status status = textiles_import(&d, tiles, count, map_count, &env, &set);
    if ((status == TXM_OK) != (set != NULL) || (!set && !env.message[0])) abort();
    return set;
}

/* ---- pictures of a set --------------------------------------------------------------------- */

static txm_sample sample_of(const textiles_set *set, int map, pool *p) {
    static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
    uint8_t *bytes = take(p, (size_t)(textiles_size(set) + 1) * (size_t)(textiles_size(set) + 1) * 16);
    for (int k = 0; k < 3; k++) { /* the one that is not refused */
        const int side = textiles_size(set) + (textiles_kind_of(set) == TEXTILES_TRIANGLE);
        const txm_image out = {bytes, side, side, textiles_channels(set, map), samples[k], 0};
        if (textiles_draw_tile(set, 0, 0, map, NULL, out) == TXM_OK) return samples[k];
    }
    abort();
}

static void draw(const textiles_set *set, pool *p, source *s) {
    textiles_layout layout;
    textiles_plane plane;
    trouble t;
    txm_env env = troubled(&t, s);
    const int map = pick(s, textiles_map_count(set)), channels = textiles_channels(set, map);
    const txm_sample sample = sample_of(set, map, p);
    const int gutter = pick(s, 20) - 1, tile = pick(s, textiles_count(set) + 1), side = textiles_size(set) +
        (textiles_kind_of(set) == TEXTILES_TRIANGLE) + 2 * (gutter < 0 ? 0 : gutter);
    const txm_image single = fresh_image(p, s, side, side, channels, sample);
    const txm_status drawn = textiles_draw_tile(set, tile, gutter, map, &env, single);
    look_at_results(succeeded(drawn, &t, &env), &single, 1);
    const textiles_packing packing = (textiles_packing)pick(s, 3);
    if (!succeeded(textiles_layout_make(set, packing, gutter, &env, &layout), &t, &env)) return;
    const txm_image atlas = fresh_image(p, s, layout.width, layout.height, channels, sample);
    const int success = succeeded(textiles_draw_atlas(set, &layout, map, &env, atlas), &t, &env);
    look_at_results(success, &atlas, 1);
    for (int i = -1; i <= textiles_count(set); i++) {
        int x = 0, y = 0, step = 0;
        float uv[4][2], from[2];
        if (!textiles_place(&layout, i, &x, &y, &step, uv)) continue;
        if (x < 0 || y < 0 || x >= layout.width || y >= layout.height) abort();
        textiles_source(set, i, pick(s, side), pick(s, side), from);
        textiles_face_uv(&layout, i, pick(s, 4), uv);
    }
    fuzz_succeeded += success;
    if (!success || !succeeded(textiles_plane_make(set, 7, &env, &plane), &t, &env)) return;
    const txm_image window = fresh_image(p, s, 1 + pick(s, 60), 1 + pick(s, 60), channels, sample);
    const double step = pick(s, 2) ? 1 : (double)pick(s, 400) / 100, at = pick(s, 4) ? 0 : 1e9 * textiles_size(set);
    const txm_status status = textiles_draw_plane(&plane, &layout, &atlas, at + pick(s, 500), -(double)pick(s, 500) / 8,
                                                  step, &env, window);
    look_at_results(succeeded(status, &t, &env), &window, 1);
    if (t.memory.blocks) abort();
}

/* ---- tilings ------------------------------------------------------------------------------- */

static void look_at_grid(const textiles_set *set, const int *tiles, int width, int height) {
    const int corners = textiles_kind_of(set) == TEXTILES_CORNER;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            textiles_tile a, b;
            if (!textiles_tile_at(set, tiles[y * width + x], &a)) abort();
            if (x + 1 < width) {
                textiles_tile_at(set, tiles[y * width + x + 1], &b);
                if (corners ? a.edges[1] != b.edges[0] || a.edges[2] != b.edges[3] : a.edges[1] != b.edges[3]) abort();
            }
            if (y + 1 < height) {
                textiles_tile_at(set, tiles[(y + 1) * width + x], &b);
                if (corners ? a.edges[3] != b.edges[0] || a.edges[2] != b.edges[1] : a.edges[2] != b.edges[0]) abort();
            }
        }
}

static void tile(const textiles_set *set, pool *p, source *s) {
    const int width = 1 + pick(s, 20), height = 1 + pick(s, 20), cells = width * height;
    int *tiles = (int *)(void *)take(p, (size_t)cells * sizeof *tiles);
    trouble t;
    txm_env env = troubled(&t, s);
    for (int i = 0; i < cells; i++) tiles[i] = UNTOUCHED;
    if (succeeded(textiles_scanline(set, width, height, 3, &env, tiles), &t, &env)) {
        look_at_grid(set, tiles, width, height);
    } else {
        for (int i = 0; i < cells; i++)
            if (tiles[i] != UNTOUCHED) abort();
    }
    for (int i = 0; i < cells; i++)
        tiles[i] = pick(s, 40) ? -1 : pick(s, textiles_count(set) + (pick(s, 30) == 0));
    int *before = (int *)(void *)take(p, (size_t)cells * sizeof *before);
    memcpy(before, tiles, (size_t)cells * sizeof *before);
    if (succeeded(textiles_solve(set, width, height, pick(s, 2), 5, &env, tiles), &t, &env)) {
        look_at_grid(set, tiles, width, height);
        for (int i = 0; i < cells; i++)
            if (before[i] >= 0 && before[i] != tiles[i]) abort();
        fuzz_succeeded++;
    } else if (memcmp(before, tiles, (size_t)cells * sizeof *before) != 0) {
        abort();
    }
    if (t.memory.blocks) abort();
}

static void assign(const textiles_set *set, pool *p, source *s) {
    const int corners = textiles_kind_of(set) == TEXTILES_TRIANGLE ? 3 : 4;
    const int faces = 1 + pick(s, MOST_FACES), across = 1 + pick(s, 8), vertices = 4 * MOST_FACES;
    uint32_t *indices = (uint32_t *)(void *)take(p, (size_t)(faces * corners) * sizeof *indices);
    int *edges = (int *)(void *)take(p, (size_t)(faces * 4) * sizeof *edges);
    int *tiles = (int *)(void *)take(p, (size_t)faces * sizeof *tiles);
    int *rotations = (int *)(void *)take(p, (size_t)faces * sizeof *rotations);
    const int kind = pick(s, 3); /* a grid, a grid with a wrong corner, anything */
    trouble t;
    txm_env env = troubled(&t, s);
    for (int f = 0; f < faces; f++) {
        const uint32_t a = (uint32_t)(f / across * (across + 1) + f % across), b = a + (uint32_t)across + 1;
        const uint32_t grid[4] = {a, b, b + 1, a + 1};
        for (int k = 0; k < corners; k++)
            indices[f * corners + k] = kind == 2 ? (uint32_t)pick(s, 12) : grid[k];
        for (int k = 0; k < 4; k++) edges[4 * f + k] = pick(s, textiles_colors(set) + (pick(s, 90) == 0));
        tiles[f] = rotations[f] = UNTOUCHED;
    }
    if (kind == 1) indices[pick(s, faces * corners)] = pick(s, 2) ? 0xffffffffu : 1;
    const txm_status status =
        corners == 3 ? textiles_assign_triangles(set, indices, (size_t)faces, (size_t)vertices, 1, &env, tiles, rotations)
                     : textiles_assign_quads(set, indices, (size_t)faces, (size_t)vertices, pick(s, 3) ? NULL : edges, 1,
                                             &env, tiles);
    const int success = succeeded(status, &t, &env);
    for (int f = 0; f < faces; f++) {
        if (!success && tiles[f] != UNTOUCHED) abort();
        if (success && (tiles[f] < 0 || tiles[f] >= textiles_count(set))) abort();
        if (success && corners == 3 && (rotations[f] < 0 || rotations[f] > 2)) abort();
    }
    fuzz_succeeded += success;
    if (t.memory.blocks) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static pool p;
    source s = source_of(data, size);
    textiles_set *set = pick(&s, 12) ? import(&p, &s) : cut(&p, &s);
    if (set) {
        textiles_joints joints;
        trouble t;
        txm_env env = troubled(&t, &s);
        if (pick(&s, 4) == 0)
            succeeded(textiles_measure(set, pick(&s, textiles_map_count(set) + 1), &env, &joints), &t, &env);
        if (t.memory.blocks) abort();
        draw(set, &p, &s);
        tile(set, &p, &s);
        assign(set, &p, &s);
    }
    textiles_set_free(set);
    if (kept.memory.blocks) abort();
    drain(&p);
    return 0;
}
