/* membrane.h - the types and functions of each file
   SPDX-License-Identifier: MIT OR Unlicense  */
#ifndef MEMBRANE_H
#define MEMBRANE_H

#include "trimesh_cover.h"

#include "files/mesh_io.h"

/* ---- surface.c: closed surfaces f(p) = 0 that each ray from the origin meets once ---- */
enum {
    GRID = 40, /* squares along the side of a cube's face */
    SURFACE_VERTICES = 6 * (GRID + 1) * (GRID + 1),
    SURFACE_TRIANGLES = 12 * GRID * GRID
};
double sphere(const double p[3]);
double capsule(const double p[3]);
void make_surface(double (*f)(const double[3]), float *positions, uint32_t *indices);
double area_of(const txm_mesh *m);

/* ---- lipids.c: a few beads each; the tails begin at z = 0, the heads are above ---- */
typedef struct bead {
    const char *element;
    float x, y, z, radius;
    unsigned char color[3];
} bead;

enum { KINDS = 4, MOST_BEADS = 13 };
typedef struct lipid {
    const bead *beads;
    int count;
    float share;
} lipid;
extern const lipid lipids[KINDS];
int make_lipid(int kind, int steps, mesh_data *out, const char **why);

/* ---- bilayer.c: retile, scatter ---- */
typedef struct membrane {
    trimesh_instance *lipids;
    size_t count;
} membrane;
txm_status make_membrane(double (*f)(const double[3]), txm_env *env, membrane *m);
void cut_away(membrane *m);

/* ---- files.c: return NULL, or what went wrong ---- */
const char *write_xyz(const membrane *m, const char *path);
const char *write_scene(const membrane *m, const char *extension, const char *path);

#endif
