/* image_io.c - image files in and out; image_io.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_io.h"
#include "stb_config.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>

enum {
    MAX_SIDE = 1 << 24,   /* stb_image's own limit                  */
    MAX_PIXELS = 1 << 28, /* 1 GiB as RGBA                          */
    JPEG_QUALITY = 95
};

/* ---- files ------------------------------------------------------------------------------ */

void file_extension(const char *path, char extension[8]) {
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash + 1 : path, '.');
    size_t n = dot ? strlen(dot) : 0;
    if (n > 7) n = 0;
    for (size_t i = 0; i < n; i++) extension[i] = (char)tolower((unsigned char)dot[i]);
    extension[n] = 0;
}

unsigned char *file_read(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    unsigned char *bytes = NULL;
    size_t capacity = 1 << 16, n = 0;
    if (!file) return NULL;
    for (;;) {
        unsigned char *grown = (unsigned char *)realloc(bytes, capacity);
        if (!grown) break;
        bytes = grown;
        n += fread(bytes + n, 1, capacity - n, file);
        if (n < capacity || capacity > INT_MAX / 2) break;
        capacity *= 2;
    }
    int error = ferror(file) ? errno : bytes == NULL ? ENOMEM : n == capacity ? EFBIG : 0;
    fclose(file);
    if (error) {
        free(bytes);
        bytes = NULL;
        errno = error;
    }
    *size = n;
    return bytes;
}

/* ---- reading ---------------------------------------------------------------------------- */

/* stb_image puts zeros where a JPEG, BMP, TGA or PNM ends too early, and calls it a picture. Fed
   through this reader, a decoder that asks for more than there is gives itself away. Only its
   look-ahead buffer, which it fills first of all, may well get less than it has room for. */
typedef struct reader {
    const unsigned char *bytes;
    size_t size, at;
    const char *look_ahead;
    int ran_out;
} reader;

static int reader_read(void *user, char *data, int size) {
    reader *r = (reader *)user;
    size_t n = r->size - r->at;
    if (!r->look_ahead) r->look_ahead = data;
    if (n == 0 || (n < (size_t)size && data != r->look_ahead)) r->ran_out = 1;
    if (n > (size_t)size) n = (size_t)size;
    memcpy(data, r->bytes + r->at, n);
    r->at += n;
    return (int)n;
}

static void reader_skip(void *user, int n) {
    reader *r = (reader *)user;
    if (n < 0) {
        r->at -= (size_t)-n < r->at ? (size_t)-n : r->at;
    } else if ((size_t)n > r->size - r->at) {
        r->at = r->size;
        r->ran_out = 1;
    } else {
        r->at += (size_t)n;
    }
}

static int reader_eof(void *user) {
    const reader *r = (const reader *)user;
    return r->at == r->size;
}

static const stbi_io_callbacks reader_callbacks = {reader_read, reader_skip, reader_eof};

int image_is_known(const unsigned char *bytes, size_t size) {
    int w, h, c;
    return size <= INT_MAX && stbi_info_from_memory(bytes, (int)size, &w, &h, &c);
}

int image_decode(const unsigned char *bytes, size_t size, int channels, txm_image *image,
                 const char **why) {
    int w, h, c;
    reader r = {bytes, size, 0, NULL, 0};
    memset(image, 0, sizeof *image);
    if (size == 0) return *why = "the file is empty", 0;
    if (size > INT_MAX || !stbi_info_from_memory(bytes, (int)size, &w, &h, &c))
        return *why = "not a PNG, JPEG, BMP, TGA or binary PNM image, or damaged", 0;
    if (w < 1 || h < 1 || h > MAX_PIXELS / w)
        return *why = "more than 2^28 pixels; scale it down", 0;
    if (channels == 0) channels = c == 2 ? 4 : c;
    image->pixels = stbi_load_from_callbacks(&reader_callbacks, &r, &w, &h, &c, channels);
    if (image->pixels && r.ran_out) image_free(image);
    if (!image->pixels) return *why = "the image is damaged or cut short; get a whole copy", 0;
    image->width = w;
    image->height = h;
    image->channels = channels;
    return 1;
}

int image_read(const char *path, int channels, txm_image *image, const char **why) {
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    memset(image, 0, sizeof *image);
    if (!bytes) return *why = strerror(errno), 0;
    int ok = image_decode(bytes, size, channels, image, why);
    free(bytes);
    return ok;
}

void image_free(txm_image *image) {
    stbi_image_free(image->pixels);
    memset(image, 0, sizeof *image);
}

/* ---- writing ---------------------------------------------------------------------------- */

int image_can_write(const char *extension, int width, int height, int channels, const char **why) {
    int is_jpeg = !strcmp(extension, ".jpg") || !strcmp(extension, ".jpeg");
    int is_tga = !strcmp(extension, ".tga");
    int is_other = !strcmp(extension, ".png") || !strcmp(extension, ".bmp");
    if (!is_jpeg && !is_tga && !is_other)
        return *why = "end the name in .png, .tga, .bmp or .jpg", 0;
    if ((is_jpeg || is_tga) && (width > 65535 || height > 65535))
        return *why = "JPEG and TGA hold at most 65535 pixels a side; use .png", 0;
    if (is_jpeg && channels == 4)
        return *why = "JPEG has no alpha channel; use .png, .tga or .bmp", 0;
    return 1;
}

/* A growing block for the encoder's output; bytes is NULL after it ran out of memory. */
typedef struct sink {
    unsigned char *bytes;
    size_t size, capacity;
    int failed;
} sink;

static void sink_write(void *user, void *data, int size) {
    sink *s = (sink *)user;
    size_t n = (size_t)size;
    if (s->failed) return;
    if (s->size + n > s->capacity) {
        size_t capacity = 2 * (s->size + n) + 4096;
        unsigned char *grown = (unsigned char *)realloc(s->bytes, capacity);
        if (!grown) {
            s->failed = 1;
            return;
        }
        s->bytes = grown;
        s->capacity = capacity;
    }
    memcpy(s->bytes + s->size, data, n);
    s->size += n;
}

int image_encode(const char *extension, const txm_image *image, unsigned char **bytes, size_t *size,
                 const char **why) {
    int w = image->width, h = image->height, c = image->channels, ok;
    sink s = {NULL, 0, 0, 0};
    *bytes = NULL;
    if (!image_can_write(extension, w, h, c, why)) return 0;
    if (!strcmp(extension, ".png"))
        ok = stbi_write_png_to_func(sink_write, &s, w, h, c, image->pixels, 0);
    else if (!strcmp(extension, ".tga"))
        ok = stbi_write_tga_to_func(sink_write, &s, w, h, c, image->pixels);
    else if (!strcmp(extension, ".bmp"))
        ok = stbi_write_bmp_to_func(sink_write, &s, w, h, c, image->pixels);
    else /* .jpg */
        ok = stbi_write_jpg_to_func(sink_write, &s, w, h, c, image->pixels, JPEG_QUALITY);
    if (!ok || s.failed) {
        free(s.bytes);
        return *why = "no memory to encode the picture; make it smaller", 0;
    }
    *bytes = s.bytes;
    *size = s.size;
    return 1;
}
