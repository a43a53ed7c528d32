/* test_texpatch_straight.c - photographs of patterns made straight
   SPDX-License-Identifier: MIT OR Unlicense

   The test photographs planes of brick, tiles, chequers, planks and cloth itself, so that it knows
   where each pixel lies on the plane.

   make build/tests/unit/test_texpatch_straight && build/tests/unit/test_texpatch_straight */
#include "patchkit.h"

/* ---- a camera in front of a plane ------------------------------------------------------- */

typedef enum pattern { BRICK, THIRD_BRICK, TILES, CHEQUERS, PLANKS, CLOTH, PATTERNS } pattern;

static const char *const pattern_names[PATTERNS] = {"brick",    "third brick", "tiles",
                                                    "chequers", "planks",      "cloth"};

/* Angles in degrees: the plane is tilted about an axis in it, then the camera is turned. lens: what
   a radius r, in half widths, was before the lens bent it: r (1 + lens r^2). swell: how far the wall
   itself swings to both sides, in half widths. */
typedef struct shot {
    double tilt, axis, turn, focal, lens, noise, swell;
} shot;

/* Where a point of the picture, in half sides from its middle, lies on the plane. */
static void on_plane(const shot *s, double x, double y, double plane[2]) {
    double sine, cosine, ax, ay;
    const double lens = 1 + s->lens * (x * x + y * y), depth = 2 * s->focal;
    x *= lens;
    y *= lens;
    txm_sincos(-s->turn * TXM_PI / 180, &sine, &cosine);
    const double u = cosine * x - sine * y, v = sine * x + cosine * y;
    txm_sincos(s->axis * TXM_PI / 180, &ay, &ax);
    txm_sincos(s->tilt * TXM_PI / 180, &sine, &cosine);
    /* along the axis of the tilt nothing changes, across it the ray meets the plane elsewhere */
    const double along = u * ax + v * ay, across = v * ax - u * ay;
    const double t = depth / (depth * cosine - across * sine);
    plane[0] = along * t * cosine * ax - across * t * ay;
    plane[1] = along * t * cosine * ay + across * t * ax;
    if (!(s->swell > 0)) return;
    double moved[2];
    for (int d = 0; d < 2; d++) {
        txm_sincos(TXM_PI * (plane[1 - d] + 0.3 * plane[d]) + 1 + d, &sine, &cosine);
        moved[d] = s->swell * sine;
    }
    for (int d = 0; d < 2; d++) plane[d] += moved[d];
}

/* Gray of a pattern at (u, v), whose unit is the height of a course. */
static double pattern_at(pattern p, double u, double v) {
    const double shift[PATTERNS] = {1.5, 1, 0, 0, 0, 0}, length = p == TILES || p == CHEQUERS ? 2 : 3;
    const double high = p == TILES || p == CHEQUERS ? 2 : 1;
    if (p == CLOTH) {
        const double i = floor(u), j = floor(v), a = u - i - 0.5, b = v - j - 0.5;
        const double c = (int)(i + j) & 1 ? 1 - 3 * a * a - b * b : 1 - 3 * b * b - a * a;
        return 0.2 + 0.6 * c;
    }
    const double j = floor(v / high);
    if (p == PLANKS) u += 3 * smooth(j * 7.7, 0, 1, 3);
    else u += shift[p] * (p == BRICK ? (double)((int)j & 1) : j);
    const double wide = p == PLANKS ? 14 : length, i = floor(u / wide);
    if (p == CHEQUERS) return (int)(i + j) & 1 ? 0.8 : 0.2;
    if (u - i * wide < 0.14 || v - j * high < 0.14) return p == PLANKS ? 0.1 : 0.85;
    return 0.3 + 0.3 * smooth(i * 3.3, j * 5.1, 1, 4) + 0.1 * smooth(u * 3, v * 3, 1, 5);
}

