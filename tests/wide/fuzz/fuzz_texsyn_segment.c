/* fuzz_texsyn_segment.c - random pictures, masks and options into texsyn_segment
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   The bytes choose size, channels, depth, strides, picture, mask, segments, transition, and which
   allocation fails. Each label must be there, by area, and nothing else; nothing is written after an
   error or beside the rows.                                                                     */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#define FUZZ_BYTES 64
#include "fuzzkit.h"

enum { MOST_SIDE = 200, PAD = 3, FILL = 0x5c };

/* An image of its own block, exactly as large as it must be, filled with FILL; every other one
   bottom-up. */
static txm_image make_image(source *s, int width, int height, int channels, txm_sample sample) {
    const size_t unit = txm_sample_bytes(sample), row = (size_t)width * (size_t)channels * unit;
    const size_t stride = row + (size_t)pick(s, PAD) * unit, bytes = stride * (size_t)(height - 1) + row;
    const int is_down = pick(s, 2);
    uint8_t *block = (uint8_t *)malloc(bytes);
    if (!block) exit(1);
    memset(block, FILL, bytes);
    txm_image im = {block, width, height, channels, sample, (ptrdiff_t)stride};
    if (!is_down) {
        im.pixels = block + stride * (size_t)(height - 1);
        im.stride = -im.stride;
    }
    return im;
}

static void drop(txm_image *im) {
    if (im->pixels) free(im->stride < 0 ? (char *)im->pixels + im->stride * (im->height - 1) : (char *)im->pixels);
}

/* Halves, stripes, dust or one gray, in a few colours; now and then a number that is none. */
static void draw(source *s, const txm_image *im) {
    const int kind = pick(s, 5), period = 2 + pick(s, 60), noise = pick(s, 256);
    const int is_odd = im->sample == TXM_F32 && pick(s, 8) == 0;
    txm_rng rng = txm_rng_make((uint64_t)pick(s, 65536), 3);
    for (int y = 0; y < im->height; y++) {
        for (int x = 0; x < im->width; x++) {
            const int part = kind == 0   ? 2 * x > im->width
                             : kind == 1 ? x / period % 2 + y / period % 3
                             : kind == 2 ? (int)txm_rng_below(&rng, 4)
                             : kind == 3 ? x * y / period % 5
                                         : 0;
            for (int c = 0; c < im->channels; c++) {
                const int v = 40 * part * (c + 1) % 256 + (int)txm_rng_below(&rng, (uint32_t)noise + 1);
                txm_image_set(im, x, y, c, (float)(v % 256) / 255);
            }
        }
    }
    if (is_odd) ((float *)im->pixels)[pick(s, im->width * im->channels)] = pick(s, 2) ? NAN : 1e9f;
}

static txm_image some_image(source *s, int width, int height, int channels) {
    static const txm_sample samples[3] = {TXM_U8, TXM_U16, TXM_F32};
    const txm_image im = make_image(s, width, height, channels, samples[pick(s, 3)]);
    draw(s, &im);
    return im;
}

/* Are all pixels of `out`, its stride too, as they were made? */
static int is_untouched(const txm_image *out) {
    for (int y = 0; y < out->height; y++)
        for (int x = 0; x < out->width; x++)
            if (((const uint8_t *)txm_image_row_const(out, y))[x] != FILL) return 0;
    return 1;
}

static void judge_labels(const texsyn_segment_desc *d, const txm_image *out, int count) {
    long area[256] = {0};
    for (int y = 0; y < out->height; y++) {
        const uint8_t *row = (const uint8_t *)txm_image_row_const(out, y);
        for (int x = 0; x < out->width; x++) area[row[x]]++;
        for (int x = out->width; y + 1 < out->height && x < labs((long)out->stride); x++)
            if (out->stride > 0 && row[x] != FILL) abort();
    }
    if (count < 1 || count > TEXSYN_MAX_SEGMENTS || (d->segments && count > d->segments)) abort();
    for (int l = 0; l < TEXSYN_TRANSITION; l++)
        if ((l < count) != (area[l] > 0)) abort();
    if (!d->transition && area[TEXSYN_TRANSITION]) abort();
    if (!d->mask.pixels && d->image.channels != 4 && area[TEXSYN_NO_LABEL]) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    source s = source_of(data, size);
    texsyn_segment_desc d = {0};
    memory m = {0};
    txm_env env = {0};
    const int width = 1 + pick(&s, MOST_SIDE), height = 1 + pick(&s, MOST_SIDE);
    int count = -1;
    d.image = some_image(&s, width, height, 1 + pick(&s, 4));
    if (pick(&s, 2)) d.mask = some_image(&s, width + (pick(&s, 20) == 0), height, 1 + pick(&s, 4));
    d.segments = pick(&s, 2) ? 0 : pick(&s, TEXSYN_MAX_SEGMENTS + 2);
    d.transition = pick(&s, 2);
    d.seed = (uint64_t)pick(&s, 65536);
    txm_image out = make_image(&s, width, height, 1, TXM_U8);
    env.allocate = allocate;
    env.release = release;
    env.memory_user = &m;
    if (pick(&s, 6) == 0) m.fail_at = 1 + pick(&s, 60);
    const txm_status status = texsyn_segment(&d, &env, out, &count);
    if (status == TXM_OK) {
        fuzz_succeeded++;
        judge_labels(&d, &out, count);
    } else if (!env.message[0] || count != -1 || !is_untouched(&out)) {
        abort();
    }
    if (m.blocks) abort();
    drop(&d.image);
    drop(&d.mask);
    drop(&out);
    return 0;
}
