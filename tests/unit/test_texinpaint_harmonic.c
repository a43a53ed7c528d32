/* test_texinpaint_harmonic.c - smooth fills, gutters, and the equations behind them
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_harmonic && build/tests/unit/test_texinpaint_harmonic */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "texinpaint/harmonic.h"

#include "testkit.h"

/* ---- equations ----------------------------------------------------------------------------- */

enum { NODES = 420, LINKS = 4 * NODES };

/* A random graph in rows. */
typedef struct network {
    uint32_t first[NODES + 1], to[2 * LINKS];
    float weight[2 * LINKS];
    double a[NODES][NODES]; /* the same as a matrix, without ground */
} network;

static void network_make(network *g, txm_rng *rng, int components) {
    memset(g, 0, sizeof *g);
    for (uint32_t k = 0; k < LINKS; k++) { /* first a path through each component, then any */
        const uint32_t i = k < NODES ? k : txm_rng_below(rng, NODES);
        const uint32_t j = k < NODES ? (k + (uint32_t)components) % NODES : txm_rng_below(rng, NODES);
        if (i == j || i % (uint32_t)components != j % (uint32_t)components) continue;
        const float w = txm_rng_float(rng) < 0.1f ? 8.0f : 0.25f + txm_rng_float(rng);
        g->a[i][j] -= (double)w;
        g->a[j][i] -= (double)w;
    }
    uint32_t n = 0;
    for (uint32_t i = 0; i < NODES; i++) {
        g->first[i] = n;
        for (uint32_t j = 0; j < NODES; j++) {
            if (!(g->a[i][j] < 0)) continue;
            g->to[n] = j;
            g->weight[n] = (float)-g->a[i][j];
            g->a[i][j] = -(double)g->weight[n];
            g->a[i][i] += (double)g->weight[n++];
        }
    }
    g->first[NODES] = n;
}

