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
    MAX_PNG16 = 1 << 29,  /* bytes; stb_image_write counts in int   */
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

int file_write(const char *path, const unsigned char *bytes, size_t size) {
    FILE *file = fopen(path, "wb");
    if (!file) return 0;
    const int ok = fwrite(bytes, 1, size, file) == size;
    return fclose(file) == 0 && ok;
}

/* ---- reading ---------------------------------------------------------------------------- */

/* Where a JPEG, BMP, TGA or PNM ends too early, stb_image fills in zeros without an error. This
   reader notices when a decoder asks for more bytes than there are. Only the look-ahead buffer,
   which is filled first, may get fewer than it has room for. */
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

/* A PNM of 16 bits, c channels in the file; pixels stay NULL if it is cut short. stb_image leaves
   the bytes in the file's order, does not look at the maximum, and reads beyond its block when it
   converts the channels. */
static void read_pnm16(const unsigned char *bytes, size_t size, int c, txm_image *image) {
    const unsigned char *p = bytes + 2, *end = bytes + size;
    unsigned maximum = 0;
    for (int i = 0; i < 3; i++) { /* width, height, maximum, with comments between */
        for (int comment = 0; p < end && (comment || !isdigit(*p)); p++)
            comment = *p == '#' || (comment && *p != '\n' && *p != '\r');
        for (maximum = 0; p < end && isdigit(*p); p++)
            maximum = 10 * maximum + (unsigned)(*p - '0');
    }
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    const size_t texel = (size_t)image->channels * txm_sample_bytes(image->sample);
    if (p == end || (size_t)(end - p - 1) < pixels * (size_t)c * 2) return;
    p++; /* one white space */
    image->pixels = malloc(pixels * texel);
    for (int y = 0; y < image->height && image->pixels; y++) {
        for (int x = 0; x < image->width; x++) {
            float v[3] = {0, 0, 0};
            for (int k = 0; k < c; k++, p += 2) v[k] = (float)(p[0] << 8 | p[1]) / (float)maximum;
            /* as stb_image weighs colours */
            const float gray = c == 1 ? v[0] : (77 * v[0] + 150 * v[1] + 29 * v[2]) / 256;
            for (int k = 0; k < image->channels; k++) {
                const int is_alpha = image->channels % 2 == 0 && k == image->channels - 1;
                const int is_gray = c == 1 || image->channels < 3;
                txm_image_set(image, x, y, k, is_alpha ? 1 : is_gray ? gray : v[k]);
            }
        }
    }
}

static int decode(const unsigned char *bytes, size_t size, int channels, int deep, txm_image *image,
                  const char **why) {
    int w, h, c;
    reader r = {bytes, size, 0, NULL, 0};
    memset(image, 0, sizeof *image);
    if (size == 0) return *why = "the file is empty", 0;
    if (size > INT_MAX || !stbi_info_from_memory(bytes, (int)size, &w, &h, &c))
        return *why = "not a PNG, JPEG, BMP, TGA or binary PNM image, or damaged", 0;
    if (w < 1 || h < 1 || h > MAX_PIXELS / w)
        return *why = "more than 2^28 pixels; scale it down", 0;
    const int has_16 = stbi_is_16_bit_from_memory(bytes, (int)size);
    image->width = w;
    image->height = h;
    if (channels == 0) channels = c == 2 ? 4 : c;
    image->channels = channels;
    image->sample = deep && has_16 ? TXM_U16 : TXM_U8;
    if (has_16 && bytes[0] == 'P')
        read_pnm16(bytes, size, c, image);
    else if (image->sample == TXM_U16)
        image->pixels = stbi_load_16_from_callbacks(&reader_callbacks, &r, &w, &h, &c, channels);
    else
        image->pixels = stbi_load_from_callbacks(&reader_callbacks, &r, &w, &h, &c, channels);
    if (image->pixels && !r.ran_out) return 1;
    image_free(image);
    return *why = "the image is damaged or cut short; get a whole copy", 0;
}

int image_decode(image_job *job, const unsigned char *bytes, size_t size, txm_image *image,
                 const char **why) {
    return decode(bytes, size, job->channels, job->deep, image, why);
}

int image_load(image_job *job, const char *path, txm_image *image, const char **why) {
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    memset(image, 0, sizeof *image);
    if (!bytes) return *why = strerror(errno), 0;
    const int ok = image_decode(job, bytes, size, image, why);
    free(bytes);
    return ok;
}

int image_read(const char *path, int channels, txm_image *image, const char **why) {
    image_job job = {0};
    job.channels = channels;
    return image_load(&job, path, image, why);
}

int image_read_deep(const char *path, int channels, txm_image *image, const char **why) {
    image_job job = {0};
    job.channels = channels;
    job.deep = 1;
    return image_load(&job, path, image, why);
}

