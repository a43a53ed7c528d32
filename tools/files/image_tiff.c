/* image_tiff.c - TIFF in and out, by libtiff where it is installed
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

int tiff_is(const unsigned char *bytes, size_t size) {
    return size >= 8 && (!memcmp(bytes, "II*\0", 4) || !memcmp(bytes, "MM\0*", 4) ||
                         !memcmp(bytes, "II+\0", 4) || !memcmp(bytes, "MM\0+", 4));
}

#ifndef TEXKIT_TIFF

const int tiff_is_built_in = 0;

int tiff_read(image_source *s, txm_image *image) {
    (void)image;
    return *s->why = "this texkit was built without libtiff; convert it to PNG", 0;
}

int tiff_write(image_target *t, const txm_image *image) {
    (void)image;
    return *t->why = "this texkit was built without libtiff", 0;
}

#else

#include <stdio.h>
#include <tiffio.h>

const int tiff_is_built_in = 1;

enum {
    MOST_SAMPLES = 16,         /* of a pixel                                                 */
    MOST_TILE_BYTES = 1 << 28, /* a small picture may lie in a large tile                    */
    STRIP_BYTES = 1 << 18      /* of the strips that are written                             */
};

/* ---- a file in memory: read from, or written to and grown ---------------------------------------- */

typedef struct memory {
    const unsigned char *bytes;
    size_t size, at;
    image_target *t; /* if it is written */
} memory;

static tmsize_t read_memory(thandle_t handle, void *to, tmsize_t size) {
    memory *m = (memory *)handle;
    const unsigned char *bytes = m->t ? m->t->bytes : m->bytes;
    const size_t end = m->t ? m->t->size : m->size;
    size_t n = m->at < end ? end - m->at : 0;
    if (n > (size_t)size) n = (size_t)size;
    if (n) memcpy(to, bytes + m->at, n);
    m->at += n;
    return (tmsize_t)n;
}

static tmsize_t write_memory(thandle_t handle, void *from, tmsize_t size) {
    memory *m = (memory *)handle;
    static const unsigned char zeros[64];
    while (m->t && m->at > m->t->size && !m->t->is_full) { /* a gap */
        const size_t gap = m->at - m->t->size;
        image_put(m->t, zeros, gap < sizeof zeros ? gap : sizeof zeros);
    }
    if (!m->t || m->t->is_full) return 0;
    const size_t inside = m->t->size - m->at, n = (size_t)size < inside ? (size_t)size : inside;
    if (n) memcpy(m->t->bytes + m->at, from, n);
    image_put(m->t, (const unsigned char *)from + n, (size_t)size - n);
    m->at += (size_t)size;
    return m->t->is_full ? 0 : size;
}

static toff_t seek_memory(thandle_t handle, toff_t offset, int from) {
    memory *m = (memory *)handle;
    if (from == SEEK_CUR) offset += m->at;
    if (from == SEEK_END) offset += m->t ? m->t->size : m->size;
    m->at = (size_t)offset;
    return offset;
}

static toff_t size_of_memory(thandle_t handle) {
    const memory *m = (const memory *)handle;
    return m->t ? m->t->size : m->size;
}

static int close_memory(thandle_t handle) {
    (void)handle;
    return 0;
}

static TIFF *open_memory(memory *m, const char *mode) {
    TIFFSetErrorHandler(NULL); /* else it prints */
    TIFFSetWarningHandler(NULL);
    return TIFFClientOpen("picture", mode, (thandle_t)m, read_memory, write_memory, seek_memory,
                          close_memory, size_of_memory, NULL, NULL);
}

/* ---- reading ------------------------------------------------------------------------------ */

typedef struct reading {
    TIFF *file;
    image_source *s;
    txm_image *image;
    uint32_t width, height;
    uint16_t bits, samples, photometric, planar, format;
    int has_alpha, is_premultiplied;
} reading;

