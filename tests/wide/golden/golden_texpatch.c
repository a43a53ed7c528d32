/* golden_texpatch.c - hashes of textures that texpatch.h makes of pieces; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include "golden.h"

enum { SIDE = 64, WIDTH = 96, HEIGHT = 80 };
static uint8_t exemplar[2][SIDE * SIDE * 4], out[WIDTH * HEIGHT * 4];

static texpatch_exemplar one_exemplar(const txm_image *maps) {
    texpatch_exemplar e;
    memset(&e, 0, sizeof e);
    e.maps = maps;
    return e;
}

static texpatch_desc describe(const texpatch_exemplar *exemplars, int count, int maps) {
    texpatch_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.exemplars = exemplars;
    desc.exemplar_count = count;
    desc.map_count = maps;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.seed = 3;
    return desc;
}

static uint64_t make(const texpatch_desc *desc, int channels, txm_env *env) {
    const txm_image image = golden_image(out, desc->width, desc->height, channels, TXM_U8);
    golden_need(texpatch_make(desc, env, &image), "make", env);
    return tk_hash(0, out, (size_t)desc->width * (size_t)desc->height * (size_t)channels);
}

static uint64_t torus(int channels, int width, int height, txm_env *env) {
    golden_noise(exemplar[0], SIDE, SIDE, channels);
    const txm_image map = golden_image(exemplar[0], SIDE, SIDE, channels, TXM_U8);
    const texpatch_exemplar e = one_exemplar(&map);
    texpatch_desc desc = describe(&e, 1, 1);
    desc.width = width;
    desc.height = height;
    desc.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
    return make(&desc, channels, env);
}

static uint64_t tileable(txm_env *env) {
    return torus(3, WIDTH, HEIGHT, env);
}

/* more rows than are finished at a time, and an odd number of them */
static uint64_t tall(txm_env *env) {
    return torus(1, 33, 601, env);
}

static uint64_t turned(txm_env *env) {
    golden_noise(exemplar[0], SIDE, SIDE, 1);
    const txm_image map = golden_image(exemplar[0], SIDE, SIDE, 1, TXM_U8);
    const texpatch_exemplar e = one_exemplar(&map);
    texpatch_desc desc = describe(&e, 1, 1);
    desc.turns = 4;
    desc.mirror = 1;
    desc.passes = 1;
    desc.novelty = 0.5f;
    return make(&desc, 1, env);
}

/* a brick wall's lattice is found, and kept where the output wraps */
static uint64_t lattice(txm_env *env) {
    golden_bricks(exemplar[0], SIDE, SIDE, 3);
    const txm_image map = golden_image(exemplar[0], SIDE, SIDE, 3, TXM_U8);
    const texpatch_exemplar e = one_exemplar(&map);
    texpatch_desc desc = describe(&e, 1, 1);
    float vectors[4] = {0, 0, 0, 0};
    texpatch_job *job = NULL;
    desc.tileable = TEXPATCH_TILE_X;
    golden_need(texpatch_begin(&desc, env, &job), "begin", env);
    const int found = texpatch_lattice(job, vectors);
    texpatch_free(job);
    uint64_t hash = make(&desc, 3, env);
    hash = golden_hash(hash, &found, sizeof found, 4);
    return golden_hash(hash, vectors, sizeof vectors, 4);
}

/* a lattice that the caller tells, patches alone */
static uint64_t lattice_given(txm_env *env) {
    golden_bricks(exemplar[0], SIDE, SIDE, 1);
    const txm_image map = golden_image(exemplar[0], SIDE, SIDE, 1, TXM_U8);
    const texpatch_exemplar e = one_exemplar(&map);
    texpatch_desc desc = describe(&e, 1, 1);
    desc.lattice = 1;
    desc.lattice_vectors[0] = 16;
    desc.lattice_vectors[2] = 8;
    desc.lattice_vectors[3] = 8;
    desc.passes = -1;
    return make(&desc, 1, env);
}

