/* test_texsyn_knit.c - joining two pictures: what lies outside the zone stays, the seam vanishes
   SPDX-License-Identifier: MIT OR Unlicense */
#include "synkit.h"

#include <math.h>

enum { SIDE = 72, ZONE = 3, MOST = SIDE * SIDE * 4, DARK = 90 };

static uint8_t pic_a[MOST], pic_b[MOST], layout[SIDE * SIDE], result[MOST], again[MOST];

/* ---- pictures ------------------------------------------------------------------------------------ */

/* Smooth clouds, dark or bright, in all channels; alpha is opaque. */
static void draw_clouds(uint8_t *p, int channels, int base, uint64_t seed) {
    static uint8_t plane[SIDE * SIDE];
    for (int c = 0; c < channels; c++) {
        draw_smooth(plane, SIDE, SIDE, seed + (uint64_t)c / 2);
        for (int i = 0; i < SIDE * SIDE; i++)
            p[i * channels + c] = (uint8_t)(c == 3 ? 255 : base + plane[i] / (3 + c));
    }
}

typedef int shape(int x, int y);

static int half(int x, int y) {
    (void)y;
    return x >= SIDE / 2;
}

static int wave(int x, int y) {
    return y > 36 + (int)(12 * sin(x / 9.0));
}

static int island(int x, int y) {
    return (x - 36) * (x - 36) + (y - 30) * (y - 30) < 18 * 18;
}

static int dot(int x, int y) {
    return x == 40 && y == 20;
}

static int checks(int x, int y) {
    return (x / 8 + y / 8) & 1;
}

static int dust(int x, int y) {
    return (x * 7 + y * 13) % 5 == 0;
}

static int corner(int x, int y) {
    return x < 5 && y < 5;
}

static shape *const shapes[] = {half, wave, island, dot, checks, dust, corner};
enum { SHAPES = sizeof shapes / sizeof *shapes };

static void draw_layout(shape *is_b) {
    for (int i = 0; i < SIDE * SIDE; i++) layout[i] = is_b(i % SIDE, i / SIDE) ? 255 : 0;
}

static texsyn_knit_desc knit_desc(int channels) {
    texsyn_knit_desc d;
    memset(&d, 0, sizeof d);
    d.a = view_bytes(pic_a, SIDE, SIDE, channels);
    d.b = view_bytes(pic_b, SIDE, SIDE, channels);
    d.layout = view_bytes(layout, SIDE, SIDE, 1);
    d.quality = -2;
    d.zone = ZONE;
    return d;
}

/* Two pictures that differ. */
static texsyn_knit_desc two(int channels, shape *is_b) {
    draw_clouds(pic_a, channels, 10, 3);
    draw_clouds(pic_b, channels, 10 + DARK, 50);
    draw_layout(is_b);
    return knit_desc(channels);
}

static void knit(const texsyn_knit_desc *desc, txm_image out) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    const txm_status status = texsyn_knit(desc, &env, out);
    if (status != TXM_OK) fail_msg("knit: %d, %s", status, env.message);
    assert_int_equal(progress.errors, 0);
}

/* ---- what stays ------------------------------------------------------------------------------------ */

/* Is a pixel farther than this from all pixels of the other label? */
static int is_deep(int x, int y, double far_) {
    const int r = (int)ceil(far_);
    for (int v = y - r; v <= y + r; v++)
        for (int u = x - r; u <= x + r; u++)
            if (u >= 0 && v >= 0 && u < SIDE && v < SIDE &&
                layout[v * SIDE + u] != layout[y * SIDE + x] &&
                (u - x) * (u - x) + (v - y) * (v - y) <= far_ * far_)
                return 0;
    return 1;
}

/* Beyond the reach of the displacement and the zone the layout is obeyed, to the byte. Returns how many
   pixels that are. */
static int check_outside(int channels, double reach) {
    int count = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const uint8_t *from = layout[i] ? pic_b : pic_a;
        if (!is_deep(i % SIDE, i / SIDE, reach)) continue;
        assert_memory_equal(result + i * channels, from + i * channels, (size_t)channels);
        count++;
    }
    return count;
}