static int read_fields(reading *r) {
    uint16_t extras = 0, orientation = 1, compression = 1, *kinds = NULL;
    uint32_t size = 0;
    void *icc = NULL;
    TIFF *f = r->file;
    if (!TIFFGetField(f, TIFFTAG_IMAGEWIDTH, &r->width) || !TIFFGetField(f, TIFFTAG_IMAGELENGTH, &r->height))
        return *r->s->why = image_damaged, 0;
    if (!image_check_size(r->s, r->width, r->height)) return 0;
    TIFFGetFieldDefaulted(f, TIFFTAG_BITSPERSAMPLE, &r->bits);
    TIFFGetFieldDefaulted(f, TIFFTAG_SAMPLESPERPIXEL, &r->samples);
    TIFFGetFieldDefaulted(f, TIFFTAG_PLANARCONFIG, &r->planar);
    TIFFGetFieldDefaulted(f, TIFFTAG_SAMPLEFORMAT, &r->format);
    TIFFGetFieldDefaulted(f, TIFFTAG_EXTRASAMPLES, &extras, &kinds);
    TIFFGetFieldDefaulted(f, TIFFTAG_ORIENTATION, &orientation);
    TIFFGetFieldDefaulted(f, TIFFTAG_COMPRESSION, &compression);
    if (!TIFFGetField(f, TIFFTAG_PHOTOMETRIC, &r->photometric)) r->photometric = PHOTOMETRIC_MINISBLACK;
    r->is_premultiplied = extras > 0 && kinds[0] == EXTRASAMPLE_ASSOCALPHA;
    r->has_alpha = r->is_premultiplied || (extras > 0 && kinds[0] == EXTRASAMPLE_UNASSALPHA);
    if (orientation >= IMAGE_UPRIGHT && orientation <= IMAGE_LAST_ORIENTATION)
        r->s->orientation = orientation;
    if (!TIFFIsCODECConfigured(compression))
        return *r->s->why = "a compression that libtiff does not know; convert it to PNG", 0;
    if (r->format != SAMPLEFORMAT_UINT && r->format != SAMPLEFORMAT_VOID)
        return *r->s->why = "samples that are float or signed; convert it to 16 bits", 0;
    if (TIFFGetField(f, TIFFTAG_ICCPROFILE, &size, &icc) && r->photometric != PHOTOMETRIC_SEPARATED)
        image_check_profile(r->s, (const unsigned char *)icc, size);
    return 1;
}

/* One strip or tile: which part of the picture it holds, and how its pixels lie. */
typedef struct unit {
    uint32_t x, y, width, height; /* of the part inside the picture                */
    size_t row, pixel;            /* samples from one row or pixel to the next      */
    int first, channels;          /* of the picture's channels                      */
} unit;

/* The unit's samples into the picture. */
static void place_unit(const reading *r, const unit *u, const unsigned char *from) {
    const uint32_t flip = r->photometric != PHOTOMETRIC_MINISWHITE ? 0 : r->bits == 16 ? 0xffff : 0xff;
    const size_t channels = (size_t)r->image->channels;
    const uint16_t *wide = (const uint16_t *)(const void *)from;
    for (uint32_t y = 0; y < u->height; y++) {
        void *row = txm_image_row(r->image, (int)(u->y + y));
        for (uint32_t x = 0; x < u->width; x++) {
            for (int c = 0; c < u->channels; c++) {
                const size_t i = y * u->row + x * u->pixel + (size_t)c;
                const size_t o = (u->x + x) * channels + (size_t)(u->first + c);
                const uint32_t mask = u->first + c == 0 ? flip : 0; /* gray has one */
                if (r->bits == 16) ((uint16_t *)row)[o] = (uint16_t)(wide[i] ^ mask);
                else ((uint8_t *)row)[o] = (uint8_t)(from[i] ^ mask);
            }
        }
    }
}

