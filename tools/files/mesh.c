/* mesh.c - mesh files in and out; mesh_io.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_io.h"
#include "mesh_file.h"

#include <errno.h>

/* ---- reading ----------------------------------------------------------------------------- */

/* Is there this word, in whatever case, and behind it the end of a word? */
static int starts_with(const text *in, const char *word) {
    size_t n = 0;
    for (; word[n]; n++) {
        if ((size_t)(in->end - in->at) <= n || (in->at[n] | 32) != word[n]) return 0;
    }
    return text_at_word_end(in->at + n, in->end);
}

/* Text of two bytes a character, or of four. */
static int is_wide_text(const unsigned char *bytes, size_t size) {
    return size >= 2 && ((bytes[0] == 0xff && bytes[1] == 0xfe) ||
                         (bytes[0] == 0xfe && bytes[1] == 0xff));
}

/* A line with the word solid and a name; then facets, or the end. */
static int is_stl_text(const text *in) {
    text at = *in;
    text_skip_space(&at);
    if (!starts_with(&at, "solid")) return 0;
    if (!memchr(at.at, 0, (size_t)(at.end - at.at))) return 1;
    text_skip_line(&at);
    text_skip_space(&at);
    return starts_with(&at, "facet") || starts_with(&at, "endsolid");
}

static int is_gltf_text(const text *in) {
    text at = *in;
    text_skip_space(&at);
    return at.at < at.end && *at.at == '{';
}

static int read_format(builder *b, const unsigned char *bytes, size_t size, int points_too) {
    text in = text_of(bytes, size);
    int ok;
    if (size >= 4 && !memcmp(bytes, "glTF", 4)) return mesh_read_glb(b, bytes, size);
    if (stl_has_size(bytes, size)) return mesh_read_stl_binary(b, bytes, size);
    if (is_wide_text(bytes, size))
        return builder_fail(b, 0, "its text is in UTF-16; save it in UTF-8");
    if (is_gltf_text(&in))
        return builder_fail(b, 0, "a .gltf has its triangles in other files; save it as .glb");
    if (starts_with(&in, "ply")) ok = mesh_read_ply(b, &in, points_too);
    else if (off_begins(&in)) ok = mesh_read_off(b, &in);
    else if (is_stl_text(&in)) ok = mesh_read_stl_text(b, &in);
    else if (stl_may_be(bytes, size)) return mesh_read_stl_binary(b, bytes, size);
    else ok = mesh_read_obj(b, &in);
    b->commas = in.commas;
    return ok;
}

int mesh_decode(const unsigned char *bytes, size_t size, int flags, mesh_data *mesh,
                const char **why) {
    builder b;
    memset(mesh, 0, sizeof *mesh);
    builder_init(&b, mesh, why);
    b.unmoved = (flags & MESH_UNMOVED) != 0;
    if (size == 0) return builder_fail(&b, 0, "the file is empty");
    const int ok = read_format(&b, bytes, size, (flags & MESH_POINTS) != 0) &&
                   builder_triangulate(&b) && builder_finish(&b);
    if (!ok) mesh_free(mesh);
    builder_free(&b);
    return ok;
}

int mesh_read(const char *path, int flags, mesh_data *mesh, const char **why) {
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    memset(mesh, 0, sizeof *mesh);
    if (!bytes) return *why = strerror(errno), 0;
    const int ok = mesh_decode(bytes, size, flags, mesh, why);
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
    free(mesh->face_colors);
    free(mesh->materials);
    free(mesh->material_names);
    free(mesh->library);
    free(mesh->corner_normals);
    free(mesh->joints);
    free(mesh->weights);
    free(mesh->wind);
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
    own->repeats = own->repeats_down = scene->repeats;
    own->png = scene->png;
    own->png_size = scene->png_size;
    part.mesh = scene->surface;
    part.material = own;
    return part;
}

/* ---- writing ----------------------------------------------------------------------------- */

int mesh_can_write(const char *extension, const char **why) {
    static const char *const all[] = {".obj", ".ply", ".stl", ".glb"};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        if (!strcmp(extension, all[i])) return 1;
    }
    return *why = "end the name in .obj, .ply, .stl or .glb", 0;
}

static int write_scene(const char *extension, const mesh_scene *scene, sink *s, const char **why) {
    mesh_material own;
    const int is_glb = !strcmp(extension, ".glb");
    if (!mesh_can_write(extension, why)) return 0;
    if (!is_glb && !scene_part_count(scene)) return *why = "there is no surface to write", 0;
    int ok;
    if (is_glb) ok = mesh_write_glb(scene, s);
    else if (!strcmp(extension, ".ply"))
        ok = mesh_write_ply(scene_part(scene, 0, &own).mesh, &scene->place, s);
    else if (!strcmp(extension, ".stl")) ok = mesh_write_stl(scene, s);
    else ok = mesh_write_obj(scene, s);
    if (!ok) s->failed = 1;
    return 1;
}

int mesh_encode(const char *extension, const mesh_scene *scene, unsigned char **bytes, size_t *size,
                const char **why) {
    sink s = sink_new();
    *bytes = NULL;
    return write_scene(extension, scene, &s, why) && sink_finish(&s, bytes, size, why);
}

int mesh_encode_extents(const char *extension, const mesh_scene *scene, mesh_file *file, const char **why) {
    sink s = sink_new();
    memset(file, 0, sizeof *file);
    return write_scene(extension, scene, &s, why) && sink_finish_extents(&s, file, why);
}
