/* image_io.c - image files in and out; image_io.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense

   This is what is common to all formats; each has a file of its own beside this one.             */
#include "image_formats.h"
#include "stb_config.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>

enum {
    MAX_SIDE = 1 << 24,
    MAX_PIXELS = 1 << 28, /* 1 GiB as RGBA, which all modules of the suite take */
    MAX_TGA = 65535, MAX_JPEG = 65500, MAX_WEBP = 16383 /* pixels a side */
};

const char image_damaged[] = "the image is damaged or cut short; get a whole copy";
const char image_no_memory[] = "no memory for the picture; make it smaller";

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
    const int is_stdin = !strcmp(path, "-");
    FILE *file = is_stdin ? stdin : fopen(path, "rb");
    unsigned char *bytes = NULL;
    size_t capacity = 1 << 16, n = 0;
    int error = 0;
    if (!file) return NULL;
    for (; !error; capacity *= 2) {
        unsigned char *grown = (unsigned char *)realloc(bytes, capacity);
        if (!grown) {
            error = ENOMEM;
            break;
        }
        bytes = grown;
        n += fread(bytes + n, 1, capacity - n, file);
        if (ferror(file)) error = errno;
        if (n < capacity) break;
        if (capacity > INT_MAX / 2) error = EFBIG;
    }
    if (!is_stdin) fclose(file);
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

/* ---- pictures in memory ------------------------------------------------------------------- */

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
    free(image->pixels);
    memset(image, 0, sizeof *image);
}

int image_copy(const txm_image *image, txm_image *copy) {
    if (!image_new(image->width, image->height, image->channels, image->sample, copy)) return 0;
    const size_t row =
        (size_t)image->width * (size_t)image->channels * txm_sample_bytes(image->sample);
    for (int y = 0; y < image->height; y++)
        memcpy(txm_image_row(copy, y), txm_image_row_const(image, y), row);
    return 1;
}

/* ---- what readers and writers share --------------------------------------------------------- */

int image_check_size(image_source *s, uint64_t width, uint64_t height) {
    image_job *job = s->job;
    const int is_limited = job->max_side > 0 && job->max_side < MAX_SIDE;
    const uint64_t side = is_limited ? (uint64_t)job->max_side : MAX_SIDE;
    if (width < 1 || height < 1) return *s->why = image_damaged, 0;
    if (width <= side && height <= side && height <= MAX_PIXELS / width) return 1;
    if (width > side || height > side)
        snprintf(job->text, sizeof job->text, "%llu x %llu pixels are too large: at most %llu a side; "
                 "scale it down", (unsigned long long)width, (unsigned long long)height,
                 (unsigned long long)side);
    else
        snprintf(job->text, sizeof job->text, "%llu x %llu pixels are too large: at most 2^28; scale "
                 "it down", (unsigned long long)width, (unsigned long long)height);
    return *s->why = job->text, 0;
}

int image_begin(image_source *s, uint64_t width, uint64_t height, int channels, txm_sample sample,
                txm_image *image) {
    if (!image_check_size(s, width, height)) return 0;
    if (!image_new((int)width, (int)height, channels, sample, image)) return *s->why = image_no_memory, 0;
    *s->why = image_damaged; /* for libraries that jump home */
    return 1;
}

int image_continue(image_job *job, const char **why, size_t done, size_t whole, const char *stage) {
    if (!job || !txm_progress(job->env, (float)done / (float)whole, stage)) return 1;
    job->is_cancelled = 1;
    return *why = "stopped", 0;
}

void image_warn(const image_source *s, const char *text) {
    if (s->job->warn) s->job->warn(s->job->user, text);
}

void image_put(image_target *t, const void *bytes, size_t size) {
    if (t->is_full || size == 0) return;
    if (size > t->capacity - t->size) {
        const size_t capacity = 2 * (t->size + size) + 4096;
        unsigned char *grown = (unsigned char *)realloc(t->bytes, capacity);
        t->is_full = !grown;
        if (!grown) return;
        t->bytes = grown;
        t->capacity = capacity;
    }
    memcpy(t->bytes + t->size, bytes, size);
    t->size += size;
}

/* ---- reading ---------------------------------------------------------------------------- */