/* Four samples for each pixel; light falls off to the left, and there is noise. */
static txm_image photograph(pattern p, const shot *s, int width, int height, double courses) {
    const txm_image im = new_image(width, height, 3, TXM_U8);
    const double half = 0.5 * (width > height ? width : height);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double sum = 0;
            for (int k = 0; k < 4; k++) {
                double at[2];
                on_plane(s, (x + 0.25 + 0.5 * (k & 1) - 0.5 * width) / half,
                         (y + 0.25 + 0.25 * (k & 2) - 0.5 * height) / half, at);
                sum += pattern_at(p, 200 + at[0] * courses / 2, 200 + at[1] * courses / 2);
            }
            const double light = 0.75 + 0.5 * x / width;
            for (int c = 0; c < 3; c++)
                txm_image_set(&im, x, y, c,
                              (float)(sum / 4 * light * (1 - 0.1 * c) +
                                      s->noise * (at_random(x, y, c) / 255.0 - 0.5)));
        }
    }
    return im;
}

/* ---- how far the result is from the truth ----------------------------------------------- */

typedef struct truth {
    double error;   /* of a corner, in parts of the photograph's width           */
    double turn[2]; /* of the two axes, in degrees                               */
    double aspect;  /* width over height of a square of the plane                */
} truth;

/* Fit (x, y) of the plane = an affine function of the pixels of the result by three corners of a grid
   and measure the rest: a homography would bend it. */
static truth judge(const texpatch_straight *straight, const shot *s, int width, int height) {
    enum { STEPS = 8 };
    truth t = {0, {0, 0}, 0};
    int w, h;
    double sums[3][3] = {{0}}, right[2][3] = {{0}}, map[2][3];
    const double half = 0.5 * (width > height ? width : height);
    double at[STEPS + 1][STEPS + 1][2], photo[STEPS + 1][STEPS + 1][2];
    assert_int_equal(texpatch_straight_found(straight, &w, &h), 1);
    for (int j = 0; j <= STEPS; j++) {
        for (int i = 0; i <= STEPS; i++) {
            double *p = photo[j][i];
            const double row[3] = {1, (double)i / STEPS - 0.5, (double)j / STEPS - 0.5};
            assert_int_equal(texpatch_straight_source(straight, (w - 1.0) * i / STEPS,
                                                      (h - 1.0) * j / STEPS, p),
                             1);
            assert_true(p[0] > -1 && p[1] > -1 && p[0] < width && p[1] < height);
            on_plane(s, (p[0] + 0.5 - 0.5 * width) / half, (p[1] + 0.5 - 0.5 * height) / half,
                     at[j][i]);
            for (int a = 0; a < 3; a++) {
                for (int b = 0; b < 3; b++) sums[a][b] += row[a] * row[b];
                for (int d = 0; d < 2; d++) right[d][a] += row[a] * at[j][i][d];
            }
        }
    }
    /* the columns of the grid are orthogonal */
    for (int d = 0; d < 2; d++)
        for (int a = 0; a < 3; a++) map[d][a] = right[d][a] / sums[a][a];
    for (int j = 0; j <= STEPS; j++) {
        for (int i = 0; i <= STEPS; i++) {
            double off[2], x[2], y[2];
            const double px = (photo[j][i][0] + 0.5 - 0.5 * width) / half;
            const double py = (photo[j][i][1] + 0.5 - 0.5 * height) / half;
            for (int d = 0; d < 2; d++)
                off[d] = at[j][i][d] - map[d][0] - map[d][1] * ((double)i / STEPS - 0.5) -
                         map[d][2] * ((double)j / STEPS - 0.5);
            on_plane(s, px + 1e-4, py, x);
            on_plane(s, px, py + 1e-4, y);
            for (int d = 0; d < 2; d++) {
                x[d] = (x[d] - at[j][i][d]) / 1e-4;
                y[d] = (y[d] - at[j][i][d]) / 1e-4;
            }
            const double det = x[0] * y[1] - x[1] * y[0];
            const double ex = (y[1] * off[0] - y[0] * off[1]) / det;
            const double ey = (x[0] * off[1] - x[1] * off[0]) / det;
            t.error = fmax(t.error, sqrt(ex * ex + ey * ey) * half / width);
        }
    }
    const double xx = map[0][1] / w, xy = map[1][1] / w, yx = map[0][2] / h, yy = map[1][2] / h;
    t.turn[0] = atan2(xy, xx) * 180 / TXM_PI;
    t.turn[1] = atan2(-yx, yy) * 180 / TXM_PI;
    t.aspect = sqrt((xx * xx + xy * xy) / (yx * yx + yy * yy));
    return t;
}

