/* fuzz_image_decode.c - hostile bytes into image_decode
   SPDX-License-Identifier: MIT OR Unlicense

   With clang: -fsanitize=fuzzer,address,undefined, run on a folder of pictures.
   With any compiler: -DFUZZ_STANDALONE; the program then makes pictures of all formats and mutates them
   itself, where it matters: fields of headers, chunks, markers, directories. Checksums are made right
   again, else none of it would get any further:
   fuzz_image_decode RUNS [SEED]

   Built with the image files of tools/files/. Whatever is accepted must be as image_io.h promises; half
   of the runs are cancelled somewhere.                                                          */
#include "filekit.h"

#include <stdio.h>

enum { MOST_SIDE = 1024 };

static long accepted, cancelled;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

typedef struct patience { /* cancels at this report */
    int reports, most;
} patience;

static int report(void *user, float fraction, const char *stage) {
    patience *p = (patience *)user;
    if (!(fraction >= 0 && fraction <= 1.001f) || !stage) abort();
    return ++p->reports == p->most;
}

static void warn(void *user, const char *text) {
    (void)user;
    if (!text || !text[0] || strchr(text, '\n')) abort();
}

/* An exact copy on the heap, so that the sanitizer sees any read beyond it. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    txm_image image;
    image_job job = {0};
    patience p = {0, 0};
    txm_env env = {0};
    const char *why = NULL;
    uint32_t choice = (uint32_t)size;
    uint8_t *copy = (uint8_t *)malloc(size ? size : 1);
    if (!copy) return 0;
    if (size) memcpy(copy, data, size);
    for (size_t i = 0; i < size; i++) choice = choice * 31 + data[i];
    env.progress = report;
    env.progress_user = &p;
    p.most = choice >> 8 & 1 ? (int)(choice >> 9 & 63) : 0;
    job.channels = (int)(choice % 5);
    job.deep = (int)(choice >> 6 & 1);
    job.max_side = MOST_SIDE;
    job.env = &env;
    job.warn = warn;
    const int ok = image_decode(&job, copy, size, &image, &why);
    free(copy);
    if (job.is_cancelled && (ok || p.reports != p.most)) abort();
    cancelled += job.is_cancelled;
    if (!ok) {
        if (!why || !why[0] || strchr(why, '\n') || image.pixels) abort();
        return 0;
    }
    accepted++;
    if (txm_image_check(&image, "image", 0, NULL) != TXM_OK) abort();
    if (image.width > MOST_SIDE || image.height > MOST_SIDE || image.channels == 2) {
        if (job.channels != 2) abort();
    }
    if (job.channels && image.channels != job.channels) abort();
    if (image.sample != TXM_U8 && (image.sample != TXM_U16 || !job.deep)) abort();
    uint32_t sum = 0; /* of all samples: none lies beyond the block */
    for (int y = 0; y < image.height; y++) {
        const uint8_t *row = (const uint8_t *)txm_image_row_const(&image, y);
        const size_t bytes = (size_t)image.width * (size_t)image.channels * txm_sample_bytes(image.sample);
        for (size_t i = 0; i < bytes; i++) sum = sum * 33 + row[i];
    }
    image_free(&image);
    return (int)(sum & 0); /* libFuzzer wants 0 */
}

#ifdef FUZZ_STANDALONE

/* ---- pictures to begin with ------------------------------------------------------------------ */

enum { SEEDS = 64 };

static fk_file seeds[SEEDS];
static int seed_count;

static fk_file *new_seed(void) {
    if (seed_count == SEEDS) abort();
    return &seeds[seed_count++];
}

static void encode_seed(const char *extension, int channels, txm_sample sample, int side, txm_rng *rng) {
    txm_image image;
    unsigned char *bytes;
    const char *why;
    size_t size;
    if (!image_can_write(extension, side, side, channels, &why)) return;
    if (!image_new(side, side / 2 + 3, channels, sample, &image)) abort();
    for (int y = 0; y < image.height; y++)
        for (int x = 0; x < image.width; x++)
            for (int c = 0; c < channels; c++)
                txm_image_set(&image, x, y, c, (float)((x * 5 + y * 3 + 40 * c) % 97) / 97 +
                              0.03f * txm_rng_float(rng));
    if (!image_encode(NULL, extension, &image, &bytes, &size, &why)) abort();
    fk_put(new_seed(), bytes, size);
    free(bytes);
    image_free(&image);
}

