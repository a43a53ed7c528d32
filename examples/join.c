/* join.c - tiles of a picture in, one picture out, of any size
   SPDX-License-Identifier: MIT OR Unlicense

   join OUT.tif|OUT.ppm|OUT.pgm COLUMNS TILE...

   TILEs are pictures in rows from top to bottom, COLUMNS in each row. All have the size of the first,
   except those in the last column and the last row, which may be smaller; plane.sh makes such tiles.
   Only one tile is in memory at a time.

   A .tif is a BigTIFF whose own tiles are the tiles given: programs for large pictures (libvips,
   GDAL, QGIS, ImageMagick) read any part of it directly, and can compress it. A .ppm or .pgm stores
   the samples row by row. All keep 16 bits if the tiles have them.            */
#define _XOPEN_SOURCE 700 /* POSIX: fseeko */
#include "files/image_io.h"
#include "files/stb_config.h"

#include <stdio.h>

typedef struct picture {
    FILE *file;
    int is_tiff;
    size_t width, height, columns, rows; /* pixels and tiles of the whole                      */
    size_t tile_width, tile_height;      /* of all but the last tiles                          */
    size_t channels, bytes;              /* bytes of a sample: 1 or 2                          */
    uint64_t at;                         /* where the pixels begin in the file                 */
} picture;

/* A number, most significant byte first: the order of PNM and one of the two of TIFF. */
static int put(FILE *file, uint64_t value, int bytes) {
    while (bytes-- > 0)
        if (putc((int)(value >> (8 * bytes) & 255), file) == EOF) return 0;
    return 1;
}

/* ---- headers ------------------------------------------------------------------------------ */

static int begin_pnm(picture *p) {
    const int n = fprintf(p->file, "P%c\n%zu %zu\n%d\n", p->channels == 1 ? '5' : '6', p->width,
                          p->height, p->bytes == 1 ? 255 : 65535);
    p->at = (uint64_t)n;
    return n > 0;
}

/* An entry of TIFF's directory, 20 bytes. Values of up to 8 bytes are stored in the entry itself,
   left-aligned; for longer ones `value` is their offset in the file. */
static int put_entry(picture *p, int tag, int type, uint64_t count, uint64_t value) {
    const int bytes = type == 3 ? 2 : type == 4 ? 4 : 8;
    int ok = put(p->file, (uint64_t)tag, 2) && put(p->file, (uint64_t)type, 2) &&
             put(p->file, count, 8);
    if ((uint64_t)bytes * count > 8) return ok && put(p->file, value, 8);
    for (uint64_t i = 0; i < count; i++) ok = ok && put(p->file, value, bytes);
    return ok && put(p->file, 0, 8 - bytes * (int)count);
}

/*  0: header | 16: directory | offsets of tiles | sizes of tiles | at: tile 0 | tile 1 | ...  */
static int begin_tiff(picture *p) {
    enum { SHORT = 3, LONG = 4, LONG8 = 16 };
    const uint64_t count = p->columns * p->rows, entries = 11 + (p->channels == 4);
    const uint64_t size = (uint64_t)p->tile_width * p->tile_height * p->channels * p->bytes;
    const uint64_t places = 16 + 8 + 20 * entries + 8, sizes = places + 8 * count;
    p->at = sizes + 8 * count;
    int ok = fputs("MM", p->file) >= 0 && put(p->file, 43, 2) && put(p->file, 8, 2) &&
             put(p->file, 0, 2) && put(p->file, 16, 8) && put(p->file, entries, 8) &&
             put_entry(p, 256, LONG, 1, p->width) && put_entry(p, 257, LONG, 1, p->height) &&
             put_entry(p, 258, SHORT, p->channels, 8 * p->bytes) &&
             put_entry(p, 259, SHORT, 1, 1) &&                         /* not compressed    */
             put_entry(p, 262, SHORT, 1, p->channels == 1 ? 1 : 2) &&  /* gray or RGB       */
             put_entry(p, 277, SHORT, 1, p->channels) &&
             put_entry(p, 284, SHORT, 1, 1) && /* the channels are interleaved              */
             put_entry(p, 322, LONG, 1, p->tile_width) &&
             put_entry(p, 323, LONG, 1, p->tile_height) &&
             put_entry(p, 324, LONG8, count, count == 1 ? p->at : places) &&
             put_entry(p, 325, LONG8, count, count == 1 ? size : sizes) &&
             (p->channels != 4 || put_entry(p, 338, SHORT, 1, 2)) &&   /* not premultiplied */
             put(p->file, 0, 8);
    for (uint64_t i = 0; i < count; i++) ok = ok && put(p->file, p->at + i * size, 8);
    for (uint64_t i = 0; i < count; i++) ok = ok && put(p->file, size, 8);
    /* tiles are stored in full size; beyond the picture they are 0, to the end of the file */
    return ok && fseeko(p->file, (off_t)(p->at + count * size - 1), SEEK_SET) == 0 &&
           put(p->file, 0, 1);
}

