/* image_formats.h - what the readers and writers of image formats share; for image_*.c alone
   SPDX-License-Identifier: MIT OR Unlicense

   A reader gets an image_source, checks the size that the header tells with image_begin, which also
   makes room for the pixels, and fills them in as the file has them: 1 to 4 channels, TXM_U8 or
   TXM_U16. image_io.c then gives them the channels and the depth that are wanted and turns them
   upright. A writer appends to an image_target. All return 1 if all went well, else they have said
   why.                                                                                          */
#ifndef IMAGE_FORMATS_H
#define IMAGE_FORMATS_H

#include "image_io.h"

/* The image reads: 1..8 as in EXIF's tag 274, 1 upright; 6: its first row is the right side. */
enum { IMAGE_UPRIGHT = 1, IMAGE_LAST_ORIENTATION = 8 };

typedef struct image_source {
    const unsigned char *bytes; /* the whole file */
    size_t size;
    image_job *job;
    const char **why;
    int orientation; /* out, if the file tells one */
} image_source;

typedef struct image_target {
    unsigned char *bytes; /* for free() */
    size_t size, capacity;
    int is_full; /* there was no memory for more */
    image_job *job;
    const char **why;
} image_target;

extern const char image_damaged[]; /* a reason that most readers give */
extern const char image_no_memory[];

/* Refuse a size beyond the job's limits. */
int image_check_size(image_source *s, uint64_t width, uint64_t height);

/* The same, then make room; image->pixels are zeros. Readers free them when they fail. */
int image_begin(image_source *s, uint64_t width, uint64_t height, int channels, txm_sample sample,
                txm_image *image);

/* Report that so much of the whole is done. 0: the user has cancelled, and why is said. */
int image_continue(image_job *job, const char **why, size_t done, size_t whole, const char *stage);

/* Say to the user what is odd about the file. */
void image_warn(const image_source *s, const char *text);

/* Warn of an embedded colour profile unless it is one of sRGB; profile_warning: what it says. */
void image_check_profile(const image_source *s, const unsigned char *icc, size_t size);
extern const char image_profile_warning[];

/* Does the gray or RGB picture of this profile mean sRGB, or so nearly that nobody sees it? */
int image_profile_is_srgb(const unsigned char *icc, size_t size);

/* The orientation that a block of EXIF tells, with or without "Exif" in front; 0: none. */
int image_exif_orientation(const unsigned char *exif, size_t size);

/* Turn a picture upright. 0: no memory; then it is as it was. */
int image_turn(txm_image *image, int orientation);

/* Give a picture other channels, and 8 bits instead of 16. 0: no memory; then it is as it was. */
int image_convert(txm_image *image, int channels, txm_sample sample);

/* A copy whose rows lie one behind the other, the first one first. 0: no memory. */
int image_copy(const txm_image *image, txm_image *copy);

/* Append to the output; what there is no memory for is left out, is_full tells. */
void image_put(image_target *t, const void *bytes, size_t size);

/* ---- the formats ---------------------------------------------------------------------------- */

/* Do the bytes begin like such a file? */
int png_is(const unsigned char *bytes, size_t size);
int jpeg_is(const unsigned char *bytes, size_t size);
int bmp_is(const unsigned char *bytes, size_t size);
int pnm_is(const unsigned char *bytes, size_t size);
int tga_is(const unsigned char *bytes, size_t size);
int tiff_is(const unsigned char *bytes, size_t size);
int webp_is(const unsigned char *bytes, size_t size);

int png_read(image_source *s, txm_image *image);
int jpeg_read(image_source *s, txm_image *image);
int bmp_read(image_source *s, txm_image *image);
int pnm_read(image_source *s, txm_image *image);
int tga_read(image_source *s, txm_image *image);
int tiff_read(image_source *s, txm_image *image);
int webp_read(image_source *s, txm_image *image);

/* Samples are 8 bits, for PNG and TIFF also 16. palette: NULL, or the colours of a picture of one
   channel of 8 bits */
int png_write(image_target *t, const txm_image *image, const unsigned char palette[256][3]);
int jpeg_write(image_target *t, const txm_image *image);
int tiff_write(image_target *t, const txm_image *image);
int webp_write(image_target *t, const txm_image *image);

/* Were the libraries of these installed when this was compiled? */
extern const int tiff_is_built_in, webp_is_built_in;

#endif /* IMAGE_FORMATS_H */