static void check_shot(pattern p, const shot *s, int width, int height, double courses) {
    const txm_image photo = photograph(p, s, width, height, courses);
    texpatch_straight_desc desc;
    texpatch_straight *straight;
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(&desc, 0, sizeof desc);
    desc.photo = photo;
    desc.focal = (float)s->focal;
    assert_int_equal(texpatch_straight_find(&desc, &env, &straight), TXM_OK);
    if (!texpatch_straight_found(straight, NULL, NULL))
        fail_msg("%s: not found at %g degrees", pattern_names[p], s->tilt);
    const truth t = judge(straight, s, width, height);
    show(pattern_names[p], t.error);
    assert_between("error, of the width", t.error, 0, 0.01);
    assert_between("turn of the rows", t.turn[0], -0.6, 0.6);
    assert_between("turn of the columns", t.turn[1], -0.6, 0.6);
    assert_between("aspect", t.aspect, 0.98, 1.02);
    assert_between("agreement", texpatch_straight_agreement(straight), 0.7, 1);
    texpatch_straight_free(straight);
}

static void test_wall(void **state) {
    (void)state;
    const shot s = {20, 80, 0, 1, 0, 0.05, 0};
    for (int p = 0; p < PATTERNS; p++) check_shot((pattern)p, &s, 384, 288, 24);
}

static void test_floor(void **state) {
    (void)state;
    const shot s = {-45, 3, 0, 1, 0, 0.05, 0};
    for (int p = 0; p < PATTERNS; p++) check_shot((pattern)p, &s, 480, 320, p == CLOTH ? 30 : 20);
}

static void test_turned(void **state) {
    (void)state;
    tk_wide();
    const shot s = {8, 40, 14, 1, 0, 0.05, 0}, t = {0, 0, -15, 1, 0, 0.05, 0};
    for (int p = 0; p < CLOTH; p++) {
        check_shot((pattern)p, &s, 320, 320, 20);
        check_shot((pattern)p, &t, 320, 240, 20);
    }
}

static void test_lens(void **state) {
    (void)state;
    tk_wide();
    const shot s = {0, 0, 0, 1, 0.15, 0.05, 0}, t = {15, 70, 5, 0.8, -0.1, 0.05, 0};
    for (int p = 0; p < PATTERNS; p++) {
        check_shot((pattern)p, &s, 384, 288, 20);
        check_shot((pattern)p, &t, 384, 288, 20);
    }
}

/* A wall that swings by 1 or 1.5 % of the width, over about the width of the picture: without the
   field the error is twice as large. */
static void test_wavy(void **state) {
    (void)state;
    tk_wide();
    static const pattern patterns[] = {BRICK, THIRD_BRICK, TILES, CHEQUERS, CLOTH, TILES, CLOTH};
    for (int i = 0; i < 7; i++) {
        const shot s = {i < 5 ? 10 : 0, 80, 0, 1, 0, 0.05, i < 5 ? 0.02 : 0.03};
        check_shot(patterns[i], &s, 480, 360, 20);
    }
}

