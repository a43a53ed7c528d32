/* test_image_io.c - pictures of 16 bits: written, read again, converted; and files that are none
   SPDX-License-Identifier: MIT OR Unlicense

   Built with: tools/files/image_io.c tools/files/stb.c                                           */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "files/image_io.h"

#include <stdio.h>

/* ---- helpers ------------------------------------------------------------------------------- */

enum { W = 19, H = 7 };

/* An exact copy on the heap, so that the sanitizer sees any read beyond it. */
static int decode(const void *bytes, size_t size, int channels, int deep, txm_image *image,
                  const char **why) {
    unsigned char *copy = (unsigned char *)malloc(size ? size : 1);
    assert_non_null(copy);
    if (size) memcpy(copy, bytes, size);
    *why = NULL;
    image_job job = {0};
    job.channels = channels;
    job.deep = deep;
    const int ok = image_decode(&job, copy, size, image, why);
    free(copy);
    if (!ok) { /* one line that says why, and nothing left behind */
        assert_non_null(*why);
        assert_true((*why)[0] != 0 && strchr(*why, '\n') == NULL);
        assert_null(image->pixels);
    }
    return ok;
}

static txm_image read_all(const void *bytes, size_t size, int channels, int deep) {
    txm_image image;
    const char *why;
    if (!decode(bytes, size, channels, deep, &image, &why)) fail_msg("%s", why);
    assert_int_equal(txm_image_check(&image, "image", 0, NULL), TXM_OK);
    return image;
}

/* noise and slopes */
static void draw(uint16_t *p, int channels) {
    txm_rng rng = txm_rng_make(4, (uint64_t)channels);
    for (int i = 0; i < W * H * channels; i++) {
        const int slope = 1000 * (i / channels % W) + i, noise = (int)txm_rng_below(&rng, 65536);
        p[i] = (uint16_t)(i % channels ? slope : noise);
    }
}

static txm_image view(void *pixels, int channels, txm_sample sample) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = W;
    im.height = H;
    im.channels = channels;
    im.sample = sample;
    return im;
}

static unsigned char *encode(const txm_image *image, size_t *size) {
    unsigned char *bytes;
    const char *why;
    why = NULL;
    if (!image_encode(NULL, ".png", image, &bytes, size, &why)) fail_msg("%s", why);
    assert_null(why); /* is set by failures only */
    return bytes;
}

static void assert_pixel(const txm_image *im, int x, int y, int c, int expected) {
    const void *row = txm_image_row_const(im, y);
    const int i = x * im->channels + c;
    assert_int_equal(im->sample == TXM_U16 ? ((const uint16_t *)row)[i] : ((const uint8_t *)row)[i],
                     expected);
}

/* ---- PNG ----------------------------------------------------------------------------------- */

static void png_round_trips(void **state) {
    (void)state;
    uint16_t pixels[W * H * 4];
    for (int channels = 1; channels <= 4; channels++) {
        size_t size;
        draw(pixels, channels);
        const txm_image image = view(pixels, channels, TXM_U16);
        unsigned char *png = encode(&image, &size);
        const unsigned char kinds[5] = {0, 0, 4, 2, 6}, end[4] = {0xae, 0x42, 0x60, 0x82};
        assert_int_equal(png[24], 16);
        assert_int_equal(png[25], kinds[channels]);
        assert_memory_equal(png + size - 4, end, 4); /* the checksum of every PNG's last chunk */
        for (int deep = 0; deep < 2; deep++) {
            txm_image back = read_all(png, size, 0, deep);
            assert_int_equal(back.sample, deep ? TXM_U16 : TXM_U8);
            assert_int_equal(back.width, W);
            assert_int_equal(back.height, H);
            assert_int_equal(back.channels, channels == 2 ? 4 : channels);
            for (int i = 0; i < W * H * back.channels; i++) {
                const int p = i / back.channels, c = i % back.channels;
                const int v = channels == 2 ? pixels[2 * p + (c == 3)] : pixels[i];
                assert_pixel(&back, p % W, p / W, c, deep ? v : (v + 128) / 257);
            }
            image_free(&back);
        }
        txm_image gray = read_all(png, size, 1, 1);
        assert_int_equal(gray.channels, 1);
        assert_int_equal(gray.sample, TXM_U16);
        if (channels < 3) assert_pixel(&gray, 5, 3, 0, pixels[(3 * W + 5) * channels]);
        image_free(&gray);
        free(png);
    }
}