/* two exemplars of four maps in register: colour, normal, height, label */
static uint64_t maps(txm_env *env) {
    static float normal[2][SIDE * SIDE * 3], normal_out[WIDTH * HEIGHT * 3];
    static uint16_t height[2][SIDE * SIDE], height_out[WIDTH * HEIGHT];
    static uint8_t label[2][SIDE * SIDE], label_out[WIDTH * HEIGHT];
    static uint8_t mask[SIDE * SIDE];
    txm_image in[2][4];
    texpatch_exemplar e[2];
    texpatch_map kinds[4];
    golden_noise(exemplar[0], SIDE, SIDE, 3);
    golden_blobs(exemplar[1], SIDE, SIDE, 3);
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double x = exemplar[k][3 * i] / 255.0 - 0.5, y = exemplar[k][3 * i + 1] / 255.0 - 0.5;
            const double z = sqrt(1 - 0.9 * (x * x + y * y)), l = sqrt(x * x + y * y + z * z);
            normal[k][3 * i] = txm_float((x / l + 1) / 2);
            normal[k][3 * i + 1] = txm_float((y / l + 1) / 2);
            normal[k][3 * i + 2] = txm_float((z / l + 1) / 2);
            height[k][i] = (uint16_t)(exemplar[k][3 * i] * 200);
            label[k][i] = (uint8_t)(exemplar[k][3 * i] / 64);
            mask[i] = i % SIDE < 50 || i / SIDE < 50 ? 255 : 0;
        }
        in[k][0] = golden_image(exemplar[k], SIDE, SIDE, 3, TXM_U8);
        in[k][1] = golden_image(normal[k], SIDE, SIDE, 3, TXM_F32);
        in[k][2] = golden_image(height[k], SIDE, SIDE, 1, TXM_U16);
        in[k][3] = golden_image(label[k], SIDE, SIDE, 1, TXM_U8);
        e[k] = one_exemplar(in[k]);
    }
    e[1].mask = golden_image(mask, SIDE, SIDE, 1, TXM_U8);
    memset(kinds, 0, sizeof kinds);
    kinds[0].weight = 1;
    kinds[1].weight = 0.5f;
    kinds[1].is_normal = 1;
    kinds[2].is_data = 1;
    kinds[3].is_label = 1;
    texpatch_desc desc = describe(e, 2, 4);
    desc.maps = kinds;
    desc.turns = 2;
    desc.patch = 24;
    desc.passes = 2;
    const txm_image to[4] = {golden_image(out, WIDTH, HEIGHT, 3, TXM_U8),
                             golden_image(normal_out, WIDTH, HEIGHT, 3, TXM_F32),
                             golden_image(height_out, WIDTH, HEIGHT, 1, TXM_U16),
                             golden_image(label_out, WIDTH, HEIGHT, 1, TXM_U8)};
    golden_need(texpatch_make(&desc, env, to), "make", env);
    uint64_t hash = tk_hash(0, out, WIDTH * HEIGHT * 3);
    hash = golden_hash(hash, normal_out, sizeof normal_out, 4);
    hash = golden_hash(hash, height_out, sizeof height_out, 2);
    hash = tk_hash(hash, label_out, sizeof label_out);
    return hash;
}

/* what a guide asks for, around a part that is kept */
static uint64_t guided(txm_env *env) {
    static uint8_t layers[SIDE * SIDE], guide[WIDTH * HEIGHT], counts[WIDTH * HEIGHT];
    static uint8_t kept[WIDTH * HEIGHT * 3], keep[WIDTH * HEIGHT];
    golden_blobs(exemplar[0], SIDE, SIDE, 3);
    for (int i = 0; i < SIDE * SIDE; i++) layers[i] = (uint8_t)(exemplar[0][3 * i] > 100 ? 255 : 0);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const int i = y * WIDTH + x;
            guide[i] = (uint8_t)(x * 2 > y * 3 ? 255 : 0);
            counts[i] = y > 8 ? 255 : 0;
            keep[i] = x > 60 && x < 80 && y > 30 && y < 60 ? 255 : 0;
            for (int c = 0; c < 3; c++) kept[3 * i + c] = (uint8_t)(x * 2 + y + 20 * c);
        }
    }
    const txm_image map = golden_image(exemplar[0], SIDE, SIDE, 3, TXM_U8);
    const txm_image kept_map = golden_image(kept, WIDTH, HEIGHT, 3, TXM_U8);
    texpatch_exemplar e = one_exemplar(&map);
    e.guide = golden_image(layers, SIDE, SIDE, 1, TXM_U8);
    texpatch_desc desc = describe(&e, 1, 1);
    desc.guide = golden_image(guide, WIDTH, HEIGHT, 1, TXM_U8);
    desc.guide_mask = golden_image(counts, WIDTH, HEIGHT, 1, TXM_U8);
    desc.kept = &kept_map;
    desc.keep = golden_image(keep, WIDTH, HEIGHT, 1, TXM_U8);
    return make(&desc, 3, env);
}

/* all steps, a part made anew, the sources of all pixels */
static uint64_t again(txm_env *env) {
    static uint8_t part[WIDTH * HEIGHT];
    golden_noise(exemplar[0], SIDE, SIDE, 3);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int x = i % WIDTH, y = i / WIDTH;
        part[i] = x > 20 && x < 60 && y > 30 && y < 66 ? 255 : 0;
    }
    const txm_image map = golden_image(exemplar[0], SIDE, SIDE, 3, TXM_U8);
    const txm_image anew = golden_image(part, WIDTH, HEIGHT, 1, TXM_U8);
    const txm_image image = golden_image(out, WIDTH, HEIGHT, 3, TXM_U8);
    const texpatch_exemplar e = one_exemplar(&map);
    texpatch_desc desc = describe(&e, 1, 1);
    texpatch_job *job = NULL;
    uint64_t hash = 0;
    desc.passes = 1;
    golden_need(texpatch_begin(&desc, env, &job), "begin", env);
    for (int round = 0; round < 2; round++) {
        int more = 1;
        while (more) golden_need(texpatch_step(job, env, &more), "step", env);
        golden_need(texpatch_draw(job, 0, 0, 0, env, image), "draw", env);
        hash = tk_hash(hash, out, WIDTH * HEIGHT * 3);
        if (round == 0) golden_need(texpatch_again(job, &anew, NULL, NULL, 5, env), "again", env);
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const texpatch_source s = texpatch_source_at(job, i % WIDTH, i / WIDTH);
        const float numbers[4] = {s.x, s.y, (float)s.exemplar, (float)s.turn};
        hash = golden_hash(hash, numbers, sizeof numbers, 4);
    }
    texpatch_free(job);
    return hash;
}

