/* golden_textiles.c - hashes of tile sets, atlases and assignments of textiles.h; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"

#include "golden.h"

enum { SIDE = 64, TILE = 32, MOST = 1 << 21 };
static uint8_t exemplar[SIDE * SIDE * 4], out[MOST];

static textiles_desc describe(textiles_kind kind, const textiles_exemplar *e, int count) {
    textiles_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.kind = kind;
    desc.exemplars = e;
    desc.exemplar_count = count;
    desc.size = TILE;
    desc.seed = 3;
    return desc;
}

/* a set of one map with some channels */
static textiles_set *make(textiles_kind kind, int channels, int variants, txm_env *env) {
    const txm_image map = golden_image(exemplar, SIDE, SIDE, channels, TXM_U8);
    const textiles_exemplar e = {&map, 1};
    textiles_set *set = NULL;
    golden_noise(exemplar, SIDE, SIDE, channels);
    textiles_desc desc = describe(kind, &e, 1);
    desc.variants = variants;
    desc.reduced = kind == TEXTILES_TRIANGLE;
    golden_need(textiles_make(&desc, env, &set), "make", env);
    return set;
}

/* All tiles of a set: pixels of its first map and where they come from. */
static uint64_t set_hash(const textiles_set *set, txm_env *env, uint64_t hash) {
    const int triangle = textiles_kind_of(set) == TEXTILES_TRIANGLE;
    const int side = TILE + triangle, channels = textiles_channels(set, 0);
    const txm_image image = golden_image(out, side, side, channels, TXM_U8);
    for (int t = 0; t < textiles_count(set); t++) {
        textiles_tile tile;
        memset(&tile, 0, sizeof tile);
        textiles_tile_at(set, t, &tile);
        hash = golden_hash(hash, tile.edges, (size_t)(4 - triangle) * sizeof(int), 4);
        golden_need(textiles_draw_tile(set, t, 0, 0, env, image), "draw a tile", env);
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < (triangle ? side - y : side); x++) {
                float from[2] = {0, 0};
                const int e = textiles_source(set, t, x, y, from);
                hash = golden_hash(hash, &e, sizeof e, 4);
                hash = golden_hash(hash, from, sizeof from, 4);
                hash = tk_hash(hash, out + (y * side + x) * channels, (size_t)channels);
            }
        }
    }
    return hash;
}

static uint64_t wang(txm_env *env) {
    textiles_set *set = make(TEXTILES_WANG, 3, 1, env);
    const uint64_t hash = set_hash(set, env, 0);
    textiles_set_free(set);
    return hash;
}

static uint64_t corner(txm_env *env) {
    textiles_set *set = make(TEXTILES_CORNER, 1, 1, env);
    const uint64_t hash = set_hash(set, env, 0);
    textiles_set_free(set);
    return hash;
}

static uint64_t triangle(txm_env *env) {
    textiles_set *set = make(TEXTILES_TRIANGLE, 3, 1, env);
    const uint64_t hash = set_hash(set, env, 0);
    textiles_set_free(set);
    return hash;
}

/* classes with edges of two exemplars, a second map of floats in register, nothing repaired */
static uint64_t frame(txm_env *env) {
    enum { SMALL = TILE + 8 };
    static uint8_t other[SIDE * SIDE * 3];
    static float floats[2][SIDE * SIDE], values[SMALL * SMALL];
    static const int classes[3][4] = {{0, 0, 0, 0}, {1, 0, 1, 0}, {1, 1, 0, 1}}, edges[2] = {0, 1};
    golden_noise(exemplar, SIDE, SIDE, 3);
    golden_blobs(other, SIDE, SIDE, 3);
    for (int i = 0; i < SIDE * SIDE; i++) {
        floats[0][i] = (float)exemplar[3 * i] / 3.0f;
        floats[1][i] = (float)other[3 * i] / 7.0f;
    }
    const txm_image maps[2][2] = {{golden_image(exemplar, SIDE, SIDE, 3, TXM_U8),
                                   golden_image(floats[0], SIDE, SIDE, 1, TXM_F32)},
                                  {golden_image(other, SIDE, SIDE, 3, TXM_U8),
                                   golden_image(floats[1], SIDE, SIDE, 1, TXM_F32)}};
    const textiles_exemplar e[2] = {{maps[0], 2}, {maps[1], 2}};
    textiles_set *set = NULL;
    textiles_desc desc = describe(TEXTILES_FRAME, e, 2);
    desc.classes = classes;
    desc.class_count = 3;
    desc.edge_exemplars = edges;
    desc.repair = TEXTILES_REPAIR_NONE;
    desc.variants = 2;
    golden_need(textiles_make(&desc, env, &set), "make", env);
    uint64_t hash = set_hash(set, env, 0);
    const txm_image image = golden_image(values, SMALL, SMALL, 1, TXM_F32);
    for (int t = 0; t < textiles_count(set); t++) {
        golden_need(textiles_draw_tile(set, t, 4, 1, env, image), "draw a tile", env);
        hash = golden_hash(hash, values, sizeof values, 4);
    }
    textiles_set_free(set);
    return hash;
}