/* Gauss, with pivots. */
static void solve_dense(double a[NODES][NODES], double *b) {
    for (int i = 0; i < NODES; i++) {
        int best = i;
        for (int k = i; k < NODES; k++)
            if (fabs(a[k][i]) > fabs(a[best][i])) best = k;
        for (int j = 0; j < NODES; j++) {
            const double t = a[i][j];
            a[i][j] = a[best][j];
            a[best][j] = t;
        }
        const double t = b[i];
        b[i] = b[best];
        b[best] = t;
        for (int k = i + 1; k < NODES; k++) {
            const double f = a[k][i] / a[i][i];
            for (int j = i; j < NODES && f != 0; j++) a[k][j] -= f * a[i][j];
            b[k] -= f * b[i];
        }
    }
    for (int i = NODES; i-- > 0;) {
        for (int k = i + 1; k < NODES; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
}

static network net;
static double matrix[NODES][NODES];

static void test_grid_against_direct_solve(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(1, 1);
    for (int round = 0; round < 3; round++) {
        double ground[NODES], b[NODES], right[NODES], x[NODES];
        txm_arena arena;
        txi_grid grid;
        network_make(&net, &rng, round + 1);
        for (int i = 0; i < NODES; i++) {
            ground[i] = i < 40 ? 0.01 + txm_rng_double(&rng) : 0;
            b[i] = right[i] = txm_rng_double(&rng) - 0.5;
            x[i] = 3;
        }
        memcpy(matrix, net.a, sizeof matrix);
        for (int i = 0; i < NODES; i++) {
            matrix[i][i] += ground[i];
            if (!(matrix[i][i] > 0)) matrix[i][i] = ground[i] = 1; /* by itself */
        }
        solve_dense(matrix, right);
        txm_arena_init(&arena, NULL);
        assert_int_equal(txi_grid_make(NODES, net.first, net.to, net.weight, ground, &arena, NULL, &grid),
                         TXM_OK);
        assert_true(grid.levels >= 2);
        assert_int_equal(txi_grid_solve(&grid, b, x, 1e-10, "test", NULL), TXM_OK);
        for (int i = 0; i < NODES; i++) assert_true(fabs(x[i] - right[i]) < 1e-6 * (1 + fabs(right[i])));
        txm_arena_free(&arena);
    }
}

/* The gradient along links, the values at the rim and the pull towards a guess, as one dense system. */
static void test_poisson_against_direct_solve(void **state) {
    (void)state;
    enum { RIM = 50 };
    static float link[2 * LINKS], rim[RIM], value[RIM], rim_weight[RIM];
    static uint32_t rim_first[NODES + 1], rim_texel[RIM], texel[NODES];
    txm_rng rng = txm_rng_make(2, 1);
    for (int round = 0; round < 4; round++) {
        const double screen = round % 2 ? 0.3 : 0;
        double u[NODES], right[NODES];
        double scratch[NODES];
        txi_steps steps = {link, rim, value};
        txi_poisson_system system;
        txm_arena arena;
        txm_arena_init(&arena, NULL);
        network_make(&net, &rng, 1);
        const txi_texel_graph g = {NODES, texel, net.first, net.to, net.weight, rim_first, rim_texel,
                                   rim_weight};
        memcpy(matrix, net.a, sizeof matrix);
        for (int i = 0; i < NODES; i++) {
            rim_first[i] = (uint32_t)(i < RIM ? i : RIM);
            u[i] = txm_rng_double(&rng);
            right[i] = screen * u[i];
            matrix[i][i] += screen;
        }
        rim_first[NODES] = RIM;
        for (int i = 0; i < RIM; i++) {
            rim_weight[i] = 0.5f + txm_rng_float(&rng);
            value[i] = txm_rng_float(&rng);
            rim[i] = round > 1 ? txm_rng_float(&rng) - 0.5f : 0;
            matrix[i][i] += (double)rim_weight[i];
            right[i] += (double)rim_weight[i] * ((double)value[i] - rim[i]);
        }
        if (round < 2) steps.rim = NULL;
        for (uint32_t i = 0; i < NODES; i++) {
            for (uint32_t k = net.first[i]; k < net.first[i + 1]; k++) {
                const uint32_t j = net.to[k];
                uint32_t back = net.first[j];
                while (net.to[back] != i) back++;
                link[k] = i < j ? txm_rng_float(&rng) - 0.5f : -link[back];
                right[i] -= (double)net.weight[k] * link[k];
            }
            if (!(matrix[i][i] > 0)) { /* by itself: keeps its value */
                matrix[i][i] = 1;
                right[i] = u[i];
            }
        }
        solve_dense(matrix, right);
        assert_int_equal(txi_poisson_make(&g, screen, &arena, NULL, &system), TXM_OK);
        assert_int_equal(txi_surface_poisson(&system, &steps, u, scratch, 1e-10, NULL), TXM_OK);
        for (int i = 0; i < NODES; i++) assert_true(fabs(u[i] - right[i]) < 1e-5);
        txm_arena_free(&arena);
    }
}

/* An island without rim keeps its level at one node, and its steps. */
static void test_poisson_without_rim(void **state) {
    (void)state;
    const uint32_t first[6] = {0, 1, 3, 5, 7, 8}, to[8] = {1, 0, 2, 1, 3, 2, 4, 3};
    const float weight[8] = {1, 1, 2, 2, 1, 1, 1, 1}, step[8] = {1, -1, 2, -2, 3, -3, -1, 1};
    const uint32_t none[6] = {0};
    uint32_t texel[5] = {0};
    double u[5] = {10, 0, 0, 0, 0};
    const double wanted[5] = {10, 11, 13, 16, 15};
    const txi_texel_graph g = {5, texel, (uint32_t *)first, (uint32_t *)to, (float *)weight,
                               (uint32_t *)none, NULL, NULL};
    const txi_steps steps = {step, NULL, NULL};
    txi_poisson_system system;
    double scratch[5];
    txm_arena arena;
    txm_arena_init(&arena, NULL);
    assert_int_equal(txi_poisson_make(&g, 0, &arena, NULL, &system), TXM_OK);
    assert_int_equal(txi_surface_poisson(&system, &steps, u, scratch, 1e-10, NULL), TXM_OK);
    for (int i = 0; i < 5; i++) assert_true(fabs(u[i] - wanted[i]) < 1e-7);
    txm_arena_free(&arena);
}

static void test_stencil(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(3, 1);
    for (int round = 0; round < 2000; round++) {
        const double p = txm_rng_double(&rng) * 3.14159265, l = 1 + 20 * txm_rng_double(&rng);
        const double c = cos(p), s = sin(p);
        const double xx = l * c * c + s * s, xy = (l - 1) * c * s, yy = l * s * s + c * c;
        const txi_stencil t = txi_stencil_of(xx, xy, yy);
        double sum[3] = {0, 0, 0};
        for (int k = 0; k < 3; k++) {
            assert_true(t.weight[k] >= 0 && abs(t.x[k]) < 9 && abs(t.y[k]) < 9);
            sum[0] += t.weight[k] * t.x[k] * t.x[k];
            sum[1] += t.weight[k] * t.x[k] * t.y[k];
            sum[2] += t.weight[k] * t.y[k] * t.y[k];
        }
        assert_true(fabs(sum[0] - xx) < 1e-9 && fabs(sum[1] - xy) < 1e-9 && fabs(sum[2] - yy) < 1e-9);
    }
}

/* ---- pictures and meshes ------------------------------------------------------------------------ */

enum { SIDE = 64, PIXELS = SIDE * SIDE };

static float in[4 * PIXELS], out[4 * PIXELS];
static uint8_t mask[PIXELS];

static txm_image image_of(void *pixels, int channels, txm_sample sample) {
    txm_image image;
    memset(&image, 0, sizeof image);
    image.pixels = pixels;
    image.width = image.height = SIDE;
    image.channels = channels;
    image.sample = sample;
    return image;
}

static texinpaint_desc desc_of(void *pixels, int channels, txm_sample sample) {
    texinpaint_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.image = image_of(pixels, channels, sample);
    desc.mask = image_of(mask, 1, TXM_U8);
    return desc;
}

/* A plane of 12 x 6 units, z = 0, in two charts cut at x = 6: the left one upright, the right one turned
   by 90 degrees, of another size and (sheared) with sides that are not at right angles. */
static float positions[3 * 8] = {0, 0, 0, 6, 0, 0, 6, 6, 0, 0, 6, 0, 6, 0, 0, 12, 0, 0, 12, 6, 0, 6, 6, 0};
static const uint32_t faces[12] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
static float uv[2 * 8];

static void plane_make(texinpaint_desc *desc, double shear) {
    const double left[4][2] = {{4, 4}, {30, 4}, {30, 30}, {4, 30}};
    /* x runs upwards in the atlas, y to the right; 20 texels are 6 units; y also runs downwards */
    const double right[4][2] = {{36, 30}, {36, 10}, {56, 10 + shear}, {56, 30 + shear}};
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 2; k++) {
            uv[2 * i + k] = (float)((left[i][k] + 0.25) / SIDE);
            uv[8 + 2 * i + k] = (float)((right[i][k] + 0.25) / SIDE);
        }
    }
    desc->mesh.positions = positions;
    desc->mesh.indices = faces;
    desc->mesh.vertex_count = 8;
    desc->mesh.face_count = 4;
    desc->uv = uv;
    desc->uv_count = 8;
}

