/* filekit.h - image files made byte by byte, for tests and fuzz programs of the image readers
   SPDX-License-Identifier: MIT OR Unlicense */
#ifndef FILEKIT_H
#define FILEKIT_H

#include "files/image_io.h"

enum { FK_ROOM = 1 << 16 };

/* ---- bytes that are put one behind the other ------------------------------------------------ */

typedef struct fk_file {
    unsigned char bytes[FK_ROOM];
    size_t size;
} fk_file;

static inline void fk_put(fk_file *f, const void *bytes, size_t size) {
    if (size > FK_ROOM - f->size) abort();
    if (size) memcpy(f->bytes + f->size, bytes, size);
    f->size += size;
}

static inline void fk_byte(fk_file *f, int value) {
    const unsigned char byte = (unsigned char)(value & 255);
    fk_put(f, &byte, 1);
}

/* a number of so many bytes: the high one first, or the low one */
static inline void fk_big(fk_file *f, uint32_t value, int bytes) {
    for (int i = bytes - 1; i >= 0; i--) fk_byte(f, i < 4 ? (int)(value >> (8 * i) & 255) : 0);
}

static inline void fk_little(fk_file *f, uint32_t value, int bytes) {
    for (int i = 0; i < bytes; i++) fk_byte(f, i < 4 ? (int)(value >> (8 * i) & 255) : 0);
}

/* bytes into the middle */
static inline void fk_insert(fk_file *f, size_t at, const void *bytes, size_t size) {
    if (size > FK_ROOM - f->size || at > f->size) abort();
    memmove(f->bytes + at + size, f->bytes + at, f->size - at);
    memcpy(f->bytes + at, bytes, size);
    f->size += size;
}

/* ---- PNG ----------------------------------------------------------------------------------- */

static inline uint32_t fk_crc(const unsigned char *p, size_t count) {
    uint32_t crc = 0xffffffffu;
    while (count-- > 0) {
        crc ^= *p++;
        for (int k = 0; k < 8; k++) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    }
    return ~crc;
}