static uint64_t atlas_hash(textiles_set *set, textiles_packing packing, int gutter, txm_env *env,
                           uint64_t hash) {
    textiles_layout layout;
    golden_need(textiles_layout_make(set, packing, gutter, env, &layout), "layout", env);
    const int channels = textiles_channels(set, 0);
    const size_t bytes = (size_t)layout.width * (size_t)layout.height * (size_t)channels;
    if (bytes > MOST) golden_need(TXM_TOO_LARGE, "atlas", env);
    const txm_image image = golden_image(out, layout.width, layout.height, channels, TXM_U8);
    golden_need(textiles_draw_atlas(set, &layout, 0, env, image), "atlas", env);
    for (int t = 0; t < layout.count; t++) {
        int at[3] = {0, 0, 0};
        float uv[4][2] = {{0, 0}, {0, 0}, {0, 0}, {0, 0}};
        textiles_place(&layout, t, &at[0], &at[1], &at[2], uv);
        hash = golden_hash(hash, at, sizeof at, 4);
        hash = golden_hash(hash, uv, sizeof uv, 4);
    }
    return tk_hash(hash, out, bytes);
}

static uint64_t atlases(txm_env *env) {
    textiles_set *set = make(TEXTILES_WANG, 1, 1, env);
    uint64_t hash = atlas_hash(set, TEXTILES_PACKED, -1, env, 0);
    hash = atlas_hash(set, TEXTILES_TORUS, 0, env, hash);
    hash = atlas_hash(set, TEXTILES_SLICES, 4, env, hash);
    textiles_set_free(set);
    set = make(TEXTILES_TRIANGLE, 1, 1, env);
    hash = atlas_hash(set, TEXTILES_PACKED, 4, env, hash);
    textiles_set_free(set);
    set = make(TEXTILES_CORNER, 1, 1, env);
    hash = atlas_hash(set, TEXTILES_TORUS, -1, env, hash);
    textiles_set_free(set);
    return hash;
}

/* windows of the plane, squares and triangles */
static uint64_t planes(txm_env *env) {
    static int tiles[50 * 40];
    uint64_t hash = 0;
    for (int kind = TEXTILES_WANG; kind <= TEXTILES_TRIANGLE; kind++) {
        textiles_set *set = make((textiles_kind)kind, 1, kind == TEXTILES_WANG ? 2 : 1, env);
        textiles_plane plane;
        textiles_layout layout;
        golden_need(textiles_plane_make(set, 77, env, &plane), "plane", env);
        golden_need(textiles_layout_make(set, TEXTILES_PACKED, 4, env, &layout), "layout", env);
        if (kind == TEXTILES_TRIANGLE) {
            for (int i = 0; i < 50 * 40; i++) {
                int turn = 0;
                tiles[i] = textiles_plane_triangle(&plane, i % 50 - 20, i / 50 - 9, i % 2, &turn);
                tiles[i] = tiles[i] * 4 + turn;
            }
        } else textiles_plane_fill(&plane, -2000000000, 17, 50, 40, tiles);
        hash = golden_hash(hash, tiles, sizeof tiles, 4);
        const size_t bytes = (size_t)layout.width * (size_t)layout.height;
        const txm_image atlas = golden_image(out, layout.width, layout.height, 1, TXM_U8);
        const txm_image window = golden_image(out + bytes, 90, 70, 1, TXM_U8);
        golden_need(textiles_draw_atlas(set, &layout, 0, env, atlas), "atlas", env);
        golden_need(textiles_draw_plane(&plane, &layout, &atlas, -123.25, 4567.5, 0.75, env, window),
                    "draw the plane", env);
        hash = tk_hash(hash, out + bytes, 90 * 70);
        textiles_set_free(set);
    }
    return hash;
}