/* where texel (x, y) lies on the plane; 0: in no chart */
static int plane_at(int x, int y, double shear, double place[2]) {
    const double u = x + 0.25, v = y + 0.25; /* texel centres are at one half, the charts at .25 */
    if (u >= 4 && u <= 30 && v >= 4 && v <= 30) {
        place[0] = (u - 4) * 6 / 26;
        place[1] = (v - 4) * 6 / 26;
        return 1;
    }
    place[1] = (u - 36) * 6 / 20;
    place[0] = 6 + (30 + shear * (u - 36) / 20 - v) * 6 / 20;
    return u >= 36 && u <= 56 && place[0] >= 6 && place[0] <= 12;
}

/* The largest error in a hole about the seam, for a function on the plane. */
static double plane_error(double (*f)(double x, double y), double shear) {
    texinpaint_desc desc = desc_of(in, 1, TXM_F32);
    const txm_image o = image_of(out, 1, TXM_F32);
    double worst = 0;
    int filled = 0;
    plane_make(&desc, shear);
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        const int inside = plane_at(i % SIDE, i / SIDE, shear, p);
        const double dx = p[0] - 6.4, dy = p[1] - 3;
        mask[i] = inside && dx * dx + dy * dy < 2.2 * 2.2 ? 255 : 0;
        in[i] = inside && !mask[i] ? (float)f(p[0], p[1]) : mask[i] ? 99.0f : -5.0f;
    }
    assert_int_equal(texinpaint_harmonic(&desc, NULL, &o), TXM_OK);
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        if (!mask[i]) {
            assert_true(out[i] == in[i]);
            continue;
        }
        plane_at(i % SIDE, i / SIDE, shear, p);
        worst = fmax(worst, fabs((double)out[i] - f(p[0], p[1])));
        filled++;
    }
    assert_true(filled > 200);
    return worst;
}