static void check_shape(shape *is_b, int channels, float roughness, texsyn_likeness likeness) {
    const double moved = roughness > 0 ? 2.5 * (double)roughness : 0;
    texsyn_knit_desc d = two(channels, is_b);
    d.roughness = roughness;
    d.likeness = likeness;
    knit(&d, view_bytes(result, SIDE, SIDE, channels));
    /* distances are measured by steps, which are up to 4 % off */
    const int count = check_outside(channels, (moved + ZONE + 2) * 1.05);
    if (is_b == half || is_b == island) assert_true(count > SIDE * SIDE / 8);
    for (int i = 0; i < SIDE * SIDE && channels == 4; i++) assert_int_equal(result[4 * i + 3], 255);
}

static void test_outside(void **state) {
    (void)state;
    tk_wide();
    for (int i = 0; i < SHAPES; i++) check_shape(shapes[i], 3, 3.0f, TEXSYN_LIKENESS_DIFFERENT);
    check_shape(wave, 1, 2.0f, TEXSYN_LIKENESS_DIFFERENT);
    check_shape(island, 4, 2.0f, TEXSYN_LIKENESS_DIFFERENT);
    check_shape(half, 3, -1.0f, TEXSYN_LIKENESS_DIFFERENT);
    check_shape(half, 3, 3.0f, TEXSYN_LIKENESS_SAME);
    check_shape(island, 4, 2.0f, TEXSYN_LIKENESS_SAME);
    check_shape(wave, 1, -1.0f, TEXSYN_LIKENESS_SAME);
    check_shape(dot, 3, 3.0f, TEXSYN_LIKENESS_SAME);
}

/* Every pixel is like one of the two sides, and the zone as drawn has the right one. */
static void test_sides(void **state) {
    (void)state;
    texsyn_knit_desc d = two(1, half);
    int wrong = 0;
    d.roughness = -1;
    knit(&d, view_bytes(result, SIDE, SIDE, 1));
    for (int i = 0; i < SIDE * SIDE; i++) wrong += (result[i] > 97) != half(i % SIDE, i / SIDE);
    assert_in_range(wrong, 0, SIDE);
}

/* A border is displaced by what was asked for: the wider, the more pixels change sides. */
static void test_roughness(void **state) {
    (void)state;
    int changed[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        texsyn_knit_desc d = two(1, half);
        d.roughness = k == 0 ? -1.0f : k == 1 ? 2.0f : 8.0f;
        d.zone = 1;
        knit(&d, view_bytes(result, SIDE, SIDE, 1));
        for (int i = 0; i < SIDE * SIDE; i++)
            changed[k] += (result[i] > 97) != half(i % SIDE, i / SIDE);
    }
    assert_true(changed[0] < SIDE / 4);
    assert_between(changed[1], SIDE, SIDE * 4);
    assert_between(changed[2], SIDE * 3, SIDE * 14);
}

/* ---- no seam --------------------------------------------------------------------------------------- */

/* Mean difference of neighbours that lie across the line, or elsewhere. */
static double gradient(const uint8_t *p, int across) {
    double sum = 0, count = 0;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE - 1; x++) {
            if ((x == SIDE / 2 - 1) != across) continue;
            sum += abs(p[y * SIDE + x] - p[y * SIDE + x + 1]);
            count++;
        }
    }
    return sum / count;
}

/* Two pieces of one texture: no seam where the line was drawn, whether it moves or not. */
static void test_no_seam(void **state) {
    (void)state;
    for (int moves = 0; moves < 2; moves++) {
        draw_smooth(pic_a, SIDE, SIDE, 5);
        draw_smooth(pic_b, SIDE, SIDE, 77);
        draw_layout(half);
        texsyn_knit_desc d = knit_desc(1);
        d.roughness = moves ? 0.0f : -1.0f;
        d.quality = 0;
        d.zone = moves ? 0 : 5;
        knit(&d, view_bytes(result, SIDE, SIDE, 1));
        assert_between(gradient(result, 1) / gradient(result, 0), 0.6, 1.25);
    }
}

/* The edges of the zone do not show: where known and new pixels meet, neighbours differ as elsewhere. */
static void test_no_edge_of_zone(void **state) {
    (void)state;
    enum { WIDE = 6 };
    texsyn_knit_desc d = two(1, half);
    double at[2] = {0, 0}, count[2] = {0, 0};
    d.roughness = -1;
    d.quality = 0;
    d.zone = WIDE;
    knit(&d, view_bytes(result, SIDE, SIDE, 1));
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE - 1; x++) {
            const int is_rim = x == SIDE / 2 - WIDE - 1 || x == SIDE / 2 + WIDE - 1;
            if (x == SIDE / 2 - 1) continue;
            at[is_rim] += abs(result[y * SIDE + x] - result[y * SIDE + x + 1]);
            count[is_rim]++;
        }
    }
    assert_between(at[1] / count[1] / (at[0] / count[0]), 0.6, 1.25);
}

