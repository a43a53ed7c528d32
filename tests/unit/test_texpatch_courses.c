/* test_texpatch_courses.c - bricks in courses that begin anywhere keep their length
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texpatch_courses && build/tests/unit/test_texpatch_courses */
#include "patchkit.h"

/* ---- walls ---------------------------------------------------------------------------------- */

enum { JOINT = 3, MORTAR = 190, BRICK = 96, HALFWAY = 150 };

/* How courses begin, and where their joints lie. */
typedef enum bond { BOND_RANDOM, BOND_HALF, BOND_THIRD, BOND_NONE } bond;

typedef struct wall {
    bond kind;
    int length, high; /* of a brick, its joint included */
    int upright;      /* courses go down */
} wall;

static int is_joint(const wall *w, int along, int course) {
    int begin = 0;
    if (w->kind == BOND_RANDOM) begin = at_random(course, 5, 1) * w->length / 256;
    if (w->kind == BOND_HALF) begin = course % 2 * w->length / 2;
    if (w->kind == BOND_THIRD) begin = course % 3 * w->length / 3;
    if (w->kind != BOND_NONE) return (along + begin) % w->length < JOINT;
    /* planks: a joint somewhere in the middle of each length */
    const int plank = along / w->length, at = along % w->length;
    const int joint = w->length / 6 + at_random(plank, course, 7) * w->length * 2 / 3 / 256;
    return at >= joint && at < joint + JOINT;
}

/* Joints across the courses cover so little that the wall is much like itself moved along them. */
static txm_image draw_wall(const wall *w, int width, int height) {
    const txm_image im = new_image(width, height, 1, TXM_U8);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int along = w->upright ? y : x, across = w->upright ? x : y;
            const int mortar =
                across % w->high < JOINT || is_joint(w, along + 40, across / w->high + 1);
            ((uint8_t *)im.pixels)[y * width + x] =
                (uint8_t)((mortar ? MORTAR : BRICK) + at_random(x, y, 3) / 24);
        }
    }
    return im;
}

static int is_bright(const txm_image *im, int x, int y) {
    return txm_image_get(im, x, y, 0) > (float)HALFWAY / 255;
}

/* Bricks that are whole between two joints, and how many there are in all; a course is read along its
   middle, which lies where both of its own joints are as far. */
static void count_bricks(const txm_image *im, const wall *w, int *whole, int *all) {
    const int length = w->upright ? im->height : im->width, size = w->upright ? im->width : im->height;
    *whole = *all = 0;
    for (int across = 1; across < size; across++) {
        /* a joint along the course is bright nearly everywhere */
        int bright = 0, middle = across + w->high / 2, last = -1;
        for (int i = 0; i < length; i++)
            bright += w->upright ? is_bright(im, across, i) : is_bright(im, i, across);
        if (bright < length * 3 / 4 || middle >= size) continue;
        for (int i = 1; i < length; i++) {
            const int is = w->upright ? is_bright(im, middle, i) : is_bright(im, i, middle);
            const int was = w->upright ? is_bright(im, middle, i - 1) : is_bright(im, i - 1, middle);
            if (!is || was) continue;
            *whole += last >= 0 && abs(i - last - w->length) <= w->length / 12 + 1;
            *all += last >= 0;
            last = i;
        }
        across += w->high / 2;
    }
}

static void test_bonds(void **state) {
    (void)state;
    static const wall walls[] = {
        {BOND_RANDOM, 96, 24, 0}, {BOND_RANDOM, 84, 22, 1}, {BOND_HALF, 96, 24, 1}, {BOND_THIRD, 96, 24, 0}};
    for (int i = 0; i < (int)(sizeof walls / sizeof *walls); i++) {
        const wall *w = &walls[i];
        const txm_image bricks = draw_wall(w, w->upright ? 190 : 240, w->upright ? 240 : 190);
        const texpatch_exemplar e = exemplar_of(&bricks);
        for (int tileable = 0; tileable <= 3; tileable += 3) {
            texpatch_desc d = desc_of(&e, 1, 1, w->upright ? 9 * w->high : 3 * w->length,
                                      w->upright ? 3 * w->length : 9 * w->high);
            float v[4];
            int whole, all;
            d.tileable = tileable;
            texpatch_job *job = begin(&d);
            assert_int_equal(texpatch_lattice(job, v), 1);
            run(job);
            const txm_image out = drawn(job, 0, &bricks, d.width, d.height);
            texpatch_free(job);
            count_bricks(&out, w, &whole, &all);
            show("bond", i);
            show("bricks", all);
            assert_true(all >= 12);
            assert_between("whole bricks", whole / (double)all, 0.8, 1);
        }
    }
}