static inline uint32_t fk_number(const unsigned char *p) {
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

/* a chunk behind the others */
static inline void fk_chunk(fk_file *f, const char *name, const void *data, size_t size) {
    fk_big(f, (uint32_t)size, 4);
    fk_put(f, name, 4);
    fk_put(f, data, size);
    fk_big(f, fk_crc(f->bytes + f->size - size - 4, size + 4), 4);
}

/* a chunk between the header and the rest */
static inline void fk_insert_chunk(fk_file *png, const char *name, const void *data, size_t size) {
    fk_file *chunk = (fk_file *)calloc(1, sizeof *chunk);
    if (!chunk) abort();
    fk_chunk(chunk, name, data, size);
    fk_insert(png, 33, chunk->bytes, chunk->size);
    free(chunk);
}

static inline void fk_begin_png(fk_file *f, int width, int height, int bits, int kind) {
    fk_file head = {{0}, 0};
    f->size = 0;
    fk_put(f, "\x89PNG\r\n\x1a\n", 8);
    fk_big(&head, (uint32_t)width, 4);
    fk_big(&head, (uint32_t)height, 4);
    fk_byte(&head, bits);
    fk_byte(&head, kind);
    fk_big(&head, 0, 3);
    fk_chunk(f, "IHDR", head.bytes, head.size);
}

/* The rows, a filter byte before each, not packed; and the end. */
static inline void fk_end_png(fk_file *f, const void *rows, size_t size) {
    const unsigned char *p = (const unsigned char *)rows;
    fk_file data = {{0}, 0};
    uint32_t a = 1, b = 0;
    for (size_t i = 0; i < size; i++) {
        a = (a + p[i]) % 65521;
        b = (b + a) % 65521;
    }
    fk_put(&data, "\x78\x01\x01", 3);
    fk_little(&data, (uint32_t)size, 2);
    fk_little(&data, ~(uint32_t)size, 2);
    fk_put(&data, rows, size);
    fk_big(&data, b << 16 | a, 4);
    fk_chunk(f, "IDAT", data.bytes, data.size);
    fk_chunk(f, "IEND", NULL, 0);
}

/* Make the checksums of all chunks right again. */
static inline void fk_mend_png(unsigned char *bytes, size_t size) {
    for (size_t at = 8; at + 12 <= size;) {
        const size_t length = fk_number(bytes + at);
        if (length > size - at - 12) return;
        const uint32_t crc = fk_crc(bytes + at + 4, length + 4);
        for (int i = 0; i < 4; i++) bytes[at + 8 + length + (size_t)i] = (unsigned char)(crc >> (24 - 8 * i));
        at += length + 12;
    }
}

/* ---- what several formats hold --------------------------------------------------------------- */

/* EXIF that tells the orientation, in either order of bytes, without the word "Exif". */
static inline void fk_exif(fk_file *f, int orientation, int big) {
    void (*put)(fk_file *, uint32_t, int) = big ? fk_big : fk_little;
    fk_put(f, big ? "MM" : "II", 2);
    put(f, 42, 2);
    put(f, 8, 4);
    put(f, 2, 2);     /* entries */
    put(f, 0x100, 2); /* the width, a long number */
    put(f, 4, 2);
    put(f, 1, 4);
    put(f, 77, 4);
    put(f, 274, 2);
    put(f, 3, 2);
    put(f, 1, 4);
    put(f, (uint32_t)orientation, 2);
    put(f, 0, 2);
    put(f, 0, 4); /* no more directories */
}

/* A colour profile: primaries in 1/65536, red, green, blue; one gamma in 1/256. */
static inline void fk_icc(fk_file *f, const int primaries[9], int gamma) {
    static const char *const names[3] = {"rXYZ", "gXYZ", "bXYZ"}, *const curves[3] = {"rTRC", "gTRC", "bTRC"};
    const uint32_t tables = 128 + 4 + 6 * 12, size = tables + 3 * 20 + 16;
    f->size = 0;
    fk_big(f, size, 4);
    fk_put(f, "test\2\0\0\0mntrRGB XYZ ", 20);
    fk_big(f, 2026u << 16 | 1, 4);
    fk_big(f, 1u << 16, 4);
    fk_big(f, 0, 4);
    fk_put(f, "acsp", 4);
    while (f->size < 68) fk_byte(f, 0);
    fk_big(f, 0xf6d6, 4); /* D50 */
    fk_big(f, 0x10000, 4);
    fk_big(f, 0xd32d, 4);
    while (f->size < 128) fk_byte(f, 0);
    fk_big(f, 6, 4);
    for (uint32_t i = 0; i < 3; i++) {
        fk_put(f, names[i], 4);
        fk_big(f, tables + 20 * i, 4);
        fk_big(f, 20, 4);
    }
    for (uint32_t i = 0; i < 3; i++) {
        fk_put(f, curves[i], 4);
        fk_big(f, tables + 60, 4);
        fk_big(f, 14, 4);
    }
    for (int i = 0; i < 3; i++) {
        fk_put(f, "XYZ \0\0\0\0", 8);
        for (int c = 0; c < 3; c++) fk_big(f, (uint32_t)primaries[3 * i + c], 4);
    }
    fk_put(f, "curv\0\0\0\0", 8);
    fk_big(f, 1, 4);
    fk_big(f, (uint32_t)gamma, 2);
    fk_big(f, 0, 2);
}

/* ---- BMP and TGA ----------------------------------------------------------------------------- */

/* The heads of a BMP of Windows; what follows is the palette or masks, then the pixels. */
static inline void fk_begin_bmp(fk_file *f, int width, int height, int bits, int compression, int colours,
                                int between) {
    f->size = 0;
    fk_put(f, "BM", 2);
    fk_little(f, 0, 8);
    fk_little(f, (uint32_t)(54 + between), 4);
    fk_little(f, 40, 4);
    fk_little(f, (uint32_t)width, 4);
    fk_little(f, (uint32_t)height, 4);
    fk_little(f, 1, 2);
    fk_little(f, (uint32_t)bits, 2);
    fk_little(f, (uint32_t)compression, 4);
    fk_little(f, 0, 12);
    fk_little(f, (uint32_t)colours, 4);
    fk_little(f, 0, 4);
}

static inline void fk_begin_tga(fk_file *f, int kind, int width, int height, int bits, int descriptor,
                                int colours, int colour_bits) {
    f->size = 0;
    fk_byte(f, 0);
    fk_byte(f, colours > 0);
    fk_byte(f, kind);
    fk_little(f, 0, 2);
    fk_little(f, (uint32_t)colours, 2);
    fk_byte(f, colour_bits);
    fk_little(f, 0, 4);
    fk_little(f, (uint32_t)width, 2);
    fk_little(f, (uint32_t)height, 2);
    fk_byte(f, bits);
    fk_byte(f, descriptor);
}

#endif /* FILEKIT_H */
