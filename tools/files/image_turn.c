/* image_turn.c - pictures turned upright as EXIF tells, and given other channels or 8 bits
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

/* ---- EXIF --------------------------------------------------------------------------------- */

enum {
    EXIF_HEAD = 6,         /* bytes of "Exif" and two zeros, which some formats leave out */
    TIFF_HEAD = 8,         /* byte order, the number 42, where the first directory is     */
    TIFF_ENTRY = 12,       /* tag, type, count, value                                     */
    TAG_ORIENTATION = 274,
    TYPE_SHORT = 3
};

static unsigned number(const unsigned char *p, int bytes, int big) {
    unsigned value = 0;
    for (int i = 0; i < bytes; i++) value = value << 8 | p[big ? i : bytes - 1 - i];
    return value;
}

int image_exif_orientation(const unsigned char *exif, size_t size) {
    if (size >= EXIF_HEAD && !memcmp(exif, "Exif\0", 5)) {
        exif += EXIF_HEAD;
        size -= EXIF_HEAD;
    }
    if (size < TIFF_HEAD || (memcmp(exif, "II*\0", 4) != 0 && memcmp(exif, "MM\0*", 4) != 0)) return 0;
    const int big = exif[0] == 'M';
    const size_t at = number(exif + 4, 4, big);
    if (at > size - 2) return 0;
    const size_t count = number(exif + at, 2, big);
    for (size_t i = 0; i < count && TIFF_ENTRY * (i + 1) <= size - 2 - at; i++) {
        const unsigned char *entry = exif + at + 2 + TIFF_ENTRY * i;
        if (number(entry, 2, big) != TAG_ORIENTATION) continue;
        const unsigned value = number(entry + 8, number(entry + 2, 2, big) == TYPE_SHORT ? 2 : 4, big);
        return value >= IMAGE_UPRIGHT && value <= IMAGE_LAST_ORIENTATION ? (int)value : 0;
    }
    return 0;
}

/* ---- turning ------------------------------------------------------------------------------ */

/* Texel by texel, in blocks, whose rows and columns both stay in the cache. */
int image_turn(txm_image *image, int orientation) {
    enum { BLOCK = 32 };
    const int w = image->width, h = image->height, swaps = orientation >= 5;
    const size_t texel = (size_t)image->channels * txm_sample_bytes(image->sample);
    const size_t row = (size_t)w * texel;
    /* where the turned picture begins in this one, and the steps to its next column and row */
    const int from_right = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
    const int from_bottom = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
    const ptrdiff_t right = from_right ? -(ptrdiff_t)texel : (ptrdiff_t)texel;
    const ptrdiff_t down = from_bottom ? -(ptrdiff_t)row : (ptrdiff_t)row;
    txm_image turned;
    if (orientation <= IMAGE_UPRIGHT || orientation > IMAGE_LAST_ORIENTATION) return 1;
    if (!image_new(swaps ? h : w, swaps ? w : h, image->channels, image->sample, &turned)) return 0;
    const unsigned char *first = (const unsigned char *)image->pixels;
    if (from_right) first += row - texel;
    if (from_bottom) first += row * (size_t)(h - 1);
    const ptrdiff_t across = swaps ? down : right, along = swaps ? right : down;
    for (int y0 = 0; y0 < turned.height; y0 += BLOCK) {
        const int y1 = y0 + BLOCK < turned.height ? y0 + BLOCK : turned.height;
        for (int x0 = 0; x0 < turned.width; x0 += BLOCK) {
            const int x1 = x0 + BLOCK < turned.width ? x0 + BLOCK : turned.width;
            for (int y = y0; y < y1; y++) {
                unsigned char *to = (unsigned char *)txm_image_row(&turned, y) + (size_t)x0 * texel;
                for (int x = x0; x < x1; x++, to += texel)
                    memcpy(to, first + x * across + y * along, texel);
            }
        }
    }
    image_free(image);
    *image = turned;
    return 1;
}

/* ---- channels and depth ------------------------------------------------------------------- */

/* Samples as 32 bits, whatever the depth; most is white */
static void convert_texel(const uint32_t *from, int had, uint32_t *to, int wanted, uint32_t most) {
    const int color = had >= 3, alpha = had % 2 == 0;
    /* weights of ITU-R BT.601 in 1/256 */
    const uint32_t gray = color ? (77 * from[0] + 150 * from[1] + 29 * from[2] + 128) >> 8 : from[0];
    for (int c = 0; c < wanted; c++) to[c] = wanted < 3 || !color ? gray : from[c < 3 ? c : 0];
    if (wanted % 2 == 0) to[wanted - 1] = alpha ? from[had - 1] : most;
}

int image_convert(txm_image *image, int channels, txm_sample sample) {
    const int had = image->channels;
    const int is_deep = image->sample == TXM_U16, narrows = is_deep && sample == TXM_U8;
    txm_image out;
    if (had == channels && !narrows) return 1;
    if (!image_new(image->width, image->height, channels, narrows ? TXM_U8 : image->sample, &out))
        return 0;
    for (int y = 0; y < image->height; y++) {
        const void *row = txm_image_row_const(image, y);
        void *to = txm_image_row(&out, y);
        for (size_t x = 0; x < (size_t)image->width; x++) {
            uint32_t from[4] = {0, 0, 0, 0}, values[4];
            for (int c = 0; c < had; c++) {
                const size_t i = x * (size_t)had + (size_t)c;
                from[c] = is_deep ? ((const uint16_t *)row)[i] : ((const uint8_t *)row)[i];
            }
            convert_texel(from, had, values, channels, is_deep ? 65535 : 255);
            for (int c = 0; c < channels; c++) {
                const size_t i = x * (size_t)channels + (size_t)c;
                if (narrows) ((uint8_t *)to)[i] = (uint8_t)((values[c] * 255 + 32895) >> 16);
                else if (is_deep) ((uint16_t *)to)[i] = (uint16_t)values[c];
                else ((uint8_t *)to)[i] = (uint8_t)values[c];
            }
        }
    }
    image_free(image);
    *image = out;
    return 1;
}
