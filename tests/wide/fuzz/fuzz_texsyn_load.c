/* fuzz_texsyn_load.c - hostile bytes into texsyn_load and texsyn_composite_load
   SPDX-License-Identifier: MIT OR Unlicense

   With clang: -fsanitize=fuzzer,address,undefined, run on a folder of .txs and .txc files.
   With any compiler: -DFUZZ_STANDALONE; the program then mutates the files it is given itself:
   fuzz_texsyn_load RUNS FILE...

   The checksum at the end is put right first, or nothing would ever get past it.
   Whatever is accepted must survive all that one can do with a model, and be written back.
   The allocator refuses to hand out more than MOST_BYTES, a multiple of what any model of a
   few thousand bytes needs: a loader that believes a forged size stops the run.                 */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include <stdio.h>

static long loaded; /* models so far */

enum { MOST_BYTES = 1 << 26, MOST_INPUT = 1 << 16, WIDTH = 24, HEIGHT = 20 };

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

static void load(const uint8_t *data, size_t size);
static void load_composite(const uint8_t *data, size_t size);

/* An exact copy on the heap, so that the sanitizer sees any read beyond it. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint8_t *copy = (uint8_t *)malloc(size ? size : 1);
    if (!copy) return 0;
    if (size) memcpy(copy, data, size);
    repair_crc(copy, size);
    if (size >= 4 && memcmp(copy, "TXC1", 4) == 0) load_composite(copy, size);
    else load(copy, size);
    free(copy);
    return 0;
}

static txm_env guarded_env(void) {
    txm_env env;
    memset(&env, 0, sizeof env);
    env.allocate = allocate;
    env.release = release;
    return env;
}

static uint8_t again[4 * MOST_INPUT], pixels[WIDTH * HEIGHT * 4], labels[WIDTH * HEIGHT];

static txm_image view(uint8_t *bytes, int channels) {
    txm_image out;
    memset(&out, 0, sizeof out);
    out.pixels = bytes;
    out.width = WIDTH;
    out.height = HEIGHT;
    out.channels = channels;
    return out;
}

static void load(const uint8_t *data, size_t size) {
    static unsigned count;
    texsyn_model *model = NULL;
    txm_env env = guarded_env();
    if (size > MOST_INPUT) return;
    if (texsyn_load(data, size, &env, &model) != TXM_OK) {
        if (model || !env.message[0]) abort();
        return;
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
        memset(&desc, 0, sizeof desc);
        desc.model = model;
        desc.width = WIDTH;
        desc.height = HEIGHT;
        desc.quality = -2;
        const txm_image out = view(pixels, texsyn_channels(model));
        if (texsyn_synthesize(&desc, &env, out) != TXM_OK && !env.message[0]) abort();
    }
    texsyn_model_free(model);
}

static void load_composite(const uint8_t *data, size_t size) {
    static unsigned count;
    texsyn_composite *composite = NULL;
    txm_env env = guarded_env();
    if (size > MOST_INPUT) return;
    if (texsyn_composite_load(data, size, &env, &composite) != TXM_OK) {
        if (composite || !env.message[0]) abort();
        return;
    }

    loaded++;
    size_t written = 0;
    const int most = texsyn_composite_label_count(composite);
    if (most < 1 || most > 16) abort();
    for (int k = -1; k <= most; k++)
        if (!texsyn_composite_model(composite, k) != (k < 0 || k == most)) abort();
    if (texsyn_composite_save(composite, &env, again, sizeof again, &written) != TXM_OK) abort();

    if (count++ % 16 == 0) {
        texsyn_composite_desc desc;
        memset(&desc, 0, sizeof desc);
        desc.composite = composite;
        desc.width = WIDTH;
        desc.height = HEIGHT;
        desc.quality = -2;
        const txm_image map = view(labels, 1);
        const txm_image out = view(pixels, texsyn_channels(texsyn_composite_model(composite, 0)));
        if (texsyn_composite_layout(&desc, &env, map) == TXM_OK && count % 32 == 1)
            desc.layout = map;
        if (texsyn_composite_synthesize(&desc, &env, out) != TXM_OK && !env.message[0]) abort();
        for (int i = 0; i < WIDTH * HEIGHT; i++)
            if (labels[i] >= most) abort();
    }
    texsyn_composite_free(composite);
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

/* Any number: small, or at a limit. */
static int any(txm_rng *rng) {
    static const int limits[] = {0, 1, -1, 9, 20, 41, 60, 255, 4095, -4095, (1 << 24) - 1};
    return txm_rng_below(rng, 2) ? (int)txm_rng_below(rng, 41) - 20
                                 : limits[txm_rng_below(rng, sizeof limits / sizeof *limits)];
}

