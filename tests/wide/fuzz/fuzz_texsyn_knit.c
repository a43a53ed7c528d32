/* fuzz_texsyn_knit.c - random pictures, layouts and descriptions into texsyn_knit
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   The bytes choose sizes, channels, depth, strides, kind of layout, zone, roughness, example of a border
   and which allocation fails. Nothing may be written after an error, nor between the rows.       */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#define FUZZ_BYTES 24
#include "fuzzkit.h"

enum { MOST_SIDE = 72, MOST_BYTES = MOST_SIDE * (MOST_SIDE * 16 + 32), USED = FUZZ_BYTES };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static uint8_t a[MOST_BYTES], b[MOST_BYTES], layout[MOST_BYTES], border[MOST_BYTES],
        border_layout[MOST_BYTES], out[MOST_BYTES], before[MOST_BYTES];
    static const int channels_of[4] = {1, 3, 4, 2};
    static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
    static const float roughnesses[8] = {0, 0, 0, -1, 0.5f, 3, 32, 33};
    uint8_t d[USED] = {0};
    memcpy(d, data, size < USED ? size : USED);
    txm_rng rng = txm_rng_make(d[0], d[1]);
    const int width = 14 + d[2] % (MOST_SIDE - 13), height = 14 + d[3] % (MOST_SIDE - 13);
    const int channels = channels_of[d[4] % 16 ? d[4] % 3 : 3];
    const txm_sample sample = samples[d[5] % 3];
    memory m = {0, d[6] % 4 ? 0 : 1 + d[7] % 90, 0};
    txm_env env;
    texsyn_knit_desc desc;
    memset(&env, 0, sizeof env);
    memset(&desc, 0, sizeof desc);
    env.allocate = allocate;
    env.release = release;
    env.memory_user = &m;
    desc.a = image_over(a, width, height, channels, sample, d[8]);
    desc.b = image_over(b, d[9] % 2 ? width : 15 + d[9] / 2 % 40, height, channels, sample, d[10]);
    desc.layout = image_over(layout, width, height, 1 + d[11] % 4, TXM_U8, d[11] / 4);
    draw_image(&desc.a, d[12], &rng);
    draw_image(&desc.b, d[13], &rng);
    draw_mask(&desc.layout, d[14], d[15] % (width + 4), d[16] % (height + 4), &rng);
    if (d[17] % 3 == 0) {
        const int side = 15 + d[18] % 50;
        desc.border = image_over(border, side, side, channels, samples[d[18] % 3], d[18]);
        desc.border_layout = image_over(border_layout, side, side, 1, TXM_U8, d[19]);
        draw_image(&desc.border, d[13] + 1, &rng);
        draw_mask(&desc.border_layout, d[19], side / 2, side / 3, &rng);
    }
    desc.zone = d[20] % 16 ? d[20] % 9 : d[20] / 3;
    desc.roughness = roughnesses[d[21] % 8];
    desc.likeness = (texsyn_likeness)(d[22] % 3);
    desc.quality = d[23] % 16 ? d[23] % 3 - 2 : 3;
    desc.seed = d[0];
    const txm_image result = image_over(out, width, height, channels, sample, d[8] / 8);
    memset(out, 0x5c, sizeof out);
    memcpy(before, out, sizeof out);

    const txm_status status = texsyn_knit(&desc, &env, result);
    if (m.blocks) abort();
    if (status != TXM_OK && (!env.message[0] || memcmp(out, before, sizeof out) != 0)) abort();
    fuzz_succeeded += status == TXM_OK;
    const size_t row = (size_t)width * (size_t)channels * txm_sample_bytes(sample);
    for (int y = 0; y < height; y++) memset(txm_image_row(&result, y), 0x5c, row);
    if (memcmp(out, before, sizeof out) != 0) abort();
    return 0;
}