/* ---- tiles -------------------------------------------------------------------------------- */

/* The size of the picture, from its first tile and the last tiles of the first row and column. */
static int measure(picture *p, char **tiles, const txm_image *first) {
    int width, height, unused;
    p->tile_width = (size_t)first->width;
    p->tile_height = (size_t)first->height;
    p->channels = (size_t)first->channels;
    p->bytes = txm_sample_bytes(first->sample);
    if (!stbi_info(tiles[p->columns - 1], &width, &unused, &unused) ||
        !stbi_info(tiles[(p->rows - 1) * p->columns], &unused, &height, &unused))
        return 0;
    p->width = (p->columns - 1) * p->tile_width + (size_t)width;
    p->height = (p->rows - 1) * p->tile_height + (size_t)height;
    return 1;
}

static int has_its_place(const picture *p, size_t index, const txm_image *tile) {
    const size_t right = p->width - index % p->columns * p->tile_width;
    const size_t below = p->height - index / p->columns * p->tile_height;
    return (size_t)tile->channels == p->channels && txm_sample_bytes(tile->sample) == p->bytes &&
           (size_t)tile->width == (right < p->tile_width ? right : p->tile_width) &&
           (size_t)tile->height == (below < p->tile_height ? below : p->tile_height);
}

/* Write each row to its place in the file. */
static int write_tile(picture *p, size_t index, const txm_image *tile) {
    const size_t texel = p->channels * p->bytes, bytes = texel * (size_t)tile->width;
    const uint64_t x = index % p->columns * p->tile_width, y = index / p->columns * p->tile_height;
    for (int v = 0; v < tile->height; v++) {
        unsigned char *row = (unsigned char *)txm_image_row(tile, v);
        const uint64_t pixel = p->is_tiff ? (index * p->tile_height + (uint64_t)v) * p->tile_width
                                          : (y + (uint64_t)v) * p->width + x;
        for (size_t i = 0; p->bytes == 2 && i < bytes; i += 2) { /* most significant byte first */
            uint16_t sample;
            memcpy(&sample, row + i, 2);
            row[i] = (unsigned char)(sample >> 8);
            row[i + 1] = (unsigned char)(sample & 255);
        }
        if (fseeko(p->file, (off_t)(p->at + pixel * texel), SEEK_SET) != 0 ||
            fwrite(row, 1, bytes, p->file) != bytes)
            return 0;
    }
    return 1;
}

/* Returns NULL, or what is wrong, and in *name with which tile. */
static const char *join(picture *p, char **tiles, const char **name) {
    const char *why = NULL;
    for (size_t i = 0; i < p->columns * p->rows && !why; i++) {
        txm_image tile;
        *name = tiles[i];
        if (!image_read_deep(tiles[i], 0, &tile, &why)) return why;
        if (i == 0) {
            if (!measure(p, tiles, &tile)) why = "the tiles beside or below it cannot be read";
            else if (p->is_tiff && (tile.width % 16 || tile.height % 16))
                why = "the sides of TIFF's tiles must be multiples of 16; make a .ppm";
            else if (!p->is_tiff && tile.channels == 4) why = "a .ppm has no alpha; make a .tif";
            else if (!(p->is_tiff ? begin_tiff : begin_pnm)(p))
                why = "the picture cannot be written";
        }
        if (!why && !has_its_place(p, i, &tile)) why = "its size or format is not that of the first tile";
        if (!why && !write_tile(p, i, &tile)) why = "the picture cannot be written";
        image_free(&tile);
    }
    return why;
}

int main(int argc, char **argv) {
    picture p = {0};
    const int columns = argc > 3 ? atoi(argv[2]) : 0;
    char extension[8];
    if (columns < 1 || (argc - 3) % columns != 0) {
        fprintf(stderr, "usage: join OUT.tif|OUT.ppm|OUT.pgm COLUMNS TILE...\n");
        return 2;
    }
    file_extension(argv[1], extension);
    p.is_tiff = !strncmp(extension, ".tif", 4);
    p.columns = (size_t)columns;
    p.rows = (size_t)(argc - 3) / p.columns;
    p.file = fopen(argv[1], "wb");

    const char *name = argv[1];
    const char *failed = p.file ? join(&p, argv + 3, &name) : "cannot make it";
    if (p.file && fclose(p.file) != 0 && !failed) failed = "the picture cannot be written";
    if (failed && p.file) remove(argv[1]);
    if (failed) fprintf(stderr, "join: '%s': %s\n", name, failed);
    return failed != NULL;
}