/* Rows apart or bottom-up, channels left at 0: the same file. */
static void png_of_views(void **state) {
    (void)state;
    enum { ROW = W + 3 };
    uint16_t pixels[W * H], apart[ROW * H];
    size_t size, other_size;
    draw(pixels, 1);
    const txm_image plain = view(pixels, 1, TXM_U16);
    unsigned char *png = encode(&plain, &size);
    for (int flip = 0; flip < 2; flip++) {
        txm_image image = view(apart + (flip ? ROW * (H - 1) : 0), 0, TXM_U16);
        image.stride = (flip ? -1 : 1) * ROW * (ptrdiff_t)sizeof *apart;
        for (int y = 0; y < H; y++)
            memcpy(txm_image_row(&image, y), pixels + W * y, W * sizeof *pixels);
        unsigned char *other = encode(&image, &other_size);
        assert_int_equal(other_size, size);
        assert_memory_equal(other, png, size);
        free(other);
    }
    free(png);
}

static void eight_bits_stay_eight(void **state) {
    (void)state;
    uint8_t pixels[W * H * 3];
    size_t size;
    for (int i = 0; i < W * H * 3; i++) pixels[i] = (uint8_t)(i * 7);
    const txm_image image = view(pixels, 3, TXM_U8);
    unsigned char *png = encode(&image, &size);
    assert_int_equal(png[24], 8);
    txm_image back = read_all(png, size, 0, 1);
    assert_int_equal(back.sample, TXM_U8);
    assert_memory_equal(back.pixels, pixels, sizeof pixels);
    image_free(&back);
    free(png);
}

static void floats_are_refused(void **state) {
    (void)state;
    static const char *const extensions[] = {".jpg", ".jpeg", ".tga", ".bmp", ".png"};
    float pixels[W * H] = {0};
    for (int i = 0; i < 5; i++) {
        const txm_image image = view(pixels, 1, TXM_F32);
        unsigned char *bytes;
        const char *why = "";
        size_t size;
        assert_false(image_encode(NULL, extensions[i], &image, &bytes, &size, &why));
        assert_null(bytes);
        assert_non_null(strstr(why, "float"));
    }
}

/* Formats of 8 bits get the nearest values; the picture that is written stays as it is. */
static void other_formats_take_8_bits(void **state) {
    (void)state;
    static const char *const extensions[] = {".tga", ".bmp"};
    uint16_t pixels[W * H * 3], before[W * H * 3];
    for (int i = 0; i < W * H * 3; i++) pixels[i] = (uint16_t)(i * 7919);
    memcpy(before, pixels, sizeof before);
    for (int i = 0; i < 2; i++) {
        const txm_image image = view(pixels, 3, TXM_U16);
        unsigned char *bytes;
        const char *why = "";
        size_t size;
        assert_true(image_encode(NULL, extensions[i], &image, &bytes, &size, &why));
        txm_image back = read_all(bytes, size, 0, 1);
        assert_int_equal(back.sample, TXM_U8);
        for (int k = 0; k < W * H * 3; k++)
            assert_int_equal(((const uint8_t *)back.pixels)[k], (pixels[k] + 128) / 257);
        image_free(&back);
        free(bytes);
    }
    assert_memory_equal(pixels, before, sizeof before);
}

static void damaged_png(void **state) {
    (void)state;
    uint16_t pixels[W * H * 3];
    size_t size;
    draw(pixels, 3);
    const txm_image image = view(pixels, 3, TXM_U16);
    unsigned char *png = encode(&image, &size);
    txm_image back;
    const char *why;
    for (size_t n = 0; n + 12 < size; n++) /* up to the last chunk */
        assert_false(decode(png, n, 0, 1, &back, &why));
    for (size_t i = 0; i < size; i++) {
        png[i] ^= 0x40;
        if (decode(png, size, 0, 1, &back, &why)) image_free(&back);
        png[i] ^= 0x40;
    }
    free(png);
}

/* ---- PNM ----------------------------------------------------------------------------------- */

