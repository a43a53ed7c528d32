/* image_png_write.c - PNG out: filters of our own, zlib, threads
   SPDX-License-Identifier: MIT OR Unlicense

   A picture is cut into bands of rows, whatever the number of threads. Each is filtered and deflated by
   itself and ends at a byte (Z_SYNC_FLUSH), so that all together are one stream; the checksums are
   combined. A band looks back on nothing before it, which costs less than a hundredth of the size.   */
#include "image_formats.h"

#include <limits.h>
#include <zlib.h>

/* Ways to pack pixels. Photographs: what is left after prediction hardly repeats, so looking for
   repetitions costs four times the time and gains nothing. Drawings and labels repeat a lot. */
typedef struct packing {
    int has_filters, strategy, level;
} packing;

static const packing packings[] = {
    {1, Z_RLE, 1},
    {1, Z_FILTERED, 6},
    {0, Z_DEFAULT_STRATEGY, 6},
};

enum {
    PACKINGS = sizeof packings / sizeof *packings,
    BAND_BYTES = 1 << 18,   /* of a band, or one row                                         */
    BANDS_AT_ONCE = 16,     /* by all threads; as many bands are in memory                   */
    TRIAL_BANDS = 8,        /* of the picture, from top to bottom, that are tried            */
    TRIAL_BYTES = 1 << 15,  /* of each: what deflate looks back on                           */
    BETTER_PERCENT = 97,    /* of the bytes: what a slower packing must reach                */
    WINDOW_BITS = 15, MEMORY_LEVEL = 8, /* zlib's defaults                                   */
    FILTERS = 5
};

/* Rows y .. y + rows - 1 of a picture. */
typedef struct band {
    int y, rows, is_last;
    unsigned char *bytes; /* deflated, for free(); NULL: no memory */
    size_t size, raw;     /* raw: before                           */
    uLong sum;            /* Adler-32 of what was deflated         */
} band;

typedef struct writing {
    const txm_image *image;
    const packing *packing;
    size_t row;   /* bytes of a row */
    size_t pixel; /* and of a pixel */
    band bands[BANDS_AT_ONCE];
} writing;

/* ---- filters ------------------------------------------------------------------------------- */

/* A row as it is in the file: 16 bits have their high byte first. */
static void copy_row(const writing *w, int y, unsigned char *to) {
    const void *from = txm_image_row_const(w->image, y);
    if (w->image->sample != TXM_U16) {
        memcpy(to, from, w->row);
        return;
    }
    for (size_t i = 0; i < w->row / 2; i++) {
        const unsigned v = ((const uint16_t *)from)[i];
        to[2 * i] = (unsigned char)(v >> 8);
        to[2 * i + 1] = (unsigned char)(v & 255);
    }
}

/* What remains of a byte, as a number of either sign, without it. */
static unsigned magnitude(unsigned char v) {
    return v < 128 ? v : 256u - v;
}

/* Of the left, upper and upper left byte the one closest to left + upper - upper left. */
static int paeth(int a, int b, int c) {
    const int p = b - c, q = a - c, pa = abs(p), pb = abs(q), pc = abs(p + q);
    const int ab = pa <= pb ? a : b, least = pa <= pb ? pa : pb;
    return least <= pc ? ab : c;
}

/* The row x below the row up, both behind `pixel` bytes of 0, through a filter. Returns the sum of what
   remains: the filter with the smallest is the best guess [PNG specification, 12.7]. */
static unsigned long filter(int kind, const unsigned char *x, const unsigned char *up, size_t row, size_t pixel,
                            unsigned char *to) {
    const unsigned char *left = x - pixel, *corner = up - pixel;
    unsigned long sum = 0;
    if (kind == 0) memcpy(to, x, row);
    for (size_t i = 0; i < row && kind == 1; i++) to[i] = (unsigned char)(x[i] - left[i]);
    for (size_t i = 0; i < row && kind == 2; i++) to[i] = (unsigned char)(x[i] - up[i]);
    for (size_t i = 0; i < row && kind == 3; i++) to[i] = (unsigned char)(x[i] - (left[i] + up[i]) / 2);
    for (size_t i = 0; i < row && kind == 4; i++)
        to[i] = (unsigned char)(x[i] - paeth(left[i], up[i], corner[i]));
    for (size_t i = 0; i < row; i++) sum += magnitude(to[i]);
    return sum;
}