/* ---- an example of a border ---------------------------------------------------------------------------- */

/* Two materials of three levels each, and examples in which the dark level, or the bright one, of the
   first always lies at the border: the zone follows the example. */
static double first_at_border(int level) {
    static uint8_t example[SIDE * SIDE], where[SIDE * SIDE];
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int x = i % SIDE, y = i / SIDE;
        pic_a[i] = (uint8_t)(20 + 40 * (at_random(x, y, 1) % 3));
        pic_b[i] = (uint8_t)(160 + 40 * (at_random(x, y, 2) % 3));
        where[i] = x / 9 % 2 ? 255 : 0;
        example[i] = where[i] ? pic_b[i] : pic_a[i];
        if (!where[i] && (x % 9 == 0 || x % 9 == 8)) example[i] = (uint8_t)(20 + 40 * level);
    }
    draw_layout(half);
    texsyn_knit_desc d = knit_desc(1);
    d.roughness = -1;
    d.quality = 0;
    d.border = view_bytes(example, SIDE, SIDE, 1);
    d.border_layout = view_bytes(where, SIDE, SIDE, 1);
    knit(&d, view_bytes(result, SIDE, SIDE, 1));
    for (int y = 0; y < SIDE; y++) sum += result[y * SIDE + SIDE / 2 - 1];
    return sum / SIDE;
}

static void test_example(void **state) {
    (void)state;
    const double dark = first_at_border(0), bright = first_at_border(2);
    assert_true(bright > dark + 25);
}

/* ---- formats --------------------------------------------------------------------------------------------- */

/* 16 bits and floats, bottom-up and with gaps between the rows, give the same picture. */
static void test_formats(void **state) {
    (void)state;
    enum { ROW = SIDE * 3 + 5 };
    static uint16_t words[2][SIDE * SIDE * 3], words_out[SIDE * SIDE * 3];
    static float floats[2][SIDE * ROW], floats_out[SIDE * SIDE * 3];
    texsyn_knit_desc d = two(3, wave);
    knit(&d, view_bytes(result, SIDE, SIDE, 3));
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < SIDE * SIDE * 3; i++) {
            const uint8_t v = (k ? pic_b : pic_a)[i];
            words[k][i] = (uint16_t)(v * 257);
            floats[k][(SIDE - 1 - i / (SIDE * 3)) * ROW + i % (SIDE * 3)] = (float)v / 255.0f;
        }
    }
    d.a = view_words(words[0], SIDE, SIDE, 3);
    d.b = view_words(words[1], SIDE, SIDE, 3);
    knit(&d, view_words(words_out, SIDE, SIDE, 3));
    d.a = view_float(floats[0] + (SIDE - 1) * ROW, SIDE, SIDE, 3);
    d.b = view_float(floats[1] + (SIDE - 1) * ROW, SIDE, SIDE, 3);
    d.a.stride = d.b.stride = -(ptrdiff_t)(ROW * sizeof(float));
    knit(&d, view_float(floats_out, SIDE, SIDE, 3));
    for (int i = 0; i < SIDE * SIDE * 3; i++) {
        assert_near(words_out[i] / 257.0, result[i], 1.01);
        assert_near((double)floats_out[i] * 255, result[i], 1.01);
    }
}

/* Colours under transparent pixels make no difference. */
static void test_alpha(void **state) {
    (void)state;
    texsyn_knit_desc d = two(4, wave);
    for (int i = 0; i < SIDE * SIDE; i++)
        if (i / 3 % 5 == 0) pic_a[4 * i + 3] = pic_b[4 * ((i * 7) % (SIDE * SIDE)) + 3] = 0;
    for (int alike = 0; alike < 2; alike++) {
        d.likeness = alike ? TEXSYN_LIKENESS_SAME : TEXSYN_LIKENESS_DIFFERENT;
        knit(&d, view_bytes(result, SIDE, SIDE, 4));
        for (int i = 0; i < SIDE * SIDE; i++) {
            if (pic_a[4 * i + 3] == 0) memset(pic_a + 4 * i, i * 5, 3);
            if (pic_b[4 * i + 3] == 0) memset(pic_b + 4 * i, i * 3, 3);
        }
        knit(&d, view_bytes(again, SIDE, SIDE, 4));
        for (int i = 0; i < SIDE * SIDE; i++) {
            assert_int_equal(result[4 * i + 3], again[4 * i + 3]);
            if (result[4 * i + 3])
                assert_memory_equal(result + 4 * i, again + 4 * i, 4);
        }
    }
    for (int i = 0; i < SIDE * SIDE; i++) pic_a[4 * i + 3] = pic_b[4 * i + 3] = 0;
    d.likeness = TEXSYN_LIKENESS_DIFFERENT;
    knit(&d, view_bytes(result, SIDE, SIDE, 4));
    for (int i = 0; i < SIDE * SIDE; i++) assert_int_equal(result[4 * i + 3], 0);
}

