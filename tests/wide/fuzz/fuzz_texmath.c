/* fuzz_texmath.c - random pictures, masks and descriptions into the image kernels of texmath.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   Views that are none must be refused; after an error results are untouched; hidden colour must not
   matter, and what is known stays as it is. Sides of meshes of all kinds must be sorted and linked.  */
#include "texmath.h"

#define FUZZ_BYTES 160
#include "soupkit.h"

enum { MOST_SIDE = 40 };

/* Views with fields of any value: a check must say what is wrong without a look at the pixels. */
static void view(source *s) {
    static float pixels[4];
    static const int odd[6] = {0, -1, 1, 0x7fffffff, -0x7fffffff - 1, 46341};
    txm_image im;
    txm_env env;
    memset(&env, 0, sizeof env);
    im.pixels = pick(s, 8) ? (char *)pixels + pick(s, 3) : NULL;
    im.width = pick(s, 2) ? 1 + pick(s, 9) : odd[pick(s, 6)];
    im.height = pick(s, 2) ? 1 + pick(s, 9) : odd[pick(s, 6)];
    im.channels = pick(s, 7) - 1;
    im.sample = (txm_sample)pick(s, 4);
    im.stride = pick(s, 2) ? 0 : pick(s, 8) ? pick(s, 200) - 100 : pick(s, 2) ? PTRDIFF_MIN : PTRDIFF_MAX;
    const txm_status status = txm_image_check(&im, "picture", (size_t)pick(s, 3) * 1000, &env);
    if (status != TXM_OK && !env.message[0]) abort();
    if (status == TXM_OK && (im.width < 1 || im.height < 1 || !im.pixels)) abort();
    fuzz_succeeded += status == TXM_OK;
}

/* A coarser level, and its coverage. */
static void halve(pool *p, source *s) {
    const int width = 1 + pick(s, MOST_SIDE), height = 1 + pick(s, MOST_SIDE), channels = 1 + pick(s, 4);
    const txm_content content = (txm_content)pick(s, 4);
    const txm_sample sample = any_sample(s);
    trouble t;
    txm_env env = troubled(&t, s);
    const txm_image from = any_image(p, s, width, height, channels, sample);
    const txm_image half = fresh_image(p, s, txm_level_side(width, 1) + (pick(s, 20) == 0),
                                       txm_level_side(height, 1), channels, sample);
    const int success = succeeded(txm_image_halve(&from, content, pick(s, 4), &half, &env), &t, &env);
    look_at_results(success, &half, 1);
    fuzz_succeeded += success;
    if (success) {
        const float threshold = (float)pick(s, 12) / 10;
        const double coverage = txm_image_coverage(&from, threshold);
        if (!(coverage >= 0 && coverage <= 1)) abort();
        succeeded(txm_image_set_coverage(&half, coverage, threshold, &env), &t, &env);
        if (!is_padding_fresh(&half)) abort();
    }
    if (t.memory.blocks) abort();
}

static void even(pool *p, source *s) {
    const int width = 1 + pick(s, 3 * MOST_SIDE), height = 1 + pick(s, 3 * MOST_SIDE), channels = 1 + pick(s, 4);
    const txm_sample sample = any_sample(s);
    txm_even_desc d;
    trouble t;
    float stops = -1;
    memset(&d, 0, sizeof d);
    txm_env env = troubled(&t, s);
    d.image = any_image(p, s, width, height, channels, sample);
    if (pick(s, 2)) d.mask = any_mask(p, s, width + (pick(s, 30) == 0), height, 1, any_sample(s));
    d.radius = pick(s, 2) ? 0 : pick(s, 10) ? 8 + (float)pick(s, 60) : (float)pick(s, 3) * 1e6f - 1;
    const int is_finite = txm_image_is_finite(&d.image);
    const txm_image out = fresh_image(p, s, width, height, channels, sample);
    const int success = succeeded(txm_even(&d, &env, &out), &t, &env);
    look_at_results(success, &out, 1);
    if (success && !is_finite) abort();
    fuzz_succeeded += success;
    env = troubled(&t, s);
    const int measured = succeeded(txm_uneven(&d, &env, &stops), &t, &env);
    if (measured ? !(stops >= 0) : stops != 0) abort();
    if (t.memory.blocks) abort();
}

/* What shows stays; two pictures that differ in hidden colour alone become one. */
static void bleed(pool *p, source *s) {
    const int width = 1 + pick(s, MOST_SIDE), height = 1 + pick(s, MOST_SIDE), channels = 1 + pick(s, 4);
    const int wrap = pick(s, 4);
    const txm_sample sample = any_sample(s);
    trouble t;
    txm_env env = troubled(&t, s);
    const txm_image a = any_image(p, s, width, height, channels, sample);
    const txm_image b = fresh_image(p, s, width, height, channels, sample);
    const int is_finite = txm_image_is_finite(&a), alpha = channels % 2 ? -1 : channels - 1;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            for (int c = 0; c < channels; c++) {
                const int hidden = alpha >= 0 && c < alpha && !(txm_image_get(&a, x, y, alpha) > 0);
                txm_image_set(&b, x, y, c, hidden ? 1 - txm_image_get(&a, x, y, c) : txm_image_get(&a, x, y, c));
            }
    if (succeeded(txm_image_bleed(&a, wrap, &env), &t, &env)) {
        fuzz_succeeded++;
        if (!is_padding_fresh(&a)) abort();
        for (int i = 0; is_finite && i < width * height * channels; i++) { /* what shows is as it was */
            const int x = i / channels % width, y = i / channels / width, c = i % channels;
            if (alpha >= 0 && c < alpha && !(txm_image_get(&b, x, y, alpha) > 0)) continue;
            if (!(txm_image_get(&a, x, y, c) == txm_image_get(&b, x, y, c))) abort();
        }
        if (succeeded(txm_image_bleed(&b, wrap, &env), &t, &env) && is_finite)
            for (int y = 0; y < height; y++)
                for (int i = 0; i < width * channels; i++) {
                    const float v = txm_image_get(&a, i / channels, y, i % channels);
                    if (!(v == txm_image_get(&b, i / channels, y, i % channels))) abort();
                }
    }
    if (t.memory.blocks) abort();
}