static double constant(double x, double y) {
    (void)x, (void)y;
    return 0.75;
}
static double linear(double x, double y) {
    return (2 * x + y) / 30;
}
static double saddle(double x, double y) {
    return ((x - 6.4) * (x - 6.4) - (y - 3) * (y - 3)) / 4.84;
}

static void test_across_a_seam(void **state) {
    (void)state;
    /* the hole spans .33 of the linear function, 2 of the saddle: .006 is a third of a step of a texel */
    assert_true(plane_error(constant, 0) < 1e-6);
    assert_true(plane_error(linear, 0) < 0.006);
    assert_true(plane_error(saddle, 0) < 0.04);
    assert_true(plane_error(constant, 12) < 1e-6);
    assert_true(plane_error(linear, 12) < 0.006);
    assert_true(plane_error(saddle, 12) < 0.04);
}

/* In a picture it is the membrane of txm_poisson. */
static void test_picture_is_a_membrane(void **state) {
    (void)state;
    static float solved[PIXELS];
    txm_poisson_desc poisson;
    texinpaint_desc desc = desc_of(in, 1, TXM_F32);
    const txm_image o = image_of(out, 1, TXM_F32);
    txm_rng rng = txm_rng_make(4, 1);
    memset(&poisson, 0, sizeof poisson);
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE - 20, y = i / SIDE - 30;
        mask[i] = x * x + y * y < 300 || (i % SIDE > 50 && i / SIDE < 20) ? 200 : 0;
        in[i] = solved[i] = txm_rng_float(&rng);
    }
    poisson.image = image_of(solved, 1, TXM_F32);
    poisson.mask = desc.mask;
    poisson.tolerance = 1e-8f;
    assert_int_equal(txm_poisson(&poisson, NULL), TXM_OK);
    assert_int_equal(texinpaint_harmonic(&desc, NULL, &o), TXM_OK);
    for (int i = 0; i < PIXELS; i++) assert_true(fabsf(out[i] - solved[i]) < 2e-6f);
}

/* ---- kinds of maps -------------------------------------------------------------------------------- */

static void disk_mask(int cx, int cy, int radius) {
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE - cx, y = i / SIDE - cy;
        mask[i] = x * x + y * y < radius * radius ? 255 : 0;
    }
}

static void test_sample_types(void **state) {
    (void)state;
    static uint8_t bytes[3 * PIXELS], bytes_out[3 * PIXELS];
    static uint16_t words[3 * PIXELS], words_out[3 * PIXELS];
    disk_mask(32, 32, 20);
    for (int i = 0; i < 3 * PIXELS; i++) {
        const int x = i / 3 % SIDE, y = i / 3 / SIDE;
        const double v = i % 3 == 0 ? x / 63.0 : i % 3 == 1 ? y / 63.0 : 0.5;
        const int hole = mask[i / 3] != 0;
        in[i] = hole ? 0 : (float)v;
        bytes[i] = (uint8_t)(hole ? 0 : v * 255 + 0.5);
        words[i] = (uint16_t)(hole ? 0 : v * 65535 + 0.5);
    }
    texinpaint_desc a = desc_of(in, 3, TXM_F32), b = desc_of(bytes, 3, TXM_U8);
    texinpaint_desc c = desc_of(words, 3, TXM_U16);
    const txm_image ao = image_of(out, 3, TXM_F32), bo = image_of(bytes_out, 3, TXM_U8);
    const txm_image co = image_of(words_out, 3, TXM_U16);
    assert_int_equal(texinpaint_harmonic(&a, NULL, &ao), TXM_OK);
    assert_int_equal(texinpaint_harmonic(&b, NULL, &bo), TXM_OK);
    assert_int_equal(texinpaint_harmonic(&c, NULL, &co), TXM_OK);
    for (int i = 0; i < 3 * PIXELS; i++) {
        const int x = i / 3 % SIDE, y = i / 3 / SIDE;
        const double v = i % 3 == 0 ? x / 63.0 : i % 3 == 1 ? y / 63.0 : 0.5;
        assert_true(fabs((double)out[i] - v) < 1e-5);
        assert_true(fabs(bytes_out[i] - 255 * v) < 1.1);
        assert_true(fabs(words_out[i] - 65535 * v) < 1.6);
    }
}