/* A smaller picture goes on reflected; a larger one is cut off. */
static void test_other_size(void **state) {
    (void)state;
    enum { SMALL = 29 };
    static uint8_t small[SMALL * SMALL];
    texsyn_knit_desc d = two(1, half);
    d.roughness = -1; /* else the border depends on what would lie beyond the picture */
    for (int i = 0; i < SMALL * SMALL; i++) small[i] = pic_b[i / SMALL * SIDE + i % SMALL];
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int u = i % SIDE % (2 * SMALL), v = i / SIDE % (2 * SMALL);
        pic_b[i] = small[(v < SMALL ? v : 2 * SMALL - 1 - v) * SMALL +
                         (u < SMALL ? u : 2 * SMALL - 1 - u)];
    }
    knit(&d, view_bytes(result, SIDE, SIDE, 1));
    d.b = view_bytes(small, SMALL, SMALL, 1);
    knit(&d, view_bytes(again, SIDE, SIDE, 1));
    assert_memory_equal(result, again, SIDE * SIDE);
}

/* Pictures of one colour. */
static void test_constant(void **state) {
    (void)state;
    texsyn_knit_desc d = two(3, wave);
    memset(pic_a, 40, sizeof pic_a);
    memset(pic_b, 200, sizeof pic_b);
    knit(&d, view_bytes(result, SIDE, SIDE, 3));
    for (int i = 0; i < SIDE * SIDE * 3; i++)
        assert_true(abs(result[i] - 40) <= 1 || abs(result[i] - 200) <= 1);
    memset(pic_b, 40, sizeof pic_b);
    knit(&d, view_bytes(result, SIDE, SIDE, 3));
    for (int i = 0; i < SIDE * SIDE * 3; i++) assert_near(result[i], 40, 1);
}

/* Larger than a window. */
static void test_long(void **state) {
    (void)state;
    enum { WIDE = 600, HIGH = 48 };
    static uint8_t a[WIDE * HIGH], b[WIDE * HIGH], l[WIDE * HIGH], out[WIDE * HIGH];
    draw_smooth(a, WIDE, HIGH, 3);
    draw_smooth(b, WIDE, HIGH, 4);
    for (int i = 0; i < WIDE * HIGH; i++) {
        a[i] = (uint8_t)(a[i] / 3);
        b[i] = (uint8_t)(120 + b[i] / 3);
        l[i] = i / WIDE >= HIGH / 2 ? 255 : 0;
    }
    texsyn_knit_desc d = knit_desc(1);
    d.a = view_bytes(a, WIDE, HIGH, 1);
    d.b = view_bytes(b, WIDE, HIGH, 1);
    d.layout = view_bytes(l, WIDE, HIGH, 1);
    d.roughness = 2;
    for (int alike = 0; alike < 2; alike++) {
        d.likeness = alike ? TEXSYN_LIKENESS_SAME : TEXSYN_LIKENESS_DIFFERENT;
        knit(&d, view_bytes(out, WIDE, HIGH, 1));
        assert_memory_equal(out, a, WIDE * 10);
        assert_memory_equal(out + WIDE * (HIGH - 10), b + WIDE * (HIGH - 10), WIDE * 10);
        assert_memory_not_equal(out, a, WIDE * HIGH / 2);
    }
}