/* windows of the endless plane, far from its origin too */
static uint64_t plane(txm_env *env) {
    static texpatch_source sources[20 * 30];
    golden_noise(exemplar[0], SIDE, SIDE, 1);
    const txm_image map = golden_image(exemplar[0], SIDE, SIDE, 1, TXM_U8);
    const txm_image window = golden_image(out, 20, 30, 1, TXM_U8);
    const texpatch_exemplar e = one_exemplar(&map);
    texpatch_desc desc = describe(&e, 1, 1);
    texpatch_plane *p = NULL;
    uint64_t hash = 0;
    desc.turns = 4;
    desc.mirror = 1;
    golden_need(texpatch_plane_make(&desc, env, &p), "plane", env);
    for (int k = 0; k < 2; k++) {
        golden_need(texpatch_plane_draw(p, k ? (int64_t)1 << 33 : -70, 5, env, &window, sources),
                    "window", env);
        hash = tk_hash(hash, out, 20 * 30);
        for (int i = 0; i < 20 * 30; i++) {
            const float numbers[3] = {sources[i].x, sources[i].y, (float)sources[i].turn};
            hash = golden_hash(hash, numbers, sizeof numbers, 4);
        }
    }
    texpatch_plane_free(p);
    return hash;
}

/* a wall seen from the side */
static uint64_t straight(txm_env *env) {
    enum { WALL = 160 };
    static uint8_t photo[WALL * WALL], drawn[2 * WALL * WALL];
    texpatch_straight_desc desc;
    texpatch_straight *found;
    int w, h;
    for (int y = 0; y < WALL; y++) {
        for (int x = 0; x < WALL; x++) {
            /* rational numbers: the same bits everywhere */
            const double depth = 1 + x / (4.0 * WALL);
            const int u = (int)(2 * x / depth), v = (int)((2 * y - WALL + 0.2 * x) / depth) + 480;
            const int shifted = u + v / 20 % 2 * 20;
            const int shade = (int)(txm_hash((uint64_t)(v / 20 * 97 + shifted / 40)) % 48);
            photo[y * WALL + x] = (uint8_t)(v % 20 < 4 || shifted % 40 < 4 ? 210 : 80 + shade);
        }
    }
    memset(&desc, 0, sizeof desc);
    desc.photo = golden_image(photo, WALL, WALL, 1, TXM_U8);
    golden_need(texpatch_straight_find(&desc, env, &found), "find", env);
    if (!texpatch_straight_found(found, &w, &h)) golden_need(TXM_BAD_DATA, "find", env);
    const txm_image out = golden_image(drawn, w, h, 1, TXM_U8);
    golden_need(texpatch_straight_draw(found, &desc.photo, NULL, env, &out), "draw", env);
    texpatch_straight_free(found);
    return tk_hash(0, drawn, (size_t)w * (size_t)h);
}

/* coarser levels of a picture, of a normal map and of labels */
static uint64_t half(txm_env *env) {
    enum { ODD = 63, HALF = 31 };
    static uint16_t deep[ODD * ODD * 3], deep_half[HALF * HALF * 3];
    uint64_t hash = 0;
    golden_noise(exemplar[0], ODD, ODD, 3);
    for (int i = 0; i < ODD * ODD * 3; i++) deep[i] = (uint16_t)(exemplar[0][i] * 257);
    const txm_image from = golden_image(exemplar[0], ODD, ODD, 3, TXM_U8);
    const txm_image to = golden_image(out, HALF, HALF, 3, TXM_U8);
    const txm_image from_deep = golden_image(deep, ODD, ODD, 3, TXM_U16);
    const txm_image to_deep = golden_image(deep_half, HALF, HALF, 3, TXM_U16);
    for (int kind = 0; kind < 4; kind++) {
        texpatch_map map;
        memset(&map, 0, sizeof map);
        map.is_normal = kind == 1;
        map.is_label = kind == 2;
        map.is_data = kind == 3;
        golden_need(texpatch_half(&from, kind ? &map : NULL, 0, env, &to), "half", env);
        golden_need(texpatch_half(&from_deep, kind ? &map : NULL, 0, env, &to_deep), "half", env);
        hash = tk_hash(hash, out, HALF * HALF * 3);
        hash = golden_hash(hash, deep_half, sizeof deep_half, 2);
    }
    return hash;
}

static const golden_case cases[] = {
    {"tileable", tileable}, {"tall", tall}, {"turned", turned}, {"lattice", lattice}, {"lattice-given", lattice_given},
    {"maps", maps},         {"guided", guided}, {"again", again},     {"plane", plane},
    {"half", half},
    {"straight", straight}};
GOLDEN_MAIN("texpatch")