/* Transparent texels have no colour: opaque red on the left, transparent green on the right. */
static void test_alpha(void **state) {
    (void)state;
    texinpaint_desc desc = desc_of(in, 4, TXM_F32);
    const txm_image o = image_of(out, 4, TXM_F32);
    disk_mask(32, 32, 20);
    for (int i = 0; i < PIXELS; i++) {
        const int left = i % SIDE < 32;
        in[4 * i] = left ? 1.0f : 0.0f;
        in[4 * i + 1] = left ? 0.0f : 1.0f;
        in[4 * i + 2] = 0;
        in[4 * i + 3] = left ? 1.0f : 0.0f;
    }
    assert_int_equal(texinpaint_harmonic(&desc, NULL, &o), TXM_OK);
    for (int i = 0; i < PIXELS; i++) { /* all of the hole is red */
        if (!mask[i]) {
            assert_memory_equal(out + 4 * i, in + 4 * i, 4 * sizeof *out);
            continue;
        }
        assert_true(fabsf(out[4 * i] - 1) < 1e-3f && fabsf(out[4 * i + 1]) < 1e-3f);
        assert_true(out[4 * i + 3] > 0 && out[4 * i + 3] < 1);
    }
    assert_true(fabsf(out[4 * (32 * SIDE + 31) + 3] - 0.5f) < 0.05f);
}

/* Over a seam whose charts are turned by 90 degrees a normal map keeps its direction in space. */
static void normals_across_a_seam(int is_normal) {
    texinpaint_desc desc = desc_of(in, 1, TXM_F32);
    static float normals[3 * PIXELS], normals_out[3 * PIXELS];
    texinpaint_map map;
    int filled = 0;
    memset(&map, 0, sizeof map);
    map.image = image_of(normals, 3, TXM_F32);
    map.is_normal = is_normal;
    desc.maps = &map;
    desc.map_count = 1;
    plane_make(&desc, 0);
    /* (.48, .36, .8) in space; on the left u is x and v is y; on the right u is y and v is -x */
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        const int inside = plane_at(i % SIDE, i / SIDE, 0, p), is_left = i % SIDE < 32;
        const double dx = p[0] - 6.4, dy = p[1] - 3, down = is_normal == 2 ? 1 : -1;
        mask[i] = inside && dx * dx + dy * dy < 2.2 * 2.2 ? 255 : 0;
        in[i] = 0;
        const double x = is_left ? 0.48 : 0.36, y = is_left ? down * 0.36 : -down * 0.48;
        normals[3 * i] = mask[i] ? 0 : (float)((x + 1) / 2);
        normals[3 * i + 1] = mask[i] ? 0 : (float)((y + 1) / 2);
        normals[3 * i + 2] = mask[i] ? 0 : 0.9f;
    }
    const txm_image both[2] = {image_of(out, 1, TXM_F32), image_of(normals_out, 3, TXM_F32)};
    assert_int_equal(texinpaint_harmonic(&desc, NULL, both), TXM_OK);
    for (int i = 0; i < PIXELS; i++) {
        const double down = is_normal == 2 ? 1 : -1;
        const int is_left = i % SIDE < 32;
        if (!mask[i]) continue;
        const double x = is_left ? 0.48 : 0.36, y = is_left ? down * 0.36 : -down * 0.48;
        assert_true(fabs(normals_out[3 * i] - (x + 1) / 2) < 1e-4);
        assert_true(fabs(normals_out[3 * i + 1] - (y + 1) / 2) < 1e-4);
        assert_true(fabs((double)normals_out[3 * i + 2] - 0.9) < 1e-4);
        filled++;
    }
    assert_true(filled > 200);
}

