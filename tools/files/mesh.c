/* mesh.c - mesh files in and out; mesh_io.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_io.h"
#include "mesh_file.h"

#include <errno.h>

/* ---- reading ----------------------------------------------------------------------------- */

int mesh_decode(const unsigned char *bytes, size_t size, int points_too, mesh_data *mesh,
                const char **why) {
    builder b;
    text in;
    int ok;
    memset(mesh, 0, sizeof *mesh);
    builder_init(&b, mesh, why);
    if (size == 0) return builder_fail(&b, 0, "the file is empty");
    in.at = (const char *)bytes;
    in.end = in.at + size;
    in.line = 1;
    if (size >= 4 && !memcmp(bytes, "glTF", 4))
        return builder_fail(&b, 0, "glTF is only written, not read; convert it to OBJ or PLY");
    if (size >= 4 && !memcmp(bytes, "ply", 3) && (bytes[3] == '\n' || bytes[3] == '\r'))
        ok = mesh_read_ply(&b, &in, points_too);
    else ok = mesh_read_obj(&b, &in);
    ok = ok && builder_triangulate(&b) && builder_finish(&b);
    if (!ok) mesh_free(mesh);
    builder_free(&b);
    return ok;
}

int mesh_read(const char *path, int points_too, mesh_data *mesh, const char **why) {
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    memset(mesh, 0, sizeof *mesh);
    if (!bytes) return *why = strerror(errno), 0;
    const int ok = mesh_decode(bytes, size, points_too, mesh, why);
    free(bytes);
    return ok;
}

void mesh_free(mesh_data *mesh) {
    free(mesh->positions);
    free(mesh->normals);
    free(mesh->rotations);
    free(mesh->colors);
    free(mesh->indices);
    free(mesh->uvs);
    free(mesh->corner_normals);
    free(mesh->joints);
    free(mesh->weights);
    memset(mesh, 0, offsetof(mesh_data, message));
}

/* ---- what a scene holds ------------------------------------------------------------------ */

int scene_part_count(const mesh_scene *scene) {
    return scene->part_count + (scene->surface != NULL);
}

mesh_part scene_part(const mesh_scene *scene, int i, mesh_material *own) {
    mesh_part part;
    if (!scene->surface) return scene->parts[i];
    if (i > 0) return scene->parts[i - 1];
    memset(own, 0, sizeof *own);
    own->name = "surface";
    own->texture = scene->texture;
    own->png = scene->png;
    own->png_size = scene->png_size;
    part.mesh = scene->surface;
    part.material = own;
    return part;
}

/* ---- writing ----------------------------------------------------------------------------- */

int mesh_can_write(const char *extension, const char **why) {
    if (!strcmp(extension, ".obj") || !strcmp(extension, ".ply") || !strcmp(extension, ".glb"))
        return 1;
    return *why = "end the name in .obj, .ply or .glb", 0;
}

int mesh_encode(const char *extension, const mesh_scene *scene, unsigned char **bytes, size_t *size,
                const char **why) {
    sink s = sink_new();
    mesh_material own;
    const int is_glb = !strcmp(extension, ".glb");
    *bytes = NULL;
    if (!mesh_can_write(extension, why)) return 0;
    if (!is_glb && !scene_part_count(scene)) return *why = "there is no surface to write", 0;
    int ok;
    if (is_glb) ok = mesh_write_glb(scene, &s);
    else if (!strcmp(extension, ".ply")) ok = mesh_write_ply(scene_part(scene, 0, &own).mesh, &s);
    else ok = mesh_write_obj(scene, &s);
    if (!ok) s.failed = 1;
    return sink_finish(&s, bytes, size, why);
}
