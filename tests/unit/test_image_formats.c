/* test_image_formats.c - image files as people have them, written byte by byte
   SPDX-License-Identifier: MIT OR Unlicense

   Built with: tools/files/image_*.c tools/files/stb.c                                            */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "filekit.h"
#include "threads.h"

#include <stdio.h>
#include <jpeglib.h>

/* ---- helpers ------------------------------------------------------------------------------- */

static fk_file file; /* too large for a small stack */
static char warnings[400];
static int warning_count;

static void note(void *user, const char *text) {
    (void)user;
    warning_count++;
    strncat(warnings, text, sizeof warnings - strlen(warnings) - 1);
}

static image_job new_job(int channels, int deep) {
    image_job job = {0};
    job.channels = channels;
    job.deep = deep;
    job.warn = note;
    warnings[0] = 0;
    warning_count = 0;
    return job;
}

/* An exact copy on the heap, so that the sanitizer sees any read beyond it. */
static int decode_as(image_job *job, const fk_file *f, size_t size, txm_image *image, const char **why) {
    unsigned char *copy = (unsigned char *)malloc(size ? size : 1);
    assert_non_null(copy);
    memcpy(copy, f->bytes, size);
    *why = NULL;
    const int ok = image_decode(job, copy, size, image, why);
    free(copy);
    if (!ok) {
        assert_true(*why && **why && !strchr(*why, '\n'));
        assert_null(image->pixels);
    }
    return ok;
}

static txm_image read_as(const fk_file *f, int channels, int deep) {
    image_job job = new_job(channels, deep);
    txm_image image;
    const char *why;
    if (!decode_as(&job, f, f->size, &image, &why)) fail_msg("%s", why);
    return image;
}

static void refuse(const fk_file *f, size_t size, const char *text) {
    image_job job = new_job(0, 1);
    txm_image image;
    const char *why;
    assert_false(decode_as(&job, f, size, &image, &why));
    if (!strstr(why, text)) fail_msg("'%s' lacks '%s'", why, text);
}

static int sample(const txm_image *im, int x, int y, int c) {
    const void *row = txm_image_row_const(im, y);
    const int i = x * im->channels + c;
    return im->sample == TXM_U16 ? ((const uint16_t *)row)[i] : ((const uint8_t *)row)[i];
}

/* The samples of 8 bits, row by row. */
static void assert_samples(const fk_file *f, int w, int h, int channels, const char *expected) {
    txm_image im = read_as(f, 0, 0);
    assert_int_equal(im.width, w);
    assert_int_equal(im.height, h);
    assert_int_equal(im.channels, channels);
    for (int i = 0; i < w * h * channels; i++)
        assert_int_equal(sample(&im, i / channels % w, i / channels / w, i % channels),
                         (unsigned char)expected[i]);
    image_free(&im);
}

static void encode(const char *extension, const txm_image *image) {
    unsigned char *bytes;
    const char *why;
    size_t size;
    if (!image_encode(NULL, extension, image, &bytes, &size, &why)) fail_msg("%s", why);
    file.size = 0;
    fk_put(&file, bytes, size);
    free(bytes);
}

static int is_built_in(const char *extension) {
    const char *why;
    return image_can_write(extension, 0, 0, 0, &why);
}

/* ---- PNG ----------------------------------------------------------------------------------- */

static void colour_keys(void **state) {
    (void)state;
    fk_begin_png(&file, 3, 1, 8, 0);
    fk_chunk(&file, "tRNS", "\0\5", 2);
    fk_end_png(&file, "\0\4\5\6", 4);
    assert_samples(&file, 3, 1, 4, "\4\4\4\xff\5\5\5\0\6\6\6\xff");
    fk_begin_png(&file, 2, 1, 8, 2);
    fk_chunk(&file, "tRNS", "\0\1\0\2\0\3", 6);
    fk_end_png(&file, "\0\1\2\3\1\2\4", 7);
    assert_samples(&file, 2, 1, 4, "\1\2\3\0\1\2\4\xff");
    fk_begin_png(&file, 3, 1, 4, 0); /* 4 bits */
    fk_chunk(&file, "tRNS", "\0\1", 2);
    fk_end_png(&file, "\0\x01\x20", 3);
    assert_samples(&file, 3, 1, 4, "\0\0\0\xff\x11\x11\x11\0\x22\x22\x22\xff");
    fk_begin_png(&file, 4, 1, 2, 3); /* a palette */
    fk_chunk(&file, "PLTE", "abcdefghi", 9);
    fk_chunk(&file, "tRNS", "\0\x7f", 2);
    fk_end_png(&file, "\0\x18", 2);
    assert_samples(&file, 4, 1, 4, "abc\0def\x7fghi\xff" "abc\0");
}

