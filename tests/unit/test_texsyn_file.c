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
    for (char version = '1'; version <= '3'; version++) {
        memcpy(noise, "TXS", 3);
        noise[3] = (uint8_t)version;
        for (size_t size = 9; size < 4096; size += size < 200 ? 1 : 97) {
            repair_crc(noise, size);
            refuses_load(noise, size);
        }
    }
}

/* A model of 0.1.0: it loads, keeps its version, and makes the picture that it made then. */
static const uint8_t first_version[] = {
    0x54, 0x58, 0x53, 0x31, 0x00, 0x02, 0x84, 0xc9, 0x6c, 0x00, 0x01, 0xf9, 0xfc, 0x26, 0x4b, 0x64,
    0x04, 0xe7, 0x30, 0xb7, 0xff, 0xe0, 0x43, 0xff, 0xfe, 0x04, 0x22, 0x6e, 0xd0, 0xbd, 0x4e, 0xbc,
    0xae, 0xd0, 0x0a, 0xd3, 0x1e, 0xf8, 0x8d, 0x55, 0x79, 0x5c, 0x8f, 0xf6, 0x28, 0x3c, 0x75, 0xac,
    0x47, 0x70, 0x60, 0x6e, 0x07, 0x81, 0x5d, 0x7f, 0x91, 0x5d, 0xdb, 0x0b, 0xd3, 0x29, 0xf3, 0x27,
    0x64, 0xe2, 0x13, 0x6d, 0xa2, 0xcd, 0x5a, 0x79, 0x4c, 0xb4, 0x4f, 0xbe, 0x56, 0x83, 0x60, 0x60,
    0xac, 0x36, 0x69, 0xf3, 0xf8, 0x60, 0x4a, 0xc8, 0x16, 0x0c, 0x4d, 0xf3, 0x97, 0xc0, 0xa3, 0xfe,
    0x59, 0x99, 0xed, 0x81, 0x64, 0xe0, 0xc6, 0x81, 0xb4, 0x5c, 0xa9, 0xd0, 0xd5, 0x49, 0x74, 0x14,
    0x33, 0x3a, 0x39, 0x49, 0x79, 0xae, 0x2d, 0x75, 0x93, 0xdf, 0x64, 0x98, 0x2b, 0xb6, 0x65, 0x8a,
    0xad, 0x62, 0x41, 0xc7, 0x8a, 0xf8, 0x7b, 0x77, 0xdf, 0x6a, 0xf5, 0x45, 0xdc, 0x37, 0xe5, 0x81,
    0xb6, 0x46, 0x1e, 0x5f, 0x33, 0xe5, 0xdd, 0x5c, 0xce, 0xe6, 0x41, 0x77, 0x6a, 0x60, 0x13, 0x9b,
    0x1e, 0xd9, 0x17, 0x60, 0x86, 0x12, 0x6a, 0x9c, 0xe4, 0x9d, 0x49, 0x17, 0xa0, 0xba, 0xa8, 0x3b,
    0xdb, 0xee, 0xe7, 0x62, 0xd2, 0x66, 0x99, 0x21, 0x26, 0x58, 0xe8, 0xdc, 0x99, 0x40, 0xd9, 0x4a,
    0x78, 0xb6, 0x85, 0xd5, 0x4f, 0x0e, 0x1f, 0xa3, 0x02, 0x41, 0xe0, 0xd6, 0x25, 0x15, 0xbe, 0xef,
    0xc6, 0xae, 0xfb, 0x29, 0x70, 0xb2, 0x4a, 0xf0, 0x31, 0x8d, 0x94, 0x90, 0x73, 0xc0, 0xe3, 0x64,
    0xe6, 0x5d, 0xf5, 0x87, 0xcd, 0x5f, 0xed, 0xfe, 0x6f, 0xbc, 0x3c, 0x08, 0x5e, 0x02, 0xea, 0x53,
    0x39, 0x12, 0x08, 0xe9, 0x47, 0xcf, 0xa1, 0xb4, 0x3f, 0x17, 0x68, 0x34, 0xc5, 0xe6, 0x7b, 0xe6,
    0x5c, 0xd5, 0x29, 0xd6, 0x33, 0x45, 0x26, 0x15, 0x5f, 0x47, 0x61, 0x1c, 0x7f, 0x06, 0x13, 0xfc,
    0x99, 0x2d, 0xff, 0x60, 0xa8, 0xbe, 0x68, 0x45, 0x65, 0xd8, 0xec, 0x1c, 0x6a, 0xde, 0xed, 0x7e,
    0x53, 0x3a, 0xff, 0x40, 0xb7, 0x04, 0xf5, 0x9e, 0x0c, 0x5a, 0x42, 0x5b, 0x7b, 0xe0, 0x18, 0x54,
    0x89, 0xdd, 0x84, 0x09, 0x7e, 0xfe, 0x70, 0x27, 0x38, 0x2c, 0x58, 0xd6, 0x3e, 0x7b, 0xf3, 0x6e,
    0x76, 0x11, 0x28, 0x40, 0x54, 0x75, 0x82, 0x2b, 0x77, 0x1d, 0x12, 0xf4, 0x54, 0xae, 0x8f, 0x29,
    0xd2, 0xdd, 0x1a, 0xd4, 0x01, 0x2a, 0xef, 0x35, 0x6e, 0x54, 0x09, 0x48, 0xd1, 0x42, 0x4f, 0x4f,
    0xac, 0xca, 0x73, 0x66, 0xce, 0x0d, 0xfc, 0x88, 0xc8, 0xc2, 0xe2, 0x90, 0xb3, 0x47, 0x98, 0x6a,
    0xf0, 0xda, 0xbe, 0x72, 0x88, 0x6f, 0x71, 0x8b, 0x57, 0x63, 0xec, 0x96, 0xcf, 0xa5, 0xbe, 0xaa,
    0x9a, 0x8d, 0xe6, 0xf5, 0x6b, 0xcc, 0x9f, 0xf5, 0x86, 0xc3, 0xba, 0x6a, 0xe3, 0x47, 0x0f, 0x08,
    0xba, 0x77, 0xf2, 0x88, 0xf0, 0xc9, 0x38, 0x67, 0xe6, 0xd3, 0x19, 0x4f, 0x7a, 0x15, 0x77, 0x37,
    0x45, 0x64, 0xf0, 0x93, 0xc4, 0x8e, 0x4c, 0xf4, 0x10, 0xfb, 0xb4, 0x8a, 0x61, 0x00, 0xbe, 0xe2,
    0x39, 0xb2,
};

