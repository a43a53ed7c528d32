/* image_tga.c - reads Targa: gray, true colour or with a palette, also run-length encoded, from any corner
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

enum {
    HEAD = 18,                                    /* bytes                                    */
    PALETTE = 1, TRUE_COLOUR = 2, GRAY = 3,       /* kinds, 8 more if run-length encoded      */
    RUN_LENGTH = 8,
    ALPHA_BITS = 15, FROM_RIGHT = 16, FROM_TOP = 32, INTERLEAVED = 192 /* of the descriptor */
};

typedef struct tga {
    int kind, is_run_length;
    int bits, entry_bits;     /* of a pixel; of an entry of the palette     */
    unsigned width, height, first, count; /* of the palette                             */
    int descriptor, channels;
    const unsigned char *at, *end, *palette;
} tga;

static unsigned number(const unsigned char *p) {
    return p[0] | (unsigned)p[1] << 8;
}

static int is_one_of(int bits, int a, int b, int c, int d) {
    return bits == a || bits == b || bits == c || bits == d;
}

/* There is no signature: the header must make sense. 0: it does not. */
static int read_header(tga *t, const unsigned char *bytes, size_t size) {
    if (size < HEAD || bytes[1] > 1) return 0;
    t->is_run_length = bytes[2] >= RUN_LENGTH;
    t->kind = bytes[2] - (t->is_run_length ? RUN_LENGTH : 0);
    t->first = number(bytes + 3);
    t->count = bytes[1] ? number(bytes + 5) : 0;
    t->entry_bits = bytes[7];
    t->width = number(bytes + 12);
    t->height = number(bytes + 14);
    t->bits = bytes[16];
    t->descriptor = bytes[17];
    if (t->width == 0 || t->height == 0 || t->descriptor & INTERLEAVED) return 0;
    if (t->count && !is_one_of(t->entry_bits, 15, 16, 24, 32)) return 0;
    switch (t->kind) {
    case PALETTE: return t->count > 0 && (t->bits == 8 || t->bits == 16);
    case TRUE_COLOUR: return is_one_of(t->bits, 15, 16, 24, 32);
    case GRAY: return t->bits == 8 || t->bits == 16;
    default: return 0;
    }
}

int tga_is(const unsigned char *bytes, size_t size) {
    tga t;
    return read_header(&t, bytes, size);
}

/* Colours are stored blue first; those of 15 and 16 bits have 5 bits a channel. */
static void take_colour(const unsigned char *p, int bits, unsigned char *to) {
    if (bits <= 16) {
        const unsigned v = number(p);
        for (int c = 0; c < 3; c++) to[c] = (unsigned char)(((v >> (10 - 5 * c) & 31) * 255 + 15) / 31);
    } else {
        for (int c = 0; c < 3; c++) to[c] = p[2 - c];
        if (bits == 32) to[3] = p[3];
    }
}

static void take_pixel(const tga *t, const unsigned char *p, unsigned char *to) {
    if (t->kind == GRAY) {
        to[0] = p[0];
        if (t->bits == 16) to[1] = p[1];
    } else if (t->kind == TRUE_COLOUR) {
        take_colour(p, t->bits, to);
    } else { /* an index beyond the palette stays black */
        const unsigned i = (t->bits == 8 ? p[0] : number(p)) - t->first;
        const size_t entry = (size_t)(t->entry_bits + 7) / 8;
        if (i < t->count) take_colour(t->palette + i * entry, t->entry_bits, to);
    }
}

/* Where the file's pixel x of row y is in the upright picture. */
static unsigned char *place(const tga *t, const txm_image *image, int x, int y) {
    const int row = t->descriptor & FROM_TOP ? y : image->height - 1 - y;
    const int column = t->descriptor & FROM_RIGHT ? image->width - 1 - x : x;
    return (unsigned char *)txm_image_row(image, row) + (size_t)column * (size_t)image->channels;
}

static int read_pixels(tga *t, image_source *s, txm_image *image) {
    const size_t bytes = (size_t)(t->bits + 7) / 8;
    int run = 0, repeats = 0; /* pixels left of a packet, which repeats one pixel or holds them all */
    for (int y = 0; y < image->height; y++) {
        if (!image_continue(s->job, s->why, (size_t)y, t->height, "read")) return 0;
        for (int x = 0; x < image->width; x++, run--) {
            if (t->is_run_length && run == 0) {
                if (t->at == t->end) return *s->why = image_damaged, 0;
                repeats = *t->at >> 7;
                run = (*t->at++ & 127) + 1;
            }
            if ((size_t)(t->end - t->at) < bytes) return *s->why = image_damaged, 0;
            take_pixel(t, t->at, place(t, image, x, y));
            if (!repeats || run == 1) t->at += bytes;
        }
    }
    return 1;
}

/* The fourth channel of files that do not say what it is: alpha unless it is empty. */
static int has_alpha(const tga *t, const txm_image *image) {
    if (image->channels != 4 || t->descriptor & ALPHA_BITS) return 1;
    for (int y = 0; y < image->height; y++) {
        const unsigned char *row = (const unsigned char *)txm_image_row_const(image, y);
        for (int x = 0; x < image->width; x++)
            if (row[4 * (size_t)x + 3]) return 1;
    }
    return 0;
}

int tga_read(image_source *s, txm_image *image) {
    tga t;
    if (!read_header(&t, s->bytes, s->size)) return *s->why = image_damaged, 0;
    const size_t entries = t.count * ((size_t)(t.entry_bits + 7) / 8);
    const size_t head = HEAD + (size_t)s->bytes[0]; /* with a comment */
    const int bits = t.kind == PALETTE ? t.entry_bits : t.bits;
    if (head > s->size || entries > s->size - head) return *s->why = image_damaged, 0;
    t.palette = s->bytes + head;
    t.at = t.palette + entries;
    t.end = s->bytes + s->size;
    t.channels = t.kind == GRAY ? t.bits / 8 : bits == 32 ? 4 : 3;
    if (!image_check_size(s, t.width, t.height)) return 0;
    /* a packet of two bytes or more holds at most 128 pixels */
    if ((uint64_t)t.width * t.height / (t.is_run_length ? 64 : 1) > (uint64_t)(t.end - t.at))
        return *s->why = image_damaged, 0;
    if (!image_begin(s, t.width, t.height, t.channels, TXM_U8, image) || !read_pixels(&t, s, image))
        return 0;
    if (!has_alpha(&t, image) && !image_convert(image, 3, TXM_U8)) return *s->why = image_no_memory, 0;
    return 1;
}