/* The key has 16 bits: its neighbours stay opaque, also where 8 are wanted. */
static void colour_keys_of_16_bits(void **state) {
    (void)state;
    for (int deep = 0; deep < 2; deep++) {
        fk_begin_png(&file, 3, 1, 16, 0);
        fk_chunk(&file, "tRNS", "\x12\x34", 2);
        fk_end_png(&file, "\0\x12\x33\x12\x34\x12\x35", 7);
        txm_image im = read_as(&file, 0, deep);
        assert_int_equal(im.sample, deep ? TXM_U16 : TXM_U8);
        assert_int_equal(im.channels, 4);
        for (int x = 0; x < 3; x++) {
            assert_int_equal(sample(&im, x, 0, 3), x == 1 ? 0 : deep ? 65535 : 255);
            assert_int_equal(sample(&im, x, 0, 2), deep ? 0x1233 + x : (0x1233 + x + 128) / 257);
        }
        image_free(&im);
        fk_begin_png(&file, 2, 1, 16, 2);
        fk_chunk(&file, "tRNS", "\0\1\0\2\0\3", 6);
        fk_end_png(&file, "\0\0\1\0\2\0\3\0\1\0\2\1\3", 13);
        im = read_as(&file, 0, deep);
        assert_int_equal(im.channels, 4);
        assert_int_equal(sample(&im, 0, 0, 3), 0);
        assert_int_equal(sample(&im, 1, 0, 3), deep ? 65535 : 255);
        image_free(&im);
    }
}

static void wrong_sums(void **state) {
    (void)state;
    fk_begin_png(&file, 3, 1, 8, 0);
    fk_chunk(&file, "tEXt", "Title\0x", 7);
    fk_end_png(&file, "\0\4\5\6", 4);
    assert_samples(&file, 3, 1, 1, "\4\5\6");
    for (size_t i = 29; i < file.size; i++) { /* all that follows the header's numbers */
        const unsigned char kept = file.bytes[i];
        file.bytes[i] ^= 0x01;
        refuse(&file, file.size, "damaged");
        file.bytes[i] = kept;
    }
    file.bytes[file.size - 17] ^= 1; /* the sum over the pixels; that over the chunk is right */
    fk_mend_png(file.bytes, file.size);
    refuse(&file, file.size, "damaged");
}

static void sizes_are_checked_first(void **state) {
    (void)state;
    fk_begin_png(&file, 60000, 60000, 8, 2);
    fk_end_png(&file, "\0\1\2\3", 4);
    refuse(&file, file.size, "60000 x 60000 pixels are too large: at most 2^28");
    fk_begin_png(&file, 1 << 30, 1, 8, 2);
    fk_end_png(&file, "\0\1\2\3", 4);
    refuse(&file, file.size, "too large: at most 16777216 a side");
    fk_begin_png(&file, 3, 1, 8, 0);
    fk_end_png(&file, "\0\4\5\6", 4);
    for (int side = 2; side <= 3; side++) {
        image_job job = new_job(0, 0);
        txm_image image;
        const char *why;
        job.max_side = side;
        const int ok = decode_as(&job, &file, file.size, &image, &why);
        assert_int_equal(ok, side == 3);
        if (ok) image_free(&image);
        else assert_string_equal(why, "3 x 1 pixels are too large: at most 2 a side; scale it down");
    }
}

/* ---- turned pictures ------------------------------------------------------------------------- */

/* 4 x 2 pixels of values 10 y + x, or blocks of them; how they read when upright, for each orientation */
static const char *const upright[9] = {
    "", "00 01 02 03|10 11 12 13", "03 02 01 00|13 12 11 10", "13 12 11 10|03 02 01 00",
    "10 11 12 13|00 01 02 03", "00 10|01 11|02 12|03 13", "10 00|11 01|12 02|13 03",
    "13 03|12 02|11 01|10 00", "03 13|02 12|01 11|00 10"};

/* block: pixels a side of what is one pixel above; step: gray between two; within: of rounding */
static void assert_upright(const txm_image *im, int orientation, int block, int within) {
    const char *p = upright[orientation];
    const int columns = orientation < 5 ? 4 : 2;
    assert_int_equal(im->width, columns * block);
    assert_int_equal(im->height, 8 / columns * block);
    for (int i = 0; i < 8; i++, p += 3) {
        const int x = i % columns * block + block / 2, y = i / columns * block + block / 2;
        const int expected = 100 * (p[0] - '0') + 20 * (p[1] - '0');
        assert_in_range(sample(im, x, y, 0), expected > within ? expected - within : 0, expected + within);
    }
}

static txm_image turned_picture(int block, int channels) {
    txm_image im;
    assert_true(image_new(4 * block, 2 * block, channels, TXM_U8, &im));
    for (int y = 0; y < im.height; y++)
        for (int x = 0; x < im.width; x++)
            for (int c = 0; c < channels; c++)
                txm_image_set(&im, x, y, c, (float)(100 * (y / block) + 20 * (x / block)) / 255);
    return im;
}

