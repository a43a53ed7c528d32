/* patch.h - what the files of 'texkit patch' share
   SPDX-License-Identifier: MIT OR Unlicense

   patch.c holds the command, patch_options.c refuses what does not go together, patch_files.c reads
   and writes, strokes.c makes guides of strokes.                                                */
#ifndef PATCH_H
#define PATCH_H

#include "command.h"
#include "texpatch.h"

enum {
    MAX_NAMES = TEXPATCH_MAX_MAPS > TEXPATCH_MAX_EXEMPLARS ? TEXPATCH_MAX_MAPS
                                                           : TEXPATCH_MAX_EXEMPLARS
};

/* Names out of a list; they lie in storage. */
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
    int extent[2], passes, directx, tileable, tileable_x, tileable_y, lod;

    texpatch_desc desc; /* of the library, filled in as options are read and files are */
    texpatch_exemplar exemplars[TEXPATCH_MAX_EXEMPLARS];
    texpatch_map maps[TEXPATCH_MAX_MAPS];
    names exemplar_names, map_names[TEXPATCH_MAX_EXEMPLARS];
    txm_image pictures[TEXPATCH_MAX_EXEMPLARS][TEXPATCH_MAX_MAPS], kept[TEXPATCH_MAX_MAPS];
    int64_t window_x, window_y;

    /* the result */
    char (*paths)[MAX_PATH]; /* map 0 and its levels, map 1 and its levels, ... */
    int path_count;
    txm_image out[TEXPATCH_MAX_MAPS];
    texpatch_source *from; /* of all pixels; NULL: nobody asks */
} patch_job;

/* ---- patch_options.c ---- */

/* Take a list apart at its separators; most names, none empty. */
int patch_split(patch_job *j, const char *option, const char *list, char separator, int most,
                names *n);

/* Refuse, before any work, what does not go together. */
int patch_check_options(patch_job *j);

/* ---- patch_files.c ---- */

/* All paths that will be written. */
int patch_name_outputs(patch_job *j);

/* All pictures; then it is known what OUT has to hold. */
int patch_read_all(patch_job *j);

/* The share of neighbours that are neighbours in the exemplar. */
double patch_continuous(const patch_job *j);

int patch_write_outputs(patch_job *j);

/* ---- strokes.c ---- */

/* The strokes of --control become guides. */
int patch_take_strokes(patch_job *j);

#endif /* PATCH_H */