static void test_normals(void **state) {
    (void)state;
    normals_across_a_seam(1);
    normals_across_a_seam(2);
}

/* Opposite normals meet: still of unit length everywhere. */
static void test_normals_are_unit(void **state) {
    (void)state;
    static uint8_t normals[3 * PIXELS], normals_out[3 * PIXELS];
    texinpaint_desc desc = desc_of(in, 1, TXM_F32);
    texinpaint_map map;
    txm_rng rng = txm_rng_make(5, 1);
    memset(&map, 0, sizeof map);
    map.image = image_of(normals, 3, TXM_U8);
    map.is_normal = 1;
    desc.maps = &map;
    desc.map_count = 1;
    disk_mask(30, 30, 22);
    for (int i = 0; i < 3 * PIXELS; i++) normals[i] = (uint8_t)txm_rng_below(&rng, 256);
    const txm_image both[2] = {image_of(out, 1, TXM_F32), image_of(normals_out, 3, TXM_U8)};
    assert_int_equal(texinpaint_harmonic(&desc, NULL, both), TXM_OK);
    for (int i = 0; i < PIXELS; i++) {
        double n = 0;
        for (int c = 0; c < 3; c++) {
            const double v = txm_normal_decode(normals_out[3 * i + c] / 255.0, TXM_U8);
            n += v * v;
        }
        if (mask[i]) assert_true(fabs(n - 1) < 0.03);
        else assert_memory_equal(normals + 3 * i, normals_out + 3 * i, 3);
    }
}

static void test_labels_are_the_nearest(void **state) {
    (void)state;
    static uint8_t labels[PIXELS], labels_out[PIXELS];
    texinpaint_desc desc = desc_of(in, 1, TXM_F32);
    texinpaint_map map;
    int wrong = 0, count = 0;
    txm_rng rng = txm_rng_make(6, 1);
    memset(&map, 0, sizeof map);
    map.image = image_of(labels, 1, TXM_U8);
    map.is_label = 1;
    desc.maps = &map;
    desc.map_count = 1;
    disk_mask(30, 34, 21);
    for (int i = 0; i < PIXELS; i++) labels[i] = (uint8_t)txm_rng_below(&rng, 256);
    const txm_image both[2] = {image_of(out, 1, TXM_F32), image_of(labels_out, 1, TXM_U8)};
    assert_int_equal(texinpaint_harmonic(&desc, NULL, both), TXM_OK);
    for (int i = 0; i < PIXELS; i++) {
        int least = INT_MAX, found = 0;
        if (!mask[i]) {
            assert_int_equal(labels_out[i], labels[i]);
            continue;
        }
        for (int pass = 0; pass < 2; pass++) {
            for (int k = 0; k < PIXELS; k++) {
                const int x = k % SIDE - i % SIDE, y = k / SIDE - i / SIDE, d = x * x + y * y;
                if (mask[k]) continue;
                if (!pass) least = d < least ? d : least;
                else found |= sqrt(d) < sqrt(least) + 0.8 && labels[k] == labels_out[i];
            }
        }
        count++;
        wrong += !found;
    }
    assert_true(count > 1000 && wrong == 0);
}

static void test_a_hole_without_known_texels_gets_the_mean(void **state) {
    (void)state;
    texinpaint_desc desc = desc_of(in, 1, TXM_F32);
    const txm_image o = image_of(out, 1, TXM_F32);
    double sum = 0;
    int count = 0;
    plane_make(&desc, 0);
    positions[12] = positions[21] = 7; /* the right half no longer touches the left one */
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        const int inside = plane_at(i % SIDE, i / SIDE, 0, p);
        mask[i] = inside && i % SIDE > 32 ? 255 : 0;
        in[i] = (float)(i % 7) / 7;
        if (inside && !mask[i]) sum += (double)in[i];
        count += inside && !mask[i];
    }
    const txm_status status = texinpaint_harmonic(&desc, NULL, &o);
    positions[12] = positions[21] = 6;
    assert_int_equal(status, TXM_OK);
    for (int i = 0; i < PIXELS; i++) {
        if (mask[i]) assert_true(fabs((double)out[i] - sum / count) < 1e-5);
    }
}

/* ---- gutters ----------------------------------------------------------------------------------- */