/* finite grids: at random, and around what is given */
static uint64_t grids(txm_env *env) {
    static int tiles[60 * 50];
    uint64_t hash = 0;
    for (int kind = TEXTILES_WANG; kind <= TEXTILES_CORNER; kind++) {
        textiles_set *set = make((textiles_kind)kind, 1, 2, env);
        golden_need(textiles_scanline(set, 60, 50, 5, env, tiles), "scanline", env);
        hash = golden_hash(hash, tiles, sizeof tiles, 4);
        for (int i = 0; i < 60 * 50; i++)
            if (i % 7 || i / 60 % 5) tiles[i] = -1;
        golden_need(textiles_solve(set, 60, 50, 0, 6, env, tiles), "solve", env);
        hash = golden_hash(hash, tiles, sizeof tiles, 4);
        for (int i = 1; i < 60 * 50; i++) tiles[i] = -1;
        golden_need(textiles_solve(set, 60, 50, 1, 7, env, tiles), "solve", env);
        hash = golden_hash(hash, tiles, sizeof tiles, 4);
        textiles_set_free(set);
    }
    return hash;
}

/* meshes of triangles and of quads, and how well the tiles join */
static uint64_t meshes(txm_env *env) {
    enum { N = 30 };
    static uint32_t quads[N * N * 4], triangles[N * N * 6];
    static int tiles[2 * N * N], turns[2 * N * N];
    uint64_t hash = 0;
    textiles_joints joints;
    for (int i = 0; i < N * N; i++) { /* a torus; corners nw, sw, se, ne */
        const int x = i % N, y = i / N, x1 = (x + 1) % N, y1 = (y + 1) % N;
        const int quad[4] = {y * N + x, y1 * N + x, y1 * N + x1, y * N + x1};
        const int split[6] = {quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]};
        for (int k = 0; k < 4; k++) quads[4 * i + k] = (uint32_t)quad[k];
        for (int k = 0; k < 6; k++) triangles[6 * i + k] = (uint32_t)split[k];
    }
    textiles_set *set = make(TEXTILES_TRIANGLE, 1, 2, env);
    golden_need(textiles_assign_triangles(set, triangles, 2 * N * N, N * N, 4, env, tiles, turns),
                "triangles", env);
    hash = golden_hash(hash, tiles, sizeof tiles, 4);
    hash = golden_hash(hash, turns, sizeof turns, 4);
    golden_need(textiles_measure(set, 0, env, &joints), "measure", env);
    const double triangle_joints[4] = {joints.mean, joints.worst, joints.least, joints.overall};
    hash = golden_hash(hash, triangle_joints, sizeof triangle_joints, 8);
    textiles_set_free(set);
    set = make(TEXTILES_WANG, 1, 1, env);
    golden_need(textiles_assign_quads(set, quads, N * N, N * N, NULL, 4, env, tiles), "quads", env);
    hash = golden_hash(hash, tiles, N * N * sizeof *tiles, 4);
    golden_need(textiles_measure(set, 0, env, &joints), "measure", env);
    const double square_joints[4] = {joints.mean, joints.worst, joints.least, joints.overall};
    hash = golden_hash(hash, square_joints, sizeof square_joints, 8);
    textiles_set_free(set);
    return hash;
}

static const golden_case cases[] = {{"wang", wang},       {"corner", corner}, {"triangle", triangle},
                                    {"frame", frame},     {"atlases", atlases}, {"planes", planes},
                                    {"grids", grids},     {"meshes", meshes}};
GOLDEN_MAIN("textiles")