static void add_exif(fk_file *f) {
    fk_file exif = {{0}, 0}, marker = {{0}, 0};
    fk_exif(&exif, 6, 1);
    if (f->bytes[0] == 0x89) {
        fk_insert_chunk(f, "eXIf", exif.bytes, exif.size);
    } else {
        fk_put(&marker, "\xff\xe1", 2);
        fk_big(&marker, (uint32_t)exif.size + 8, 2);
        fk_put(&marker, "Exif\0", 6);
        fk_put(&marker, exif.bytes, exif.size);
        fk_insert(f, 2, marker.bytes, marker.size);
    }
}

static void encode_seeds(txm_rng *rng) {
    static const char *const extensions[] = {".png", ".jpg", ".tga", ".bmp", ".tif", ".webp"};
    for (size_t e = 0; e < sizeof extensions / sizeof *extensions; e++) {
        for (int channels = 1; channels <= 4; channels++) {
            if (channels == 2 && e > 0) continue;
            encode_seed(extensions[e], channels, TXM_U8, 24, rng);
            if (image_takes_16_bits(extensions[e])) encode_seed(extensions[e], channels, TXM_U16, 9, rng);
        }
        if (e < 2) add_exif(&seeds[seed_count - 1]);
    }
}

static void png_seeds(void) {
    static const int kinds[][2] = {{1, 0}, {2, 3}, {4, 0}, {8, 3}, {16, 2}, {16, 0}, {8, 6}};
    unsigned char rows[1024], colours[12];
    for (size_t i = 0; i < sizeof rows; i++) rows[i] = (unsigned char)(i * 29 % 256);
    for (size_t i = 0; i < sizeof colours; i++) colours[i] = (unsigned char)(i * 23);
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        fk_file *f = new_seed();
        const int samples = kinds[k][1] == 2 ? 3 : kinds[k][1] == 6 ? 4 : 1;
        const size_t row = 1 + (size_t)(7 * samples * kinds[k][0] + 7) / 8;
        for (size_t y = 0; y < 5; y++) rows[y * row] = (unsigned char)y; /* the filter */
        fk_begin_png(f, 7, 5, kinds[k][0], kinds[k][1]);
        if (kinds[k][1] == 3) fk_chunk(f, "PLTE", colours, 12);
        if (kinds[k][1] < 4) fk_chunk(f, "tRNS", "\0\1\0\2\0\3", kinds[k][1] == 0 ? 2 : kinds[k][1] == 3 ? 3 : 6);
        fk_end_png(f, rows, 5 * row);
        if (k == 4) fk_insert_chunk(f, "gAMA", "\0\1\x86\xa0", 4);
    }
}

static void bmp_seeds(void) {
    static const int kinds[][2] = {{1, 0}, {4, 0}, {8, 0}, {16, 0}, {16, 3}, {24, 0}, {32, 0}, {32, 3}, {8, 1}, {4, 2}};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const int bits = kinds[k][0], compression = kinds[k][1];
        const int colours = bits <= 8 ? 1 << bits : 0, between = 4 * colours + (compression == 3 ? 12 : 0);
        fk_file *f = new_seed();
        fk_begin_bmp(f, 7, k % 2 && compression == 0 ? -5 : 5, bits, compression, colours, between);
        for (int i = 0; i < colours; i++) fk_little(f, (uint32_t)(i * 0x010305), 4);
        if (compression == 3)
            for (int i = 0; i < 3; i++) fk_little(f, bits == 16 ? 0x1fu << (5 * i) : 0x3ffu << (10 * i), 4);
        if (compression == 1) fk_put(f, "\7\1\0\0\0\3\1\2\3\0\4\2\0\0\0\2\1\1\6\5\0\0\7\3\0\1", 26);
        else if (compression == 2) fk_put(f, "\7\x12\0\0\0\5\x12\x34\x50\0\2\x11\0\0\0\2\1\1\6\x55\0\0\7\x33\0\1", 26);
        else
            for (int i = 0; i < 5 * ((7 * bits + 31) / 32 * 4); i++) fk_byte(f, i * 37);
    }
}