typedef struct format {
    int (*is)(const unsigned char *bytes, size_t size);
    int (*read)(image_source *s, txm_image *image);
} format;

static const format *find_format(const unsigned char *bytes, size_t size) {
    static const format formats[] = {
        {png_is, png_read},   {jpeg_is, jpeg_read}, {pnm_is, pnm_read}, {bmp_is, bmp_read},
        {tiff_is, tiff_read}, {webp_is, webp_read}, {tga_is, tga_read}, /* has no signature: the last */
    };
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (formats[i].is(bytes, size)) return &formats[i];
    return NULL;
}

int image_is_known(const unsigned char *bytes, size_t size) {
    return find_format(bytes, size) != NULL;
}

/* Why a file is of no format that is read; some are common. */
static const char *name_stranger(const unsigned char *bytes, size_t size) {
    if (size == 0) return "the file is empty";
    if (size >= 12 && !memcmp(bytes + 4, "ftyp", 4))
        return "a HEIC or AVIF picture, or a film; convert it to PNG";
    if (size >= 4 && !memcmp(bytes, "GIF8", 4)) return "a GIF; convert it to PNG";
    if (size >= 4 && !memcmp(bytes, "8BPS", 4)) return "a Photoshop document; save it as PNG";
    if (size >= 4 && !memcmp(bytes, "\x76\x2f\x31\x01", 4))
        return "an OpenEXR picture; convert it to PNG of 16 bits";
    return "not a PNG, JPEG, BMP, TGA, PNM, TIFF or WebP image, or damaged";
}

