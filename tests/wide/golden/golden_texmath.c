/* golden_texmath.c - hashes of the kernels of texmath.h; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#include "golden.h"

static uint64_t random_numbers(txm_env *env) {
    uint64_t hash = 0;
    int items[100];
    (void)env;
    for (uint64_t seed = 0; seed < 5; seed++) {
        txm_rng rng = txm_rng_make(seed * 1234567, seed);
        for (int i = 0; i < 100; i++) {
            const uint32_t next = txm_rng_next(&rng), below = txm_rng_below(&rng, 17);
            const int range = txm_rng_range(&rng, -5, 1000000);
            const float f = txm_rng_float(&rng);
            const double d = txm_rng_double(&rng);
            items[i] = i;
            hash = golden_hash(hash, &next, sizeof next, 4);
            hash = golden_hash(hash, &below, sizeof below, 4);
            hash = golden_hash(hash, &range, sizeof range, 4);
            hash = golden_hash(hash, &f, sizeof f, 4);
            hash = golden_hash(hash, &d, sizeof d, 8);
        }
        txm_shuffle(&rng, items, 100);
        hash = golden_hash(hash, items, sizeof items, 4);
    }
    return hash;
}

static uint64_t sort(txm_env *env) {
    enum { COUNT = 5000 };
    static txm_pair pairs[COUNT], scratch[COUNT];
    txm_rng rng = txm_rng_make(2, 3);
    (void)env;
    for (uint32_t i = 0; i < COUNT; i++) {
        pairs[i].key = txm_sort_key((txm_rng_float(&rng) - 0.5f) * (float)(i % 7));
        pairs[i].value = i;
    }
    txm_sort_pairs(pairs, scratch, COUNT);
    return golden_hash(0, pairs, sizeof pairs, 4);
}

static uint64_t eigen(txm_env *env) {
    txm_rng rng = txm_rng_make(5, 1);
    uint64_t hash = 0;
    for (int i = 0; i < 200; i++) {
        double a[6], values[3], vectors[3][3];
        for (int k = 0; k < 6; k++) a[k] = txm_rng_double(&rng) * 4 - (k >= 3 ? 2 : 0);
        if (i % 10 == 0) a[3] = a[4] = a[5] = 0;
        golden_need(txm_eigen3(a, values, vectors), "eigen3", env);
        hash = golden_hash(hash, values, sizeof values, 8);
        hash = golden_hash(hash, vectors, sizeof vectors, 8);
    }
    return hash;
}

static uint64_t cut(txm_env *env) {
    enum { LENGTH = 60, WIDE = 24 };
    static float error[LENGTH * WIDE];
    static double scratch[LENGTH * LENGTH];
    int path[LENGTH];
    txm_rng rng = txm_rng_make(8, 8);
    uint64_t hash = 0;
    (void)env;
    for (int i = 0; i < LENGTH * WIDE; i++)
        error[i] = i % 29 == 3 ? INFINITY : (float)txm_rng_below(&rng, 50);
    const double down = txm_cut(error, LENGTH, WIDE, WIDE, 1, path, scratch);
    hash = golden_hash(hash, &down, sizeof down, 8);
    hash = golden_hash(hash, path, sizeof path, 4);
    const double right = txm_cut(error, WIDE, LENGTH, 1, WIDE, path, scratch);
    hash = golden_hash(hash, &right, sizeof right, 8);
    return golden_hash(hash, path, WIDE * sizeof *path, 4);
}

/* a minimum cut on a grid with 4 and with 6 directions */
static uint64_t flow(txm_env *env) {
    enum { WIDE = 40, HIGH = 30, ROW = WIDE + 2, COUNT = ROW * (HIGH + 2) };
    uint64_t hash = 0;
    for (int directions = 4; directions <= 6; directions += 2) {
        const int step[6] = {1, ROW, directions == 6 ? ROW - 1 : -1, -1, -ROW, 1 - ROW};
        txm_rng rng = txm_rng_make(1, (uint64_t)directions);
        txm_arena arena;
        txm_flow g;
        memset(&g, 0, sizeof g);
        txm_arena_init(&arena, env);
        if (!txm_flow_make(&g, &arena, directions, COUNT))
            golden_need(TXM_OUT_OF_MEMORY, "flow", env);
        g.count = COUNT;
        for (int d = 0; d < directions; d++) {
            g.step[d] = directions == 6 ? step[d] : step[d < 2 ? d : d + 1];
            memset(g.arc[d], 0, COUNT * sizeof(int32_t));
        }
        memset(g.excess, 0, COUNT * sizeof(int32_t));
        for (int y = 1; y <= HIGH; y++) {
            for (int x = 1; x <= WIDE; x++) {
                const int p = y * ROW + x;
                g.excess[p] = x == 1 ? 500 : x == WIDE ? -500 : 0;
                for (int d = 0; d < directions / 2; d++) {
                    const int q = p + g.step[d], qx = q % ROW, qy = q / ROW;
                    if (qx < 1 || qx > WIDE || qy < 1 || qy > HIGH) continue;
                    g.arc[d][p] = (int32_t)txm_rng_below(&rng, 100);
                    g.arc[d + directions / 2][q] = (int32_t)txm_rng_below(&rng, 100);
                }
            }
        }
        txm_flow_solve(&g);
        for (int p = 0; p < COUNT; p++) {
            const int sink = g.tree[p] == TXM_FLOW_SINK;
            hash = golden_hash(hash, &sink, sizeof sink, 4);
        }
        txm_arena_free(&arena);
    }
    return hash;
}