int image_new(int width, int height, int channels, txm_sample sample, txm_image *image) {
    size_t pixels, bytes;
    memset(image, 0, sizeof *image);
    image->width = width;
    image->height = height;
    image->channels = channels;
    image->sample = sample;
    if (txm_mul((size_t)width, (size_t)height, 1, &pixels) &&
        txm_mul(pixels, (size_t)channels, txm_sample_bytes(sample), &bytes))
        image->pixels = calloc(bytes, 1);
    return image->pixels != NULL;
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

/* Numbers in PNG are big-endian. */
static void put_number(unsigned char *to, uint32_t value) {
    for (int i = 0; i < 4; i++) to[i] = (unsigned char)(value >> (24 - 8 * i) & 255);
}

static uint32_t crc_of(uint32_t crc, const unsigned char *p, int count) {
    while (count-- > 0) {
        crc ^= *p++;
        for (int k = 0; k < 8; k++) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    }
    return crc;
}

static void put_chunk(sink *s, const char *name, unsigned char *data, int size) {
    unsigned char head[8], tail[4];
    put_number(head, (uint32_t)size);
    memcpy(head + 4, name, 4);
    put_number(tail, ~crc_of(crc_of(0xffffffffu, head + 4, 4), data, size));
    sink_write(s, head, 8);
    if (size) sink_write(s, data, size);
    sink_write(s, tail, 4);
}

/* PNG's filter 4 (Paeth): predicts a byte from those to the left, above, and above left */
static int paeth(int a, int b, int c) {
    const int pa = abs(b - c), pb = abs(a - c), pc = abs(a + b - 2 * c);
    return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
}

/* stb_image_write has no PNG of 16 bits. All rows get the same filter. */
static int write_png16(sink *s, const txm_image *image) {
    static const unsigned char kinds[5] = {0, 0, 4, 2, 6};
    unsigned char signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    unsigned char header[13] = {0};
    const size_t texel = 2 * (size_t)image->channels, row = texel * (size_t)image->width + 1;
    const size_t size = row * (size_t)image->height;
    unsigned char *data = (unsigned char *)malloc(size), *packed;
    int n;
    if (!data) return 0;
    for (int y = 0; y < image->height; y++) {
        const uint16_t *from = (const uint16_t *)txm_image_row_const(image, y);
        unsigned char *to = data + (size_t)y * row;
        *to++ = 4;
        for (size_t i = 0; i < row / 2; i++) {
            *to++ = (unsigned char)(from[i] >> 8);
            *to++ = (unsigned char)(from[i] & 255);
        }
    }
    for (int y = image->height - 1; y >= 0; y--) { /* backwards: filters use the bytes before */
        unsigned char *p = data + (size_t)y * row;
        const unsigned char *up = y ? p - row : p;
        for (size_t x = row - 1; x > 0; x--) {
            const int left = x > texel;
            p[x] = (unsigned char)(p[x] - paeth(left ? p[x - texel] : 0, y ? up[x] : 0,
                                                left && y ? up[x - texel] : 0));
        }
    }
    packed = stbi_zlib_compress(data, (int)size, &n, stbi_write_png_compression_level);
    free(data);
    if (!packed) return 0;
    put_number(header, (uint32_t)image->width);
    put_number(header + 4, (uint32_t)image->height);
    header[8] = 16;
    header[9] = kinds[image->channels];
    sink_write(s, signature, 8);
    put_chunk(s, "IHDR", header, 13);
    put_chunk(s, "IDAT", packed, n);
    put_chunk(s, "IEND", NULL, 0);
    free(packed);
    return 1;
}

int image_encode(const char *extension, const txm_image *image, unsigned char **bytes, size_t *size,
                 const char **why) {
    const txm_image im = txm_image_resolve(*image);
    int w = im.width, h = im.height, c = im.channels, ok;
    sink s = {NULL, 0, 0, 0};
    *bytes = NULL;
    if (!image_can_write(extension, w, h, c, why)) return 0;
    if (im.sample == TXM_F32)
        return *why = "no format here takes float samples; convert them to 8 or 16 bits", 0;
    if (im.sample == TXM_U16 && strcmp(extension, ".png") != 0)
        return *why = "of these formats only PNG takes 16 bits a sample; use .png", 0;
    if (im.sample == TXM_U16 && (size_t)h > MAX_PNG16 / (2 * (size_t)c * ((size_t)w + 1)))
        return *why = "more than 2^29 bytes; make it smaller", 0;
    if (im.sample == TXM_U16)
        ok = write_png16(&s, &im);
    else if (!strcmp(extension, ".png"))
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

int image_encode_indexed(const txm_image *labels, const unsigned char palette[256][3],
                         unsigned char **bytes, size_t *size, const char **why) {
    unsigned char signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    unsigned char header[13] = {0}, colours[3 * 256], *data = NULL, *packed = NULL;
    const size_t width = (size_t)labels->width, height = (size_t)labels->height;
    sink s = {NULL, 0, 0, 0};
    int n = 0;
    *bytes = NULL;
    if (height > MAX_PNG16 / (width + 1)) return *why = "more than 2^29 bytes; make it smaller", 0;
    data = (unsigned char *)malloc((width + 1) * height);
    for (size_t y = 0; y < height && data; y++) { /* no filter: neighbouring indices are equal */
        data[y * (width + 1)] = 0;
        memcpy(data + y * (width + 1) + 1, txm_image_row_const(labels, (int)y), width);
    }
    if (data)
        packed = stbi_zlib_compress(data, (int)((width + 1) * height), &n,
                                    stbi_write_png_compression_level);
    free(data);
    if (packed) {
        put_number(header, (uint32_t)width);
        put_number(header + 4, (uint32_t)height);
        header[8] = 8;
        header[9] = 3; /* indexed */
        memcpy(colours, palette, sizeof colours);
        sink_write(&s, signature, 8);
        put_chunk(&s, "IHDR", header, 13);
        put_chunk(&s, "PLTE", colours, (int)sizeof colours);
        put_chunk(&s, "IDAT", packed, n);
        put_chunk(&s, "IEND", NULL, 0);
        free(packed);
    }
    if (!s.bytes || s.failed) {
        free(s.bytes);
        return *why = "no memory to encode the picture; make it smaller", 0;
    }
    *bytes = s.bytes;
    *size = s.size;
    return 1;
}

int image_write(const char *path, const txm_image *image, const char **why) {
    char extension[8];
    unsigned char *bytes;
    size_t size;
    file_extension(path, extension);
    if (!image_encode(extension, image, &bytes, &size, why)) return 0;
    const int ok = file_write(path, bytes, size);
    free(bytes);
    return ok ? 1 : (*why = "cannot write the file", 0);
}
