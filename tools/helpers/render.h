/* render.h - draws meshes to look at: a small software rasteriser
   SPDX-License-Identifier: MIT OR Unlicense

   The camera is placed so that the whole scene is in the picture; depth is tested per sample, a pixel
   has several samples, and sums are of linear light. Both sides of a triangle look the same. The
   picture does not depend on the number of threads.                                                              */
#ifndef RENDER_H
#define RENDER_H

#include "files/mesh_io.h"

typedef struct render_desc {
    int width, height;        /* pixels, 1..16384 each                                         */
    int samples;              /* along a side of a pixel, 1..4; 0 = 3                          */
    float azimuth, elevation; /* degrees: where the camera stands, from +z towards +x, and up  */
    float zoom;               /* 0 = 1: all of the scene in the picture                        */
    float field;              /* degrees from top to bottom, up to 120; 0 = parallel rays      */
    int z_up;                 /* +z is up instead of +y, azimuth from -y towards +x            */
    int flat;                 /* the triangles' own normals, no smooth ones                    */
    float wire;               /* width of lines along all edges of the surface in pixels; 0 = none */
    int colors;               /* the colors of the vertices, of those that have some           */
    int cells;                /* these not blended: each point has the color of the nearest corner */
    const txm_image *texture; /* on the surface, if it has texture coordinates; NULL = none    */
} render_desc;

/* Draw the scene's surface and instances into a new RGB picture; release it with image_free. 0 if
   there is no memory, or nothing to be seen: *why says so. */
int render(const mesh_scene *scene, const render_desc *desc, txm_image *out, const char **why);

#endif /* RENDER_H */