static void test_dilation_against_brute_force(void **state) {
    (void)state;
    static uint8_t bytes[PIXELS], bytes_out[PIXELS];
    txm_rng rng = txm_rng_make(7, 1);
    for (int round = 0; round < 12; round++) {
        texinpaint_desc desc = desc_of(bytes, 1, TXM_U8);
        const txm_image o = image_of(bytes_out, 1, TXM_U8);
        const int is_mesh = round % 2, reach = round % 3 == 2 ? 5 : 0;
        double p[2];
        if (is_mesh) plane_make(&desc, 0);
        desc.gutter = reach;
        for (int i = 0; i < PIXELS; i++) {
            bytes[i] = (uint8_t)txm_rng_below(&rng, 256);
            mask[i] = txm_rng_below(&rng, 100) < (uint32_t)(is_mesh ? 20 : 80 + round) ? 255 : 0;
        }
        if (is_mesh && round == 1) desc.mask.pixels = NULL;
        assert_int_equal(texinpaint_dilate(&desc, NULL, &o), TXM_OK);
        for (int i = 0; i < PIXELS; i++) {
            const int masked = mask[i] && desc.mask.pixels;
            const int fills = is_mesh ? !plane_at(i % SIDE, i / SIDE, 0, p) : masked;
            int least = INT_MAX, found = 0;
            for (int pass = 0; pass < 2 && fills; pass++) {
                for (int k = 0; k < PIXELS; k++) {
                    const int x = k % SIDE - i % SIDE, y = k / SIDE - i / SIDE, d = x * x + y * y;
                    if ((mask[k] && desc.mask.pixels) || (is_mesh && !plane_at(k % SIDE, k / SIDE, 0, p)))
                        continue;
                    if (!pass) least = d < least ? d : least;
                    else found |= d == least && bytes[k] == bytes_out[i];
                }
            }
            if (!fills || (reach && least > reach * reach)) assert_int_equal(bytes_out[i], bytes[i]);
            else assert_true(found);
        }
    }
}

/* Without mesh and mask colours spread into the transparent pixels, which stay transparent. */
static void test_transparent_pixels(void **state) {
    (void)state;
    static uint16_t a[2 * PIXELS], b[2 * PIXELS];
    texinpaint_desc desc = desc_of(a, 2, TXM_U16);
    const txm_image o = image_of(b, 2, TXM_U16);
    desc.mask.pixels = NULL;
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE;
        a[2 * i] = (uint16_t)(x < 20 ? 3000 : x > 40 ? 5000 : 7);
        a[2 * i + 1] = (uint16_t)(x < 20 ? 1 : x > 40 ? 65535 : 0);
    }
    assert_int_equal(texinpaint_dilate(&desc, NULL, &o), TXM_OK);
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % SIDE;
        assert_int_equal(b[2 * i + 1], a[2 * i + 1]);
        assert_int_equal(b[2 * i], x <= 30 ? 3000 : 5000);
    }
    for (int i = 0; i < PIXELS; i++) a[2 * i + 1] = 0;
    assert_int_equal(texinpaint_dilate(&desc, NULL, &o), TXM_TOO_SMALL);
}

static void test_in_place(void **state) {
    (void)state;
    static uint8_t a[PIXELS], b[PIXELS];
    texinpaint_desc desc = desc_of(a, 1, TXM_U8);
    const txm_image same = image_of(a, 1, TXM_U8), other = image_of(b, 1, TXM_U8);
    disk_mask(32, 32, 12);
    for (int call = 0; call < 2; call++) {
        for (int i = 0; i < PIXELS; i++) a[i] = (uint8_t)(i * 7);
        for (int k = 0; k < 2; k++)
            assert_int_equal(call ? texinpaint_dilate(&desc, NULL, k ? &same : &other)
                                  : texinpaint_harmonic(&desc, NULL, k ? &same : &other), TXM_OK);
        assert_memory_equal(a, b, sizeof a);
    }
}

/* ---- refusals and faults ------------------------------------------------------------------------ */

