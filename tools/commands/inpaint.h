/* inpaint.h - what the files of 'texkit inpaint' share
   SPDX-License-Identifier: MIT OR Unlicense

   inpaint.c holds the command and its options, inpaint_lines.c reads lines that were drawn,
   inpaint_files.c reads and writes pictures.                                                    */
#ifndef INPAINT_H
#define INPAINT_H

#include "command.h"
#include "files/image_io.h"
#include "files/mesh_io.h"
#include "texinpaint.h"

/* A picture of --debug, encoded. */
typedef struct inpaint_shown {
    char path[MAX_PATH];
    unsigned char *bytes;
    size_t size;
} inpaint_shown;

typedef struct inpaint_job {
    cli run;

    /* options as they were given */
    const char *mesh_path, *texture, *mask, *source, *map_list, *normals, *labels, *structure;
    const char *guide, *prior, *alpha, *debug;
    int directx, gutter, smooth, dilate, preview;

    const char *picture; /* IMAGE or --texture */
    texinpaint_desc desc;
    texinpaint_map maps[TEXINPAINT_MAX_MAPS];
    char (*names)[MAX_PATH]; /* of the maps; NULL: there are none */
    char (*paths)[MAX_PATH]; /* of the outputs: the picture's, then those of the maps */
    mesh_data mesh;
    uint32_t *corners;       /* 0, 1, 2, ...: each corner of the mesh has texture coordinates of its own */
    mesh_lines drawn;
    texinpaint_line *lines;

    txm_image out[TEXINPAINT_MAX_MAPS];

    /* the pictures of --debug, as PNG */
    inpaint_shown *shown;
    size_t shown_count;
    int show_status; /* of the last picture; after a failure no more are kept */
} inpaint_job;

/* ---- inpaint_lines.c ---- */

/* Read the lines of --guide or --prior. */
int inpaint_read_lines(inpaint_job *j, const char *path);

/* ---- inpaint_files.c ---- */

/* Name and announce the outputs: OUT and one for each map. */
int inpaint_name_outputs(inpaint_job *j);

/* Announce the files in the folder of --debug that may be written over. An exit status. */
int inpaint_announce_shown(inpaint_job *j);

/* Read mesh, pictures and masks, and make room for the outputs. */
int inpaint_read_all(inpaint_job *j);

/* The callback that keeps the pictures of --debug. */
void inpaint_show(void *user, const char *name, const txm_image *picture);

int inpaint_write_outputs(inpaint_job *j);

#endif /* INPAINT_H */
