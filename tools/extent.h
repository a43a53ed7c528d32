/* extent.h - a part of a file that lies somewhere in memory
   SPDX-License-Identifier: MIT OR Unlicense                                                     */
#ifndef EXTENT_H
#define EXTENT_H

#include <stddef.h>

/* Extents one behind the other are a file whose bytes need not be copied into one block. */
typedef struct file_extent {
    const void *bytes;
    size_t size;
} file_extent;

#endif /* EXTENT_H */