static uint64_t halve(txm_env *env) {
    static float from[63 * 50 * 4], to[31 * 25 * 4];
    uint64_t hash = 0;
    txm_rng rng = txm_rng_make(4, 4);
    for (int i = 0; i < 63 * 50 * 4; i++) from[i] = txm_rng_float(&rng) * 3 - 1;
    for (int kind = 0; kind < 3; kind++) { /* RGB and RGBA of light, normals */
        const int channels = kind == 1 ? 4 : 3;
        const txm_image image = golden_image(from, 63, 50, channels, TXM_F32);
        const txm_image half = golden_image(to, 31, 25, channels, TXM_F32);
        golden_need(txm_image_halve(&image, kind == 2 ? TXM_NORMALS : TXM_COLOR, 0, &half, env),
                    "halve", env);
        hash = golden_hash(hash, to, (size_t)(31 * 25 * channels) * sizeof(float), 4);
    }
    return hash;
}

/* levels and hidden colour of a cutout of 16 bits that tiles */
static uint64_t cutout(txm_env *env) {
    static uint16_t from[61 * 40 * 4], to[30 * 20 * 4];
    const txm_image image = golden_image(from, 61, 40, 4, TXM_U16);
    const txm_image half = golden_image(to, 30, 20, 4, TXM_U16);
    txm_rng rng = txm_rng_make(4, 5);
    for (int i = 0; i < 61 * 40 * 4; i++) {
        from[i] = (uint16_t)(txm_rng_next(&rng) & 0xffff);
        if (i % 4 == 3 && i / 44 % 3) from[i] = i % 7 ? 0 : 9000;
    }
    golden_need(txm_image_halve(&image, TXM_COLOR, 3, &half, env), "halve", env);
    golden_need(txm_image_set_coverage(&half, txm_image_coverage(&image, 0.5f), 0.5f, env),
                "coverage", env);
    golden_need(txm_image_bleed(&image, TXM_WRAP_X, env), "bleed", env);
    return golden_hash(golden_hash(0, to, sizeof to, 2), from, sizeof from, 2);
}

static uint64_t poisson_hash(float screen, int with_target, txm_env *env) {
    enum { WIDE = 40, HIGH = 36 };
    static float image[WIDE * HIGH * 3], target[WIDE * HIGH * 3];
    static uint8_t mask[WIDE * HIGH];
    txm_poisson_desc desc;
    txm_rng rng = txm_rng_make(6, 2);
    for (int i = 0; i < WIDE * HIGH; i++) {
        const int x = i % WIDE, y = i / WIDE;
        const int inside = x > 4 && x < 30 && y > 3 && y < 30 && (x - 15) * (y - 12) < 60;
        mask[i] = inside || x == 39 ? 255 : 0;
        for (int c = 0; c < 3; c++) {
            image[3 * i + c] = txm_rng_float(&rng);
            target[3 * i + c] = 0.1f * (txm_rng_float(&rng) - 0.5f);
        }
    }
    memset(&desc, 0, sizeof desc);
    desc.image = golden_image(image, WIDE, HIGH, 3, TXM_F32);
    desc.mask = golden_image(mask, WIDE, HIGH, 1, TXM_U8);
    if (with_target) desc.target = golden_image(target, WIDE, HIGH, 3, TXM_F32);
    desc.screen = screen;
    golden_need(txm_poisson(&desc, env), "poisson", env);
    return golden_hash(0, image, sizeof image, 4);
}

static uint64_t membrane(txm_env *env) {
    return poisson_hash(0, 0, env);
}

static uint64_t poisson(txm_env *env) {
    return poisson_hash(0.05f, 1, env);
}

/* what reads and writes samples of all types */
static uint64_t samples(txm_env *env) {
    uint8_t bytes[4 * 16];
    uint16_t words[4 * 16];
    txm_rng rng = txm_rng_make(9, 9);
    uint64_t hash = 0;
    (void)env;
    const txm_image image = golden_image(bytes, 4, 4, 4, TXM_U8);
    const txm_image deep = golden_image(words, 4, 4, 4, TXM_U16);
    for (int round = 0; round < 20; round++) {
        for (int i = 0; i < 64; i++) {
            const float value = txm_rng_float(&rng) * 1.2f - 0.1f;
            txm_image_set(&image, i % 4, i / 4 % 4, i / 16, value);
            txm_image_set(&deep, i % 4, i / 4 % 4, i / 16, value);
            const float got = txm_image_get(&deep, i % 4, i / 4 % 4, i / 16);
            hash = golden_hash(hash, &got, sizeof got, 4);
        }
        hash = tk_hash(hash, bytes, sizeof bytes);
        hash = golden_hash(hash, words, sizeof words, 2);
    }
    return hash;
}

