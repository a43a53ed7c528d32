/* patch.h - what the files of 'texkit patch' share
   SPDX-License-Identifier: MIT OR Unlicense

   patch.c holds the command, patch_options.c checks the options, patch_files.c reads and writes,
   strokes.c turns strokes into guides.                                                          */
#ifndef PATCH_H
#define PATCH_H

#include "command.h"
#include "straighten.h"

enum {
    MAX_NAMES = TEXPATCH_MAX_MAPS > TEXPATCH_MAX_EXEMPLARS ? TEXPATCH_MAX_MAPS
                                                           : TEXPATCH_MAX_EXEMPLARS
};

/* The names of a list; storage holds the text. */
typedef struct names {
    char *storage;
    const char *at[MAX_NAMES];
    int count;
} names;

typedef struct patch_job {
    cli run;
    char extension[8];

    /* options as they were given */
    const char *map_list, *weights, *normals, *labels, *data, *more, *masks, *guides, *target;
    const char *target_mask, *guide_weight, *kept_list, *keep, *novelty, *lattice, *window;
    const char *sources, *control;
    int straighten; /* photographs are made straight first */
    int extent[2], passes, directx, tileable, tileable_x, tileable_y, lod, cutout, even;

    texpatch_desc desc; /* filled in while options and files are read */
    texpatch_exemplar exemplars[TEXPATCH_MAX_EXEMPLARS];
    texpatch_map maps[TEXPATCH_MAX_MAPS];
    names exemplar_names, map_names[TEXPATCH_MAX_EXEMPLARS];
    txm_image pictures[TEXPATCH_MAX_EXEMPLARS][TEXPATCH_MAX_MAPS], kept[TEXPATCH_MAX_MAPS];
    int64_t window_x, window_y;

    /* the result */
    char (*paths)[MAX_PATH]; /* map 0 and its levels, map 1 and its levels, ... */
    int path_count;
    txm_image out[TEXPATCH_MAX_MAPS];
    texpatch_source *from; /* of all pixels; NULL: not needed */
} patch_job;

/* ---- patch_options.c ---- */

/* Split a list at its commas into at most so many names, none of them empty. */
int patch_split(patch_job *j, const char *option, const char *list, int most, names *n);

/* Refuse, before any work, options that do not go together. */
int patch_check_options(patch_job *j);

/* ---- patch_files.c ---- */

/* Name and announce all outputs. */
int patch_name_outputs(patch_job *j);

/* Read all pictures, and check that OUT's format can hold the result. */
int patch_read_all(patch_job *j);

/* The share of neighbours in OUT that are neighbours in the exemplar. */
double patch_continuous(const patch_job *j);

int patch_write_outputs(patch_job *j);

/* ---- strokes.c ---- */

/* Read the strokes of --control and turn them into guides. */
int patch_take_strokes(patch_job *j);

#endif /* PATCH_H */
