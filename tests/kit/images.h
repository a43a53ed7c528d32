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

/* a byte that depends on the pixel and on which picture it is */
static inline int at_random(int x, int y, int which) {
    const uint64_t place = (uint64_t)(uint32_t)x << 32 | (uint32_t)y;
    return (int)(txm_hash(place + 0x9e3779b97f4a7c15u * (uint64_t)(uint32_t)(which + 1)) >> 56);
}

#endif /* IMAGES_H */