/* All rows of a band, each behind the number of its filter, into raw bytes. 0: no memory. */
static int filter_band(const writing *w, const band *b, unsigned char *raw) {
    const size_t line = w->pixel + w->row;
    unsigned char *lines = (unsigned char *)calloc(2, line), *trial = (unsigned char *)malloc(w->row);
    const int ok = lines && trial;
    if (ok && b->y > 0) copy_row(w, b->y - 1, lines + w->pixel);
    for (int i = 0; i < b->rows && ok; i++, raw += 1 + w->row) {
        const unsigned char *up = lines + (size_t)(i & 1) * line + w->pixel;
        unsigned char *x = lines + (size_t)(~i & 1) * line + w->pixel;
        copy_row(w, b->y + i, x);
        raw[0] = 0;
        unsigned long best = filter(0, x, up, w->row, w->pixel, raw + 1);
        for (int kind = 1; kind < FILTERS && w->packing->has_filters; kind++) {
            const unsigned long sum = filter(kind, x, up, w->row, w->pixel, trial);
            if (sum >= best) continue;
            best = sum;
            raw[0] = (unsigned char)kind;
            memcpy(raw + 1, trial, w->row);
        }
    }
    free(lines);
    free(trial);
    return ok;
}

/* ---- bands --------------------------------------------------------------------------------- */

static void deflate_band(const writing *w, band *b, unsigned char *raw) {
    z_stream z;
    memset(&z, 0, sizeof z);
    if (deflateInit2(&z, w->packing->level, Z_DEFLATED, -WINDOW_BITS, MEMORY_LEVEL, w->packing->strategy) != Z_OK)
        return;
    const size_t room = deflateBound(&z, (uLong)b->raw) + 16; /* and the end of a flush */
    b->bytes = (unsigned char *)malloc(room);
    if (b->bytes) {
        z.next_in = raw;
        z.avail_in = (uInt)b->raw;
        z.next_out = b->bytes;
        z.avail_out = (uInt)room;
        const int want = b->is_last ? Z_STREAM_END : Z_OK, got = deflate(&z, b->is_last ? Z_FINISH : Z_SYNC_FLUSH);
        b->size = room - z.avail_out;
        b->sum = adler32(adler32(0, NULL, 0), raw, (uInt)b->raw);
        if (got != want || z.avail_in || !z.avail_out) { /* cannot be: the room would not do */
            free(b->bytes);
            b->bytes = NULL;
        }
    }
    deflateEnd(&z);
}

static void pack_band(void *context, int i) {
    writing *w = (writing *)context;
    band *b = &w->bands[i];
    b->raw = (size_t)b->rows * (1 + w->row);
    unsigned char *raw = (unsigned char *)malloc(b->raw);
    b->bytes = NULL;
    if (raw && filter_band(w, b, raw)) deflate_band(w, b, raw);
    free(raw);
}

/* The bytes of some bands in a packing; 0: no memory. */
static size_t try_bands(writing *w, const txm_env *env, const packing *p, int count) {
    size_t size = 0;
    int ok = 1;
    w->packing = p;
    txm_parallel_for(env, count, pack_band, w);
    for (int i = 0; i < count; i++) {
        ok = ok && w->bands[i].bytes;
        size += w->bands[i].size;
        free(w->bands[i].bytes);
    }
    return ok ? size : 0;
}

/* The packing that makes bands of the picture smallest, or all of it if it is not large. 0: no memory. */
static int choose(writing *w, const txm_env *env) {
    const int height = w->image->height, tall = w->row < TRIAL_BYTES ? (int)(TRIAL_BYTES / w->row) : 1;
    const int is_whole = height / TRIAL_BANDS <= tall, count = is_whole ? 1 : TRIAL_BANDS;
    const packing *chosen = NULL;
    size_t best = 0;
    for (int b = 0; b < count; b++) {
        w->bands[b].y = is_whole ? 0 : (height - tall) / (TRIAL_BANDS - 1) * b;
        w->bands[b].rows = is_whole ? height : tall;
        w->bands[b].is_last = 1;
    }
    for (int i = 0; i < PACKINGS; i++) {
        const size_t size = try_bands(w, env, &packings[i], count);
        if (size == 0) return 0;
        if (chosen && size >= best / 100 * BETTER_PERCENT) continue;
        best = size;
        chosen = &packings[i];
    }
    w->packing = chosen;
    return 1;
}

