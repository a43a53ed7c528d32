/* images.h - what the tests of all headers that work on pictures share
   SPDX-License-Identifier: MIT OR Unlicense                                                   */
#ifndef IMAGES_H
#define IMAGES_H

#include "texmath.h"

#include <string.h>

/* packed rows from pixels on */
static inline txm_image view(void *pixels, int width, int height, int channels, txm_sample sample) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    return im;
}

#endif /* IMAGES_H */