static void pnm_of_16_bits(void **state) {
    (void)state;
    /* 2 x 2, the largest number 65535; comments where they may stand */
    static const char gray[] = "P5 2\n# 77 x\n2 65535\n\x12\x34\xff\xff\x00\x00\x00\x7f";
    static const char color[] = "P6#c\n2 1#\n1000\n\x03\xe8\x00\x00\x01\xf4\x00\x00\x03\xe8\x00\x00";
    txm_image im = read_all(gray, sizeof gray - 1, 0, 1);
    static const int values[4] = {0x1234, 0xffff, 0, 0x7f};
    assert_int_equal(im.sample, TXM_U16);
    assert_int_equal(im.channels, 1);
    for (int i = 0; i < 4; i++) assert_pixel(&im, i % 2, i / 2, 0, values[i]);
    image_free(&im);
    for (int channels = 2; channels <= 4; channels++) { /* to other channels, to 8 bits */
        for (int deep = 0; deep < 2; deep++) {
            im = read_all(gray, sizeof gray - 1, channels, deep);
            assert_int_equal(im.channels, channels);
            for (int i = 0; i < 4 * channels; i++) {
                const int c = i % channels, v = values[i / channels];
                const int is_alpha = channels % 2 == 0 && c == channels - 1;
                assert_pixel(&im, i / channels % 2, i / channels / 2, c,
                             deep ? is_alpha ? 65535 : v : is_alpha ? 255 : (v + 128) / 257);
            }
            image_free(&im);
        }
    }
    static const int rgb[2][3] = {{65535, 0, 32768}, {0, 65535, 0}};
    for (int channels = 0; channels <= 4; channels++) {
        im = read_all(color, sizeof color - 1, channels, 1);
        assert_int_equal(im.channels, channels ? channels : 3);
        for (int x = 0; x < 2; x++) {
            const double blue = x ? 0 : 32767.5;
            const int g = (int)((77.0 * rgb[x][0] + 150.0 * rgb[x][1] + 29 * blue) / 256 + 0.5);
            for (int c = 0; c < im.channels; c++)
                assert_pixel(&im, x, 0, c,
                             im.channels % 2 == 0 && c == im.channels - 1 ? 65535
                             : im.channels < 3                            ? g
                                                                          : rgb[x][c]);
        }
        image_free(&im);
    }
    txm_image back;
    const char *why;
    for (size_t n = 0; n + 1 < sizeof color; n++) assert_false(decode(color, n, 1, 0, &back, &why));
    /* more than the largest number: cut off */
    im = read_all("P5 1 1 256 \x02\x00", 13, 0, 1);
    assert_pixel(&im, 0, 0, 0, 65535);
    image_free(&im);
    im = read_all("P5 1 1 255 \x02", 12, 0, 1); /* 8 bits */
    assert_int_equal(im.sample, TXM_U8);
    assert_pixel(&im, 0, 0, 0, 2);
    image_free(&im);
}

/* ---- files --------------------------------------------------------------------------------- */

static void from_a_path(void **state) {
    (void)state;
    const char *path = "build/tests/deep.png", *why = NULL;
    uint16_t pixels[W * H];
    draw(pixels, 1);
    const txm_image image = view(pixels, 1, TXM_U16);
    assert_true(image_write(path, &image, &why));
    txm_image back;
    assert_true(image_read_deep(path, 0, &back, &why));
    assert_int_equal(back.sample, TXM_U16);
    assert_memory_equal(back.pixels, pixels, sizeof pixels);
    image_free(&back);
    assert_true(image_read(path, 0, &back, &why));
    assert_int_equal(back.sample, TXM_U8);
    image_free(&back);
    assert_int_equal(remove(path), 0);
    assert_false(image_read_deep(path, 0, &back, &why));
    assert_non_null(why);
    assert_null(back.pixels);

    why = NULL;
    assert_false(image_write("build/tests/no/such/folder.png", &image, &why));
    assert_string_equal(why, "cannot write the file");
    assert_false(image_write("build/tests/deep.gif", &image, &why));
    assert_non_null(strstr(why, ".png"));
    assert_null(fopen("build/tests/deep.gif", "rb"));
    assert_false(file_write("build/tests", (const unsigned char *)"", 0));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(png_round_trips),           cmocka_unit_test(png_of_views),
        cmocka_unit_test(eight_bits_stay_eight),     cmocka_unit_test(floats_are_refused),
        cmocka_unit_test(other_formats_take_8_bits),
        cmocka_unit_test(damaged_png),               cmocka_unit_test(pnm_of_16_bits),
        cmocka_unit_test(from_a_path),
    };
    return cmocka_run_group_tests_name("image_io", tests, NULL, NULL);
}
