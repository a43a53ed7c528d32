/* fuzz_texsyn_fill.c - random pictures, masks and descriptions into texsyn_fill
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   The bytes choose size, channels, depth, strides, kind of mask and source, quality, and which
   allocation fails. Known pixels must come out as they went in, and nothing after an error.     */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#define FUZZ_BYTES 16
#include "fuzzkit.h"

enum { MOST_SIDE = 80, MOST_BYTES = MOST_SIDE * (MOST_SIDE * 16 + 32), USED = FUZZ_BYTES };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static uint8_t image[MOST_BYTES], mask[MOST_BYTES], source[MOST_BYTES], out[MOST_BYTES],
        before[MOST_BYTES];
    static const int channels_of[4] = {1, 3, 4, 2};
    static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
    uint8_t d[USED] = {0};
    memcpy(d, data, size < USED ? size : USED);
    txm_rng rng = txm_rng_make(d[0], d[1]);
    const int width = 1 + d[2] % MOST_SIDE, height = 1 + d[3] % MOST_SIDE;
    const int channels = channels_of[d[4] % 8 ? d[4] % 3 : 3];
    const txm_sample sample = samples[d[5] % 3];
    memory m = {0, d[6] % 4 ? 0 : 1 + d[7] % 60, 0};
    txm_env env;
    texsyn_fill_desc desc;
    memset(&env, 0, sizeof env);
    memset(&desc, 0, sizeof desc);
    env.allocate = allocate;
    env.release = release;
    env.memory_user = &m;
    desc.image = image_over(image, width, height, channels, sample, d[8]);
    desc.mask = image_over(mask, width, height, 1 + d[9] % 4, TXM_U8, d[9] / 4);
    if (d[10] % 2) {
        desc.source = image_over(source, width, height, 1, TXM_U8, d[10] / 2);
        draw_mask(&desc.source, d[10] / 2, width / 2, height / 3, &rng);
    }
    desc.quality = d[11] % 8 ? d[11] % 5 - 2 : 3;
    desc.seed = d[0];
    draw_image(&desc.image, d[12], &rng);
    draw_mask(&desc.mask, d[13], d[14] % (width + 4), d[15] % (height + 4), &rng);
    const txm_image result = image_over(out, width, height, channels, sample, d[8] / 8);
    memset(out, 0x5c, sizeof out);
    memcpy(before, out, sizeof out);

    const txm_status status = texsyn_fill(&desc, &env, result);
    if (m.blocks) abort();
    if (status != TXM_OK) {
        if (!env.message[0] || memcmp(out, before, sizeof out) != 0) abort();
        return 0;
    }
    fuzz_succeeded++;
    static uint8_t counts[MOST_SIDE * MOST_SIDE];
    const size_t pixel = (size_t)channels * txm_sample_bytes(sample);
    txm_mask_read(&desc.mask, TXM_MASK_REPLACES, counts);
    for (int y = 0; y < height; y++) {
        const char *from = (const char *)txm_image_row_const(&desc.image, y);
        const char *to = (const char *)txm_image_row_const(&result, y);
        for (int x = 0; x < width; x++)
            if (!counts[y * width + x] &&
                memcmp(from + pixel * (size_t)x, to + pixel * (size_t)x, pixel) != 0)
                abort();
    }
    return 0;
}
