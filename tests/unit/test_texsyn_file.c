/* test_texsyn_file.c - models as bytes: saved, loaded, damaged
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texsyn_file && build/tests/unit/test_texsyn_file */
#include "synkit.h"

/* ---- models as bytes ---------------------------------------------------------------------- */

static void test_save_and_load(void **state) {
    (void)state;
    static saved s, again;
    static uint8_t a[40 * 30 * 4], b[40 * 30 * 4];
    for (int channels = 1; channels <= 4; channels++) {
        if (channels == 2) continue;
        texsyn_model *model = small_model(channels, channels == 1 ? 1 : 2), *loaded = NULL;
        size_t size = 0;
        assert_int_equal(texsyn_save(model, NULL, NULL, 0, &size), TXM_OK);
        save(model, &s);
        assert_int_equal(s.size, size);
        assert_int_equal(crc32(s.bytes, size - 4), (uint32_t)s.bytes[size - 4] |
                                                       (uint32_t)s.bytes[size - 3] << 8 |
                                                       (uint32_t)s.bytes[size - 2] << 16 |
                                                       (uint32_t)s.bytes[size - 1] << 24);
        uint8_t *exact = (uint8_t *)malloc(size); /* the sanitizer sees any read beyond */
        assert_non_null(exact);
        memcpy(exact, s.bytes, size);
        assert_int_equal(texsyn_load(exact, size, NULL, &loaded), TXM_OK);
        free(exact);
        save(loaded, &again);
        assert_int_equal(again.size, size);
        assert_memory_equal(again.bytes, s.bytes, size);

        /* all public functions give the same */
        assert_int_equal(texsyn_channels(loaded), channels);
        assert_int_equal(texsyn_level_count(loaded), texsyn_level_count(model));
        assert_int_equal(texsyn_band_count(loaded), texsyn_band_count(model));
        assert_int_equal(texsyn_clique_count(loaded), texsyn_clique_count(model));
        for (int i = 0; i < texsyn_clique_count(model); i++) {
            texsyn_clique c, e;
            float bins[81] = {0}, others[81] = {0};
            assert_int_equal(texsyn_clique_at(model, i, &c, bins, 81),
                             texsyn_clique_at(loaded, i, &e, others, 81));
            assert_memory_equal(&c, &e, sizeof c);
            assert_memory_equal(bins, others, sizeof bins);
        }
        texsyn_synth_desc d = synth_desc(model, 40, 30);
        synthesize(&d, view_bytes(a, 40, 30, channels));
        d.model = loaded;
        synthesize(&d, view_bytes(b, 40, 30, channels));
        assert_memory_equal(a, b, (size_t)(40 * 30 * channels));

        /* a buffer that is too small keeps its neighbours */
        for (size_t capacity = 0; capacity < size; capacity += capacity < 12 ? 1 : 37) {
            uint8_t *buffer = (uint8_t *)malloc(capacity + 1);
            assert_non_null(buffer);
            buffer[capacity] = FILL;
            size_t needed = 0;
            txm_env env;
            memset(&env, 0, sizeof env);
            assert_int_equal(texsyn_save(model, &env, buffer, capacity, &needed), TXM_TOO_SMALL);
            assert_true(env.message[0] != 0);
            assert_int_equal(needed, size);
            assert_int_equal(buffer[capacity], FILL);
            free(buffer);
        }
        uint8_t *buffer = (uint8_t *)malloc(size);
        assert_int_equal(texsyn_save(model, NULL, buffer, size, &size), TXM_OK);
        assert_memory_equal(buffer, s.bytes, size);
        free(buffer);

        assert_int_equal(texsyn_save(NULL, NULL, NULL, 0, &size), TXM_BAD_ARGUMENT);
        assert_int_equal(texsyn_save(model, NULL, NULL, 0, NULL), TXM_BAD_ARGUMENT);
        texsyn_model *none = model;
        assert_int_equal(texsyn_load(NULL, 10, NULL, &none), TXM_BAD_ARGUMENT);
        assert_null(none);
        assert_int_equal(texsyn_load(s.bytes, size, NULL, NULL), TXM_BAD_ARGUMENT);
        texsyn_model_free(loaded);
        texsyn_model_free(model);
    }
}

static void refuses_load(const uint8_t *bytes, size_t size) {
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    texsyn_model *model = (texsyn_model *)&memory;
    uint8_t *exact = (uint8_t *)malloc(size ? size : 1);
    assert_non_null(exact);
    memcpy(exact, bytes, size);
    assert_int_equal(texsyn_load(exact, size, &env, &model), TXM_BAD_DATA);
    assert_null(model);
    assert_true(env.message[0] != 0);
    assert_int_equal(tk_leaks(&memory), 0);
    free(exact);
}