/* A result of whole periods: its sides are so many courses, times a whole number. */
static void test_whole(void **state) {
    (void)state;
    static const double periods[PATTERNS][2] = {{3, 2}, {3, 3}, {2, 2}, {4, 4}, {0, 1}, {2, 2}};
    const shot s = {15, 80, 4, 1, 0, 0.05, 0};
    for (int p = 0; p < PATTERNS; p++) {
        const txm_image photo = photograph((pattern)p, &s, 480, 360, 20);
        texpatch_straight_desc desc;
        texpatch_straight *straight;
        int w, h;
        double at[3][2];
        memset(&desc, 0, sizeof desc);
        desc.photo = photo;
        desc.focal = 1;
        desc.whole = 1;
        assert_int_equal(texpatch_straight_find(&desc, NULL, &straight), TXM_OK);
        assert_int_equal(texpatch_straight_found(straight, &w, &h), 1);
        assert_int_equal(texpatch_straight_whole(straight), periods[p][0] > 0 ? 3 : 2);
        for (int i = 0; i < 3; i++) {
            double q[2];
            assert_int_equal(texpatch_straight_source(straight, i == 1 ? w - 0.5 : -0.5,
                                                      i == 2 ? h - 0.5 : -0.5, q),
                             1);
            on_plane(&s, (q[0] + 0.5 - 240) / 240, (q[1] + 0.5 - 180) / 240, at[i]);
        }
        for (int i = 0; i < 2; i++) {
            if (!(periods[p][i] > 0)) continue;
            const double courses = 10 * (at[1 + i][i] - at[0][i]) / periods[p][i];
            assert_true(courses > 0.5);
            assert_between("away from a whole number", fabs(courses - floor(courses + 0.5)), 0, 0.05);
            assert_between("courses that lean", 10 * (at[1 + i][1 - i] - at[0][1 - i]), -0.1, 0.1);
        }
        texpatch_straight_free(straight);
    }
}

/* ---- without a pattern -------------------------------------------------------------------- */

static void test_nothing(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        const int side = k == 3 ? 20 : 160;
        const txm_image photo = new_image(side, side, 1, TXM_U8), out = new_image(side, side, 1, TXM_U8);
        texpatch_straight_desc desc;
        texpatch_straight *straight;
        int w, h;
        double source[2];
        for (int y = 0; y < side; y++) {
            for (int x = 0; x < side; x++) {
                const double value = k == 0 ? 0.5 : k == 1 ? smooth(x, y, 9, 3) : at_random(x, y, 3) / 255.0;
                txm_image_set(&photo, x, y, 0, (float)value);
            }
        }
        memset(&desc, 0, sizeof desc);
        desc.photo = photo;
        assert_int_equal(texpatch_straight_find(&desc, NULL, &straight), TXM_OK);
        assert_int_equal(texpatch_straight_found(straight, &w, &h), 0);
        assert_int_equal(texpatch_straight_whole(straight), 0);
        assert_true(w == side && h == side);
        assert_true(!(texpatch_straight_agreement(straight) > 0));
        assert_int_equal(texpatch_straight_source(straight, 3, 4, source), 1);
        assert_true(source[0] < 3.001 && source[0] > 2.999 && source[1] < 4.001 && source[1] > 3.999);
        assert_int_equal(texpatch_straight_draw(straight, &photo, NULL, NULL, &out), TXM_OK);
        assert_true(is_same(&photo, &out));
        texpatch_straight_free(straight);
    }
}

/* ---- what is drawn ------------------------------------------------------------------------ */

static texpatch_straight *find(const txm_image *photo, const txm_image *mask) {
    texpatch_straight_desc desc;
    texpatch_straight *straight;
    memset(&desc, 0, sizeof desc);
    desc.photo = *photo;
    if (mask) desc.mask = *mask;
    assert_int_equal(texpatch_straight_find(&desc, NULL, &straight), TXM_OK);
    return straight;
}

/* Every sample type and number of channels; hidden colour does not matter; a flat normal stays flat;
   labels are not mixed. */
