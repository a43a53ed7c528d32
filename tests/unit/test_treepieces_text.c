/* test_treepieces_text.c - species as text, presets, the ranges of fields
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_treepieces_text && build/tests/unit/test_treepieces_text

   Reads the part of the library itself, to see what is private to it.                           */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "treepieces/text.h"

#include "testkit.h"

#include <locale.h>

enum { ROOM = 16384, FILL = 0x5c };

static txm_status parse(const char *text, txm_env *env, treepieces_species *species) {
    return treepieces_species_parse(text, strlen(text), env, species);
}

/* Parse an invalid text: the status, the message, the species untouched. */
static void assert_bad(const char *text, size_t size, const char *message) {
    treepieces_species species, before;
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(&species, FILL, sizeof species);
    before = species;
    const txm_status status = treepieces_species_parse(text, size, &env, &species);
    if (status != TXM_BAD_DATA) fail_msg("\"%.60s\" gave status %d", text, status);
    if (strcmp(env.message, message) != 0)
        fail_msg("\"%.60s\" gave the message\n\"%s\", not\n\"%s\"", text, env.message, message);
    assert_memory_equal(&species, &before, sizeof species);
    assert_int_equal(treepieces_species_parse(text, size, NULL, &species), TXM_BAD_DATA);
}

/* Printed and parsed again it is the same. */
static void assert_round_trip(const treepieces_species *species) {
    static char text[ROOM];
    treepieces_species back;
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(&back, FILL, sizeof back);
    const size_t length = treepieces_species_print(species, text, sizeof text);
    assert_true(length < sizeof text);
    assert_int_equal(strlen(text), length);
    if (treepieces_species_parse(text, length, &env, &back) != TXM_OK)
        fail_msg("%s in\n%s", env.message, text);
    assert_memory_equal(species, &back, sizeof back);
}

/* ---- presets ---------------------------------------------------------------------------- */

static void every_preset_is_read(void **state) {
    (void)state;
    static const char *const wanted[] = {"oak",    "beech", "maple", "birch",  "poplar",
                                         "willow", "almond", "pine",  "spruce", "dead"};
    txm_env env;
    memset(&env, 0, sizeof env);
    assert_true(treepieces_preset_count() >= (int)(sizeof wanted / sizeof wanted[0]));
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
        treepieces_species species;
        memset(&species, FILL, sizeof species);
        assert_int_equal(treepieces_preset(wanted[i], &env, &species), TXM_OK);
        assert_string_equal(species.name, wanted[i]);
        assert_int_equal(tpc_species_check(&species, &env), TXM_OK);
        assert_true(species.orders[0].length > 3 && species.orders[0].length < 40);
        assert_int_equal(species.leaf_count == 0, !strcmp(wanted[i], "dead"));
        assert_round_trip(&species);
    }
    for (int i = 0; i < treepieces_preset_count(); i++) {
        treepieces_species species, by_name;
        assert_non_null(treepieces_preset_text(i));
        assert_int_equal(parse(treepieces_preset_text(i), &env, &species), TXM_OK);
        assert_int_equal(treepieces_preset(species.name, NULL, &by_name), TXM_OK);
        assert_memory_equal(&species, &by_name, sizeof species);
    }
    assert_null(treepieces_preset_text(-1));
    assert_null(treepieces_preset_text(treepieces_preset_count()));
}

static void an_unknown_preset_names_the_others(void **state) {
    (void)state;
    treepieces_species species, before;
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(&species, FILL, sizeof species);
    before = species;
    assert_int_equal(treepieces_preset("fern", &env, &species), TXM_BAD_ARGUMENT);
    assert_non_null(strstr(env.message, "no species \"fern\""));
    for (int i = 0; i < treepieces_preset_count(); i++) {
        treepieces_species s;
        assert_int_equal(parse(treepieces_preset_text(i), NULL, &s), TXM_OK);
        assert_non_null(strstr(env.message, s.name));
    }
    assert_int_equal(treepieces_preset(NULL, &env, &species), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_preset("oak", &env, NULL), TXM_BAD_ARGUMENT);
    assert_memory_equal(&species, &before, sizeof species);
}

/* ---- text ------------------------------------------------------------------------------- */