/* Samples of 8 or 16 bits as they are, in strips or tiles, of all channels or of one each. */
static int read_plain(reading *r, int colours) {
    TIFF *f = r->file;
    const int is_tiled = TIFFIsTiled(f), apart = r->planar == PLANARCONFIG_SEPARATE;
    const int channels = colours + (r->has_alpha && r->samples > colours);
    uint32_t w = r->width, h = r->height;
    TIFFGetFieldDefaulted(f, is_tiled ? TIFFTAG_TILELENGTH : TIFFTAG_ROWSPERSTRIP, &h);
    if (is_tiled) TIFFGetField(f, TIFFTAG_TILEWIDTH, &w);
    else if (h > r->height) h = r->height;
    if (w == 0 || h == 0) return *r->s->why = image_damaged, 0;
    const size_t inside = apart ? 1 : r->samples, sample = r->bits / 8u;
    size_t bytes = 0;
    const tmsize_t size = is_tiled ? TIFFTileSize(f) : TIFFStripSize(f);
    if (!txm_mul(w, h, inside * sample, &bytes) || size <= 0 || bytes != (size_t)size ||
        (is_tiled && bytes > MOST_TILE_BYTES))
        return *r->s->why = image_damaged, 0;
    if (!image_begin(r->s, r->width, r->height, channels, r->bits == 16 ? TXM_U16 : TXM_U8, r->image))
        return 0;
    unsigned char *block = (unsigned char *)malloc(bytes);
    if (!block) return *r->s->why = image_no_memory, 0;
    int ok = 1;
    for (int plane = 0; plane < (apart ? channels : 1) && ok; plane++) {
        for (uint32_t y = 0; y < r->height && ok; y += h) {
            for (uint32_t x = 0; x < r->width && ok; x += w) {
                unit u = {x, y, r->width - x, r->height - y, w * inside, inside, plane,
                          apart ? 1 : channels};
                if (u.width > w) u.width = w;
                if (u.height > h) u.height = h;
                /* the last strip is shorter, tiles never are */
                const size_t needed = is_tiled ? bytes : u.height * w * inside * sample;
                const tmsize_t got =
                    is_tiled ? TIFFReadEncodedTile(f, TIFFComputeTile(f, x, y, 0, (uint16_t)plane), block, size)
                             : TIFFReadEncodedStrip(f, TIFFComputeStrip(f, y, (uint16_t)plane), block, size);
                ok = got >= (tmsize_t)needed;
                if (!ok) *r->s->why = image_damaged;
                else place_unit(r, &u, block);
                ok = ok && image_continue(r->s->job, r->s->why, y, r->height, "read");
                if (w > UINT32_MAX - x) break;
            }
            if (h > UINT32_MAX - y) break;
        }
    }
    free(block);
    return ok;
}

/* All other kinds - few bits, palettes, YCbCr, CMYK, CIELab - as libtiff converts them, with 8 bits, some
   rows at a time. */
static int read_converted(reading *r) {
    char text[1024];
    TIFFRGBAImage rgba;
    uint32_t rows = r->height;
    if (!TIFFRGBAImageOK(r->file, text) || !TIFFRGBAImageBegin(&rgba, r->file, 1, text))
        return *r->s->why = "a kind of TIFF that is not read; convert it to PNG", 0;
    rgba.req_orientation = rgba.orientation; /* rows as they are */
    const int is_gray = r->photometric == PHOTOMETRIC_MINISBLACK || r->photometric == PHOTOMETRIC_MINISWHITE;
    r->is_premultiplied = rgba.alpha != 0; /* libtiff does it */
    TIFFGetFieldDefaulted(r->file, TIFFIsTiled(r->file) ? TIFFTAG_TILELENGTH : TIFFTAG_ROWSPERSTRIP, &rows);
    if (rows > r->height || rows == 0) rows = r->height;
    uint32_t *raster = (uint32_t *)malloc((size_t)r->width * rows * sizeof *raster);
    int ok = image_begin(r->s, r->width, r->height, rgba.alpha ? 4 : is_gray ? 1 : 3, TXM_U8, r->image);
    if (ok && !raster) *r->s->why = image_no_memory;
    ok = ok && raster;
    for (uint32_t y = 0; y < r->height && ok; y += rows) {
        const uint32_t count = r->height - y < rows ? r->height - y : rows;
        ok = image_continue(r->s->job, r->s->why, y, r->height, "read");
        rgba.row_offset = (int)y;
        if (ok && !TIFFRGBAImageGet(&rgba, raster, r->width, count)) {
            ok = 0;
            *r->s->why = image_damaged;
        }
        for (uint32_t k = 0; k < count && ok; k++) {
            uint8_t *to = (uint8_t *)txm_image_row(r->image, (int)(y + k));
            for (uint32_t x = 0; x < r->width; x++)
                for (int c = 0; c < r->image->channels; c++)
                    *to++ = (uint8_t)(raster[(size_t)k * r->width + x] >> (8 * c) & 255);
        }
    }
    free(raster);
    TIFFRGBAImageEnd(&rgba);
    if (ok && r->bits > 8) image_warn(r->s, "this kind of TIFF is read with 8 bits only");
    if (ok && r->photometric == PHOTOMETRIC_SEPARATED)
        image_warn(r->s, "its inks (CMYK) became RGB without a colour profile; convert it if the colours "
                         "look wrong");
    return ok;
}