static void exif_in_jpeg(void **state) {
    (void)state;
    for (int o = 1; o <= 8; o++) {
        for (int big = 0; big < 2; big++) {
            fk_file exif = {{0}, 0}, marker = {{0}, 0};
            txm_image im = turned_picture(16, o % 2 ? 1 : 3);
            encode(".jpg", &im);
            image_free(&im);
            fk_exif(&exif, o, big);
            fk_put(&marker, "\xff\xe1", 2);
            fk_big(&marker, (uint32_t)exif.size + 8, 2);
            fk_put(&marker, "Exif\0", 6);
            fk_put(&marker, exif.bytes, exif.size);
            fk_insert(&file, 2, marker.bytes, marker.size);
            im = read_as(&file, 0, 0);
            assert_upright(&im, o, 16, 3);
            assert_int_equal(warning_count, 0);
            image_free(&im);
        }
    }
}

static void exif_in_png(void **state) {
    (void)state;
    for (int o = 0; o <= 9; o++) {
        for (int channels = 1; channels <= 4; channels += 3) {
            fk_file exif = {{0}, 0};
            txm_image im = turned_picture(1, channels);
            encode(".png", &im);
            image_free(&im);
            fk_exif(&exif, o, o & 1);
            fk_insert_chunk(&file, "eXIf", exif.bytes, exif.size);
            im = read_as(&file, 0, 0);
            assert_upright(&im, o % 9 ? o : 1, 1, 0);
            image_free(&im);
        }
    }
}

static void exif_in_webp(void **state) {
    (void)state;
    for (int o = 1; o <= 8 && is_built_in(".webp"); o++) {
        fk_file exif = {{0}, 0};
        txm_image im = turned_picture(3, 1);
        encode(".webp", &im);
        image_free(&im);
        fk_exif(&exif, o, 0);
        fk_insert(&file, 12, "VP8X\n\0\0\0\x08\0\0\0\x0b\0\0\5\0\0", 18);
        fk_put(&file, "EXIF", 4);
        fk_little(&file, (uint32_t)exif.size, 4);
        fk_put(&file, exif.bytes, exif.size);
        for (int i = 0; i < 4; i++) file.bytes[4 + i] = (unsigned char)((file.size - 8) >> (8 * i) & 255);
        im = read_as(&file, 0, 0);
        assert_int_equal(im.channels, 3);
        assert_upright(&im, o, 3, 0);
        image_free(&im);
    }
}

/* A TIFF of one strip, its pixels behind the directory. */
static void begin_tiff(int width, int height, int bits, int samples, int photometric, int extra,
                       int orientation) {
    const int fields[][3] = {{256, 4, width}, {257, 4, height}, {258, 3, bits}, {259, 3, 1},
                             {262, 3, photometric}, {273, 4, 8 + 2 + 11 * 12 + 4}, {274, 3, orientation},
                             {277, 3, samples}, {278, 4, height}, {279, 4, (int)((int64_t)width * height * samples * bits / 8 % INT32_MAX)},
                             {338, 3, extra}};
    file.size = 0;
    fk_put(&file, "II*\0\x08\0\0\0", 8);
    fk_little(&file, 11, 2);
    for (int i = 0; i < 11; i++) {
        fk_little(&file, (uint32_t)fields[i][0], 2);
        fk_little(&file, (uint32_t)fields[i][1], 2);
        fk_little(&file, 1, 4);
        fk_little(&file, (uint32_t)fields[i][2], 4);
    }
    fk_little(&file, 0, 4);
}

static void tiff_as_it_comes(void **state) {
    (void)state;
    if (!is_built_in(".tif")) return;
    for (int o = 1; o <= 8; o++) {
        begin_tiff(4, 2, 8, 1, 1, 0, o);
        for (int i = 0; i < 8; i++) fk_byte(&file, 100 * (i / 4) + 20 * (i % 4));
        txm_image im = read_as(&file, 0, 0);
        assert_upright(&im, o, 1, 0);
        image_free(&im);
        refuse(&file, file.size - 1, "damaged");
    }
    begin_tiff(2, 1, 8, 1, 0, 0, 1); /* white is 0 */
    fk_put(&file, "\0\x10", 2);
    assert_samples(&file, 2, 1, 1, "\xff\xef");
    begin_tiff(2, 1, 8, 2, 1, 1, 1); /* gray times alpha; a value above alpha */
    fk_put(&file, "\x40\x80\x90\x80", 4);
    assert_samples(&file, 2, 1, 4, "\x80\x80\x80\x80\xff\xff\xff\x80");
    begin_tiff(2, 1, 8, 2, 1, 0, 1); /* a second channel of no known meaning */
    fk_put(&file, "\x40\x80\x90\x80", 4);
    assert_samples(&file, 2, 1, 1, "\x40\x90");
    begin_tiff(60000, 60000, 8, 1, 1, 0, 1);
    refuse(&file, file.size, "too large");
}

/* ---- 16 bits and alpha, out and in again ------------------------------------------------------- */