static void test_drawing(void **state) {
    (void)state;
    const shot s = {20, 80, 10, 1, 0, 0, 0};
    const txm_image photo = photograph(TILES, &s, 200, 160, 16);
    texpatch_straight *straight = find(&photo, NULL);
    int w, h;
    assert_int_equal(texpatch_straight_found(straight, &w, &h), 1);
    const txm_image rgb = new_image(w, h, 3, TXM_U8);
    assert_int_equal(texpatch_straight_draw(straight, &photo, NULL, NULL, &rgb), TXM_OK);
    for (int k = 0; k < 12; k++) {
        const txm_sample sample = (txm_sample)(k / 4);
        const int n = k % 4 + 1, colours = n < 3 ? 1 : 3;
        const txm_image from = new_image(200, 160, n, sample), to = new_image(w, h, n, sample);
        double most = 0;
        for (int i = 0; i < 200 * 160; i++) {
            for (int c = 0; c < n; c++)
                txm_image_set(&from, i % 200, i / 200, c,
                              c < colours ? txm_image_get(&photo, i % 200, i / 200, c) : 1.0f);
        }
        assert_int_equal(texpatch_straight_draw(straight, &from, NULL, NULL, &to), TXM_OK);
        for (int i = 0; i < w * h; i++) {
            for (int c = 0; c < colours; c++)
                most = fmax(most, fabs((double)txm_image_get(&to, i % w, i / w, c) -
                                       (double)txm_image_get(&rgb, i % w, i / w, c)));
        }
        assert_between("difference between sample types", most, 0, 0.15);
        if (sample != TXM_F32) assert_between("difference between whole ones", most, 0, 0.003);
    }
    const txm_image hidden[2] = {new_image(200, 160, 4, TXM_U8), new_image(200, 160, 4, TXM_U8)};
    const txm_image drawn[2] = {new_image(w, h, 4, TXM_U8), new_image(w, h, 4, TXM_U8)};
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 200 * 160; i++) {
            const int is_hidden = i % 200 < 90;
            for (int c = 0; c < 4; c++)
                txm_image_set(&hidden[k], i % 200, i / 200, c,
                              c == 3      ? is_hidden ? 0.0f : 1.0f
                              : is_hidden ? (float)k
                                          : txm_image_get(&photo, i % 200, i / 200, c));
        }
        assert_int_equal(texpatch_straight_draw(straight, &hidden[k], NULL, NULL, &drawn[k]), TXM_OK);
    }
    for (int i = 0; i < w * h; i++) {
        if (txm_image_get(&drawn[0], i % w, i / w, 3) > 0)
            assert_true(is_pixel(&drawn[0], i % w, i / w, &drawn[1], i % w, i / w));
    }
    texpatch_map map;
    memset(&map, 0, sizeof map);
    map.is_normal = 1;
    const txm_image flat = new_image(200, 160, 3, TXM_U8), still = new_image(w, h, 3, TXM_U8);
    for (int i = 0; i < 200 * 160; i++) memcpy((uint8_t *)flat.pixels + 3 * i, "\200\200\377", 3);
    assert_int_equal(texpatch_straight_draw(straight, &flat, &map, NULL, &still), TXM_OK);
    for (int i = 0; i < w * h; i++)
        assert_int_equal(memcmp((uint8_t *)still.pixels + 3 * i, "\200\200\377", 3), 0);
    map.is_normal = 0;
    map.is_label = 1;
    const txm_image labels = new_image(200, 160, 1, TXM_U8), kept = new_image(w, h, 1, TXM_U8);
    for (int i = 0; i < 200 * 160; i++) ((uint8_t *)labels.pixels)[i] = i % 200 < 99 ? 7 : 250;
    assert_int_equal(texpatch_straight_draw(straight, &labels, &map, NULL, &kept), TXM_OK);
    for (int i = 0; i < w * h; i++)
        assert_true(((uint8_t *)kept.pixels)[i] == 7 || ((uint8_t *)kept.pixels)[i] == 250);
    texpatch_straight_free(straight);
}

/* ---- refusals, memory, cancelling -------------------------------------------------------- */