/* ---- the file ------------------------------------------------------------------------------ */

static void put_number(unsigned char *to, uLong v) {
    for (int i = 0; i < 4; i++) to[i] = (unsigned char)(v >> (24 - 8 * i) & 255);
}

/* A chunk of up to three pieces. */
static void put_chunk(image_target *t, const char *name, const void *head, size_t head_size, const void *bytes,
                      size_t size, const void *tail, size_t tail_size) {
    unsigned char number[8];
    uLong sum = crc32(crc32(0, NULL, 0), (const Bytef *)name, 4);
    put_number(number, (uLong)(head_size + size + tail_size));
    memcpy(number + 4, name, 4);
    image_put(t, number, 8);
    if (head_size) sum = crc32(sum, (const Bytef *)head, (uInt)head_size);
    image_put(t, head, head_size);
    if (size) sum = crc32(sum, (const Bytef *)bytes, (uInt)size);
    image_put(t, bytes, size);
    if (tail_size) sum = crc32(sum, (const Bytef *)tail, (uInt)tail_size);
    image_put(t, tail, tail_size);
    put_number(number, sum);
    image_put(t, number, 4);
}

static void put_head(image_target *t, const txm_image *image, const unsigned char palette[256][3]) {
    enum { PALETTE = 3 };
    static const unsigned char kinds[5] = {0, 0, 4, 2, 6}; /* by channels: gray, with alpha, RGB, RGBA */
    unsigned char head[13] = {0};
    put_number(head, (uLong)image->width);
    put_number(head + 4, (uLong)image->height);
    head[8] = image->sample == TXM_U16 ? 16 : 8;
    head[9] = palette ? PALETTE : kinds[image->channels];
    image_put(t, "\x89PNG\r\n\x1a\n", 8);
    put_chunk(t, "IHDR", head, sizeof head, NULL, 0, NULL, 0);
    if (palette) put_chunk(t, "PLTE", palette, 256 * 3, NULL, 0, NULL, 0);
}

/* The bands, each in a chunk of its own. 0: no memory, or cancelled. */
static int put_bands(image_target *t, writing *w, const txm_env *env) {
    const int height = w->image->height;
    const int rows = w->row < BAND_BYTES ? (int)(BAND_BYTES / w->row) : 1;
    const unsigned char zlib_head[2] = {0x78, w->packing->level < 2 ? 0x01 : 0x9c};
    uLong sum = adler32(0, NULL, 0);
    int ok = 1;
    for (int y = 0; y < height && ok;) {
        int count = 0;
        if (!image_continue(t->job, t->why, (size_t)y, (size_t)height, "encode")) return 0;
        for (; count < BANDS_AT_ONCE && y < height; count++) {
            band *b = &w->bands[count];
            b->y = y;
            b->rows = rows < height - y ? rows : height - y;
            y += b->rows;
            b->is_last = y == height;
        }
        txm_parallel_for(env, count, pack_band, w);
        for (int i = 0; i < count; i++) {
            const band *b = &w->bands[i];
            unsigned char tail[4];
            ok = ok && b->bytes;
            if (ok) {
                sum = adler32_combine(sum, b->sum, (z_off_t)b->raw);
                put_number(tail, sum);
                put_chunk(t, "IDAT", zlib_head, b->y == 0 ? 2 : 0, b->bytes, b->size, tail, b->is_last ? 4 : 0);
            }
            free(b->bytes);
        }
    }
    return ok;
}

int png_write(image_target *t, const txm_image *image, const unsigned char palette[256][3]) {
    const txm_env *env = t->job ? t->job->env : NULL;
    writing w;
    memset(&w, 0, sizeof w);
    *t->why = image_no_memory; /* unless it is said better */
    w.image = image;
    w.pixel = (size_t)image->channels * txm_sample_bytes(image->sample);
    w.row = (size_t)image->width * w.pixel;
    if (w.row > INT_MAX / 4) return 0; /* zlib counts in 32 bits */
    if (!choose(&w, env)) return 0;
    put_head(t, image, palette);
    if (!put_bands(t, &w, env)) return 0;
    put_chunk(t, "IEND", NULL, 0, NULL, 0, NULL, 0);
    return 1;
}