/* Colours that were multiplied by alpha, undone. */
static void divide_by_alpha(txm_image *image) {
    const int deep = image->sample == TXM_U16, channels = image->channels;
    const uint32_t most = deep ? 65535 : 255;
    for (int y = 0; y < image->height; y++) {
        uint8_t *row8 = (uint8_t *)txm_image_row(image, y);
        uint16_t *row16 = (uint16_t *)txm_image_row(image, y);
        for (size_t x = 0; x < (size_t)image->width; x++) {
            const size_t at = x * (size_t)channels, last = at + (size_t)channels - 1;
            const uint32_t alpha = deep ? row16[last] : row8[last];
            for (size_t i = at; i < last && alpha; i++) {
                const uint64_t had = deep ? row16[i] : row8[i];
                const uint32_t v = (uint32_t)((had * most + alpha / 2) / alpha);
                if (deep) row16[i] = (uint16_t)(v > most ? most : v);
                else row8[i] = (uint8_t)(v > most ? most : v);
            }
        }
    }
}

static int read_all(reading *r) {
    if (!read_fields(r)) return 0;
    const int is_gray = r->photometric == PHOTOMETRIC_MINISBLACK || r->photometric == PHOTOMETRIC_MINISWHITE;
    const int colours = is_gray ? 1 : 3;
    const int is_plain = (is_gray || r->photometric == PHOTOMETRIC_RGB) && (r->bits == 8 || r->bits == 16) &&
                         r->samples >= colours && r->samples <= MOST_SAMPLES;
    if (!(is_plain ? read_plain(r, colours) : read_converted(r))) return 0;
    if (r->is_premultiplied && r->image->channels % 2 == 0) divide_by_alpha(r->image);
    if (!TIFFLastDirectory(r->file)) image_warn(r->s, "it holds more than one picture; the first was read");
    return 1;
}

int tiff_read(image_source *s, txm_image *image) {
    memory m = {s->bytes, s->size, 0, NULL};
    reading r;
    memset(&r, 0, sizeof r);
    r.s = s;
    r.image = image;
    r.file = open_memory(&m, "rm");
    if (!r.file) return *s->why = image_damaged, 0;
    const int ok = read_all(&r);
    TIFFClose(r.file);
    return ok;
}

/* ---- writing ------------------------------------------------------------------------------ */

static int write_rows(TIFF *f, image_target *t, const txm_image *image) {
    const size_t row = (size_t)image->width * (size_t)image->channels * txm_sample_bytes(image->sample);
    /* the predictor changes the rows that it is given */
    unsigned char *copy = (unsigned char *)malloc(row);
    int ok = copy != NULL;
    for (int y = 0; y < image->height && ok; y++) {
        memcpy(copy, txm_image_row_const(image, y), row);
        ok = image_continue(t->job, t->why, (size_t)y, (size_t)image->height, "encode") &&
             TIFFWriteScanline(f, copy, (uint32_t)y, 0) == 1;
    }
    free(copy);
    return ok;
}

int tiff_write(image_target *t, const txm_image *image) {
    memory m = {NULL, 0, 0, t};
    const uint16_t alpha[1] = {EXTRASAMPLE_UNASSALPHA};
    const size_t row = (size_t)image->width * (size_t)image->channels * txm_sample_bytes(image->sample);
    *t->why = image_no_memory; /* unless it is said better */
    TIFF *f = open_memory(&m, "wm");
    if (!f) return 0;
    TIFFSetField(f, TIFFTAG_IMAGEWIDTH, (uint32_t)image->width);
    TIFFSetField(f, TIFFTAG_IMAGELENGTH, (uint32_t)image->height);
    TIFFSetField(f, TIFFTAG_BITSPERSAMPLE, image->sample == TXM_U16 ? 16 : 8);
    TIFFSetField(f, TIFFTAG_SAMPLESPERPIXEL, image->channels);
    TIFFSetField(f, TIFFTAG_PHOTOMETRIC, image->channels < 3 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
    TIFFSetField(f, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    if (image->channels % 2 == 0) TIFFSetField(f, TIFFTAG_EXTRASAMPLES, 1, alpha);
    TIFFSetField(f, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
    TIFFSetField(f, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL);
    TIFFSetField(f, TIFFTAG_ROWSPERSTRIP, (uint32_t)(row < STRIP_BYTES ? STRIP_BYTES / row : 1));
    const int ok = write_rows(f, t, image) && TIFFFlush(f);
    TIFFClose(f);
    return ok && !t->is_full;
}

#endif /* TEXKIT_TIFF */