static void tga_seeds(void) {
    static const int kinds[][2] = {{1, 8}, {2, 16}, {2, 24}, {2, 32}, {3, 8}, {3, 16}, {9, 8}, {10, 24}, {10, 32}, {11, 8}};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const int kind = kinds[k][0], bits = kinds[k][1], bytes = (bits + 7) / 8;
        fk_file *f = new_seed();
        fk_begin_tga(f, kind, 6, 4, bits, (int)(k % 4) << 4, kind % 8 == 1 ? 9 : 0, kind % 8 == 1 ? 24 : 0);
        for (int i = 0; i < 27 && kind % 8 == 1; i++) fk_byte(f, i * 9);
        if (kind < 8) {
            for (int i = 0; i < 24 * bytes; i++) fk_byte(f, kind == 1 ? i % 9 : i * 11);
        } else {
            for (int i = 0; i < 4; i++) { /* packets of 3 and 3, one a run */
                fk_byte(f, 2);
                for (int j = 0; j < 3 * bytes; j++) fk_byte(f, j);
                fk_byte(f, 0x82);
                for (int j = 0; j < bytes; j++) fk_byte(f, 5 + j);
            }
        }
    }
}

static void pnm_seeds(void) {
#define BYTES(text) {text, sizeof(text)}
    static const struct {
        const char *bytes;
        size_t size;
    } files[] = {BYTES("P1 5 3 # bits\n01010 1 0 1 0 1 11111"), BYTES("P2\n3 2\n100\n0 50 100\n25 75 3\n"),
                 BYTES("P3 2 1 1000 0 500 1000 9 8 7"),        BYTES("P4\n9 2\n\xaa\x80\x55\0"),
                 BYTES("P5 3 2 31\n\1\2\3\4\5\x1f"),           BYTES("P5 2 1 65535\n\1\2\3\4"),
                 BYTES("P6 1 2 255\n\1\2\3\4\5\6"),            BYTES("P6 1 1 300\n\1\1\0\2\1\x20")};
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) fk_put(new_seed(), files[k].bytes, files[k].size);
}

/* ---- mutations ------------------------------------------------------------------------------- */

static const uint32_t numbers[] = {0, 1, 2, 3, 7, 8, 15, 16, 24, 31, 32, 127, 128, 255, 256, 1023, 1024,
                                   1025, 32767, 32768, 65535, 65536, 0x7fffffff, 0x80000000u, 0xffffffffu};

/* A place that means something: in the head, behind the start of a chunk, marker or directory. */
static size_t pick_place(txm_rng *rng, const fk_file *f) {
    const uint32_t size = (uint32_t)f->size;
    size_t at = txm_rng_below(rng, size);
    switch (txm_rng_below(rng, 4)) {
    case 0: return at % 64; /* may lie behind the end */
    case 1:                 /* the next marker of a JPEG */
        while (f->bytes[0] == 0xff && at + 1 < size && f->bytes[at] != 0xff) at++;
        return at + txm_rng_below(rng, 6);
    case 2: /* a chunk of a PNG, or of a WebP */
        if (f->bytes[0] == 0x89 || f->bytes[0] == 'R') {
            const int big = f->bytes[0] == 0x89;
            size_t chunk = big ? 8 : 12;
            for (uint32_t skip = txm_rng_below(rng, 4); skip > 0 && chunk + 8 < size; skip--) {
                const unsigned char *p = f->bytes + chunk + (big ? 0 : 4);
                const uint32_t length = big ? fk_number(p) : p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16;
                if (length > size) break;
                chunk += length + (big ? 12 : 8);
            }
            return chunk + txm_rng_below(rng, 24);
        }
        if (f->bytes[0] == 'I') { /* an entry of a TIFF's directory */
            const size_t directory = f->bytes[4] | (size_t)f->bytes[5] << 8;
            return directory + 2 + txm_rng_below(rng, 15 * 12);
        }
        return at;
    default: return at;
    }
}

