/* image_webp.c - WebP in and, without loss, out, by libwebp where it is installed
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

int webp_is(const unsigned char *bytes, size_t size) {
    return size >= 12 && !memcmp(bytes, "RIFF", 4) && !memcmp(bytes + 8, "WEBP", 4);
}

#ifndef TEXKIT_WEBP

const int webp_is_built_in = 0;

int webp_read(image_source *s, txm_image *image) {
    (void)image;
    return *s->why = "this texkit was built without libwebp; convert it to PNG", 0;
}

int webp_write(image_target *t, const txm_image *image) {
    (void)image;
    return *t->why = "this texkit was built without libwebp", 0;
}

#else

#include <webp/decode.h>
#include <webp/encode.h>

const int webp_is_built_in = 1;

enum {
    FILE_HEAD = 12,
    CHUNK_HEAD = 8,   /* name, size                                                     */
    PIECE = 1 << 15,  /* bytes that are decoded between two looks at who wants to cancel */
    EFFORT = 3        /* 0..9 of lossless packing: more takes longer and gains little     */
};

/* ---- reading ------------------------------------------------------------------------------ */

/* The profile and the orientation stand in chunks of their own. */
static void look_at_chunks(image_source *s) {
    for (size_t at = FILE_HEAD; at + CHUNK_HEAD <= s->size;) {
        const unsigned char *p = s->bytes + at;
        const size_t size = p[4] | (size_t)p[5] << 8 | (size_t)p[6] << 16 | (size_t)p[7] << 24;
        at += CHUNK_HEAD;
        if (size > s->size - at) return;
        if (!memcmp(p, "ICCP", 4)) image_check_profile(s, p + CHUNK_HEAD, size);
        if (!memcmp(p, "EXIF", 4)) s->orientation = image_exif_orientation(p + CHUNK_HEAD, size);
        at += size + (size & 1);
    }
}

static int read_pieces(image_source *s, WebPIDecoder *decoder) {
    VP8StatusCode status = VP8_STATUS_SUSPENDED;
    for (size_t n = 0; n < s->size && status == VP8_STATUS_SUSPENDED;) {
        n = s->size - n > PIECE ? n + PIECE : s->size;
        status = WebPIUpdate(decoder, s->bytes, n);
        if (!image_continue(s->job, s->why, n, s->size, "read")) return 0;
    }
    return status == VP8_STATUS_OK ? 1 : (*s->why = image_damaged, 0);
}

int webp_read(image_source *s, txm_image *image) {
    WebPDecoderConfig config;
    if (!WebPInitDecoderConfig(&config) ||
        WebPGetFeatures(s->bytes, s->size, &config.input) != VP8_STATUS_OK)
        return *s->why = image_damaged, 0;
    const WebPBitstreamFeatures *f = &config.input;
    if (f->has_animation) return *s->why = "an animation; save one of its pictures", 0;
    if (f->width < 1 || f->height < 1) return *s->why = image_damaged, 0;
    const int channels = f->has_alpha ? 4 : 3;
    if (!image_begin(s, (uint64_t)f->width, (uint64_t)f->height, channels, TXM_U8, image)) return 0;
    config.output.colorspace = f->has_alpha ? MODE_RGBA : MODE_RGB;
    config.output.is_external_memory = 1;
    config.output.u.RGBA.rgba = (uint8_t *)image->pixels;
    config.output.u.RGBA.stride = f->width * channels;
    config.output.u.RGBA.size = (size_t)f->width * (size_t)f->height * (size_t)channels;
    WebPIDecoder *decoder = WebPIDecode(NULL, 0, &config);
    if (!decoder) return *s->why = image_no_memory, 0;
    const int ok = read_pieces(s, decoder);
    WebPIDelete(decoder);
    WebPFreeDecBuffer(&config.output);
    if (ok) look_at_chunks(s);
    return ok;
}

/* ---- writing ------------------------------------------------------------------------------ */

static int put_bytes(const uint8_t *bytes, size_t size, const WebPPicture *picture) {
    image_target *t = (image_target *)picture->custom_ptr;
    image_put(t, bytes, size);
    return !t->is_full;
}

static int watch(int percent, const WebPPicture *picture) {
    image_target *t = (image_target *)picture->user_data;
    return image_continue(t->job, t->why, (size_t)percent, 100, "encode");
}

int webp_write(image_target *t, const txm_image *image) {
    WebPConfig config;
    WebPPicture picture;
    txm_image copy = *image; /* libwebp takes RGB or RGBA */
    *t->why = image_no_memory; /* unless it is said better */
    if (!WebPConfigInit(&config) || !WebPConfigLosslessPreset(&config, EFFORT) || !WebPPictureInit(&picture))
        return 0;
    config.exact = 1; /* colours where it is transparent are kept */
    if (image->channels < 3) {
        const int channels = image->channels + 2;
        if (!image_copy(image, &copy)) return 0;
        if (!image_convert(&copy, channels, TXM_U8)) {
            image_free(&copy);
            return 0;
        }
    }
    picture.use_argb = 1;
    picture.width = copy.width;
    picture.height = copy.height;
    picture.writer = put_bytes;
    picture.custom_ptr = t;
    picture.progress_hook = watch;
    picture.user_data = t;
    const uint8_t *pixels = (const uint8_t *)copy.pixels;
    const int stride = (int)txm_image_resolve(copy).stride;
    const int ok = (copy.channels == 4 ? WebPPictureImportRGBA(&picture, pixels, stride)
                                       : WebPPictureImportRGB(&picture, pixels, stride)) &&
                   WebPEncode(&config, &picture);
    WebPPictureFree(&picture);
    if (copy.pixels != image->pixels) image_free(&copy);
    return ok;
}

#endif /* TEXKIT_WEBP */
