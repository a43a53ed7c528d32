/* test_texpatch_lattice.c - sides that fit, lattices, both together
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_lattice && build/tests/unit/test_texpatch_lattice */
#include "patchkit.h"

/* ---- tileable --------------------------------------------------------------------------- */

static void test_tileable(void **state) {
    (void)state;
    const txm_image noise = draw_noise(96, 96, 3, 0, 3, 128);
    const texpatch_exemplar e = exemplar_of(&noise);
    for (int tileable = 0; tileable <= 3; tileable++) {
        double sum[2][2] = {{0, 0}, {0, 0}}, count[2][2] = {{0, 0}, {0, 0}};
        for (int seed = 0; seed < 3; seed++) {
            texpatch_desc d = desc_of(&e, 1, 1, 120, 104);
            d.tileable = tileable;
            d.passes = 2;
            d.seed = (uint64_t)seed;
            if (tileable == 0 && seed) continue;
            const txm_image out = made(&d, NULL);
            for (int k = 0; k < 2; k++) add_steps(&out, k, sum[k], count[k]);
        }
        for (int k = 0; k < 2; k++) {
            const double ratio = sum[k][1] / count[k][1] / (sum[k][0] / count[k][0]);
            if (tileable >> k & 1) assert_between("step across the wrap", ratio, 0.9, 1.1);
            else assert_between("step of sides that need not fit", ratio, 1.5, 9);
        }
    }
}

/* how far (x, y) is from a whole number of steps, in steps */
static double off_lattice(const float v[4], double x, double y) {
    const double det = (double)v[0] * (double)v[3] - (double)v[1] * (double)v[2];
    const double a = (x * (double)v[3] - y * (double)v[2]) / det;
    const double b = ((double)v[0] * y - (double)v[1] * x) / det;
    return fmax(fabs(a - floor(a + 0.5)), fabs(b - floor(b + 0.5)));
}

static void test_lattice(void **state) {
    (void)state;
    float v[4];
    static const int steps[3][2] = {{24, 16}, {30, 11}, {18, 14}};
    for (int i = 0; i < 3; i++) {
        const int dx = steps[i][0], dy = steps[i][1];
        const txm_image bricks = draw_bricks(i == 1 ? 128 : 90, 90, dx, dy);
        const texpatch_exemplar e = exemplar_of(&bricks);
        texpatch_desc d = desc_of(&e, 1, 1, 96, 96);
        texpatch_job *job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 1);
        /* a basis of the same lattice: the same area, and both known steps belong to it */
        const double det = fabs((double)v[0] * (double)v[3] - (double)v[1] * (double)v[2]);
        assert_between("area of a cell", det / (dx * dy), 0.98, 1.02);
        assert_between("a row's step is one", off_lattice(v, dx, 0), 0, 0.02);
        assert_between("that to the next row too", off_lattice(v, dx * 0.5, dy), 0, 0.02);
        texpatch_free(job);

        d.lattice = -1;
        job = begin(&d);
        v[2] = 5;
        assert_int_equal(texpatch_lattice(job, v), 0);
        assert_true(v[0] == 0 && v[1] == 0 && v[2] == 0 && v[3] == 0);
        assert_int_equal(texpatch_lattice(job, NULL), 0);
        texpatch_free(job);

        d.lattice = 1;
        d.lattice_vectors[0] = 20;
        d.lattice_vectors[3] = -17.5f;
        job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 1);
        assert_true(off_lattice(v, 20, 0) < 1e-5 && off_lattice(v, 0, 17.5) < 1e-5);
        texpatch_free(job);
    }
    for (int i = 0; i < 4; i++) {
        const txm_image plain = i < 2 ? draw_gravel(96, 80, 3, 20 * i)
                                      : draw_noise(96, 80, 3, 20 * i, i == 2 ? 2 : 3, 120);
        const texpatch_exemplar e = exemplar_of(&plain);
        const texpatch_desc d = desc_of(&e, 1, 1, 96, 96);
        texpatch_job *job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 0);
        texpatch_free(job);
    }
    assert_int_equal(texpatch_lattice(NULL, v), 0);
}

/* A torus of bricks: the steps are adapted to its sides, and the joints continue across them. */
static void test_lattice_torus(void **state) {
    (void)state;
    const txm_image bricks = draw_bricks(112, 96, 24, 16);
    const texpatch_exemplar e = exemplar_of(&bricks);
    static const int sides[3][2] = {{130, 100}, {101, 99}, {144, 128}};
    for (int i = 0; i < 3; i++) {
        texpatch_desc d = desc_of(&e, 1, 1, sides[i][0], sides[i][1]);
        float v[4];
        d.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
        texpatch_job *job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 1);
        assert_between("steps along the width", off_lattice(v, d.width, 0), 0, 0.001);
        assert_between("steps along the height", off_lattice(v, 0, d.height), 0, 0.001);
        run(job);
        const txm_image out = drawn(job, 0, &bricks, d.width, d.height);
        /* pixels whole steps apart look alike, also across the border */
        int alike[2] = {0, 0}, count[2] = {0, 0};
        for (int y = 0; y < d.height; y++) {
            for (int x = 0; x < d.width; x++) {
                const int u = (int)floorf((float)x + v[0] + 0.5f);
                const int w = (int)floorf((float)y + v[1] + 0.5f);
                const int wraps = u < 0 || w < 0 || u >= d.width || w >= d.height;
                alike[wraps] +=
                    step(&out, x, y, (u + d.width) % d.width, (w + d.height) % d.height) < 0.15;
                count[wraps]++;
            }
        }
        assert_between("alike one step on", alike[0] / (double)count[0], 0.9, 1);
        assert_between("across the border", alike[1] / (double)count[1], 0.8, 1);
        texpatch_free(job);
    }
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_tileable, release_all),
        cmocka_unit_test_teardown(test_lattice, release_all),
        cmocka_unit_test_teardown(test_lattice_torus, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