static void put_number(txm_rng *rng, fk_file *f, size_t at) {
    const uint32_t value = numbers[txm_rng_below(rng, sizeof numbers / sizeof *numbers)];
    const size_t bytes = (size_t)1 << txm_rng_below(rng, 3);
    const int big = (int)txm_rng_below(rng, 2);
    for (size_t i = 0; i < bytes && at + i < f->size; i++)
        f->bytes[at + i] = (unsigned char)(value >> 8 * (big ? bytes - 1 - i : i) & 255);
}

static void mutate(txm_rng *rng, fk_file *f) {
    for (uint32_t n = 1 + txm_rng_below(rng, 4); n > 0 && f->size > 4; n--) {
        size_t at = pick_place(rng, f);
        if (at >= f->size) at = f->size - 1;
        const size_t rest = f->size - at;
        size_t length = 1 + txm_rng_below(rng, (uint32_t)(rest < 64 ? rest : 64));
        switch (txm_rng_below(rng, 9)) {
        case 0: f->bytes[at] = (unsigned char)txm_rng_next(rng); break;
        case 1: f->bytes[at] ^= (unsigned char)(1u << txm_rng_below(rng, 8)); break;
        case 2:
        case 3:
        case 4: put_number(rng, f, at); break;
        case 5: /* cut off, or a piece taken out */
            if (txm_rng_below(rng, 4) == 0) length = rest;
            memmove(f->bytes + at, f->bytes + at + length, rest - length);
            f->size -= length;
            break;
        case 6: { /* a piece twice */
            unsigned char piece[64];
            memcpy(piece, f->bytes + at, length);
            if (f->size + length < FK_ROOM) fk_insert(f, at, piece, length);
            break;
        }
        case 7: { /* a piece of another file */
            const fk_file *other = &seeds[txm_rng_below(rng, (uint32_t)seed_count)];
            if (length > other->size) length = other->size;
            memcpy(f->bytes + at, other->bytes + txm_rng_below(rng, (uint32_t)(other->size - length + 1)), length);
            break;
        }
        default: memset(f->bytes + at, txm_rng_below(rng, 2) ? 255 : 0, length > 8 ? 8 : length);
        }
    }
    /* all but a few PNGs have right sums */
    if (f->size > 20 && f->bytes[0] == 0x89 && txm_rng_below(rng, 16)) fk_mend_png(f->bytes, f->size);
}

int main(int argc, char **argv) {
    const long runs = argc > 1 ? atol(argv[1]) : 0;
    txm_rng rng = txm_rng_make(argc > 2 ? (uint64_t)atol(argv[2]) : 1, 0);
    static fk_file work;
    if (runs < 1) {
        fprintf(stderr, "usage: fuzz_image_decode RUNS [SEED]\n");
        return 2;
    }
    encode_seeds(&rng);
    png_seeds();
    bmp_seeds();
    tga_seeds();
    pnm_seeds();
    for (int i = 0; i < seed_count; i++) LLVMFuzzerTestOneInput(seeds[i].bytes, seeds[i].size);
    printf("%d pictures, %ld of them read, %ld cancelled\n", seed_count, accepted, cancelled);
    if (accepted + cancelled < seed_count) return 1;
    for (long i = 0; i < runs; i++) {
        const fk_file *seed = &seeds[txm_rng_below(&rng, (uint32_t)seed_count)];
        work.size = seed->size;
        memcpy(work.bytes, seed->bytes, seed->size);
        mutate(&rng, &work);
        LLVMFuzzerTestOneInput(work.bytes, work.size);
    }
    printf("%ld runs, %ld accepted, %ld cancelled\n", runs, accepted, cancelled);
    return accepted > runs / 20 ? 0 : 1; /* else too little gets any further */
}
#endif
