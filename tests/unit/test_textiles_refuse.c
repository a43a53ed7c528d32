/* test_textiles_refuse.c - making sets: bad input, failing memory, cancelling
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_textiles_refuse && build/tests/unit/test_textiles_refuse */
#define TEXTILES_MAX_PIXELS (1 << 22) /* so that too large ones are near */
#include "textiles.h"

#include "tilekit.h"

/* ---- tests: bad input ------------------------------------------------------------------------------ */

static void refuses(const textiles_desc *desc, txm_status expected, const char *what) {
    tk_memory memory = {0};
    tk_progress progress = {0};
    txm_env env = tk_env(&memory, &progress);
    textiles_set *set = (textiles_set *)&memory;
    const txm_status status = textiles_make(desc, &env, &set);
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    if (set) fail_msg("%s: *out is not NULL", what);
    if (!env.message[0]) fail_msg("%s: no message", what);
    assert_int_equal(tk_leaks(&memory), 0);
    set = (textiles_set *)&memory;
    assert_int_equal(textiles_make(desc, NULL, &set), expected);
    assert_null(set);
}

#define REFUSES(field, value, expected)             \
    do {                                            \
        textiles_desc d = good;                     \
        d.field = value;                            \
        refuses(&d, expected, #field " = " #value); \
    } while (0)

/* the same of the first exemplar, or its first map */
#define REFUSES_EXEMPLAR(e, field, value, expected)                   \
    do {                                                              \
        const textiles_exemplar keep = exemplars[e];                  \
        exemplars[e].field = value;                                   \
        refuses(&good, expected, "exemplar: " #field " = " #value);   \
        exemplars[e] = keep;                                          \
    } while (0)
#define REFUSES_MAP(m, field, value, expected)                \
    do {                                                      \
        const txm_image keep = maps[m];                       \
        maps[m].field = value;                                \
        refuses(&good, expected, "map: " #field " = " #value); \
        maps[m] = keep;                                       \
    } while (0)

static void test_bad_arguments(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64 * 4];
    static float floats[64 * 64];
    txm_image maps[4] = {view(pixels, 64, 64, 3, TXM_U8), view(floats, 64, 64, 1, TXM_F32),
                         view(pixels, 64, 64, 3, TXM_U8), view(floats, 64, 64, 1, TXM_F32)};
    textiles_exemplar exemplars[2] = {{maps, 2}, {maps + 2, 2}};
    textiles_desc good = desc_of(TEXTILES_WANG, exemplars, 2, 32);
    good.repair = TEXTILES_REPAIR_NONE;
    txm_env env = {0};
    assert_int_equal(textiles_make(&good, &env, NULL), TXM_BAD_ARGUMENT);
    assert_true(env.message[0] != 0);
    refuses(NULL, TXM_BAD_ARGUMENT, "desc NULL");

    REFUSES(kind, (textiles_kind)4, TXM_BAD_ARGUMENT);
    REFUSES(kind, (textiles_kind)-1, TXM_BAD_ARGUMENT);
    REFUSES(exemplars, NULL, TXM_BAD_ARGUMENT);
    REFUSES(exemplar_count, 0, TXM_BAD_ARGUMENT);
    REFUSES(exemplar_count, -1, TXM_BAD_ARGUMENT);
    REFUSES(exemplar_count, 9, TXM_BAD_ARGUMENT);
    REFUSES(size, 7, TXM_BAD_ARGUMENT);
    REFUSES(size, 1, TXM_BAD_ARGUMENT);
    REFUSES(size, -32, TXM_BAD_ARGUMENT);
    REFUSES(size, 1025, TXM_BAD_ARGUMENT);
    good.kind = TEXTILES_TRIANGLE;
    REFUSES(size, 31, TXM_BAD_ARGUMENT);
    good.kind = TEXTILES_WANG;
    REFUSES(size, INT_MAX, TXM_BAD_ARGUMENT);
    REFUSES(colors, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 5, TXM_BAD_ARGUMENT);
    REFUSES(colors, -2, TXM_BAD_ARGUMENT);
    REFUSES(variants, 17, TXM_BAD_ARGUMENT);
    REFUSES(variants, -1, TXM_BAD_ARGUMENT);
    REFUSES(repair, (textiles_repair)3, TXM_BAD_ARGUMENT);
    REFUSES(repair, (textiles_repair)-1, TXM_BAD_ARGUMENT);
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT);
    REFUSES(class_count, 2, TXM_BAD_ARGUMENT);
    {
        static const int wishes[][4] = {{0, 2}, {-1, 0}, {0, INT_MAX}};
        for (int i = 0; i < 3; i++) REFUSES(edge_exemplars, wishes[i], TXM_BAD_ARGUMENT);
    }

    /* exemplars and maps that do not go together */
    REFUSES_EXEMPLAR(0, maps, NULL, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(1, maps, NULL, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, 0, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, -1, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, 9, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, 1, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(1, map_count, 1, TXM_BAD_ARGUMENT);
    for (int m = 0; m < 4; m++) {
        REFUSES_MAP(m, pixels, NULL, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, width, 0, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, height, -64, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, width, INT_MAX, TXM_TOO_LARGE);
        REFUSES_MAP(m, height, TEXTILES_MAX_PIXELS / 64 + 1, TXM_TOO_LARGE);
        REFUSES_MAP(m, channels, -1, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, channels, 5, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, sample, (txm_sample)3, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, stride, 5, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, stride, PTRDIFF_MAX, TXM_TOO_LARGE);
    }
    REFUSES_MAP(1, width, 63, TXM_BAD_ARGUMENT);
    REFUSES_MAP(1, height, 63, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, height, 63, TXM_BAD_ARGUMENT);
    REFUSES_MAP(0, channels, 1, TXM_BAD_ARGUMENT); /* the second exemplar has 3 */
    REFUSES_MAP(2, channels, 4, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, channels, 2, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, sample, TXM_U8, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, sample, TXM_U16, TXM_BAD_ARGUMENT);
    REFUSES_MAP(1, pixels, (char *)floats + 2, TXM_BAD_ARGUMENT);

    static const float bad[] = {(float)NAN, (float)INFINITY, -(float)INFINITY};
    static const int places[] = {0, 63, 64, 2000, 4095};
    for (size_t i = 0; i < 3; i++) {
        for (size_t p = 0; p < sizeof places / sizeof *places; p++) {
            floats[places[p]] = bad[i];
            refuses(&good, TXM_BAD_ARGUMENT, "a sample that is not finite");
            floats[places[p]] = 0;
        }
    }

    /* sizes of the exemplars */
    for (int e = 0; e < 2; e++) {
        for (int low = 0; low < 2; low++) {
            txm_image keep[2] = {maps[2 * e], maps[2 * e + 1]};
            for (int m = 0; m < 2; m++) {
                if (low) maps[2 * e + m].height = 63;
                else maps[2 * e + m].width = 63;
            }
            refuses(&good, TXM_TOO_SMALL, "an exemplar of 63 pixels a side");
            for (int m = 0; m < 2; m++) maps[2 * e + m] = keep[m];
        }
    }
    for (int m = 0; m < 4; m++) {
        maps[m] = view(pixels, 64, TEXTILES_MAX_PIXELS / 2 / 64 + 1, 1, TXM_U8);
    }
    refuses(&good, TXM_TOO_LARGE, "two exemplars, too large together");

    /* and of the set */
    for (int m = 0; m < 4; m++) maps[m] = view(pixels, 64, 64, 1, TXM_U8);
    good.exemplar_count = 1;
    REFUSES(size, 1024, TXM_TOO_LARGE);
    good.variants = 16;
    REFUSES(size, 160, TXM_TOO_LARGE); /* one of them would do */
}

static void test_bad_kinds(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64];
    static int many[65][4];
    const int wishes[4] = {0, 0, 0, 0};
    const txm_image map = view(pixels, 64, 64, 1, TXM_U8);
    const textiles_exemplar exemplar = {&map, 1};
    textiles_desc good = desc_of(TEXTILES_CORNER, &exemplar, 1, 32);
    REFUSES(reduced, 1, TXM_BAD_ARGUMENT);
    REFUSES(edge_exemplars, wishes, TXM_BAD_ARGUMENT);
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT);
    REFUSES(colors, 1, TXM_BAD_ARGUMENT);
    good.kind = TEXTILES_TRIANGLE;
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT);
    REFUSES(class_count, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 5, TXM_BAD_ARGUMENT);

    good.kind = TEXTILES_FRAME;
    REFUSES(reduced, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 5, TXM_BAD_ARGUMENT);
    REFUSES(colors, -1, TXM_BAD_ARGUMENT);
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT); /* without class_count */
    REFUSES(class_count, 1, TXM_BAD_ARGUMENT);          /* without classes     */
    good.classes = common_classes;
    good.class_count = 5;
    REFUSES(colors, 2, TXM_BAD_ARGUMENT); /* they need three */
    good.colors = 4;
    for (int i = 0; i < 64; i++) {
        many[i][0] = i / 16;
        many[i][1] = i / 4 % 4;
        many[i][3] = i % 4;
    }
    many[64][2] = 1;
    good.classes = (const int(*)[4])many;
    good.class_count = 64;
    REFUSES(class_count, 65, TXM_BAD_ARGUMENT);
    REFUSES(class_count, -1, TXM_BAD_ARGUMENT);
    REFUSES(class_count, INT_MAX, TXM_BAD_ARGUMENT);
    for (int i = 0; i < 64; i += 63) {
        for (int k = 0; k < 4; k++) {
            const int keep = many[i][k];
            many[i][k] = 4;
            refuses(&good, TXM_BAD_ARGUMENT, "a class with a color too high");
            many[i][k] = -1;
            refuses(&good, TXM_BAD_ARGUMENT, "a class with a negative color");
            many[i][k] = keep;
        }
    }
    memcpy(many[63], many[7], sizeof many[7]);
    refuses(&good, TXM_BAD_ARGUMENT, "two equal classes");
}

