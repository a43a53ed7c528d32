/* membrane - a phospholipid bilayer on a closed surface, lipid by lipid
   SPDX-License-Identifier: MIT OR Unlicense

   membrane sphere|capsule OUT.glb|OUT.xyz|OUT.png [cut]

   A surface is retiled into nearly equilateral triangles, and a patch of points is put on every
   triangle, once for each leaflet: these are the places of the lipids, a list of instances. The GLB
   stores each kind of lipid once and draws it many times (EXT_mesh_gpu_instancing); the XYZ lists all
   beads, for molecular viewers; the PNG is a picture. `cut` leaves out an eighth, to show the inside.
   All lengths are in Angstrom.

   surface.c    the sphere and the capsule, in triangles of any shape
   lipids.c     four kinds of lipids, made of beads
   bilayer.c    retile the surface, scatter lipids: calls trimesh_relax.h, trimesh_cover.h
   files.c      GLB, XYZ, PNG                                                                     */
#include "membrane.h"

#include "files/image_io.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char **argv) {
    const int is_sphere = argc > 1 && strcmp(argv[1], "sphere") == 0;
    const int is_cut = argc == 4 && strcmp(argv[3], "cut") == 0;
    char extension[8] = "";
    if (argc > 2) file_extension(argv[2], extension);
    const int xyz = strcmp(extension, ".xyz") == 0;
    if (argc < 3 || argc > 4 || (argc == 4 && !is_cut) ||
        (!is_sphere && strcmp(argv[1], "capsule") != 0) ||
        (!xyz && strcmp(extension, ".glb") != 0 && strcmp(extension, ".png") != 0)) {
        fprintf(stderr, "usage: membrane sphere|capsule OUT.glb|OUT.xyz|OUT.png [cut]\n");
        return 2;
    }
    txm_env env = {0};
    membrane m = {0};
    const char *why = NULL;
    if (make_membrane(is_sphere ? sphere : capsule, &env, &m) != TXM_OK) why = env.message;
    if (is_cut) cut_away(&m);
    if (!why) why = xyz ? write_xyz(&m, argv[2]) : write_scene(&m, extension, argv[2]);
    if (why) fprintf(stderr, "membrane: %s\n", why);
    else printf("%s: %lu lipids\n", argv[2], (unsigned long)m.count);
    free(m.lipids);
    return why != NULL;
}
