/* image_bmp.c - reads BMP of Windows and OS/2: 1 to 32 bits, from top or bottom, run-length encoded
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

enum {
    FILE_HEAD = 14,
    OLD_HEAD = 12, PLAIN_HEAD = 40, ALPHA_HEAD = 56, PROFILE_HEAD = 124, /* sizes of headers     */
    PLAIN = 0, RUNS_OF_8 = 1, RUNS_OF_4 = 2, MASKS = 3, MASKS_WITH_ALPHA = 6, /* compressions    */
    MOST_COLOURS = 256
};

typedef struct bmp {
    const unsigned char *bytes;
    size_t size, head, pixels; /* of the file; of its second header; where the pixels begin      */
    int64_t width, height;
    int is_top_down, bits;
    uint32_t compression, colours;
    uint32_t masks[4]; /* red, green, blue, alpha */
    unsigned char palette[MOST_COLOURS][3];
} bmp;

static uint32_t number(const unsigned char *p, int bytes) {
    uint32_t value = 0;
    for (int i = bytes; i-- > 0;) value = value << 8 | p[i];
    return value;
}

int bmp_is(const unsigned char *bytes, size_t size) {
    return size >= FILE_HEAD + OLD_HEAD && bytes[0] == 'B' && bytes[1] == 'M' &&
           number(bytes + FILE_HEAD, 4) >= OLD_HEAD && number(bytes + FILE_HEAD, 4) <= PROFILE_HEAD;
}

/* ---- the header --------------------------------------------------------------------------- */

static void read_size(bmp *b, const unsigned char *h) {
    if (b->head == OLD_HEAD) {
        b->width = number(h + 4, 2);
        b->height = number(h + 6, 2);
        b->bits = (int)number(h + 10, 2);
    } else {
        b->width = (int32_t)number(h + 4, 4);
        b->height = (int32_t)number(h + 8, 4);
        b->bits = (int)number(h + 14, 2);
        b->compression = number(h + 16, 4);
        b->colours = number(h + 32, 4);
    }
    b->is_top_down = b->height < 0;
    if (b->is_top_down) b->height = -b->height;
}

/* Where each channel is in a pixel of 16 or 32 bits. *tables moves behind masks that follow the header.
   0: the file ends. */
static int read_masks(bmp *b, size_t *tables) {
    static const uint32_t of_16[4] = {0x7c00, 0x03e0, 0x001f, 0};
    static const uint32_t of_32[4] = {0x00ff0000, 0x0000ff00, 0x000000ff, 0xff000000};
    memcpy(b->masks, b->bits == 16 ? of_16 : of_32, sizeof b->masks);
    if (b->compression != MASKS && b->compression != MASKS_WITH_ALPHA) return 1;
    size_t count = b->compression == MASKS_WITH_ALPHA || b->head >= ALPHA_HEAD ? 4 : 3;
    if (FILE_HEAD + PLAIN_HEAD + 4 * count > b->size) return 0;
    b->masks[3] = 0;
    for (size_t i = 0; i < count; i++)
        b->masks[i] = number(b->bytes + FILE_HEAD + PLAIN_HEAD + 4 * i, 4);
    if (b->head == PLAIN_HEAD) *tables += 4 * count;
    return 1;
}

static int is_known(const bmp *b) {
    switch (b->compression) {
    case PLAIN: return b->bits == 1 || b->bits == 4 || b->bits == 8 || b->bits == 16 || b->bits == 24 ||
                       b->bits == 32;
    case RUNS_OF_8: return b->bits == 8;
    case RUNS_OF_4: return b->bits == 4;
    case MASKS:
    case MASKS_WITH_ALPHA: return b->bits == 16 || b->bits == 32;
    default: return 0;
    }
}

static int read_header(bmp *b, image_source *s) {
    memset(b, 0, sizeof *b);
    b->bytes = s->bytes;
    b->size = s->size;
    b->head = number(s->bytes + FILE_HEAD, 4);
    b->pixels = number(s->bytes + 10, 4);
    size_t tables = FILE_HEAD + b->head;
    if (tables > s->size || (b->head != OLD_HEAD && b->head < PLAIN_HEAD))
        return *s->why = image_damaged, 0;
    read_size(b, s->bytes + FILE_HEAD);
    if (!is_known(b)) return *s->why = "a kind of BMP that is not read; convert it to PNG", 0;
    if (b->width < 0 || !read_masks(b, &tables) || b->pixels > s->size)
        return *s->why = image_damaged, 0;
    if (b->bits <= 8) {
        const size_t entry = b->head == OLD_HEAD ? 3 : 4;
        const uint32_t all = 1u << b->bits, count = b->colours && b->colours < all ? b->colours : all;
        for (size_t i = 0; i < count && tables + entry * (i + 1) <= b->pixels; i++)
            for (size_t c = 0; c < 3; c++) b->palette[i][c] = s->bytes[tables + entry * i + 2 - c];
    }
    if (b->head == PROFILE_HEAD && !memcmp(s->bytes + FILE_HEAD + 56, "DEBM", 4)) { /* MBED, reversed */
        const size_t at = number(s->bytes + FILE_HEAD + 112, 4), size = number(s->bytes + FILE_HEAD + 116, 4);
        if (at < s->size - FILE_HEAD && size <= s->size - FILE_HEAD - at)
            image_check_profile(s, s->bytes + FILE_HEAD + at, size);
    }
    return 1;
}

/* ---- pixels ------------------------------------------------------------------------------- */

static unsigned char *row_of(const bmp *b, const txm_image *image, int y) {
    return (unsigned char *)txm_image_row(image, b->is_top_down ? y : image->height - 1 - y);
}