/* Order of tasks, threads and buffers make no difference; seeds do. */
static void test_same_bytes(void **state) {
    (void)state;
    tk_wide();
    texsyn_knit_desc d = two(3, wave);
    for (int alike = 0; alike < 2; alike++) {
        d.likeness = alike ? TEXSYN_LIKENESS_SAME : TEXSYN_LIKENESS_DIFFERENT;
        d.seed = 0;
        knit(&d, view_bytes(result, SIDE, SIDE, 3));
        for (int threads = 0; threads <= 4; threads += 2) {
            txm_env env;
            int count = threads;
            memset(&env, 0, sizeof env);
            env.parallel_for = threads ? tk_parallel_threads : tk_parallel_reverse;
            env.parallel_user = &count;
            assert_int_equal(texsyn_knit(&d, &env, view_bytes(again, SIDE, SIDE, 3)), TXM_OK);
            assert_memory_equal(again, result, SIDE * SIDE * 3);
        }
        for (int k = 0; k < 2; k++) { /* in place */
            texsyn_knit_desc in_place = d;
            memcpy(again, k ? pic_b : pic_a, sizeof again);
            *(k ? &in_place.b : &in_place.a) = view_bytes(again, SIDE, SIDE, 3);
            knit(&in_place, view_bytes(again, SIDE, SIDE, 3));
            assert_memory_equal(again, result, SIDE * SIDE * 3);
        }
        d.seed = 1;
        knit(&d, view_bytes(again, SIDE, SIDE, 3));
        assert_memory_not_equal(again, result, SIDE * SIDE * 3);
    }
}

/* ---- what is refused ---------------------------------------------------------------------------------------- */

static void refuses(txm_status expected, const char *word, const texsyn_knit_desc *d,
                    txm_image out) {
    static uint8_t before[MOST];
    txm_env env;
    memset(&env, 0, sizeof env);
    if (out.pixels) memcpy(before, out.pixels, SIDE * SIDE);
    assert_int_equal(texsyn_knit(d, &env, out), expected);
    if (!strstr(env.message, word)) fail_msg("'%s' lacks '%s'", env.message, word);
    if (out.pixels) assert_memory_equal(before, out.pixels, SIDE * SIDE);
}

static void test_bad_arguments(void **state) {
    (void)state;
    static float floats[SIDE * SIDE];
    const txm_image out = view_bytes(result, SIDE, SIDE, 1);
    const texsyn_knit_desc good = two(1, half);
    texsyn_knit_desc d = good;
    refuses(TXM_BAD_ARGUMENT, "desc is NULL", NULL, out);
    d.a.pixels = NULL;
    refuses(TXM_BAD_ARGUMENT, "a: pixels", &d, out);
    d = good, d.b.pixels = NULL;
    refuses(TXM_BAD_ARGUMENT, "b: pixels", &d, out);
    d = good, d.a.channels = 2;
    refuses(TXM_BAD_ARGUMENT, "a: 2 channels", &d, out);
    d = good, d.b.channels = 3, d.b.width = d.b.height = 40;
    refuses(TXM_BAD_ARGUMENT, "b: must have the channels", &d, out);
    d = good, d.b.width = 15;
    refuses(TXM_TOO_SMALL, "b: must be 16 x 16", &d, out);
    d = good, d.a.height = 15;
    refuses(TXM_TOO_SMALL, "a: must be 16 x 16", &d, out);
    d = good, d.layout.pixels = NULL;
    refuses(TXM_BAD_ARGUMENT, "layout: pixels", &d, out);
    d = good, d.layout.width--;
    refuses(TXM_BAD_ARGUMENT, "layout: is 71 x 72 pixels", &d, out);
    d = good, d.layout.sample = TXM_F32, d.layout.pixels = floats, floats[77] = NAN;
    refuses(TXM_BAD_ARGUMENT, "layout: samples must be finite", &d, out);
    floats[77] = 0;
    for (int k = 0; k < 2; k++) {
        d = good, d.zone = k ? 65 : -1;
        refuses(TXM_BAD_ARGUMENT, "zone", &d, out);
        d = good, d.quality = k ? 3 : -3;
        refuses(TXM_BAD_ARGUMENT, "quality", &d, out);
        d = good, d.roughness = k ? 33.0f : (float)NAN;
        refuses(TXM_BAD_ARGUMENT, "roughness", &d, out);
    }
    d = good, d.likeness = (texsyn_likeness)3;
    refuses(TXM_BAD_ARGUMENT, "likeness", &d, out);
    refuses(TXM_BAD_ARGUMENT, "out: pixels", &good, view_bytes(NULL, SIDE, SIDE, 1));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_bytes(result, SIDE - 1, SIDE, 1));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_bytes(result, SIDE, SIDE, 3));
    refuses(TXM_BAD_ARGUMENT, "out", &good, view_float(floats, SIDE, SIDE, 1));
    d = good, d.b = view_float(floats, SIDE, SIDE, 1);
    refuses(TXM_BAD_ARGUMENT, "b: must have the channels and samples", &d, out);
    d.a = d.b;
    floats[5] = (float)NAN;
    refuses(TXM_BAD_ARGUMENT, "not finite", &d, view_float(floats, SIDE, SIDE, 1));
}

