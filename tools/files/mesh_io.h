/* mesh_io.h - mesh files in and out
   SPDX-License-Identifier: MIT OR Unlicense

   Reads OBJ, PLY and STL (both ascii and binary), OFF and GLB (glTF 2.0: the triangles of its scene);
   writes OBJ with its material, PLY, STL (in text where floats would be too coarse) and GLB. Where
   a function fails it returns 0, nothing stays allocated, and *why is set to an English phrase that
   fits after "cannot read 'x.obj': "; it may point to the mesh's own message.

   Texture coordinates: in memory v runs downwards, as rows of pictures do, and as glTF and
   textiles.h have it. In OBJ and PLY files v runs upwards. Only turn_v in mesh_file.h converts
   between the two.

   Colors: 8 bits in sRGB, as in pictures; a GLB gets them linear, as glTF requires.              */
#ifndef MESH_IO_H
#define MESH_IO_H

#include "extent.h"
#include "texmath.h"

/* Where a mesh lies: in the file a position is origin + scale * that in memory. Floats have seven
   digits; so readers take an origin away from coordinates that are large against the mesh's extent,
   as those of maps are, and bring extents that are out of all proportion to 1 by a scale.       */
typedef struct mesh_place {
    double origin[3];
    double scale; /* a power of two; 0 = 1 */
} mesh_place;

static inline double mesh_place_scale(const mesh_place *place) {
    return place->scale > 0 ? place->scale : 1;
}

/* From memory to the file's coordinates. */
static inline double mesh_place_out(const mesh_place *place, float value, int axis) {
    return place->origin[axis] + mesh_place_scale(place) * (double)value;
}

/* From the file's coordinates to memory; it may become infinite. */
static inline float mesh_place_in(const mesh_place *place, double value, int axis) {
    return (float)((value - place->origin[axis]) / mesh_place_scale(place));
}

enum { MESH_WIND = 6 }; /* numbers of a vertex for a shader that moves it */

/* A triangle mesh, or a list of points. Readers fill in all fields; mesh_free releases it. */
typedef struct mesh_data {
    size_t vertex_count, triangle_count; /* no triangles: a list of points                    */
    float *positions;                    /* 3 per vertex, finite                              */
    float *normals;                      /* 3 per vertex, or NULL                             */
    float *rotations;                    /* 4 per vertex, quaternions x y z w, or NULL        */
    unsigned char *colors;               /* 4 per vertex, RGBA, or NULL                       */
    uint32_t *indices;                   /* 3 per triangle, each below vertex_count           */
    float *uvs;                          /* 2 per corner, so 6 per triangle, finite; or NULL  */
    unsigned char *face_colors;          /* 4 per triangle, RGBA, or NULL                     */
    uint32_t *materials;                 /* 1 per triangle, below material_count; or NULL     */
    size_t material_count;
    char *material_names;                /* one behind the other, each with a 0 at its end    */
    char *library;                       /* OBJ: the name of the file of its materials, or NULL */
    float *corner_normals;               /* 3 per corner, or NULL; mesh_crease makes them     */
    uint32_t *joints;                    /* 4 per vertex, into a mesh_skeleton, or NULL; only */
    float *weights;                      /* 4 per vertex, sum 1           GLB files hold them */
    float *wind;                         /* MESH_WIND per vertex, or NULL; GLB writes them as
                                            TEXCOORD_1 to TEXCOORD_3                          */
    mesh_place place;                    /* of the positions                                  */
    char message[120];
    char note[200]; /* of what a reader has left out or taken another way, in one line, or "" */
} mesh_data;

/* The mesh as the libraries take it. */
static inline txm_mesh mesh_view(const mesh_data *m) {
    txm_mesh view = {0};
    view.positions = m->positions;
    view.indices = m->indices;
    view.vertex_count = m->vertex_count;
    view.face_count = m->triangle_count;
    return view;
}

/* What a surface looks like. */
typedef struct mesh_material {
    const char *name;    /* letters and digits                                      */
    const char *texture; /* as that of mesh_scene, and the next two as well         */
    const unsigned char *png;
    size_t png_size;
    const unsigned char *relief; /* GLB: normal map, as the picture's PNG is given; or NULL */
    size_t relief_size;
    int repeats;    /* the picture goes on beyond its left and right borders: these fit together    */
    int is_cut_out; /* where the picture's alpha is below 1/2 there is nothing; both sides are seen */
    int repeats_down; /* as repeats, beyond its upper and lower borders                             */
} mesh_material;

/* Many copies of a small mesh. */
typedef struct mesh_instances {
    const mesh_data *mesh;
    size_t count;
    const float *translations; /* 3 per copy                                          */
    const float *rotations;    /* 4 per copy, unit quaternions x y z w; NULL = none   */
    const float *scales;       /* 3 per copy; NULL = 1                                */
    const unsigned char *colors;   /* 4 per copy, times those of the mesh; NULL = none */
    const mesh_material *material; /* NULL = plain white                               */
    const char *name;              /* of the node, or NULL                             */
} mesh_instances;

/* A surface among others. */
typedef struct mesh_part {
    const mesh_data *mesh;
    const mesh_material *material;
} mesh_part;

/* An object of some surfaces in many places, each of them a plain node. */
typedef struct mesh_object {
    const mesh_part *parts;
    int part_count;
    size_t count;              /* of places                                    */
    const float *translations; /* 3 per place                                  */
    const float *rotations;    /* 4 per place, unit quaternions x y z w        */
    const float *scales;       /* 1 per place                                  */
    const char *name;          /* of the mesh; the nodes add a number          */
} mesh_object;

