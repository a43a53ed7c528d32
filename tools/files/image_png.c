/* image_png.c - PNG in, by libpng; image_png_write.c writes them
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

#include <png.h>

enum {
    SIGNATURE = 8,
    HEADER = 33,           /* bytes of the signature and the first chunk, which tells the size */
    SRGB_GAMMA = 45455,    /* 1 / 2.2 in 1/100000, which stands for the curve of sRGB          */
    GAMMA_TOLERANCE = 1500
};

int png_is(const unsigned char *bytes, size_t size) {
    return size >= SIGNATURE && !memcmp(bytes, "\x89PNG\r\n\x1a\n", SIGNATURE);
}

/* PNG stores samples of 16 bits high byte first. */
static int is_little_endian(void) {
    const uint16_t one = 1;
    unsigned char first;
    memcpy(&first, &one, 1);
    return first == 1;
}

/* ---- reading ------------------------------------------------------------------------------ */

typedef struct reading {
    image_source *s;
    txm_image *image;
    png_structp png;
    png_infop info;
    size_t at;
    int has_odd_profile, has_bad_sum;
} reading;

static void take(png_structp png, png_bytep to, size_t size) {
    reading *r = (reading *)png_get_io_ptr(png);
    if (size > r->s->size - r->at) png_error(png, "cut short");
    memcpy(to, r->s->bytes + r->at, size);
    r->at += size;
}

static void go_home(png_structp png, png_const_charp text) {
    (void)text;
    png_longjmp(png, 1);
}

/* A profile that libpng does not take is none of sRGB, but for one that it knows to be badly made. The
   sum over the pixels is checked when all of them are there. */
static void listen(png_structp png, png_const_charp text) {
    reading *r = (reading *)png_get_error_ptr(png);
    if (!strncmp(text, "iCCP", 4) && !strstr(text, "sRGB")) r->has_odd_profile = 1;
    if (!strncmp(text, "IDAT", 4) && strstr(text, "data check")) r->has_bad_sum = 1;
}

/* One line at most: the profile stands above all, then sRGB, then the gamma. */
static void check_colours(reading *r) {
    png_charp name;
    png_bytep icc;
    png_uint_32 size;
    int kind;
    png_fixed_point gamma;
    if (r->has_odd_profile) {
        image_warn(r->s, image_profile_warning);
    } else if (png_get_iCCP(r->png, r->info, &name, &kind, &icc, &size)) {
        if (strcmp(name, "sRGB") != 0) image_check_profile(r->s, icc, size);
    } else if (!png_get_valid(r->png, r->info, PNG_INFO_sRGB) &&
               png_get_gAMA_fixed(r->png, r->info, &gamma) &&
               abs(gamma - SRGB_GAMMA) > GAMMA_TOLERANCE) {
        image_warn(r->s, "its gamma is not that of sRGB; values are taken as they are, convert it if "
                         "it looks wrong");
    }
}

/* libpng finds room for few more than these chunks, so EXIF is read by it as well. */
static void look_at_exif(reading *r) {
    png_bytep exif;
    png_uint_32 size;
    if (png_get_eXIf_1(r->png, r->info, &size, &exif))
        r->s->orientation = image_exif_orientation(exif, size);
}

/* Transparent colours and palettes become channels, few bits 8; gray with alpha RGBA, if it may. */
static int read_head(reading *r) {
    const image_job *job = r->s->job;
    png_set_crc_action(r->png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
    png_set_user_limits(r->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX); /* checked already */
    png_set_read_fn(r->png, r, take);
    png_read_info(r->png, r->info);
    png_set_expand(r->png);
    if (is_little_endian()) png_set_swap(r->png);
    if (job->channels == 0 && (png_get_color_type(r->png, r->info) == PNG_COLOR_TYPE_GRAY_ALPHA ||
                               (png_get_color_type(r->png, r->info) == PNG_COLOR_TYPE_GRAY &&
                                png_get_valid(r->png, r->info, PNG_INFO_tRNS))))
        png_set_gray_to_rgb(r->png);
    return 1;
}

static int read_rows(reading *r) {
    const int passes = png_set_interlace_handling(r->png);
    png_read_update_info(r->png, r->info);
    const png_uint_32 height = png_get_image_height(r->png, r->info);
    if (!image_begin(r->s, png_get_image_width(r->png, r->info), height,
                     png_get_channels(r->png, r->info),
                     png_get_bit_depth(r->png, r->info) == 16 ? TXM_U16 : TXM_U8, r->image))
        return 0;
    for (int pass = 0; pass < passes; pass++) {
        for (int y = 0; y < r->image->height; y++) {
            if (!image_continue(r->s->job, r->s->why, (size_t)pass * height + (size_t)y,
                                (size_t)passes * height, "read"))
                return 0;
            png_read_row(r->png, (png_bytep)txm_image_row(r->image, y), NULL);
        }
    }
    png_read_end(r->png, r->info);
    return !r->has_bad_sum;
}

static int read_all(reading *r) {
    if (setjmp(png_jmpbuf(r->png))) return 0;
    return read_head(r) && read_rows(r);
}

static uint32_t number(const unsigned char *p) {
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

int png_read(image_source *s, txm_image *image) {
    reading r = {s, image, NULL, NULL, 0, 0, 0};
    *s->why = image_damaged; /* unless it is said better */
    if (s->size < HEADER || memcmp(s->bytes + SIGNATURE + 4, "IHDR", 4) != 0) return 0;
    if (!image_check_size(s, number(s->bytes + 16), number(s->bytes + 20))) return 0;
    r.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r, go_home, listen);
    if (r.png) r.info = png_create_info_struct(r.png);
    if (!r.info) *s->why = image_no_memory;
    const int ok = r.info && read_all(&r);
    if (ok) {
        check_colours(&r);
        look_at_exif(&r);
    }
    png_destroy_read_struct(&r.png, &r.info, NULL);
    return ok;
}