static void a_short_text_is_a_species(void **state) {
    (void)state;
    treepieces_species species;
    txm_env env;
    memset(&env, 0, sizeof env);
    assert_int_equal(treepieces_species_parse(NULL, 0, &env, &species), TXM_OK);
    assert_int_equal(tpc_species_check(&species, &env), TXM_OK);
    assert_true(species.order_count >= 2);
    assert_int_equal(parse("name bush\norder 0\nlength 3\norder 4\nlength 0.25", &env, &species),
                     TXM_OK);
    assert_int_equal(species.order_count, 5);
    assert_true(species.orders[0].length == 3 && species.orders[4].length == 0.25f);
    assert_true(species.orders[3].segments >= 1);
    assert_int_equal(tpc_species_check(&species, &env), TXM_OK);
    assert_round_trip(&species);
}

static void blanks_comments_and_line_ends(void **state) {
    (void)state;
    treepieces_species a, b;
    assert_int_equal(parse("name grey alder\nflare 2\nenvelope cone\norder 1\nprofile 1 2 3\n"
                           "sag -1.5e1\n", NULL, &a), TXM_OK);
    assert_string_equal(a.name, "grey alder");
    assert_int_equal(a.envelope, TREEPIECES_CONE);
    assert_true(a.orders[1].profile[2] == 3 && a.orders[1].sag == -15);
    assert_int_equal(parse("# a tree\r\n\r\n  name \t grey alder  \r\nflare +2.0 # wide\r\n\n"
                           "envelope cone#\r\n \t \r\norder 1\r\n\tprofile 1 2. 3e0\r\n"
                           "sag -.15E+02", NULL, &b), TXM_OK);
    assert_memory_equal(&a, &b, sizeof a);
    assert_int_equal(parse("\xef\xbb\xbfname grey alder\rflare 2\renvelope cone\r\rorder 1\r"
                           "profile 1 2 3\rsag -15\r", NULL, &b), TXM_OK);
    assert_memory_equal(&a, &b, sizeof a);
    assert_int_equal(parse("\xef\xbb\xbf", NULL, &a), TXM_OK);
    assert_int_equal(parse("", NULL, &b), TXM_OK);
    assert_memory_equal(&a, &b, sizeof a);
}

static void like_starts_from_a_preset(void **state) {
    (void)state;
    treepieces_species oak, mine;
    assert_int_equal(treepieces_preset("oak", NULL, &oak), TXM_OK);
    assert_int_equal(parse("# mine\nlike oak\n", NULL, &mine), TXM_OK);
    assert_memory_equal(&oak, &mine, sizeof oak);
    assert_int_equal(parse("like oak\nname holm\norder 1\nsag 7\n", NULL, &mine), TXM_OK);
    memset(oak.name, 0, sizeof oak.name);
    memcpy(oak.name, "holm", 4);
    oak.orders[1].sag = 7;
    assert_memory_equal(&oak, &mine, sizeof oak);
    assert_int_equal(parse("like oak\norder_count 2\nname x", NULL, &mine), TXM_OK);
    assert_int_equal(mine.order_count, 2);
    treepieces_order none;
    memset(&none, 0, sizeof none);
    assert_memory_equal(&mine.orders[2], &none, sizeof none);
    assert_round_trip(&mine);
}