static void test_load_first_version(void **state) {
    (void)state;
    static uint8_t pixels[40 * 30];
    static saved s;
    texsyn_model *model = NULL;
    assert_int_equal(texsyn_load(first_version, sizeof first_version, NULL, &model), TXM_OK);
    assert_int_equal(texsyn_clique_count(model), 15);
    save(model, &s);
    assert_int_equal(s.size, sizeof first_version);
    assert_memory_equal(s.bytes, first_version, s.size);
    const texsyn_synth_desc d = synth_desc(model, 40, 30);
    synthesize(&d, view_bytes(pixels, 40, 30, 1));
    uint64_t hash = 1469598103934665603u; /* FNV-1a */
    for (int i = 0; i < 40 * 30; i++) hash = (hash ^ pixels[i]) * 1099511628211u;
    assert_true(hash == 0x4c2dab01ee1c2062u);
    texsyn_model_free(model);

    /* as version 2 the same bytes have another meaning, and do not last */
    static uint8_t other[sizeof first_version];
    memcpy(other, first_version, sizeof other);
    other[3] = '2';
    repair_crc(other, sizeof other);
    if (texsyn_load(other, sizeof other, NULL, &model) == TXM_OK) texsyn_model_free(model);
    else assert_null(model);
}

/* With a repaired checksum the bytes may be anything: they are refused, or a model that works. */
static void test_load_mutated(void **state) {
    (void)state;
    tk_wide();
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
        cmocka_unit_test(test_load_first_version),
        cmocka_unit_test(test_load_mutated),
    };
    return cmocka_run_group_tests_name("texsyn models", tests, NULL, NULL);
}
