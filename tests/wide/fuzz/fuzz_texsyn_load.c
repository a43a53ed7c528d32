/* fuzz_texsyn_load.c - hostile bytes into texsyn_load
   SPDX-License-Identifier: MIT OR Unlicense

   With clang: -fsanitize=fuzzer,address,undefined, run on a folder of model files.
   With any compiler: -DFUZZ_STANDALONE; the program then mutates the files it is given itself:
   fuzz_texsyn_load RUNS FILE...

   The checksum at the end is put right first, or nothing would ever get past it.
   Whatever texsyn_load accepts must survive all that one can do with a model, and be written back.
   The allocator refuses to hand out more than MOST_BYTES, a multiple of what any model of a
   few thousand bytes needs: a loader that believes a forged size stops the run.                 */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include <stdio.h>

static long loaded; /* models so far */

enum { MOST_BYTES = 1 << 26, MOST_INPUT = 1 << 16 };

static void *allocate(void *user, size_t bytes) {
    (void)user;
    if (bytes > MOST_BYTES) {
        fprintf(stderr, "asked for %lu bytes\n", (unsigned long)bytes);
        abort();
    }
    return malloc(bytes);
}

static void release(void *user, void *block) {
    (void)user;
    free(block);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The checksum of a model file, CRC-32 of IEEE 802.3 by nibbles, over all but its last 4 bytes. */
static void repair_crc(uint8_t *bytes, size_t size) {
    static const uint32_t table[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u,
        0x4db26158u, 0x5005713cu, 0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu,
        0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu};
    uint32_t crc = 0xffffffffu;
    if (size < 4) return;
    for (size_t i = 0; i + 4 < size; i++) {
        crc ^= bytes[i];
        crc = crc >> 4 ^ table[crc & 15];
        crc = crc >> 4 ^ table[crc & 15];
    }
    for (int i = 0; i < 4; i++) bytes[size - 4 + (size_t)i] = (uint8_t)(~crc >> 8 * i);
}

static int load(const uint8_t *data, size_t size);

/* An exact copy on the heap, so that the sanitizer sees any read beyond it. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint8_t *copy = (uint8_t *)malloc(size ? size : 1);
    if (!copy) return 0;
    if (size) memcpy(copy, data, size);
    repair_crc(copy, size);
    load(copy, size);
    free(copy);
    return 0;
}

static int load(const uint8_t *data, size_t size) {
    static unsigned count;
    static uint8_t again[4 * MOST_INPUT], pixels[24 * 20 * 4];
    texsyn_model *model = NULL;
    txm_env env;
    memset(&env, 0, sizeof env);
    env.allocate = allocate;
    env.release = release;
    if (size > MOST_INPUT) return 0;
    if (texsyn_load(data, size, &env, &model) != TXM_OK) {
        if (model || !env.message[0]) abort();
        return 0;
    }

    loaded++;
    texsyn_clique clique;
    float bins[64];
    for (int i = -1; i <= texsyn_clique_count(model); i++)
        texsyn_clique_at(model, i, &clique, bins, 64);

    size_t written = 0;
    if (texsyn_save(model, &env, again, sizeof again, &written) != TXM_OK) abort();

    if (count++ % 512 == 0) { /* the slow part, now and then */
        texsyn_synth_desc desc;
        txm_image out;
        memset(&desc, 0, sizeof desc);
        memset(&out, 0, sizeof out);
        desc.model = model;
        desc.width = out.width = 24;
        desc.height = out.height = 20;
        desc.quality = -2;
        out.channels = texsyn_channels(model);
        out.pixels = pixels;
        if (texsyn_synthesize(&desc, &env, out) != TXM_OK && !env.message[0]) abort();
    }
    texsyn_model_free(model);
    return 0;
}

#ifdef FUZZ_STANDALONE
/* Copy one of the seeds and change it in one to four places. */
static size_t mutate(txm_rng *rng, const uint8_t *seed, size_t size, uint8_t *data) {
    memcpy(data, seed, size);
    for (uint32_t n = 1 + txm_rng_below(rng, 4); n > 0 && size > 0; n--) {
        size_t at = txm_rng_below(rng, (uint32_t)size);
        if (txm_rng_below(rng, 2)) at %= 64; /* the header, half of the time */
        if (at >= size) at = 0;
        switch (txm_rng_below(rng, 5)) {
        case 0: data[at] = (uint8_t)txm_rng_next(rng); break;
        case 1: data[at] ^= (uint8_t)(1u << txm_rng_below(rng, 8)); break;
        case 2: data[at] = txm_rng_below(rng, 2) ? 0xff : 0; break;
        case 3: size = at; break;
        default: /* a piece moved elsewhere */
            memmove(data + at, data + size / 2, (size - at) / 3 < size / 2 ? (size - at) / 3 : 0);
        }
    }
    return size;
}

int main(int argc, char **argv) {
    static uint8_t seed[MOST_INPUT], data[MOST_INPUT];
    long runs = argc > 2 ? atol(argv[1]) : 0;
    int files = argc - 2;
    txm_rng rng = txm_rng_make(1, 0);
    if (runs < 1) {
        fprintf(stderr, "usage: fuzz_texsyn_load RUNS FILE...\n");
        return 2;
    }
    for (int f = 0; f < files; f++) {
        FILE *file = fopen(argv[2 + f], "rb");
        size_t size = file ? fread(seed, 1, sizeof seed, file) : 0;
        if (!file || fclose(file) != 0 || size == 0) {
            fprintf(stderr, "cannot read '%s'\n", argv[2 + f]);
            return 2;
        }
        LLVMFuzzerTestOneInput(seed, size);
        for (long i = 0; i < runs / files; i++) {
            size_t n = mutate(&rng, seed, size, data);
            LLVMFuzzerTestOneInput(data, n);
        }
    }
    printf("%ld runs, %ld loaded\n", runs, loaded);
    return loaded > runs / 100 ? 0 : 1; /* else the checksum is not what it was */
}
#endif