static void every_fault_has_its_message(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } bad[] = {
        {"colour 1", "line 1: unknown key 'colour'; did you mean 'cloud'?"},
        {"name x\n\n# y\nflair 1", "line 4: unknown key 'flair'; did you mean 'flare'?"},
        {"name x\r\r\n\rheight 9", "line 4: unknown key 'height'"},
        {"\xef\xbb\xbfname x\nleaf-colour 1 1 1",
         "line 2: unknown key 'leaf-colour'; did you mean 'leaf_color'?"},
        {"order 0\nsegment 1", "line 2: unknown key 'segment'; did you mean 'segments'?"},
        {"Like oak", "line 1: unknown key 'Like'; did you mean 'like'?"},
        {"name x\n\xef\xbb\xbf", "line 2: unknown key '???'"},
        {"\xff\xfen", "line 1: the text is UTF-16; save it as UTF-8"},
        {"\xfe\xff", "line 1: the text is UTF-16; save it as UTF-8"},
        {"flare", "line 1: flare: a value is missing"},
        {"name", "line 1: name: a value is missing"},
        {"name # oak", "line 1: name: a value is missing"},
        {"like", "line 1: like: a value is missing"},
        {"order", "line 1: order: a value is missing"},
        {"envelope # none", "line 1: envelope: a value is missing"},
        {"leaf_color 0.1 0.2", "line 1: leaf_color: a value is missing"},
        {"leaf_color 0.1 0.2 0.3 0.4", "line 1: leaf_color: has too many values"},
        {"flare 1 2", "line 1: flare: has too many values"},
        {"order 1 2", "line 1: order: has too many values"},
        {"like oak tree", "line 1: like: has too many values"},
        {"flare wide", "line 1: wide: is not a number"},
        {"flare 1,5", "line 1: 1,5: is not a number"},
        {"flare 0x2", "line 1: 0x2: is not a number"},
        {"flare nan", "line 1: nan: is not a number"},
        {"flare inf", "line 1: inf: is not a number"},
        {"flare 1e", "line 1: 1e: is not a number"},
        {"flare 1e+", "line 1: 1e+: is not a number"},
        {"flare .", "line 1: .: is not a number"},
        {"flare -", "line 1: -: is not a number"},
        {"flare 1.2.3", "line 1: 1.2.3: is not a number"},
        {"flare 0.5", "line 1: 0.5: flare must be 1 to 4"},
        {"flare -2", "line 1: -2: flare must be 1 to 4"},
        {"flare 1e999999999999", "line 1: 1e999999999999: flare must be 1 to 4"},
        {"flare 1e-999999999999", "line 1: 1e-999999999999: flare must be 1 to 4"},
        {"leaf_count 2.5", "line 1: 2.5: leaf_count must be a whole number of 0 to 256"},
        {"leaf_count 257", "line 1: 257: leaf_count must be a whole number of 0 to 256"},
        {"order_count 0", "line 1: 0: order_count must be a whole number of 1 to 5"},
        {"order 5", "line 1: 5: order must be a whole number of 0 to 4"},
        {"order -1", "line 1: -1: order must be a whole number of 0 to 4"},
        {"order 0.5", "line 1: 0.5: order must be a whole number of 0 to 4"},
        {"order two", "line 1: two: is not a number"},
        {"order 0\nsag 361", "line 2: 361: sag must be -360 to 360"},
        {"sag 3", "line 1: sag: needs a line \"order N\" before it"},
        {"like oak\nsag 3", "line 2: sag: needs a line \"order N\" before it"},
        {"envelope 1", "line 1: 1: envelope must be one of free ellipsoid cone cylinder"},
        {"envelope Cone", "line 1: Cone: envelope must be one of free ellipsoid cone cylinder"},
        {"leaf_shape fern",
         "line 1: fern: leaf_shape must be one of oval lobed lance heart needle blossom palmate "
         "compound"},
        {"cloud_kind ball", "line 1: ball: cloud_kind must be one of round layers shoots strips"},
        {"bark_kind cork",
         "line 1: cork: bark_kind must be one of furrowed smooth lenticels plates"},
        {"name x\nlike oak", "line 2: like: must come before all other keys"},
        {"like oak\nlike oak", "line 2: like: must come before all other keys"},
        {"order 1\nlike oak", "line 2: like: must come before all other keys"},
        {"like Oak", "line 1: Oak: is not a built-in species"},
        {"like oakoak", "line 1: oakoak: is not a built-in species"},
        {"name 12345678901234567890123456789012", "line 1: name: longer than 31 characters"},
        {"name a\tb", "line 1: name: contains a control character"},
        {"crown_base 0.5\ncrown_top 0.5\nname x", "line 2: crown_top must be above crown_base"},
        {"crown_base 1.5", "line 1: crown_top must be above crown_base"},
        {"\001\002\377%s%n", "line 1: unknown key '???%s%n'"},
        {"abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyz 1",
         "line 1: unknown key 'abcdefghijklmnopqrstuvwx...'"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_bad(bad[i].text, strlen(bad[i].text), bad[i].message);
    assert_bad("name a\0b", 8, "line 1: name: contains a control character");
    assert_bad("fla\0re 1", 8, "line 1: unknown key 'fla?re'; did you mean 'flare'?");
    treepieces_species species;
    assert_int_equal(treepieces_species_parse(NULL, 3, NULL, &species), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_species_parse("", 0, NULL, NULL), TXM_BAD_ARGUMENT);
}

/* all fields, at both ends of their ranges and beyond */
static void ranges_are_the_same_read_and_checked(void **state) {
    (void)state;
    for (int i = 0; i < TPC_FIELDS + TPC_ORDER_FIELDS; i++) {
        const int in_order = i >= TPC_FIELDS;
        const tpc_field *f = in_order ? &tpc_order_fields[i - TPC_FIELDS] : &tpc_fields[i];
        if (tpc_names_of(f)) continue;
        const float step = f->kind == TPC_WHOLE ? 1 : 1e-3f * (f->high - f->low);
        const float values[4] = {f->low, f->high, f->low - step, f->high + step};
        for (int k = 0; k < 4; k++) {
            char text[200], number[TPC_NUMBER];
            treepieces_species species;
            txm_env env;
            memset(&env, 0, sizeof env);
            tpc_write_number(values[k], number);
            int n = snprintf(text, sizeof text, "%s\n%s", in_order ? "order 2" : "# none", f->key);
            for (int j = 0; j < f->count; j++)
                n += snprintf(text + n, sizeof text - (size_t)n, " %s", number);
            /* keep crown_top above crown_base */
            if (!strcmp(f->key, "crown_base"))
                snprintf(text + n, sizeof text - (size_t)n, "\ncrown_top 3");
            const txm_status status = parse(text, &env, &species);
            if (status != (k < 2 ? TXM_OK : TXM_BAD_DATA)) fail_msg("%s: %s", text, env.message);
            assert_int_equal(treepieces_preset("beech", NULL, &species), TXM_OK);
            void *base = in_order ? (void *)&species.orders[2] : (void *)&species;
            tpc_set(f, base, f->count - 1, values[k]);
            if (!strcmp(f->key, "crown_base")) species.crown_top = 3;
            if (!strcmp(f->key, "crown_top")) species.crown_base = 0;
            const int fits = tpc_species_check(&species, &env) == TXM_OK;
            /* only the orders that beech has */
            if (!strcmp(f->key, "order_count") && k == 1) continue;
            if (fits != (k < 2)) fail_msg("%s %s: %s", f->key, number, env.message);
            if (k >= 2) assert_non_null(strstr(env.message, f->key));
            if (k >= 2) assert_non_null(strstr(env.message, "species beech"));
            if (k >= 2 && in_order) assert_non_null(strstr(env.message, "order 2: "));
        }
        if (f->kind != TPC_REAL) continue;
        treepieces_species species;
        txm_env env;
        memset(&env, 0, sizeof env);
        assert_int_equal(treepieces_preset("beech", NULL, &species), TXM_OK);
        tpc_set(f, in_order ? (void *)&species.orders[0] : (void *)&species, f->count - 1,
                (float)NAN);
        assert_int_equal(tpc_species_check(&species, &env), TXM_BAD_ARGUMENT);
        assert_non_null(strstr(env.message, f->key));
    }
}

static void random_species_round_trip(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(11, 4);
    for (int n = 0; n < 200; n++) {
        treepieces_species species;
        memset(&species, 0, sizeof species);
        for (int i = 0; i < TPC_FIELDS; i++)
            for (int k = 0; k < tpc_fields[i].count; k++)
                tpc_set(&tpc_fields[i], &species, k,
                        tpc_fields[i].low +
                            (tpc_fields[i].high - tpc_fields[i].low) * txm_rng_float(&rng));
        for (int o = 0; o < species.order_count; o++)
            for (int i = 0; i < TPC_ORDER_FIELDS; i++)
                for (int k = 0; k < tpc_order_fields[i].count; k++) {
                    const tpc_field *f = &tpc_order_fields[i];
                    tpc_set(f, &species.orders[o], k,
                            f->low + (f->high - f->low) * txm_rng_float(&rng));
                }
        species.crown_base *= 0.5f;
        species.crown_top += 1;
        if (species.crown_top > 3) species.crown_top = 3;
        const int length = (int)txm_rng_below(&rng, TREEPIECES_MAX_NAME);
        for (int i = 0; i < length; i++)
            species.name[i] = i && i + 1 < length && i % 5 == 0 ? ' ' : (char)('a' + i % 26);
        assert_int_equal(tpc_species_check(&species, NULL), TXM_OK);
        assert_round_trip(&species);
    }
}

static void numbers_are_read_exactly(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(3, 9);
    for (int n = 0; n < 20000; n++) {
        char text[64], number[TPC_NUMBER];
        const uint32_t bits = txm_rng_next(&rng);
        float x;
        double read = -1;
        memcpy(&x, &bits, sizeof x);
        if (!txm_is_finite((double)x)) continue;
        /* what printf writes is read as strtod reads it, to the float */
        snprintf(text, sizeof text, n & 1 ? "%.9g" : "%.17e", (double)x);
        assert_int_equal(tpc_read_number(text, text + strlen(text), &read), 1);
        if ((float)read != x) fail_msg("%s is read as %.17g", text, read);
        /* what is written here is read by strtod and here */
        tpc_write_number(x, number);
        assert_true(strlen(number) < TPC_NUMBER);
        if (strtof(number, NULL) != x) fail_msg("%.9g is written as %s", (double)x, number);
        assert_int_equal(tpc_read_number(number, number + strlen(number), &read), 1);
        assert_true((float)read == x);
    }
    static const struct {
        float value;
        const char *text;
    } shortest[] = {
        {0, "0"},           {1, "1"},           {-1, "-1"},         {0.1f, "0.1"},
        {0.05f, "0.05"},    {100, "100"},       {1500, "1500"},     {12.5f, "12.5"},
        {-0.25f, "-0.25"},  {1e6f, "1000000"},  {1e-4f, "0.0001"},  {1e-6f, "1e-6"},
        {1.5e12f, "1.5e12"}, {137.5f, "137.5"}, {3.14159265f, "3.1415927"},
        {99.99999f, "99.99999"}, {0.99999994f, "0.99999994"},
    };
    for (size_t i = 0; i < sizeof shortest / sizeof shortest[0]; i++) {
        char number[TPC_NUMBER];
        tpc_write_number(shortest[i].value, number);
        assert_string_equal(number, shortest[i].text);
    }
    double x = 5;
    const char *long_number = "0000000000000000000001234567890123456789012345678901234567890.25";
    assert_int_equal(tpc_read_number(long_number, long_number + strlen(long_number), &x), 1);
    assert_true(fabs(x / 1.2345678901234568e39 - 1) < 1e-14);
}

static void printing_stops_at_the_capacity(void **state) {
    (void)state;
    static char whole[ROOM], part[ROOM];
    treepieces_species species;
    assert_int_equal(treepieces_preset("willow", NULL, &species), TXM_OK);
    const size_t length = treepieces_species_print(&species, whole, sizeof whole);
    assert_int_equal(treepieces_species_print(&species, NULL, 0), length);
    assert_int_equal(treepieces_species_print(&species, NULL, 99), length);
    assert_int_equal(treepieces_species_print(NULL, whole, 5), 0);
    for (size_t capacity = 0; capacity < length + 3; capacity += capacity < 40 ? 1 : 97) {
        memset(part, FILL, sizeof part);
        assert_int_equal(treepieces_species_print(&species, part, capacity), length);
        for (size_t i = capacity; i < capacity + 50; i++) assert_int_equal(part[i], FILL);
        if (!capacity) continue;
        const size_t kept = length < capacity ? length : capacity - 1;
        assert_int_equal(part[kept], 0);
        assert_memory_equal(part, whole, kept);
    }
    /* an invalid species is printed without harm */
    memset(&species, 0xff, sizeof species);
    assert_true(treepieces_species_print(&species, part, sizeof part) < sizeof part);
    species.order_count = INT_MAX;
    assert_true(treepieces_species_print(&species, part, sizeof part) < sizeof part);
}

/* a locale whose decimal point is a comma; built here if none is installed but can be built */
static const char *find_comma(void) {
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "fr_FR.utf8",
                                        "pl_PL.UTF-8", "comma"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (setlocale(LC_ALL, names[i])) return names[i];
    setenv("LOCPATH", "build/tests/locale", 1);
    if (setlocale(LC_ALL, "comma")) return "comma"; /* built by an earlier run */
    if (system("mkdir -p build/tests/locale && localedef -i de_DE -f UTF-8 "
               "build/tests/locale/comma >build/tests/locale/log 2>&1") == -1)
        return NULL;
    return setlocale(LC_ALL, "comma");
}

static void the_locale_does_not_matter(void **state) {
    (void)state;
    static char before[ROOM], after[ROOM];
    treepieces_species a, b;
    char comma[16];
    assert_int_equal(treepieces_preset("birch", NULL, &a), TXM_OK);
    const size_t length = treepieces_species_print(&a, before, sizeof before);
    if (!find_comma()) {
        print_message("no locale with a comma here\n");
        return;
    }
    snprintf(comma, sizeof comma, "%.1f", 0.5);
    const txm_status status = treepieces_preset("birch", NULL, &b);
    const size_t again = treepieces_species_print(&b, after, sizeof after);
    setlocale(LC_ALL, "C");
    assert_string_equal(comma, "0,5");
    assert_int_equal(status, TXM_OK);
    assert_memory_equal(&a, &b, sizeof a);
    assert_int_equal(again, length);
    assert_memory_equal(before, after, length);
}

/* Presets with bytes changed, cut, doubled and swapped: they are read or refused. */
static void mutated_texts_do_no_harm(void **state) {
    (void)state;
    static const char *const pieces[] = {"like oak\n", "order 4\n", "1e9", "\n",
                                         "#",          "\r",         " -",  "."};
    txm_rng rng = txm_rng_make(77, 1);
    int read = 0, refused = 0;
    for (int n = 0; n < 6000; n++) {
        const char *from = treepieces_preset_text(
            (int)txm_rng_below(&rng, (uint32_t)treepieces_preset_count()));
        size_t size = strlen(from);
        char *text = (char *)malloc(size + 64);
        memcpy(text, from, size);
        for (uint32_t k = txm_rng_below(&rng, 4) + 1; k > 0 && size; k--) {
            const size_t at = txm_rng_below(&rng, (uint32_t)size);
            const char *piece = pieces[txm_rng_below(&rng, 8)];
            const size_t count = strlen(piece);
            switch (txm_rng_below(&rng, 5)) {
            case 0: text[at] = (char)txm_rng_next(&rng); break;
            case 1: text[at] = (char)(text[at] ^ 1 << txm_rng_below(&rng, 8)); break;
            case 2: size = at; break;
            case 3: memcpy(text + at, piece, count < size - at ? count : size - at); break;
            default:
                memmove(text + at + count, text + at, size - at);
                memcpy(text + at, piece, count);
                size += count;
            }
        }
        /* of exactly this size, so that the sanitizer notices a read beyond */
        char *exact = (char *)malloc(size ? size : 1);
        memcpy(exact, text, size);
        treepieces_species species;
        txm_env env;
        memset(&env, 0, sizeof env);
        memset(&species, 0, sizeof species);
        const txm_status status = treepieces_species_parse(exact, size, &env, &species);
        if (status == TXM_OK) {
            read++;
            assert_int_equal(tpc_species_check(&species, &env), TXM_OK);
            assert_round_trip(&species);
        } else {
            refused++;
            assert_int_equal(status, TXM_BAD_DATA);
            assert_int_equal(strncmp(env.message, "line ", 5), 0);
            for (const char *p = env.message; *p; p++) assert_true(*p >= ' ' && *p < 127);
        }
        free(exact);
        free(text);
    }
    assert_true(read > 300 && refused > 300);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_preset_is_read),
        cmocka_unit_test(an_unknown_preset_names_the_others),
        cmocka_unit_test(a_short_text_is_a_species),
        cmocka_unit_test(blanks_comments_and_line_ends),
        cmocka_unit_test(like_starts_from_a_preset),
        cmocka_unit_test(every_fault_has_its_message),
        cmocka_unit_test(ranges_are_the_same_read_and_checked),
        cmocka_unit_test(random_species_round_trip),
        cmocka_unit_test(numbers_are_read_exactly),
        cmocka_unit_test(printing_stops_at_the_capacity),
        cmocka_unit_test(the_locale_does_not_matter),
        cmocka_unit_test(mutated_texts_do_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