static void round_trips(void **state) {
    (void)state;
    static const char *const extensions[] = {".png", ".tif", ".webp", ".tga", ".bmp"};
    for (size_t e = 0; e < sizeof extensions / sizeof *extensions; e++) {
        for (int k = 1; k <= 8 && is_built_in(extensions[e]); k++) {
            const int channels = (k + 1) / 2, deep = k % 2;
            const int gray_is_rgb = channels < 3 && (e == 2 || e == 4);
            if (deep && !image_takes_16_bits(extensions[e])) continue;
            txm_image im, back;
            txm_rng rng = txm_rng_make(5, (uint64_t)k);
            assert_true(image_new(33, 21, channels, deep ? TXM_U16 : TXM_U8, &im));
            for (int y = 0; y < im.height; y++)
                for (int x = 0; x < im.width; x++)
                    for (int c = 0; c < channels; c++) txm_image_set(&im, x, y, c, txm_rng_float(&rng));
            encode(extensions[e], &im);
            back = read_as(&file, 0, 1);
            assert_int_equal(back.sample, im.sample);
            assert_int_equal(back.channels, channels == 2 ? 4 : gray_is_rgb ? 3 : channels);
            for (int i = 0; i < 33 * 21; i++) {
                const int x = i % 33, y = i / 33, last = back.channels - 1;
                assert_int_equal(sample(&back, x, y, 0), sample(&im, x, y, 0));
                if (channels != 1)
                    assert_int_equal(sample(&back, x, y, last), sample(&im, x, y, channels - 1));
            }
            image_free(&back);
            image_free(&im);
        }
    }
}

/* ---- JPEG ----------------------------------------------------------------------------------- */

/* Samples that photographs, ramps, shadows and flat colours have, each in its own rows. */
static unsigned sample_of(size_t x, size_t y, unsigned *noise) {
    *noise = *noise * 1664525u + 1013904223u;
    switch (y / 7 % 4) {
    case 0: return (unsigned)(x + 3 * y) + (*noise >> 30);
    case 1: return *noise >> 16;
    case 2: return (unsigned)(x * x / 16 + y);
    default: return 11000;
    }
}

/* Bands of a PNG may be packed in any order: the same bytes, which are the picture. */
static void png_in_bands(void **state) {
    (void)state;
    for (int kind = 0; kind < 8; kind++) {
        const int channels = 1 + kind % 4, is_deep = kind >= 4;
        unsigned noise = 1;
        txm_image image, back;
        const char *why;
        assert_true(image_new(kind == 2 ? 70000 : 301, kind == 2 ? 9 : 2000, channels, is_deep ? TXM_U16 : TXM_U8, &image));
        for (int y = 0; y < image.height; y++)
            for (size_t i = 0; i < (size_t)image.width * (size_t)channels; i++) {
                const unsigned v = sample_of(i / (size_t)channels, (size_t)y + i % (size_t)channels, &noise);
                if (is_deep) ((uint16_t *)txm_image_row(&image, y))[i] = (uint16_t)(v & 65535u);
                else ((uint8_t *)txm_image_row(&image, y))[i] = (uint8_t)(v & 255u);
            }
        unsigned char *bytes[2];
        size_t size[2], chunks = 0;
        for (int reverse = 0; reverse < 2; reverse++) {
            txm_env env = {0};
            image_job job = {0};
            if (reverse) env.parallel_for = tk_parallel_reverse;
            job.env = &env;
            if (!image_encode(&job, ".png", &image, &bytes[reverse], &size[reverse], &why)) fail_msg("%s", why);
        }
        assert_int_equal(size[0], size[1]);
        assert_memory_equal(bytes[0], bytes[1], size[0]);
        for (size_t i = 0; i + 4 <= size[0]; i++) chunks += !memcmp(bytes[0] + i, "IDAT", 4);
        assert_true(chunks > 2);
        image_job job = new_job(0, 1);
        if (!image_decode(&job, bytes[0], size[0], &back, &why)) fail_msg("%s", why);
        assert_int_equal(warning_count, 0);
        const size_t row = (size_t)image.width * (size_t)channels * txm_sample_bytes(image.sample);
        /* gray with alpha is read as four channels */
        assert_int_equal(back.channels, channels == 2 ? 4 : channels);
        for (int y = 0; y < image.height && channels != 2; y++)
            assert_memory_equal(txm_image_row_const(&back, y), txm_image_row_const(&image, y), row);
        image_free(&image);
        image_free(&back);
        free(bytes[0]);
        free(bytes[1]);
    }
}