int image_decode(image_job *job, const unsigned char *bytes, size_t size, txm_image *image,
                 const char **why) {
    const char *reason = image_damaged; /* readers set it beforehand, for libraries that jump home */
    image_source s = {bytes, size, job, &reason, IMAGE_UPRIGHT};
    const format *f = find_format(bytes, size);
    memset(image, 0, sizeof *image);
    job->is_cancelled = 0;
    if (!f) return *why = name_stranger(bytes, size), 0;
    int ok = f->read(&s, image);
    if (ok) {
        const int own = image->channels == 2 ? 4 : image->channels;
        const txm_sample sample = job->deep ? image->sample : TXM_U8;
        if (sample != image->sample) image_warn(&s, "it has 16 bits a sample, of which 8 are used");
        ok = image_convert(image, job->channels ? job->channels : own, sample) &&
             image_turn(image, s.orientation);
        if (!ok) reason = image_no_memory;
    }
    if (ok) return 1;
    image_free(image);
    return *why = reason, 0;
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

static int read_silently(const char *path, int channels, int deep, txm_image *image, const char **why) {
    image_job job = {0};
    job.channels = channels;
    job.deep = deep;
    const int ok = image_load(&job, path, image, why);
    if (!ok && *why == job.text)
        *why = "too large: at most 2^24 pixels a side and 2^28 in all; scale it down";
    return ok;
}

int image_read(const char *path, int channels, txm_image *image, const char **why) {
    return read_silently(path, channels, 0, image, why);
}

int image_read_deep(const char *path, int channels, txm_image *image, const char **why) {
    return read_silently(path, channels, 1, image, why);
}

/* ---- writing ---------------------------------------------------------------------------- */

typedef enum kind { UNKNOWN, PNG, TGA, BMP, JPEG, TIFF, WEBP } kind;

static kind kind_of(const char *extension) {
    static const struct {
        const char *extension;
        kind kind;
    } kinds[] = {{".png", PNG},  {".tga", TGA},  {".bmp", BMP},   {".jpg", JPEG},
                 {".jpeg", JPEG}, {".tif", TIFF}, {".tiff", TIFF}, {".webp", WEBP}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (!strcmp(extension, kinds[i].extension)) return kinds[i].kind;
    return UNKNOWN;
}

int image_can_write(const char *extension, int width, int height, int channels, const char **why) {
    const kind k = kind_of(extension);
    const int side = width > height ? width : height;
    if (k == UNKNOWN) return *why = "end the name in .png, .tga, .bmp, .jpg, .tif or .webp", 0;
    if (k == TIFF && !tiff_is_built_in) return *why = "this texkit was built without libtiff; use .png", 0;
    if (k == WEBP && !webp_is_built_in) return *why = "this texkit was built without libwebp; use .png", 0;
    if (k == JPEG && side > MAX_JPEG) return *why = "JPEG holds at most 65500 pixels a side; use .png", 0;
    if (k == TGA && side > MAX_TGA) return *why = "TGA holds at most 65535 pixels a side; use .png", 0;
    if (k == WEBP && side > MAX_WEBP) return *why = "WebP holds at most 16383 pixels a side; use .png", 0;
    if (k == JPEG && channels == 4)
        return *why = "JPEG has no alpha channel; use .png, .tga, .bmp, .tif or .webp", 0;
    return 1;
}

int image_takes_16_bits(const char *extension) {
    return kind_of(extension) == PNG || kind_of(extension) == TIFF;
}

static void put_for_stb(void *user, void *bytes, int size) {
    image_put((image_target *)user, bytes, (size_t)size);
}

static int write_by_stb(image_target *t, kind k, const txm_image *image) {
    txm_image copy;
    *t->why = image_no_memory;
    if (!image_copy(image, &copy)) return 0;
    if (k == BMP && copy.channels == 2 && !image_convert(&copy, 4, TXM_U8)) return image_free(&copy), 0;
    const int w = copy.width, h = copy.height, c = copy.channels;
    const int ok = k == TGA ? stbi_write_tga_to_func(put_for_stb, t, w, h, c, copy.pixels)
                            : stbi_write_bmp_to_func(put_for_stb, t, w, h, c, copy.pixels);
    image_free(&copy);
    return ok;
}

/* Hand over what a writer made, if it made all of it. */
static int hand_over(image_target *t, int ok, unsigned char **bytes, size_t *size, const char **why) {
    if (ok && t->is_full) *t->why = image_no_memory;
    ok = ok && !t->is_full;
    if (!ok) {
        *why = *t->why;
        free(t->bytes);
    }
    *bytes = ok ? t->bytes : NULL;
    *size = ok ? t->size : 0;
    return ok;
}

int image_encode(image_job *job, const char *extension, const txm_image *image, unsigned char **bytes,
                 size_t *size, const char **why) {
    txm_image im = txm_image_resolve(*image), narrow;
    const char *reason = image_no_memory;
    image_target t = {NULL, 0, 0, 0, job, &reason};
    const kind k = kind_of(extension);
    int ok;
    *bytes = NULL;
    *size = 0;
    if (job) job->is_cancelled = 0;
    if (!image_can_write(extension, im.width, im.height, im.channels, why)) return 0;
    if (im.sample == TXM_F32)
        return *why = "no format here takes float samples; convert them to 8 or 16 bits", 0;
    memset(&narrow, 0, sizeof narrow);
    if (im.sample == TXM_U16 && !image_takes_16_bits(extension)) {
        if (!image_copy(&im, &narrow) || !image_convert(&narrow, im.channels, TXM_U8))
            return image_free(&narrow), *why = image_no_memory, 0;
        im = narrow;
    }
    switch (k) {
    case PNG: ok = png_write(&t, &im, NULL); break;
    case JPEG: ok = jpeg_write(&t, &im); break;
    case TIFF: ok = tiff_write(&t, &im); break;
    case WEBP: ok = webp_write(&t, &im); break;
    default: ok = write_by_stb(&t, k, &im); break;
    }
    image_free(&narrow);
    return hand_over(&t, ok, bytes, size, why);
}

int image_encode_indexed(image_job *job, const txm_image *labels, const unsigned char palette[256][3],
                         unsigned char **bytes, size_t *size, const char **why) {
    const txm_image im = txm_image_resolve(*labels);
    const char *reason = image_no_memory;
    image_target t = {NULL, 0, 0, 0, job, &reason};
    if (job) job->is_cancelled = 0;
    return hand_over(&t, png_write(&t, &im, palette), bytes, size, why);
}

int image_write(const char *path, const txm_image *image, const char **why) {
    char extension[8];
    unsigned char *bytes;
    size_t size;
    file_extension(path, extension);
    if (!image_encode(NULL, extension, image, &bytes, &size, why)) return 0;
    const int ok = file_write(path, bytes, size);
    free(bytes);
    return ok ? 1 : (*why = "cannot write the file", 0);
}