/* ---- tests: memory and cancelling -------------------------------------------------------------------- */

static txm_status try_make(void *context, txm_env *env) {
    textiles_set *set = (textiles_set *)env;
    const txm_status status = textiles_make((const textiles_desc *)context, env, &set);
    if (status == TXM_OK) assert_non_null(set);
    else assert_null(set);
    textiles_set_free(set);
    return status;
}

static void sweep_memory(textiles_desc *d) {
    assert_true(tk_sweep(try_make, d, TK_ALLOCATION) > 19);
    assert_true(tk_sweep(try_make, d, TK_ONWARD) > 19);
}

static void test_failing(void **state) {
    (void)state;
    txm_image maps[4];
    draw_maps(CELLS, 64, 64, 64, maps);
    maps[3] = draw(BLOBS, 64, 64, 1, 64);
    const textiles_exemplar exemplars[2] = {{maps + 2, 1}, {maps + 2, 1}}, plain = {maps + 3, 1};
    textiles_desc d = desc_of(TEXTILES_FRAME, exemplars, 2, 32);
    d.colors = 1;
    sweep_memory(&d);
    d.exemplar_count = 1;
    d.variants = 9; /* more than are at work at a time */
    assert_true(tk_sweep(try_make, &d, TK_CANCEL) > 3);
    d = desc_of(TEXTILES_TRIANGLE, &plain, 1, 32);
    d.reduced = 1;
    sweep_memory(&d);
    d = desc_of(TEXTILES_CORNER, &plain, 1, 32);
    sweep_memory(&d);
    for (int m = 0; m < 4; m++) free(maps[m].pixels);
}

