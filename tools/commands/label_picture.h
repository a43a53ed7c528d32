/* label_picture.h - label maps as pictures
   SPDX-License-Identifier: MIT OR Unlicense

   In a picture of labels each label has a colour of its own, at most 16 in all. Gray values that are
   all below 16 are the labels themselves. Otherwise the colours are numbered as they are sorted: gray
   values from dark to bright, colours by red, then green, then blue. So a picture that lacks a colour
   has other labels, unless it is read with the colours of another one. Transparent is no label.  */
#ifndef LABEL_PICTURE_H
#define LABEL_PICTURE_H

#include "command.h"

enum { MOST_LABELS = 16, NO_LABEL = 255 };

/* The colours of labels, 0xrrggbb; none is known while count is 0. */
typedef struct label_colours {
    int count;
    uint32_t colour[MOST_LABELS];
} label_colours;

/* Read a picture as labels, 1 channel of 8 bits; NO_LABEL where it is transparent. Colours that are
   known must do; otherwise they become those of this picture. An exit status. */
int read_labels(cli *run, const char *path, label_colours *colours, txm_image *labels);

/* The colours of count labels that are written as they are. */
void plain_labels(int count, label_colours *colours);

/* A label map in its colours, for image_free: gray if all of them are gray. An exit status. */
int draw_labels(cli *run, const txm_image *labels, const label_colours *colours, txm_image *picture);

#endif /* LABEL_PICTURE_H */
