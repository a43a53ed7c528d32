/* bench_images.c - seconds and bytes of image files: bench_images EXEMPLAR...

   Of each exemplar 4096 x 4096 pixels are made, magnified and with a little noise, as cameras have it, and
   encoded and decoded in memory, by one thread; PNG also by libpng's own simplified calls and by
   stb_image_write.
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: clock_gettime */
#include "bench.h"

#include <png.h>
#include <stb/stb_image_write.h>

enum { SIDE = 4096, NOISE = 5 /* gray levels, from end to end */ };

static void magnify(const txm_image *small, txm_sample sample, txm_image *large) {
    txm_rng rng = txm_rng_make(1, 0);
    if (!image_new(SIDE, SIDE, small->channels, sample, large)) give_up("4096 x 4096", "no memory");
    const float step_x = (float)(small->width - 1) / SIDE, step_y = (float)(small->height - 1) / SIDE;
    for (int y = 0; y < SIDE; y++) {
        const int y0 = (int)((float)y * step_y);
        const float v = (float)y * step_y - (float)y0;
        for (int x = 0; x < SIDE; x++) {
            const int x0 = (int)((float)x * step_x);
            const float u = (float)x * step_x - (float)x0;
            for (int c = 0; c < small->channels; c++) {
                const float top = (1 - u) * txm_image_get(small, x0, y0, c) +
                                  u * txm_image_get(small, x0 + 1, y0, c);
                const float low = (1 - u) * txm_image_get(small, x0, y0 + 1, c) +
                                  u * txm_image_get(small, x0 + 1, y0 + 1, c);
                const float noise = (txm_rng_float(&rng) - 0.5f) * NOISE / 255;
                txm_image_set(large, x, y, c, txm_clampf((1 - v) * top + v * low + noise, 0, 1));
            }
        }
    }
}

static void print_line(const char *name, size_t bytes, const result *written, const result *read) {
    printf("%-28s %8.2f %8.2f %8.2f\n", name, mebibytes(bytes), written->cpu, read->cpu);
    fflush(stdout);
}

static void measure(const char *name, const char *extension, const txm_image *image) {
    unsigned char *bytes;
    const char *why;
    size_t size;
    txm_image back;
    image_job job = {0};
    result written = no_result, read = no_result;
    if (!image_can_write(extension, SIDE, SIDE, image->channels, &why)) return;
    job.deep = 1;
    watch w = start();
    if (!image_encode(NULL, extension, image, &bytes, &size, &why)) give_up(name, why);
    stop(&w, &written);
    w = start();
    if (!image_decode(&job, bytes, size, &back, &why)) give_up(name, why);
    stop(&w, &read);
    print_line(name, size, &written, &read);
    image_free(&back);
    free(bytes);
}

static void measure_libpng(const txm_image *image) {
    static const png_uint_32 formats[5] = {0, PNG_FORMAT_GRAY, PNG_FORMAT_GA, PNG_FORMAT_RGB, PNG_FORMAT_RGBA};
    png_image p;
    png_alloc_size_t size = 0;
    result written = no_result, read = no_result;
    memset(&p, 0, sizeof p);
    p.version = PNG_IMAGE_VERSION;
    p.width = p.height = SIDE;
    p.format = formats[image->channels];
    size = PNG_IMAGE_PNG_SIZE_MAX(p);
    unsigned char *bytes = (unsigned char *)malloc(size), *back = (unsigned char *)malloc(PNG_IMAGE_SIZE(p));
    if (!bytes || !back) give_up("libpng", "no memory");
    watch w = start();
    if (!png_image_write_to_memory(&p, bytes, &size, 0, image->pixels, 0, NULL)) give_up("libpng", p.message);
    stop(&w, &written);
    w = start();
    memset(&p, 0, sizeof p);
    p.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_memory(&p, bytes, size) || !png_image_finish_read(&p, NULL, back, 0, NULL))
        give_up("libpng", p.message);
    stop(&w, &read);
    print_line("PNG by libpng's own calls", size, &written, &read);
    free(bytes);
    free(back);
}

static void count_bytes(void *user, void *bytes, int size) {
    (void)bytes;
    *(size_t *)user += (size_t)size;
}

static void measure_stb(const txm_image *image) {
    size_t size = 0;
    result written = no_result;
    const watch w = start();
    stbi_write_png_to_func(count_bytes, &size, SIDE, SIDE, image->channels, image->pixels, 0);
    stop(&w, &written);
    printf("%-28s %8.2f %8.2f        -\n", "PNG by stb_image_write", mebibytes(size), written.cpu);
}

int main(int argc, char **argv) {
    const char *why;
    if (argc < 2) {
        fprintf(stderr, "usage: bench_images EXEMPLAR...\n");
        return 1;
    }
    txm_image small, large, deep;
    if (!image_read(argv[1], 0, &small, &why)) give_up(argv[1], why);
    magnify(&small, TXM_U8, &large);
    magnify(&small, TXM_U16, &deep);
    printf("%s as 4096 x 4096, %d channels     MiB    write     read, seconds of one thread\n",
           file_name(argv[1]), small.channels);
    measure("PNG", ".png", &large);
    measure_libpng(&large);
    measure_stb(&large);
    measure("PNG, 16 bits", ".png", &deep);
    measure("TIFF", ".tif", &large);
    measure("TIFF, 16 bits", ".tif", &deep);
    measure("WebP without loss", ".webp", &large);
    measure("TGA", ".tga", &large);
    if (large.channels != 4) measure("JPEG", ".jpg", &large);
    image_free(&small);
    image_free(&large);
    image_free(&deep);
    return 0;
}