static void test_load_damaged(void **state) {
    (void)state;
    static saved s;
    texsyn_model *model = small_model(3, 2);
    save(model, &s);
    texsyn_model_free(model);
    for (size_t size = 0; size < s.size; size++) refuses_load(s.bytes, size);
    for (size_t at = 0; at < s.size; at++) {
        for (int bit = 0; bit < 9; bit++) { /* each bit, then all of them */
            const uint8_t flip = (uint8_t)(bit < 8 ? 1 << bit : 255);
            s.bytes[at] ^= flip;
            refuses_load(s.bytes, s.size);
            s.bytes[at] ^= flip;
        }
    }
    s.bytes[s.size] = 0;
    refuses_load(s.bytes, s.size + 1); /* something behind the end */
    repair_crc(s.bytes, s.size + 1);
    refuses_load(s.bytes, s.size + 1); /* even under a good checksum */
    static uint8_t noise[4096];
    txm_rng rng = txm_rng_make(5, 5);
    for (int i = 0; i < 4096; i++) noise[i] = (uint8_t)txm_rng_next(&rng);
    memcpy(noise, "TXS1", 4);
    for (size_t size = 9; size < 4096; size += size < 200 ? 1 : 97) {
        repair_crc(noise, size);
        refuses_load(noise, size);
    }
}

/* With a repaired checksum the bytes may be anything: they are refused, or a model that works. */
static void test_load_mutated(void **state) {
    (void)state;
    static saved s, again;
    static uint8_t bytes[1 << 15], out[32 * 32 * 4];
    enum { SYNTHESES = 4 }; /* one in so many that load synthesises */
    const int runs = tk_full() ? 1000 : 200;
    int loaded = 0, refused = 0;
    for (int channels = 1; channels <= 4; channels++) {
        if (channels == 2) continue;
        texsyn_model *model = small_model(channels, channels);
        txm_rng rng = txm_rng_make(77, (uint64_t)channels);
        save(model, &s);
        texsyn_model_free(model);
        for (int run = 0; run < runs; run++) {
            tk_memory memory = {0};
            txm_env env = tk_env(&memory, NULL);
            size_t size = s.size;
            memcpy(bytes, s.bytes, size);
            for (uint32_t n = 1 + txm_rng_below(&rng, 3); n > 0; n--) {
                /* the header, the middle, the last bytes: those change little */
                size_t at = txm_rng_below(&rng, (uint32_t)size - 4);
                const uint32_t where = txm_rng_below(&rng, 3);
                if (where == 0) at = 5 + at % 40;
                if (where == 1) at = size - 5 - at % 12;
                bytes[at] = (uint8_t)(txm_rng_below(&rng, 2)
                                          ? txm_rng_next(&rng)
                                          : bytes[at] ^ 1u << txm_rng_below(&rng, 8));
            }
            repair_crc(bytes, size);
            model = (texsyn_model *)&memory;
            const txm_status status = texsyn_load(bytes, size, &env, &model);
            if (status != TXM_OK) {
                assert_true(status == TXM_BAD_DATA || status == TXM_OUT_OF_MEMORY);
                assert_null(model);
                assert_true(env.message[0] != 0);
                refused++;
            } else {
                size_t written = 0;
                texsyn_clique c;
                for (int i = 0; i < texsyn_clique_count(model); i++)
                    assert_true(texsyn_clique_at(model, i, &c, NULL, 0) > 0);
                assert_int_equal(
                    texsyn_save(model, NULL, again.bytes, sizeof again.bytes, &written), TXM_OK);
                texsyn_synth_desc d = synth_desc(model, 32, 32);
                d.quality = -2;
                d.tileable = 1;
                const txm_image image = view_bytes(out, 32, 32, texsyn_channels(model));
                if (loaded++ % SYNTHESES == 0)
                    assert_int_equal(texsyn_synthesize(&d, NULL, image), TXM_OK);
                texsyn_model_free(model);
            }
            assert_int_equal(tk_leaks(&memory), 0);
            assert_true(memory.peak_bytes < 4u << 20);
        }
    }
    assert_true(loaded > runs / 10); /* enough of them were models */
    assert_true(refused > runs / 10);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_save_and_load),
        cmocka_unit_test(test_load_damaged),
        cmocka_unit_test(test_load_mutated),
    };
    return cmocka_run_group_tests_name("texsyn models", tests, NULL, NULL);
}