static void test_bad_layouts(void **state) {
    (void)state;
    static uint8_t where[SIDE * SIDE];
    const txm_image out = view_bytes(result, SIDE, SIDE, 1);
    texsyn_knit_desc d = two(1, half);
    d.border = d.a;
    refuses(TXM_BAD_ARGUMENT, "border_layout: pixels", &d, out);
    d.border_layout = view_bytes(where, SIDE, SIDE, 1);
    refuses(TXM_TOO_SMALL, "border_layout: its border is shorter than 64", &d, out);
    d.border_layout.width--;
    refuses(TXM_BAD_ARGUMENT, "border_layout: is 71 x 72 pixels", &d, out);
    d.border.channels = 3, d.border.width = d.border.height = 20;
    refuses(TXM_BAD_ARGUMENT, "border: must have the channels", &d, out);
    d.border.width = 8;
    refuses(TXM_TOO_SMALL, "border: must be 16 x 16", &d, out);
    d.border.pixels = NULL;
    memset(layout, 127, sizeof layout);
    refuses(TXM_BAD_ARGUMENT, "layout: is all black", &d, out);
    memset(layout, 128, sizeof layout);
    refuses(TXM_BAD_ARGUMENT, "layout: is all white", &d, out);
    draw_layout(half);
    d.zone = 64;
    d.likeness = TEXSYN_LIKENESS_SAME;
    refuses(TXM_TOO_SMALL, "256", &d, out);
    d.likeness = TEXSYN_LIKENESS_DIFFERENT; /* these are learned from the pictures beneath */
    knit(&d, out);
}

/* ---- memory and cancelling --------------------------------------------------------------------------------- */

static txm_status try_knit(void *context, txm_env *env) {
    memset(result, FILL, 40 * 36 * 3);
    const txm_status status =
        texsyn_knit((const texsyn_knit_desc *)context, env, view_bytes(result, 40, 36, 3));
    for (int i = 0; i < 40 * 36 * 3 && status != TXM_OK; i++) assert_int_equal(result[i], FILL);
    return status;
}

static void test_failing(void **state) {
    (void)state;
    static uint8_t stripes[40 * 36];
    texsyn_knit_desc d = two(3, half);
    d.a = view_bytes(pic_a, 40, 36, 3);
    d.b = view_bytes(pic_b, 40, 36, 3);
    for (int i = 0; i < 40 * 36; i++) {
        layout[i] = i % 40 >= 20 ? 255 : 0;
        stripes[i] = i % 40 / 10 % 2 ? 255 : 0;
    }
    d.layout = view_bytes(layout, 40, 36, 1);
    d.roughness = 1;
    for (int k = 0; k < 3; k++) {
        d.likeness = k == 1 ? TEXSYN_LIKENESS_SAME : TEXSYN_LIKENESS_DIFFERENT;
        if (k == 2) d.border = d.a, d.border_layout = view_bytes(stripes, 40, 36, 1);
        assert_true(tk_sweep(try_knit, &d, TK_ALLOCATION) > 20);
        assert_true(tk_sweep(try_knit, &d, TK_ONWARD) > 20);
        assert_true(tk_sweep(try_knit, &d, TK_CANCEL) > 5);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_outside),       cmocka_unit_test(test_sides),
        cmocka_unit_test(test_roughness),     cmocka_unit_test(test_no_seam),
        cmocka_unit_test(test_no_edge_of_zone), cmocka_unit_test(test_example),
        cmocka_unit_test(test_formats),       cmocka_unit_test(test_alpha),
        cmocka_unit_test(test_other_size),    cmocka_unit_test(test_constant),
        cmocka_unit_test(test_long),          cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_bad_arguments), cmocka_unit_test(test_bad_layouts),
        cmocka_unit_test(test_failing),
    };
    return cmocka_run_group_tests_name("texsyn_knit", tests, NULL, NULL);
}