/* Planks of any length repeat across their courses alone: these stay whole. */
static void test_planks(void **state) {
    (void)state;
    static const wall w = {BOND_NONE, 100, 24, 0};
    const txm_image planks = draw_wall(&w, 260, 180);
    const texpatch_exemplar e = exemplar_of(&planks);
    for (int tileable = 0; tileable <= 3; tileable += 3) {
        texpatch_desc d = desc_of(&e, 1, 1, 300, 10 * w.high);
        float v[4];
        int bright = 0;
        d.tileable = tileable;
        texpatch_job *job = begin(&d);
        assert_int_equal(texpatch_lattice(job, v), 1);
        assert_true(v[0] == 0 && v[1] == 0);
        assert_between("from course to course", fabs((double)v[3]), w.high - 0.3, w.high + 0.3);
        run(job);
        const txm_image out = drawn(job, 0, &planks, d.width, d.height);
        texpatch_free(job);
        for (int y = 0; y < d.height; y++) {
            int row = 0;
            for (int x = 0; x < d.width; x++) row += is_bright(&out, x, y);
            bright += row >= d.width * 3 / 4;
        }
        assert_between("rows of joints, by course", bright / 10.0, 0.9, 4);
    }
}

static void test_plane(void **state) {
    (void)state;
    tk_wide();
    static const wall w = {BOND_RANDOM, 96, 24, 0};
    const txm_image bricks = draw_wall(&w, 240, 190);
    const texpatch_exemplar e = exemplar_of(&bricks);
    const texpatch_desc d = desc_of(&e, 1, 1, 0, 0);
    txm_env env = {0};
    texpatch_plane *plane;
    int whole, all;
    assert_int_equal(texpatch_plane_make(&d, &env, &plane), TXM_OK);
    const int side = texpatch_plane_cell(plane);
    const txm_image out = new_image(side, side, 1, TXM_U8);
    assert_int_equal(texpatch_plane_draw(plane, -side / 2, side / 2, &env, &out, NULL), TXM_OK);
    texpatch_plane_free(plane);
    count_bricks(&out, &w, &whole, &all);
    assert_true(all >= 12);
    assert_between("whole bricks where cells meet", whole / (double)all, 0.9, 1);
}

static txm_status begin_it(void *context, txm_env *env) {
    texpatch_job *job;
    const txm_status status = texpatch_begin((const texpatch_desc *)context, env, &job);
    texpatch_free(job);
    return status;
}

static void test_no_memory(void **state) {
    (void)state;
    tk_wide();
    static const wall w = {BOND_RANDOM, 96, 24, 0};
    const txm_image bricks = draw_wall(&w, 240, 190);
    const texpatch_exemplar e = exemplar_of(&bricks);
    texpatch_desc d = desc_of(&e, 1, 1, 96, 96);
    assert_true(tk_sweep(begin_it, &d, TK_ALLOCATION) > 20);
    d.tileable = TEXPATCH_TILE_X | TEXPATCH_TILE_Y;
    d.width = d.height = 192;
    assert_true(tk_sweep(begin_it, &d, TK_ALLOCATION) > 20);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_bonds, release_all),
        cmocka_unit_test_teardown(test_planks, release_all),
        cmocka_unit_test_teardown(test_plane, release_all),
        cmocka_unit_test_teardown(test_no_memory, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
