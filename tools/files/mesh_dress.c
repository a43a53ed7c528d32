/* mesh_dress.c - what corners and faces of files carry: colors of every convention, materials
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

/* ---- colors ------------------------------------------------------------------------------ */

/* Colors of 0..1 may be a little above it, as 256 / 255; those of 0..255 are not as dark as this. */
static const float MOST_UNIT = 2;
static const float MOST_BYTE = 257; /* above it, colors are 0..65535 */

/* The largest of some channels of all shades. */
static float largest(const shade *from, size_t count, int first, int end) {
    float most = 0;
    for (size_t i = 0; i < count; i++) {
        for (int k = first; k < end; k++) {
            if (from[i].c[k] > most) most = from[i].c[k];
        }
    }
    return most;
}

/* What makes bytes of channels whose largest is this. */
static float scale_for(float most, int is_whole) {
    if (!is_whole && most <= MOST_UNIT) return 255;
    return most <= MOST_BYTE ? 1.0f : 1 / 257.0f;
}

static int is_finite_shade(const shade *s) {
    for (int k = 0; k < 4; k++) {
        if (!txm_is_finite((double)s->c[k])) return 0;
    }
    return 1;
}

size_t shades_to_bytes(shade *from, size_t count, int is_whole, unsigned char *to) {
    size_t bad = 0;
    for (size_t i = 0; i < count; i++) {
        if (is_finite_shade(&from[i])) continue;
        from[i] = shade_none();
        bad++;
    }
    const float color = scale_for(largest(from, count, 0, 3), is_whole);
    const float alpha = scale_for(largest(from, count, 3, 4), is_whole);
    for (size_t i = 0; i < count; i++) {
        const shade *s = &from[i];
        memset(to + 4 * i, 255, 4);
        if (s->c[3] <= SHADE_NONE) continue;
        for (size_t k = 0; k < (s->c[3] < 0 ? 3 : 4); k++)
            to[4 * i + k] =
                (unsigned char)(txm_clampf(s->c[k] * (k < 3 ? color : alpha), 0, 255) + 0.5f);
    }
    return bad;
}

/* ---- materials --------------------------------------------------------------------------- */

int builder_use_material(builder *b, const char *name, size_t length) {
    const char *all = (const char *)b->names.items;
    uint32_t i = 0;
    for (size_t at = 0; at < b->names.count; at += strlen(all + at) + 1, i++) {
        if (strlen(all + at) == length && !memcmp(all + at, name, length)) {
            b->material = i;
            return 1;
        }
    }
    char *to = (char *)list_add(&b->names, length + 1);
    if (!to) return builder_fail_memory(b);
    memcpy(to, name, length);
    to[length] = 0;
    b->material = i;
    b->material_count = i + 1;
    return 1;
}

const char *mesh_material_name(const mesh_data *m, size_t i) {
    const char *name = m->material_names;
    while (i-- > 0) name += strlen(name) + 1;
    return name;
}

/* ---- from polygons to triangles ---------------------------------------------------------- */

int builder_note_faces(builder *b) {
    if (b->material_count == 0 && b->face_shades.count == 0) return 1;
    const size_t count = b->faces.count, triangles = b->triangles.count;
    uint32_t *to = (uint32_t *)list_add(&b->faces, triangles - count);
    if (!to) return builder_fail_memory(b);
    for (size_t i = count; i < triangles; i++) *to++ = (uint32_t)b->polygon;
    b->polygon++;
    return 1;
}

int builder_face_shade(builder *b, const shade *s) {
    while (b->face_shades.count < b->polygons.count) {
        shade *to = (shade *)list_add(&b->face_shades, 1);
        if (!to) return builder_fail_memory(b);
        *to = b->face_shades.count == b->polygons.count ? *s : shade_none();
    }
    return 1;
}

/* The colors of faces, as bytes for each triangle. */
static int finish_face_colors(builder *b) {
    const uint32_t *face = (const uint32_t *)b->faces.items;
    const shade none = shade_none();
    if (b->face_shades.count == 0 || b->triangles.count == 0) return 1;
    if (!builder_face_shade(b, &none)) return 0; /* one for each polygon */
    unsigned char *bytes = (unsigned char *)malloc(4 * b->face_shades.count);
    b->mesh->face_colors = (unsigned char *)malloc(4 * b->triangles.count);
    if (!bytes || !b->mesh->face_colors) {
        free(bytes);
        return builder_fail_memory(b);
    }
    b->left_out[LEFT_COLORS] += shades_to_bytes((shade *)b->face_shades.items, b->face_shades.count,
                                                b->whole_face_shades, bytes);
    for (size_t i = 0; i < b->triangles.count; i++)
        memcpy(b->mesh->face_colors + 4 * i, bytes + 4 * (size_t)face[i], 4);
    free(bytes);
    return 1;
}

/* The materials of triangles. Triangles before the first name have one without a name. */
static int finish_materials(builder *b) {
    const uint32_t *face = (const uint32_t *)b->faces.items;
    const polygon *polygons = (const polygon *)b->polygons.items;
    if (b->material_count == 0 || b->triangles.count == 0) return 1;
    b->mesh->materials = (uint32_t *)malloc(b->triangles.count * sizeof(uint32_t));
    if (!b->mesh->materials) return builder_fail_memory(b);
    for (size_t i = 0; i < b->triangles.count; i++) {
        if (polygons[face[i]].material == NO_MATERIAL &&
            !builder_use_material(b, "", 0)) /* found again, or made, by its name */
            return 0;
        b->mesh->materials[i] = polygons[face[i]].material == NO_MATERIAL
                                    ? b->material
                                    : polygons[face[i]].material;
    }
    b->mesh->material_count = b->material_count;
    b->mesh->material_names = (char *)b->names.items;
    b->names.items = NULL;
    return 1;
}

int builder_finish_dress(builder *b) {
    if (!finish_face_colors(b) || !finish_materials(b)) return 0;
    b->mesh->library = (char *)b->library.items;
    b->library.items = NULL;
    return 1;
}
