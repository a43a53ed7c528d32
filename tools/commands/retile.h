/* retile.h - what the files of 'texkit retile' share
   SPDX-License-Identifier: MIT OR Unlicense

   retile.c holds the command; retile_repairs.c says what is repaired, retile_dress.c gives the result
   colors and textures, retile_instances.c puts objects on it, mesh_figures.c measures it.       */
#ifndef RETILE_H
#define RETILE_H

#include "command.h"
#include "files/mesh_io.h"
#include "trimesh_cover.h"
#include "trimesh_relax.h"

enum { MAX_PROTOTYPES = 64 }; /* distinct colors of instanced points */

typedef struct retile_job {
    cli run;
    char extension[8];

    /* options */
    trimesh_desc desc;
    const char *weld, *drop_below; /* as the user wrote them */
    const char *tiles, *patches, *instances, *texture, *density;
    int patch_count, gutter, dot, curved;
    int keep_seams, no_seams; /* as given */

    mesh_data input, patch;
    trimesh_mesh *result;
    trimesh_report report;

    /* the output: positions, normals and indices are the result's, the rest our own */
    mesh_data output;
    uint32_t *sorted; /* the output's own indices, or NULL */

    /* its picture */
    unsigned char *png;
    size_t png_size;
    char png_path[MAX_PATH], mtl_path[MAX_PATH];

    /* the objects on it */
    mesh_data prototypes[MAX_PROTOTYPES];
    mesh_instances instanced[MAX_PROTOTYPES];
    int prototype_count;
    float *placements; /* of all instances: translations, then rotations, then scales */
    size_t placed;
} retile_job;

/* ---- retile_dress.c ---- */

/* Colors, texture coordinates, the picture and instances. */
int retile_dress(retile_job *j);

/* ---- retile_repairs.c ---- */

/* The options --weld and --drop-below; the mesh has been read. */
int retile_repair_options(retile_job *j);

/* One warning line that says what was repaired, if anything was. */
void retile_tell_repairs(retile_job *j);

/* ---- retile_instances.c ---- */

/* The objects of --instances on every triangle. */
int retile_place_instances(retile_job *j);

/* ---- mesh_figures.c ---- */

/* Measure the mesh for --stats, lengths times scale; returns the mean quality and the share of
   valence 6. */
int mesh_figures(cli *run, const trimesh_mesh *m, const trimesh_report *r, double scale,
                 double *mean_quality, double *valence_6);

#endif /* RETILE_H */