/* The head comment says how much memory making a set takes. */
static void test_peak_memory(void **state) {
    (void)state;
    tk_wide();
    static const int cases[][2] = {{32, 256}, {100, 64}}; /* tile, exemplar */
    for (int i = 0; i < 2; i++) {
        const int size = cases[i][0], n = cases[i][1];
        txm_image map = draw(CELLS, n, n, 3, 64);
        const textiles_exemplar exemplar = {&map, 1};
        textiles_desc d = desc_of(TEXTILES_FRAME, &exemplar, 1, size);
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        textiles_set *set = NULL;
        d.colors = 1;
        d.variants = i ? 8 : 1;
        assert_int_equal(textiles_make(&d, &env, &set), TXM_OK);
        if (getenv("TEXTILES_TEST_SHOW"))
            printf("# tiles %d, exemplar %d: %zu bytes kept, %zu at most\n", size, n,
                   memory.live_bytes, memory.peak_bytes);
        const size_t kept = (size_t)(d.variants * size * size) * (3 + 4);
        assert_true(memory.live_bytes >= kept && memory.live_bytes < kept + 4096);
        assert_true(memory.peak_bytes < kept + (size_t)(n * n) * (40 + 8 * 3) +
                                            (size_t)(d.variants * size * size) * 190 +
                                            (size_t)d.variants * (1 << 20));
        textiles_set_free(set);
        assert_int_equal(tk_leaks(&memory), 0);
        free(map.pixels);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bad_arguments),
        cmocka_unit_test(test_bad_kinds),
        cmocka_unit_test(test_failing),
        cmocka_unit_test(test_peak_memory),
    };
    return cmocka_run_group_tests_name("textiles_refuse", tests, NULL, NULL);
}