static void odd_ends(void **state) {
    (void)state;
    txm_image im = turned_picture(32, 3);
    encode(".jpg", &im);
    image_free(&im);
    const size_t end = file.size - 2; /* where the last marker is */
    static const char *const odd[] = {"\xff\xd1", "\xff", "abcdef"};
    static const size_t sizes[] = {2, 2, 6};
    for (int i = 0; i < 3; i++) {
        fk_insert(&file, end, odd[i], sizes[i]);
        im = read_as(&file, 0, 0);
        assert_upright(&im, 1, 32, 3);
        assert_true(warning_count <= 1);
        image_free(&im);
        memmove(file.bytes + end, file.bytes + end + sizes[i], 2);
        file.size -= sizes[i];
    }
    file.size = end; /* no end */
    im = read_as(&file, 0, 0);
    assert_upright(&im, 1, 32, 3);
    assert_int_equal(warning_count, 1);
    assert_non_null(strstr(warnings, "its end is missing"));
    image_free(&im);
    for (size_t n = 0; n + 8 < end; n++) refuse(&file, n, ""); /* pixels are missing */
}

static jmp_buf jpeg_home;
static void jpeg_fails(j_common_ptr c) {
    (void)c;
    longjmp(jpeg_home, 1);
}

/* A JPEG of libjpeg's own making: two halves of one colour each. */
static void write_jpeg(int channels, int is_progressive, int is_adobe, const unsigned char colours[2][4]) {
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    unsigned char *bytes = NULL, row[64 * 4];
    unsigned long size = 0;
    c.err = jpeg_std_error(&errors);
    errors.error_exit = jpeg_fails;
    if (setjmp(jpeg_home)) fail();
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, &bytes, &size);
    c.image_width = c.image_height = 64;
    c.input_components = channels;
    c.in_color_space = channels == 4 ? JCS_CMYK : JCS_RGB;
    jpeg_set_defaults(&c);
    jpeg_set_quality(&c, 100, TRUE);
    c.write_Adobe_marker = is_adobe ? TRUE : FALSE;
    if (is_progressive) jpeg_simple_progression(&c);
    jpeg_start_compress(&c, TRUE);
    for (int y = 0; y < 64; y++) {
        JSAMPROW rows = row;
        for (int x = 0; x < 64; x++)
            for (int k = 0; k < channels; k++)
                row[x * channels + k] = (unsigned char)(colours[x / 32][k] + (channels == 3 ? (x * y) % 7 : 0));
        jpeg_write_scanlines(&c, &rows, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    file.size = 0;
    fk_put(&file, bytes, size);
    free(bytes);
}

static void cmyk(void **state) {
    (void)state;
    static const unsigned char ink[2][4] = {{255, 0, 51, 0}, {0, 102, 255, 51}};
    static const unsigned char rgb[2][3] = {{0, 255, 204}, {204, 122, 0}};
    unsigned char light[2][4];
    for (int i = 0; i < 8; i++) light[i / 4][i % 4] = (unsigned char)(255 - ink[i / 4][i % 4]);
    for (int is_adobe = 0; is_adobe < 2; is_adobe++) {
        write_jpeg(4, 0, is_adobe, is_adobe ? (const unsigned char(*)[4])light : ink);
        txm_image im = read_as(&file, 0, 0);
        assert_int_equal(im.channels, 3);
        assert_int_equal(warning_count, 1);
        assert_non_null(strstr(warnings, "CMYK"));
        for (int i = 0; i < 6; i++)
            assert_in_range(sample(&im, 10 + 32 * (i / 3), 20, i % 3) + 4, rgb[i / 3][i % 3] + 1, rgb[i / 3][i % 3] + 7);
        image_free(&im);
    }
}

static void progressive(void **state) {
    (void)state;
    static const unsigned char colours[2][4] = {{10, 100, 200}, {200, 30, 90}};
    write_jpeg(3, 1, 0, colours);
    txm_image im = read_as(&file, 0, 0);
    assert_int_equal(warning_count, 0);
    image_free(&im);
    const size_t whole = file.size;
    for (size_t n = 3; n + 40 < whole; n += 7) refuse(&file, n, "damaged"); /* scans are missing */
    file.size -= 2;
    im = read_as(&file, 0, 0);
    assert_int_equal(warning_count, 1);
    image_free(&im);
}

/* ---- BMP, TGA, PNM ---------------------------------------------------------------------------- */

static void bmp_of_all_kinds(void **state) {
    (void)state;
    fk_begin_bmp(&file, 2, -2, 24, 0, 0, 0); /* from the top */
    fk_put(&file, "\3\2\1\6\5\4\0\0\x09\x08\x07\x0c\x0b\x0a\0\0", 16);
    assert_samples(&file, 2, 2, 3, "\1\2\3\4\5\6\7\x08\x09\x0a\x0b\x0c");
    file.bytes[22] = 2; /* from the bottom */
    file.bytes[23] = file.bytes[24] = file.bytes[25] = 0;
    assert_samples(&file, 2, 2, 3, "\7\x08\x09\x0a\x0b\x0c\1\2\3\4\5\6");
    refuse(&file, file.size - 3, "damaged");
    file.size -= 2; /* what fills up the last row */
    assert_samples(&file, 2, 2, 3, "\7\x08\x09\x0a\x0b\x0c\1\2\3\4\5\6");

    fk_begin_bmp(&file, 9, 1, 1, 0, 0, 8);
    fk_put(&file, "\3\2\1\0\6\5\4\0\x55\x80\0\0", 12);
    assert_samples(&file, 9, 1, 3, "\1\2\3\4\5\6\1\2\3\4\5\6\1\2\3\4\5\6\1\2\3\4\5\6\4\5\6");
    fk_begin_bmp(&file, 3, 1, 4, 0, 2, 8);
    fk_put(&file, "\3\2\1\0\6\5\4\0\x01\x70\0\0", 12); /* 7 is in no palette */
    assert_samples(&file, 3, 1, 3, "\1\2\3\4\5\6\0\0\0");

    fk_begin_bmp(&file, 2, 1, 16, 0, 0, 0);
    fk_put(&file, "\x1f\x7c\xe0\x03", 4);
    assert_samples(&file, 2, 1, 3, "\xff\0\xff\0\xff\0");
    fk_begin_bmp(&file, 2, 1, 16, 3, 0, 12); /* 5 6 5 */
    fk_put(&file, "\0\xf8\0\0\xe0\x07\0\0\x1f\0\0\0\x1f\xf8\x20\0", 16);
    assert_samples(&file, 2, 1, 3, "\xff\0\xff\0\4\0");

    fk_begin_bmp(&file, 2, 1, 32, 0, 0, 0); /* an empty fourth byte is no alpha */
    fk_put(&file, "\3\2\1\0\6\5\4\0", 8);
    assert_samples(&file, 2, 1, 3, "\1\2\3\4\5\6");
    file.bytes[57] = 9;
    assert_samples(&file, 2, 1, 4, "\1\2\3\x09\4\5\6\0");
    fk_begin_bmp(&file, 1, 1, 24, 4, 0, 0); /* a JPEG inside */
    refuse(&file, file.size, "kind of BMP");
    fk_begin_bmp(&file, 1 << 30, 1 << 30, 24, 0, 0, 0);
    refuse(&file, file.size, "too large");
}

static void bmp_of_runs(void **state) {
    (void)state;
    static const char eight[] = "\2\1\0\0" "\0\4\1\2\1\2\0\0" "\0\2\1\1\1\2\0\1";
    fk_begin_bmp(&file, 4, 4, 8, 1, 3, 12);
    fk_put(&file, "\0\0\0\0\0\0\1\0\0\0\2\0", 12);
    fk_put(&file, eight, sizeof eight - 1);
    /* the lowest row first; what no code sets has the first colour */
    assert_samples(&file, 4, 4, 3, "\0\0\0\2\0\0\0\0\0\0\0\0" "\0\0\0\0\0\0\0\0\0\0\0\0"
                                   "\1\0\0\2\0\0\1\0\0\2\0\0" "\1\0\0\1\0\0\0\0\0\0\0\0");
    refuse(&file, file.size - 4, "damaged");
    fk_begin_bmp(&file, 4, 1, 8, 1, 3, 12);
    fk_put(&file, "\0\0\0\0\0\0\1\0\0\0\2\0\5\1", 14); /* a run beyond the row */
    refuse(&file, file.size, "damaged");
    fk_begin_bmp(&file, 5, 1, 4, 2, 3, 12);
    fk_put(&file, "\0\0\0\0\0\0\1\0\0\0\2\0\2\x12\0\3\x21\x20\0\1", 20);
    assert_samples(&file, 5, 1, 3, "\1\0\0\2\0\0\2\0\0\1\0\0\2\0\0");
}

static void tga_of_all_kinds(void **state) {
    (void)state;
    static const char *const corners[4] = {"\3\4\1\2", "\4\3\2\1", "\1\2\3\4", "\2\1\4\3"};
    for (int i = 0; i < 4; i++) { /* from the bottom, from the right, from the top, both */
        fk_begin_tga(&file, 3, 2, 2, 8, i << 4, 0, 0);
        fk_put(&file, "\1\2\3\4", 4);
        assert_samples(&file, 2, 2, 1, corners[i]);
        fk_begin_tga(&file, 11, 2, 2, 8, i << 4, 0, 0);
        fk_put(&file, "\3\1\2\3\4", 5);
        assert_samples(&file, 2, 2, 1, corners[i]);
    }
    refuse(&file, file.size - 1, "damaged");
    fk_begin_tga(&file, 10, 3, 2, 24, 32, 0, 0); /* a run over the end of a row */
    fk_put(&file, "\x83\3\2\1\1\6\5\4\x09\x08\x07", 11);
    assert_samples(&file, 3, 2, 3, "\1\2\3\1\2\3\1\2\3\1\2\3\4\5\6\7\x08\x09");
    fk_begin_tga(&file, 1, 3, 1, 8, 32, 2, 24);
    fk_put(&file, "\3\2\1\6\5\4\1\0\7", 9);
    assert_samples(&file, 3, 1, 3, "\4\5\6\1\2\3\0\0\0");
    fk_begin_tga(&file, 2, 2, 1, 16, 32, 0, 0);
    fk_put(&file, "\x1f\x7c\xe0\x03", 4);
    assert_samples(&file, 2, 1, 3, "\xff\0\xff\0\xff\0");
    fk_begin_tga(&file, 2, 1, 2, 32, 32 + 8, 0, 0); /* alpha, though empty */
    fk_put(&file, "\3\2\1\0\6\5\4\0", 8);
    assert_samples(&file, 1, 2, 4, "\1\2\3\0\4\5\6\0");
    file.bytes[17] = 32; /* none is announced */
    assert_samples(&file, 1, 2, 3, "\1\2\3\4\5\6");
}

static void pnm_of_all_kinds(void **state) {
    (void)state;
#define BYTES(text) text, sizeof(text) - 1
    static const struct {
        const char *bytes;
        size_t size;
        int w, h, channels;
        const char *samples;
    } cases[] = {
        {BYTES("P1 3 2 # bits\n0101 0 1"), 3, 2, 1, "\xff\0\xff\0\xff\0"},
        {BYTES("P2\n2 2\n100\n0 50\n100 # white\n200\n"), 2, 2, 1, "\0\x80\xff\xff"},
        {BYTES("P3 1 1 15 0 5 15"), 1, 1, 3, "\0\x55\xff"},
        {BYTES("P4 9 1\n\x55\x80"), 9, 1, 1, "\xff\0\xff\0\xff\0\xff\0\0"},
        {BYTES("P5 2 1 31\n\0\x1f"), 2, 1, 1, "\0\xff"},
        {BYTES("P5 2 1 31\n\x10\x20"), 2, 1, 1, "\x84\xff"},
        {BYTES("P6 1 1 100\n\x32\0\x64"), 1, 1, 3, "\x80\0\xff"},
        {BYTES("P6 1 1 1023\n\3\xff\0\0\2\0"), 1, 1, 3, "\xff\0\x80"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        file.size = 0;
        fk_put(&file, cases[i].bytes, cases[i].size);
        assert_samples(&file, cases[i].w, cases[i].h, cases[i].channels, cases[i].samples);
        txm_image im = read_as(&file, 0, 1);
        assert_int_equal(im.sample, i == 7 ? TXM_U16 : TXM_U8);
        image_free(&im);
    }
    static const char *const bad[] = {"P5 2 1 0\n\1\2", "P5 1 1 65536\n\1\2", "P5 0 1 255\n\1\2", "P5 2 1 255\n\1",
                                      "P2 2 1 255 1", "P2 1 1 255 x", "P1 1 1 2", "P5 2", "P5 -1 1 255 \1",
                                      "P5 99999 99999 255\n"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        file.size = 0;
        fk_put(&file, bad[i], strlen(bad[i]));
        refuse(&file, file.size, "");
    }
}

/* ---- colours that are not those of sRGB --------------------------------------------------------- */

static void begin_plain_png(void) {
    fk_begin_png(&file, 2, 1, 8, 2);
    fk_end_png(&file, "\0\1\2\3\4\5\6", 7);
}

static void add_iccp(const char *name, const int primaries[9], int gamma) {
    static fk_file icc;
    fk_file chunk = {{0}, 0};
    uint32_t a = 1, b = 0;
    fk_icc(&icc, primaries, gamma);
    for (size_t i = 0; i < icc.size; i++) {
        a = (a + icc.bytes[i]) % 65521;
        b = (b + a) % 65521;
    }
    fk_put(&chunk, name, strlen(name) + 1);
    fk_put(&chunk, "\0\x78\x01\x01", 4);
    fk_little(&chunk, (uint32_t)icc.size, 2);
    fk_little(&chunk, ~(uint32_t)icc.size, 2);
    fk_put(&chunk, icc.bytes, icc.size);
    fk_big(&chunk, b << 16 | a, 4);
    fk_insert_chunk(&file, "iCCP", chunk.bytes, chunk.size);
}

static int warnings_of_png(void) {
    txm_image im = read_as(&file, 0, 0);
    assert_int_equal(im.channels, 3);
    assert_int_equal(sample(&im, 1, 0, 2), 6);
    image_free(&im);
    return warning_count;
}

static void profiles(void **state) {
    (void)state;
    static const int srgb[9] = {28579, 14581, 910, 25238, 46982, 6363, 9377, 3970, 46798};
    static const int p3[9] = {33751, 15798, -68, 19130, 45352, 2745, 10298, 4384, 68551};
    begin_plain_png();
    assert_int_equal(warnings_of_png(), 0);
    add_iccp("mine", srgb, 563);
    assert_int_equal(warnings_of_png(), 0);
    begin_plain_png();
    add_iccp("mine", srgb, 256); /* linear */
    assert_int_equal(warnings_of_png(), 1);
    assert_non_null(strstr(warnings, "profile is not sRGB"));
    begin_plain_png();
    add_iccp("sRGB", srgb, 461); /* goes by its name */
    assert_int_equal(warnings_of_png(), 0);
    begin_plain_png();
    add_iccp("Display P3", p3, 563);
    assert_int_equal(warnings_of_png(), 1);
    assert_non_null(strstr(warnings, "profile is not sRGB"));

    static const struct {
        const char *gamma;
        int is_srgb, expected;
    } gammas[] = {{"\0\0\xb1\x8f", 0, 0}, {"\0\1\x86\xa0", 0, 1}, {"\0\0\xb1\x8f", 1, 0}, {"\0\0\xd9\x03", 0, 1}};
    for (size_t i = 0; i < sizeof gammas / sizeof *gammas; i++) {
        begin_plain_png();
        fk_insert_chunk(&file, "gAMA", gammas[i].gamma, 4);
        if (gammas[i].is_srgb) fk_insert_chunk(&file, "sRGB", "\0", 1);
        assert_int_equal(warnings_of_png(), gammas[i].expected);
        if (gammas[i].expected) assert_non_null(strstr(warnings, "gamma"));
    }

    for (int k = 0; k < 2; k++) { /* in a JPEG */
        static fk_file icc;
        fk_file marker = {{0}, 0};
        txm_image im = turned_picture(8, 3);
        encode(".jpg", &im);
        image_free(&im);
        fk_icc(&icc, k ? p3 : srgb, 563);
        fk_put(&marker, "\xff\xe2", 2);
        fk_big(&marker, (uint32_t)icc.size + 16, 2);
        fk_put(&marker, "ICC_PROFILE\0\1\1", 14);
        fk_put(&marker, icc.bytes, icc.size);
        fk_insert(&file, 20, marker.bytes, marker.size); /* behind the first marker, JFIF */
        im = read_as(&file, 0, 0);
        assert_int_equal(warning_count, k);
        image_free(&im);
    }
}

/* ---- cancelling and strangers -------------------------------------------------------------------- */

static int reports, most_reports;
static int report(void *user, float fraction, const char *stage) {
    (void)user;
    assert_true(fraction >= 0 && fraction <= 1);
    assert_non_null(stage);
    return ++reports == most_reports;
}

static void cancelling(void **state) {
    (void)state;
    static const char *const extensions[] = {".png", ".jpg", ".tga", ".bmp", ".tif", ".webp"};
    txm_env env = {0};
    env.progress = report;
    for (size_t e = 0; e < sizeof extensions / sizeof *extensions; e++) {
        if (!is_built_in(extensions[e])) continue;
        txm_image im = turned_picture(16, 3), back;
        const char *why;
        unsigned char *bytes;
        size_t size;
        image_job job = new_job(0, 0);
        job.env = &env;
        reports = 0;
        most_reports = 1;
        if (e != 2 && e != 3) { /* these are quick */
            assert_false(image_encode(&job, extensions[e], &im, &bytes, &size, &why));
            assert_true(job.is_cancelled);
            assert_null(bytes);
        }
        encode(extensions[e], &im);
        reports = most_reports = 0;
        assert_true(decode_as(&job, &file, file.size, &back, &why));
        assert_false(job.is_cancelled);
        assert_true(reports > 0);
        image_free(&back);
        for (int n = reports; n > 0; n -= 1 + n / 5) {
            reports = 0;
            most_reports = n;
            assert_false(decode_as(&job, &file, file.size, &back, &why));
            assert_true(job.is_cancelled);
            assert_int_equal(reports, n);
        }
        image_free(&im);
    }
}

static void strangers(void **state) {
    (void)state;
    static const char *const files[][2] = {{"GIF89a......", "a GIF"}, {"....ftypheic", "HEIC"}, {"8BPS.........", "Photoshop"},
                                           {"hello, world", "not a PNG"}, {"", "empty"}};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        file.size = 0;
        fk_put(&file, files[i][0], strlen(files[i][0]));
        refuse(&file, file.size, files[i][1]);
        assert_false(image_is_known(file.bytes, file.size));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colour_keys),      cmocka_unit_test(colour_keys_of_16_bits),
        cmocka_unit_test(wrong_sums),       cmocka_unit_test(sizes_are_checked_first),
        cmocka_unit_test(exif_in_jpeg),     cmocka_unit_test(exif_in_png),
        cmocka_unit_test(exif_in_webp),     cmocka_unit_test(tiff_as_it_comes),
        cmocka_unit_test(round_trips),      cmocka_unit_test(odd_ends),
        cmocka_unit_test(png_in_bands),
        cmocka_unit_test(cmyk),             cmocka_unit_test(progressive),
        cmocka_unit_test(bmp_of_all_kinds), cmocka_unit_test(bmp_of_runs),
        cmocka_unit_test(tga_of_all_kinds), cmocka_unit_test(pnm_of_all_kinds),
        cmocka_unit_test(profiles),         cmocka_unit_test(cancelling),
        cmocka_unit_test(strangers),
    };
    return cmocka_run_group_tests_name("image_formats", tests, NULL, NULL);
}