/* uneven light of a masked picture of each type of samples: how much, and taken out */
static uint64_t light(txm_env *env) {
    enum { WIDE = 90, HIGH = 70 };
    static float pixels[WIDE * HIGH * 3];
    static uint8_t mask[WIDE * HIGH];
    static const txm_sample samples[] = {TXM_U8, TXM_U16, TXM_F32};
    uint64_t hash = 0;
    for (int k = 0; k < 3; k++) {
        txm_rng rng = txm_rng_make(13, 1);
        txm_even_desc desc;
        float stops = 0;
        memset(&desc, 0, sizeof desc);
        desc.image = golden_image(pixels, WIDE, HIGH, 3, samples[k]);
        desc.mask = golden_image(mask, WIDE, HIGH, 1, TXM_U8);
        for (int i = 0; i < WIDE * HIGH; i++) {
            const int x = i % WIDE, y = i / WIDE;
            mask[i] = (uint8_t)(x * y % 31 ? 255 : 0);
            for (int c = 0; c < 3; c++)
                txm_image_set(&desc.image, x, y, c,
                              (0.1f + 0.6f * txm_rng_float(&rng)) * (float)(x + 40) / 130.0f);
        }
        golden_need(txm_uneven(&desc, env, &stops), "uneven", env);
        hash = golden_hash(hash, &stops, sizeof stops, 4);
        desc.radius = 20;
        golden_need(txm_even(&desc, env, &desc.image), "even", env);
        const size_t unit = txm_sample_bytes(samples[k]);
        hash = golden_hash(hash, pixels, WIDE * HIGH * 3 * unit, unit);
    }
    return hash;
}

static txm_vec3 rounded(txm_dvec3 v) {
    return txm_v3(txm_float(v.x), txm_float(v.y), txm_float(v.z));
}

/* turns without sine and cosine, which libm would have a part in */
static uint64_t turns(txm_env *env) {
    txm_rng rng = txm_rng_make(11, 1);
    uint64_t hash = 0;
    (void)env;
    for (int i = 0; i < 100; i++) {
        float n[7];
        for (int k = 0; k < 7; k++) n[k] = txm_rng_float(&rng) * 2 - 1;
        const txm_quat a = txm_quat_unit((txm_quat){n[0], n[1], n[2], n[3]});
        const txm_quat q = {txm_float(a.x), txm_float(a.y), txm_float(a.z), txm_float(a.w)};
        const txm_vec3 v = rounded(txm_quat_rotate(q, txm_d3(n[4], n[5], n[6])));
        const txm_vec3 across = txm_vec3_normalize(txm_vec3_cross(v, txm_v3(n[4], n[5], n[6])));
        hash = golden_hash(hash, &v, sizeof v, 4);
        hash = golden_hash(hash, &across, sizeof across, 4);
    }
    return hash;
}

/* quaternions and vectors in double */
static uint64_t frames(txm_env *env) {
    txm_rng rng = txm_rng_make(12, 1);
    uint64_t hash = 0;
    (void)env;
    for (int i = 0; i < 100; i++) {
        double n[10];
        for (int k = 0; k < 10; k++) n[k] = txm_rng_double(&rng) * 2 - 1;
        const txm_dvec3 x = txm_d3_unit(txm_d3(n[0], n[1], n[2]));
        const txm_dvec3 z = txm_d3_unit(txm_d3_cross(x, txm_d3(n[3], n[4], n[5])));
        const txm_quat q = txm_quat_from_axes(x, txm_d3_cross(z, x), z);
        const txm_quat r = txm_quat_mul(txm_quat_unit((txm_quat){n[6], n[7], n[8], n[9]}),
                                        txm_quat_conjugate(txm_quat_unit(q)));
        hash = golden_hash(hash, &q, sizeof q, 8);
        hash = golden_hash(hash, &r, sizeof r, 8);
    }
    return hash;
}

static const golden_case cases[] = {{"random", random_numbers},
                                    {"sort", sort},
                                    {"eigen", eigen},
                                    {"cut", cut},
                                    {"flow", flow},
                                    {"halve", halve},
                                    {"cutout", cutout},
                                    {"membrane", membrane},
                                    {"poisson", poisson},
                                    {"samples", samples},
                                    {"turns", turns},
                                    {"frames", frames},
                                    {"light", light}};
GOLDEN_MAIN("texmath")