static void poisson(pool *p, source *s) {
    const int width = 1 + pick(s, MOST_SIDE), height = 1 + pick(s, MOST_SIDE), channels = 1 + pick(s, 4);
    txm_poisson_desc d;
    trouble t;
    memset(&d, 0, sizeof d);
    txm_env env = troubled(&t, s);
    d.image = any_image(p, s, width, height, channels, TXM_F32);
    d.mask = any_mask(p, s, width + (pick(s, 30) == 0), height, pick(s, 30) ? 1 : 2, pick(s, 30) ? TXM_U8 : TXM_U16);
    if (pick(s, 2)) d.target = any_image(p, s, width, height, channels, TXM_F32);
    d.screen = pick(s, 2) ? 0 : (float)pick(s, 100) / 10;
    d.tolerance = pick(s, 20) ? 1e-3f : (float)pick(s, 3) - 1;
    d.max_iterations = pick(s, 20) ? 50 : pick(s, 3) - 1;
    txm_image before = fresh_image(p, s, width, height, channels, TXM_F32);
    for (int y = 0; y < height; y++)
        memcpy(txm_image_row(&before, y), txm_image_row(&d.image, y), (size_t)(width * channels) * sizeof(float));
    const int success = succeeded(txm_poisson(&d, &env), &t, &env);
    uint8_t *counts = (uint8_t *)malloc((size_t)width * (size_t)height);
    if (!counts) exit(1);
    if (success) txm_mask_read(&d.mask, TXM_MASK_REPLACES, counts);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const size_t pixel = (size_t)channels * sizeof(float);
            if (success && counts[y * width + x]) continue;
            if (memcmp((const char *)txm_image_row(&before, y) + pixel * (size_t)x,
                       (const char *)txm_image_row(&d.image, y) + pixel * (size_t)x, pixel) != 0)
                abort();
        }
    free(counts);
    if (success && !txm_image_is_finite(&d.image)) abort();
    fuzz_succeeded += success;
    if (t.memory.blocks) abort();
}

static void cut(pool *p, source *s) {
    const int length = 1 + pick(s, MOST_SIDE), width = 1 + pick(s, MOST_SIDE), across = pick(s, 2);
    float *error = (float *)(void *)take(p, (size_t)(length * width) * sizeof *error);
    double *scratch = (double *)(void *)take(p, (size_t)(length * width) * sizeof *scratch);
    int *path = (int *)(void *)take(p, (size_t)length * sizeof *path);
    for (int i = 0; i < length * width; i++) error[i] = pick(s, 9) ? (float)pick(s, 50) : INFINITY;
    const double sum = across ? txm_cut(error, length, width, 1, length, path, scratch)
                              : txm_cut(error, length, width, width, 1, path, scratch);
    if (!(sum >= 0)) abort();
    for (int i = 0; i < length; i++)
        if (path[i] < 0 || path[i] >= width || (i && abs(path[i] - path[i - 1]) > 1)) abort();
    fuzz_succeeded++;
}

/* Meshes that pass the check: their sides in order, and each in one ring with those of its edge. */
static void sides(pool *p, source *s) {
    static soup m;
    make_soup(&m, s);
    txm_mesh mesh = view_of(&m, p);
    txm_env env;
    memset(&env, 0, sizeof env);
    if (pick(s, 4) == 0 && m.faces % 4 == 0) {
        mesh.corners = 4;
        mesh.face_count = m.faces / 4 * 3;
    }
    const size_t most = pick(s, 20) ? 0 : (size_t)pick(s, 300);
    const txm_status status = txm_mesh_check(&mesh, "mesh", pick(s, 3) ? 0 : 3 + pick(s, 2), pick(s, 2), most, &env);
    must(status == TXM_OK || env.message[0]);
    const size_t count = txm_mesh_sides(&mesh);
    if (status != TXM_OK || count == 0) return;
    uint32_t *sorted = (uint32_t *)(void *)take(p, 2 * count * sizeof *sorted);
    uint32_t *next = (uint32_t *)(void *)take(p, count * sizeof *next);
    uint8_t *seen = take(p, count);
    memset(seen, 0, count);
    txm_mesh_sort_sides(&mesh, sorted);
    for (size_t i = 0; i < count; i++) {
        must(sorted[i] < count && !seen[sorted[i]]++);
        must(i == 0 || txm_mesh_before(&mesh, sorted[i - 1], sorted[i]));
    }
    txm_mesh_link(&mesh, sorted, pick(s, 4), next);
    memset(seen, 0, count);
    for (size_t i = 0; i < count; i++) {
        must(next[i] < count && !seen[next[i]]++);
        must(txm_mesh_low(&mesh, i) == txm_mesh_low(&mesh, next[i]) && txm_mesh_high(&mesh, i) == txm_mesh_high(&mesh, next[i]));
    }
    fuzz_succeeded++;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static pool p;
    source s = source_of(data, size);
    switch (pick(&s, 7)) {
    case 0: view(&s); break;
    case 1: halve(&p, &s); break;
    case 2: bleed(&p, &s); break;
    case 3: poisson(&p, &s); break;
    case 4: even(&p, &s); break;
    case 5: sides(&p, &s); break;
    default: cut(&p, &s); break;
    }
    drain(&p);
    return 0;
}