static void test_refusals(void **state) {
    (void)state;
    txm_env env;
    memset(&env, 0, sizeof env);
    texinpaint_desc desc = desc_of(in, 1, TXM_F32);
    const txm_image o = image_of(out, 1, TXM_F32);
    disk_mask(32, 32, 12);
    for (int i = 0; i < PIXELS; i++) in[i] = 0;
    assert_int_equal(texinpaint_harmonic(NULL, &env, &o), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_harmonic(&desc, &env, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_dilate(NULL, &env, &o), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_dilate(&desc, &env, NULL), TXM_BAD_ARGUMENT);
    desc.mask.pixels = NULL;
    assert_int_equal(texinpaint_harmonic(&desc, &env, &o), TXM_BAD_ARGUMENT);
    assert_int_equal(texinpaint_dilate(&desc, &env, &o), TXM_OK); /* nothing to fill */
    desc.mask.pixels = mask;
    desc.mask.width = 32;
    assert_int_equal(texinpaint_harmonic(&desc, &env, &o), TXM_BAD_ARGUMENT);
    desc.mask.width = SIDE;
    memset(mask, 255, sizeof mask);
    assert_int_equal(texinpaint_harmonic(&desc, &env, &o), TXM_TOO_SMALL);
    assert_int_equal(texinpaint_dilate(&desc, &env, &o), TXM_TOO_SMALL);
    plane_make(&desc, 0);
    desc.uv = NULL;
    assert_int_equal(texinpaint_harmonic(&desc, &env, &o), TXM_BAD_ARGUMENT);
}

typedef struct job {
    texinpaint_desc desc;
    txm_image out[4];
    int dilates;
} job;

static txm_status run(void *context, txm_env *env) {
    const job *j = (const job *)context;
    return j->dilates ? texinpaint_dilate(&j->desc, env, j->out)
                      : texinpaint_harmonic(&j->desc, env, j->out);
}

static void test_faults(void **state) {
    (void)state;
    static uint8_t normals[3 * PIXELS], labels[PIXELS], color[4 * PIXELS];
    static uint8_t done[3][4 * PIXELS];
    texinpaint_map maps[2];
    job j;
    memset(&j, 0, sizeof j);
    memset(maps, 0, sizeof maps);
    j.desc = desc_of(color, 4, TXM_U8);
    plane_make(&j.desc, 0);
    maps[0].image = image_of(normals, 3, TXM_U8);
    maps[0].is_normal = 1;
    maps[1].image = image_of(labels, 1, TXM_U8);
    maps[1].is_label = 1;
    j.desc.maps = maps;
    j.desc.map_count = 2;
    for (int i = 0; i < 3; i++) {
        j.out[i] = i ? maps[i - 1].image : j.desc.image;
        j.out[i].pixels = done[i];
    }
    for (int i = 0; i < PIXELS; i++) {
        double p[2];
        mask[i] = plane_at(i % SIDE, i / SIDE, 0, p) && fabs(p[0] - 6.2) < 2 ? 255 : 0;
        for (int c = 0; c < 4; c++) color[4 * i + c] = (uint8_t)(i * (c + 3));
    }
    const tk_output outputs[1] = {{done, sizeof done}};
    for (j.dilates = 0; j.dilates < 2; j.dilates++) {
        assert_true(tk_sweep_outputs(run, &j, TK_ALLOCATION, outputs, 1) > (j.dilates ? 10 : 40));
        assert_true(tk_sweep_outputs(run, &j, TK_ONWARD, outputs, 1) > 10);
        assert_true(tk_sweep_outputs(run, &j, TK_CANCEL, outputs, 1) >= (j.dilates ? 2 : 8));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_grid_against_direct_solve),
        cmocka_unit_test(test_poisson_against_direct_solve),
        cmocka_unit_test(test_poisson_without_rim),
        cmocka_unit_test(test_stencil),
        cmocka_unit_test(test_across_a_seam),
        cmocka_unit_test(test_picture_is_a_membrane),
        cmocka_unit_test(test_sample_types),
        cmocka_unit_test(test_alpha),
        cmocka_unit_test(test_normals),
        cmocka_unit_test(test_normals_are_unit),
        cmocka_unit_test(test_labels_are_the_nearest),
        cmocka_unit_test(test_a_hole_without_known_texels_gets_the_mean),
        cmocka_unit_test(test_dilation_against_brute_force),
        cmocka_unit_test(test_transparent_pixels),
        cmocka_unit_test(test_in_place),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