/* A joint of a skeleton, placed relative to its parent. */
typedef struct mesh_joint {
    char name[24];
    int parent; /* number of an earlier joint; the first: -1 */
    float translation[3], rotation[4]; /* x y z w */
    float bind[16]; /* inverse bind matrix: from the mesh to the joint, column by column */
} mesh_joint;

/* What moves the vertices by their joints and weights. */
typedef struct mesh_skeleton {
    const char *name; /* of the mesh's node */
    const mesh_joint *joints;
    int joint_count;    /* at most 65535                                                 */
    const char *clip;   /* name of the animation                                         */
    int key_count;      /* of the animation; 0 = none                                    */
    const float *times; /* seconds, rising from 0                                        */
    const float *turns; /* key_count rotations x y z w per joint, joint after joint      */
} mesh_skeleton;

/* What goes into one file. */
typedef struct mesh_scene {
    const mesh_data *surface;        /* or NULL                                                */
    const mesh_part *parts;          /* more surfaces, each an object of its own. PLY: only if
                                        there is no surface, and only the first                */
    int part_count;
    const mesh_skeleton *skeleton;   /* GLB: moves them, all have joints; NULL = none          */
    const char *extras;              /* GLB: a JSON object for the user, or NULL               */
    const mesh_instances *instances; /* each with triangles; GLB only: mesh_bake for the others */
    int instance_count;
    const mesh_object *objects; /* each with triangles; GLB only                               */
    int object_count;
    int repeats;              /* GLB: that picture repeats both ways                             */
    const char *texture;      /* OBJ, GLB: name of the picture on the surface, '/' between folders;
                                 NULL = none                                                    */
    const unsigned char *png; /* GLB: the picture itself, to embed; NULL = refer to it by name  */
    size_t png_size;
    const char *library; /* OBJ: name of the file that mesh_encode_mtl makes; NULL = none       */
    mesh_place place;    /* where all of it lies: GLB has it at nodes, OBJ and PLY in the numbers */
} mesh_scene;

enum {
    MESH_POINTS = 1, /* a PLY without faces will do                                            */
    MESH_UNMOVED = 2 /* the mesh keeps the place of its file, though floats may be too coarse  */
};

/* Read the bytes of a mesh file; the content decides which it is. Polygons become triangles. What
   does no harm, such as faces of two corners, is left out and said in mesh->note. 1 if all went
   well. Memory and time are in proportion to the size. */
int mesh_decode(const unsigned char *bytes, size_t size, int flags, mesh_data *mesh,
                const char **why);

/* The same from a path. */
int mesh_read(const char *path, int flags, mesh_data *mesh, const char **why);

/* Where are the seams of a mesh? Writes 3 numbers per triangle, one for each corner, into seams: equal
   for corners in the same place whose triangles have the same material and whose texture coordinates are
   the same up to rounding; those then become the very same. 0: no memory. */
int mesh_seams(mesh_data *mesh, uint32_t *seams);

/* The name of material i of a mesh; "" where the file names none. */
const char *mesh_material_name(const mesh_data *m, size_t i);

/* Release what the mesh owns; message and note stay. */
void mesh_free(mesh_data *mesh);

/* Polylines. */
typedef struct mesh_lines {
    size_t count;   /* of lines                                                          */
    float *points;  /* 3 per point, finite                                               */
    size_t *first;  /* count + 1: line i has points first[i] .. first[i + 1] - 1, 2 or more */
    char message[120];
} mesh_lines;

/* Read the polylines of the bytes of an OBJ file, its `l` elements, relative to the place of the
   mesh that they are on. 1 if all went well. */
int mesh_decode_lines(const unsigned char *bytes, size_t size, const mesh_place *place,
                      mesh_lines *lines, const char **why);

/* Release what the lines own; the message stays. */
void mesh_lines_free(mesh_lines *lines);

/* Can a mesh be written to a path with this extension (".glb")? */
int mesh_can_write(const char *extension, const char **why);

/* Encode for that extension into a block for free(). */
int mesh_encode(const char *extension, const mesh_scene *scene, unsigned char **bytes, size_t *size,
                const char **why);

/* A mesh file in extents. Those that are large arrays of the scene are not copied: they must stay as they
   are until the file has been written. */
typedef struct mesh_file {
    file_extent *extents;
    int count;
    size_t size;    /* of all extents */
    void **blocks;  /* in which the other extents lie */
    int block_count;
} mesh_file;

/* The same as mesh_encode, into extents; mesh_file_free releases them. */
int mesh_encode_extents(const char *extension, const mesh_scene *scene, mesh_file *file, const char **why);
void mesh_file_free(mesh_file *file);

/* The material that an OBJ with scene->library refers to. */
int mesh_encode_mtl(const mesh_scene *scene, unsigned char **bytes, size_t *size, const char **why);

/* Give the corners normals of their own: smooth, but not across edges where triangles differ by more
   than so many degrees. Normals that the mesh has stay where all around them is smooth. OBJ and GLB
   write them, PLY does not, as it would have to double vertices. 0: no memory, the mesh stays. */
int mesh_crease(mesh_data *mesh, float degrees);

/* A sphere of radius 1 about the origin, 8 steps^2 triangles; 0: no memory. */
int mesh_sphere(int steps, mesh_data *mesh);

/* The copies as one mesh, or list of points: their normals, colors and texture coordinates with
   them, where all have some. */
int mesh_bake(const mesh_instances *instances, int count, mesh_data *mesh, const char **why);

#endif /* MESH_IO_H */