/* The bits under a mask, as 0..255. */
static unsigned char take(uint32_t pixel, uint32_t mask) {
    if (!mask) return 0;
    while (!(mask & 1)) {
        mask >>= 1;
        pixel >>= 1;
    }
    return (unsigned char)(((uint64_t)(pixel & mask) * 255 + mask / 2) / mask);
}

static void put_pixel(const bmp *b, const unsigned char *from, size_t x, unsigned char *to, int channels) {
    if (b->bits <= 8) {
        const size_t bit = x * (size_t)b->bits;
        const int index = from[bit / 8] >> (8 - b->bits - (int)(bit % 8)) & ((1 << b->bits) - 1);
        memcpy(to, b->palette[index], 3);
    } else if (b->bits == 24) {
        for (size_t c = 0; c < 3; c++) to[c] = from[3 * x + 2 - c];
    } else {
        const int bytes = b->bits / 8;
        const uint32_t pixel = number(from + x * (size_t)bytes, bytes);
        for (int c = 0; c < channels; c++) to[c] = take(pixel, b->masks[c]);
    }
}

static int read_rows(const bmp *b, image_source *s, txm_image *image) {
    const size_t stride = ((size_t)b->width * (size_t)b->bits + 31) / 32 * 4;
    /* what fills up the last row may be missing */
    const size_t last = ((size_t)b->width * (size_t)b->bits + 7) / 8;
    const size_t left = s->size - b->pixels;
    if (left < last || (left - last) / stride < (size_t)b->height - 1) return *s->why = image_damaged, 0;
    if (!image_begin(s, (uint64_t)b->width, (uint64_t)b->height, b->masks[3] && b->bits == 32 ? 4 : 3,
                     TXM_U8, image))
        return 0;
    for (int y = 0; y < image->height; y++) {
        const unsigned char *from = s->bytes + b->pixels + (size_t)y * stride;
        unsigned char *to = row_of(b, image, y);
        if (!image_continue(s->job, s->why, (size_t)y, (size_t)b->height, "read")) return 0;
        for (size_t x = 0; x < (size_t)b->width; x++)
            put_pixel(b, from, x, to + x * (size_t)image->channels, image->channels);
    }
    return 1;
}

/* ---- run-length encoding -------------------------------------------------------------------- */

/* Pixels of a code: all from two indices in turn, or each its own. */
static int put_run(const bmp *b, txm_image *image, int64_t *x, int64_t y, int count,
                   const unsigned char *indices, int is_run) {
    if (*x + count > b->width || y >= b->height) return 0;
    unsigned char *row = row_of(b, image, (int)y);
    for (int i = 0; i < count; i++, ++*x) {
        const int at = is_run ? i % 2 : i;
        const int index = b->bits == 8 ? indices[is_run ? 0 : i]
                                       : indices[at / 2] >> (at % 2 ? 0 : 4) & 15;
        memcpy(row + 3 * (size_t)*x, b->palette[index], 3);
    }
    return 1;
}

/* What no code sets has the first colour. */
static void fill(const bmp *b, txm_image *image) {
    for (int y = 0; y < image->height; y++) {
        unsigned char *row = (unsigned char *)txm_image_row(image, y);
        for (size_t x = 0; x < (size_t)image->width; x++) memcpy(row + 3 * x, b->palette[0], 3);
    }
}

static int read_runs(const bmp *b, image_source *s, txm_image *image) {
    const unsigned char *at = s->bytes + b->pixels, *end = s->bytes + s->size;
    int64_t x = 0, y = 0;
    if (!image_begin(s, (uint64_t)b->width, (uint64_t)b->height, 3, TXM_U8, image)) return 0;
    fill(b, image);
    while (y < b->height && end - at >= 2) {
        const int count = at[0], value = at[1];
        at += 2;
        if (count > 0) {
            if (!put_run(b, image, &x, y, count, at - 1, 1)) break;
        } else if (value == 0) { /* the end of a row */
            x = 0;
            y++;
            if (!image_continue(s->job, s->why, (size_t)y, (size_t)b->height, "read")) return 0;
        } else if (value == 1) { /* the end of the picture */
            return 1;
        } else if (value == 2) { /* a step to the right and up */
            if (end - at < 2) break;
            x += at[0];
            y += at[1];
            at += 2;
        } else { /* as many pixels as they are, filled up to words */
            const int bytes = (value * b->bits + 7) / 8, padded = bytes + bytes % 2;
            if (end - at < bytes || !put_run(b, image, &x, y, value, at, 0)) break;
            at += end - at < padded ? bytes : padded;
        }
    }
    /* the last code may be missing */
    if (y == b->height || (y == b->height - 1 && x == b->width)) return 1;
    return *s->why = image_damaged, 0;
}

/* The fourth byte of plain pixels of 32 bits: alpha unless it is empty everywhere. */
static int drop_empty_alpha(image_source *s, txm_image *image) {
    for (int y = 0; y < image->height; y++) {
        const unsigned char *row = (const unsigned char *)txm_image_row_const(image, y);
        for (size_t x = 0; x < (size_t)image->width; x++)
            if (row[4 * x + 3]) return 1;
    }
    return image_convert(image, 3, TXM_U8) ? 1 : (*s->why = image_no_memory, 0);
}

int bmp_read(image_source *s, txm_image *image) {
    bmp b;
    if (!read_header(&b, s)) return 0;
    if (!image_check_size(s, (uint64_t)b.width, (uint64_t)b.height)) return 0;
    if (b.compression == RUNS_OF_8 || b.compression == RUNS_OF_4) return read_runs(&b, s, image);
    if (!read_rows(&b, s, image)) return 0;
    return b.compression == PLAIN && image->channels == 4 ? drop_empty_alpha(s, image) : 1;
}