static void test_refused(void **state) {
    (void)state;
    const txm_image photo = new_image(64, 48, 3, TXM_U8), other = new_image(32, 48, 3, TXM_U8);
    const txm_image mask = new_mask(64, 48, 255), odd = new_mask(63, 48, 255);
    texpatch_straight_desc desc;
    texpatch_straight *straight = NULL;
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(&desc, 0, sizeof desc);
    assert_int_equal(texpatch_straight_find(NULL, &env, &straight), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_straight_find(&desc, &env, &straight), TXM_BAD_ARGUMENT);
    desc.photo = photo;
    assert_int_equal(texpatch_straight_find(&desc, &env, NULL), TXM_BAD_ARGUMENT);
    desc.mask = odd;
    assert_int_equal(texpatch_straight_find(&desc, &env, &straight), TXM_BAD_ARGUMENT);
    desc.mask = mask;
    desc.focal = -1;
    assert_int_equal(texpatch_straight_find(&desc, &env, &straight), TXM_BAD_ARGUMENT);
    desc.focal = 0;
    desc.whole = 2;
    assert_int_equal(texpatch_straight_find(&desc, &env, &straight), TXM_BAD_ARGUMENT);
    desc.whole = 0;
    assert_null(straight);
    assert_int_equal(texpatch_straight_find(&desc, &env, &straight), TXM_OK);
    const txm_image out = new_image(64, 48, 3, TXM_U8);
    assert_int_equal(texpatch_straight_draw(NULL, &photo, NULL, &env, &out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_straight_draw(straight, NULL, NULL, &env, &out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_straight_draw(straight, &photo, NULL, &env, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_straight_draw(straight, &other, NULL, &env, &out), TXM_BAD_ARGUMENT);
    assert_int_equal(texpatch_straight_draw(straight, &photo, NULL, &env, &other), TXM_BAD_ARGUMENT);
    assert_true(is_filled(&out) && is_filled(&other));
    double source[2];
    assert_int_equal(texpatch_straight_source(NULL, 0, 0, source), 0);
    assert_int_equal(texpatch_straight_source(straight, 0, 0, NULL), 0);
    assert_int_equal(texpatch_straight_found(NULL, NULL, NULL), 0);
    texpatch_straight_free(straight);
    texpatch_straight_free(NULL);
}

typedef struct finding {
    txm_image photo;
} finding;

static txm_status find_it(void *context, txm_env *env) {
    const finding *f = (const finding *)context;
    texpatch_straight_desc desc;
    texpatch_straight *straight;
    memset(&desc, 0, sizeof desc);
    desc.photo = f->photo;
    desc.whole = 1;
    const txm_status status = texpatch_straight_find(&desc, env, &straight);
    assert_true((status == TXM_OK) == (straight != NULL));
    texpatch_straight_free(straight);
    return status;
}

typedef struct drawing {
    texpatch_straight *straight;
    txm_image photo, out;
} drawing;

static txm_status draw_it(void *context, txm_env *env) {
    const drawing *d = (const drawing *)context;
    return texpatch_straight_draw(d->straight, &d->photo, NULL, env, &d->out);
}

static void test_sweep(void **state) {
    (void)state;
    tk_wide();
    const shot s = {20, 80, 10, 1, 0, 0, 0};
    finding f;
    f.photo = photograph(TILES, &s, 120, 80, 12);
    assert_true(tk_sweep(find_it, &f, TK_ALLOCATION) > 5);
    assert_true(tk_sweep(find_it, &f, TK_CANCEL) > 2);
    drawing d;
    int w, h;
    d.photo = f.photo;
    d.straight = find(&f.photo, NULL);
    assert_int_equal(texpatch_straight_found(d.straight, &w, &h), 1);
    d.out = new_image(w, h, 3, TXM_U8);
    assert_true(tk_sweep(draw_it, &d, TK_CANCEL) > 2);
    texpatch_straight_free(d.straight);
    /* a wall for which a field is fitted */
    const shot wavy = {0, 80, 0, 1, 0, 0, 0.03};
    f.photo = photograph(CLOTH, &wavy, 160, 120, 12);
    assert_true(tk_sweep(find_it, &f, TK_ALLOCATION) > 5);
}

/* ---- all tests -------------------------------------------------------------------------- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(test_wall, release_all),
        cmocka_unit_test_teardown(test_floor, release_all),
        cmocka_unit_test_teardown(test_turned, release_all),
        cmocka_unit_test_teardown(test_lens, release_all),
        cmocka_unit_test_teardown(test_wavy, release_all),
        cmocka_unit_test_teardown(test_whole, release_all),
        cmocka_unit_test_teardown(test_nothing, release_all),
        cmocka_unit_test_teardown(test_drawing, release_all),
        cmocka_unit_test_teardown(test_refused, release_all),
        cmocka_unit_test_teardown(test_sweep, release_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
