/* straighten.h - straight pictures for more than one command
   SPDX-License-Identifier: MIT OR Unlicense                                                     */
#ifndef STRAIGHTEN_H
#define STRAIGHTEN_H

#include "command.h"
#include "texpatch.h"

/* A picture and what kind of map it is; map NULL: colours. */
typedef struct straight_picture {
    txm_image *image;
    const texpatch_map *map;
} straight_picture;

/* Replace pictures in register by straight ones; the pattern is found in the first, whose file is
   path, where the mask (pixels NULL: none) is not black. focal, whole: as texpatch.h has them. *agreement
   receives how clear the pattern is, or 0 after a warning: then there is none, and the pictures are
   left as they are. An exit status. */
int straighten(cli *run, const char *path, const straight_picture *pictures, int count,
               const txm_image *mask, double focal, int whole, double *agreement);

#endif /* STRAIGHTEN_H */
