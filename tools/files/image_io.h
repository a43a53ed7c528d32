/* image_io.h - image files in and out
   SPDX-License-Identifier: MIT OR Unlicense

   Reads PNG, JPEG, BMP, TGA and PNM, and TIFF and WebP if their libraries were installed when this was
   compiled, with 1, 3 or 4 channels; gray with alpha becomes RGBA, palettes RGB, colour keys alpha, CMYK
   RGB, few bits 8, other than 8 bits 16 if that is wanted. Pictures that EXIF or TIFF says are turned or
   mirrored are turned upright. Wrong checksums and missing pixels are errors. Writes PNG, TGA, BMP, JPEG,
   TIFF and WebP. Where a function fails, *why is set to an English phrase that fits after "cannot read
   'x.png': ".                                                                                    */
#ifndef IMAGE_IO_H
#define IMAGE_IO_H

#include "texmath.h"

/* The whole file in a block for free(), or NULL with errno set. "-" is standard input. */
unsigned char *file_read(const char *path, size_t *size);

/* Write a whole file; commands use cli_finish instead. 0: it cannot be written. */
int file_write(const char *path, const unsigned char *bytes, size_t size);

/* ".png" of "a/b.PNG": in lower case, at most 7 characters; "" if there is none */
void file_extension(const char *path, char extension[8]);

/* Do these bytes begin like an image of a kind that image_decode reads? */
int image_is_known(const unsigned char *bytes, size_t size);

/* How a picture is read or written; all zero: 8 bits a sample, the channels of the file, in silence. */
typedef struct image_job {
    int channels;       /* 0 keeps those of the file, 1 makes gray, 2 to 4 what it says        */
    int deep;           /* 1 keeps 16 bits a sample if the file has them: TXM_U16, else TXM_U8 */
    int max_side;       /* a longer side is refused before anything is decoded; 0 = 2^24       */
    const txm_env *env; /* reports progress and cancels; PNGs are written by its threads; or NULL */
    /* Called for what is worth a line to the user, though the picture was read: one English phrase
       that fits after "warning: 'x.jpg': ". NULL = silent.                                    */
    void (*warn)(void *user, const char *text);
    void *user;
    int is_cancelled; /* out: 1 if the picture was not read or written because env said so     */
    char text[120];   /* room for what *why says                                               */
} image_job;

/* Decode a whole file. Sizes are checked before anything is decoded. Release the result with
   image_free. 1 if all went well; else *why says why not, which may lie in job->text.            */
int image_decode(image_job *job, const unsigned char *bytes, size_t size, txm_image *image,
                 const char **why);

/* The same from a path. */
int image_load(image_job *job, const char *path, txm_image *image, const char **why);

/* The same, 8 bits and in silence; and keeping 16 bits. channels 0 keeps those of the file. */
int image_read(const char *path, int channels, txm_image *image, const char **why);
int image_read_deep(const char *path, int channels, txm_image *image, const char **why);

/* A picture of zeros; image_free releases it. 0: no memory, or too large for any. */
int image_new(int width, int height, int channels, txm_sample sample, txm_image *image);

void image_free(txm_image *image);

/* Can the format of this extension (".png") hold a width x height picture with so many channels?
   Each may be 0: not known yet. */
int image_can_write(const char *extension, int width, int height, int channels, const char **why);

/* Does the format of this extension take samples of 16 bits? */
int image_takes_16_bits(const char *extension);

/* Encode for that extension into a block for free(). Samples are TXM_U8 or TXM_U16, which is rounded to
   8 bits where not image_takes_16_bits. JPEG has quality 95, the others lose nothing else. Of the job, which may be NULL, only env is
   used. 1 if all went well. */
int image_encode(image_job *job, const char *extension, const txm_image *image, unsigned char **bytes,
                 size_t *size, const char **why);

/* A PNG of labels: one 8-bit channel whose values are indices into a palette of 256 RGB colours. */
int image_encode_indexed(image_job *job, const txm_image *labels, const unsigned char palette[256][3],
                         unsigned char **bytes, size_t *size, const char **why);

/* The same as image_encode, written to the path, whose extension says how. */
int image_write(const char *path, const txm_image *image, const char **why);

#endif /* IMAGE_IO_H */