static void forge_model(txm_rng *rng, texsyn_model *m) {
    txs_level *l = &m->level[txm_rng_below(rng, (uint32_t)m->levels)];
    txs_type *t = &l->types[txm_rng_below(rng, (uint32_t)l->type_count)];
    const int band = (int)txm_rng_below(rng, (uint32_t)m->bands);
    switch (txm_rng_below(rng, 10)) {
    case 0: t->kind = (int)txm_rng_below(rng, TEXSYN_PARALLEL + 1); break;
    case 1: t->dx = any(rng); break;
    case 2: t->dy = any(rng); break;
    case 3: t->ex = any(rng); break;
    case 4: t->other = (int)txm_rng_below(rng, 4); break;
    case 5: t->phase = (int)txm_rng_below(rng, 3); break;
    case 6: l->values[band] = 1 + (int)txm_rng_below(rng, TXS_VALUES); break;
    case 7: l->low[band] = txm_rng_below(rng, 2) ? 1e9f : (float)any(rng); break;
    case 8: l->step[band] = txm_rng_below(rng, 2) ? 1e9f : 1e-5f; break;
    default: t->root[txm_rng_below(rng, TXS_BINS)] = (int16_t)any(rng);
    }
}

static void forge_layout(txm_rng *rng, txs_layout *layout) {
    txs_lay_level *l = &layout->level[txm_rng_below(rng, (uint32_t)layout->levels)];
    txs_lay_type *t = &l->types[txm_rng_below(rng, (uint32_t)l->type_count)];
    switch (txm_rng_below(rng, 8)) {
    case 0: layout->width = 1 + abs(any(rng)); break;
    case 1: layout->height = 1 + abs(any(rng)); break;
    case 2: layout->field = (int)txm_rng_below(rng, 3); break;
    case 3: t->kind = (int)txm_rng_below(rng, 4); break;
    case 4: t->dx = any(rng); break;
    case 5: t->dy = any(rng); break;
    case 6: memset(t->share, 0, sizeof t->share); break;
    default: t->share[txm_rng_below(rng, TXS_LAY_BINS)] = (int32_t)txm_rng_below(rng, TXS_ONE + 1);
    }
}

static void forge_crossing(txm_rng *rng, texsyn_composite *c) {
    const int level = (int)txm_rng_below(rng, (uint32_t)c->levels);
    if (!c->crossings[level]) return;
    txs_crossing *x = &c->crossing[level][txm_rng_below(rng, (uint32_t)c->crossings[level])];
    switch (txm_rng_below(rng, 6)) {
    case 0: x->tail = (int)txm_rng_below(rng, 16); break;
    case 1: x->head = (int)txm_rng_below(rng, 16); break;
    case 2: x->type.dx = any(rng); break;
    case 3: x->type.other = (int)txm_rng_below(rng, 4); break;
    case 4: memset(x->type.root, 0, sizeof x->type.root); break;
    default: x->type.root[txm_rng_below(rng, TXS_BINS)] = (int16_t)any(rng);
    }
}

/* A composite with one to four fields forged, written by the library itself: it gets further than
   bytes that were changed, which confuse the decoder from there on. 0: data is no composite. */
static size_t forge(txm_rng *rng, const uint8_t *seed, size_t size, uint8_t *data) {
    texsyn_composite *c = NULL;
    size_t written = 0;
    if (texsyn_composite_load(seed, size, NULL, &c) != TXM_OK) return 0;
    for (uint32_t n = 1 + txm_rng_below(rng, 4); n > 0; n--) {
        switch (txm_rng_below(rng, 3)) {
        case 0: forge_model(rng, c->model[txm_rng_below(rng, (uint32_t)c->labels)]); break;
        case 1: forge_layout(rng, &c->layout); break;
        default: forge_crossing(rng, c);
        }
    }
    if (texsyn_composite_save(c, NULL, data, MOST_INPUT, &written) != TXM_OK) written = 0;
    texsyn_composite_free(c);
    return written;
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
            size_t n = i % 2 ? forge(&rng, seed, size, data) : 0;
            if (!n) n = mutate(&rng, seed, size, data);
            LLVMFuzzerTestOneInput(data, n);
        }
    }
    printf("%ld runs, %ld loaded\n", runs, loaded);
    return loaded > runs / 100 ? 0 : 1; /* else the checksum is not what it was */
}
#endif
