/* mesh_gltf.c - GLB files in: the triangles of a glTF 2.0 document
   SPDX-License-Identifier: MIT OR Unlicense

   Nodes, their meshes and the first texture coordinates, normals and colors of these are read;
   skins, animations and cameras are not. All sizes come from the file and are checked against its
   bytes before anything is done with them.                                                      */
#include "mesh_file.h"

#include <cjson/cJSON.h>
#include <stdio.h>

enum { GLB_HEADER = 12, CHUNK_HEADER = 8 };
enum { CHUNK_JSON = 0x4e4f534a, CHUNK_BINARY = 0x004e4942 };
enum { GL_BYTE = 5120, GL_UNSIGNED_BYTE, GL_SHORT, GL_UNSIGNED_SHORT, GL_UNSIGNED_INT = 5125, GL_FLOAT };
enum { GL_TRIANGLES = 4, GL_STRIP, GL_FAN };
enum { MOST_STRIDE = 252 }; /* as glTF has it */

/* Nodes may share meshes; so many corners a byte of the file they may make all together. */
enum { MOST_COPIES = 4 };

typedef double matrix[12]; /* three rows of an affine map */

/* A list of the document as an array, since members of a cJSON list are found one by one. */
typedef struct item {
    const cJSON *json;
} item;

typedef struct items {
    item *of;
    size_t count;
} items;

/* What an accessor refers to; stride 0: not yet known. */
typedef struct accessor {
    const unsigned char *bytes; /* of the first element */
    size_t count, stride;
    int component, width, is_normalized;
} accessor;

/* A piece of the binary chunk; is_known: 0 not yet. */
typedef struct view {
    size_t start, length, stride; /* stride 0: as large as an element */
    int is_known;
} view;

typedef struct gltf {
    builder *b;
    cJSON *json;
    const unsigned char *binary;
    size_t binary_size, room; /* room: for corners and vertices, see MOST_COPIES */
    items accessors, views, meshes, nodes, materials;
    accessor *read_accessors; /* each is read once, as many primitives may refer to it */
    view *read_views;
    unsigned char *seen;      /* per node */
    list stack;               /* of pending */
} gltf;

typedef struct pending {
    size_t node;
    matrix map;
} pending;

static size_t least_of(size_t a, size_t b) {
    return a < b ? a : b;
}

/* ---- the document ------------------------------------------------------------------------ */

static const cJSON *member(const cJSON *from, const char *name) {
    return cJSON_GetObjectItemCaseSensitive(from, name);
}

/* A whole number of 0 to most; missing gives *value as it is. 0: it is something else. */
static int get_size(const cJSON *from, const char *name, size_t most, size_t *value) {
    const cJSON *at = member(from, name);
    if (!at) return 1;
    if (!cJSON_IsNumber(at) || !(at->valuedouble >= 0 && at->valuedouble <= (double)most) ||
        at->valuedouble != floor(at->valuedouble))
        return 0;
    *value = (size_t)at->valuedouble;
    return 1;
}

/* An index that must be there and below count. */
static int get_index(const cJSON *from, const char *name, size_t count, size_t *index) {
    return count && member(from, name) && get_size(from, name, count - 1, index);
}

/* Exactly so many finite numbers; missing leaves the values. 0: it is something else. */
static int get_numbers(const cJSON *from, const char *name, int count, double *values) {
    const cJSON *numbers = member(from, name), *at;
    int n = 0;
    if (!numbers) return 1;
    cJSON_ArrayForEach(at, numbers) {
        if (n == count || !cJSON_IsNumber(at) || !txm_is_finite(at->valuedouble)) return 0;
        values[n++] = at->valuedouble;
    }
    return n == count;
}

static int get_items(const gltf *g, const char *name, items *to) {
    const cJSON *array = member(g->json, name), *at;
    const size_t count = cJSON_IsArray(array) ? (size_t)cJSON_GetArraySize(array) : 0;
    to->of = (item *)malloc((count + 1) * sizeof(item));
    if (!to->of) return builder_fail_memory(g->b);
    to->count = 0;
    if (count == 0) return 1; /* or no list, which may have members as well */
    cJSON_ArrayForEach(at, array) {
        to->of[to->count++].json = at;
    }
    return 1;
}

/* Find the two chunks, and the document in the first. */
static int read_chunks(gltf *g, const unsigned char *bytes, size_t size) {
    uint32_t head[5];
    if (size < GLB_HEADER + CHUNK_HEADER)
        return builder_fail(g->b, 0, "the file ends too early; get a whole copy");
    for (size_t i = 0; i < 5; i++) head[i] = u32_at(bytes + 4 * i);
    if (head[1] != 2)
        return builder_fail(g->b, 0, "glTF of version %lu; version 2 is read",
                            (unsigned long)head[1]);
    const size_t start = GLB_HEADER + CHUNK_HEADER;
    if (head[2] > size || head[3] > size - start)
        return builder_fail(g->b, 0, "the file ends too early; get a whole copy");
    if (head[4] != CHUNK_JSON) return builder_fail(g->b, 0, "its first chunk is not JSON");
    const size_t next = start + head[3];
    if (size - next >= CHUNK_HEADER && u32_at(bytes + next + 4) == CHUNK_BINARY) {
        g->binary = bytes + next + CHUNK_HEADER;
        g->binary_size = u32_at(bytes + next);
        if (g->binary_size > size - next - CHUNK_HEADER)
            return builder_fail(g->b, 0, "the file ends too early; get a whole copy");
    }
    g->json = cJSON_ParseWithLength((const char *)bytes + start, head[3]);
    return cJSON_IsObject(g->json) ? 1 : builder_fail(g->b, 0, "its JSON is damaged");
}

/* Is what the buffer holds in the file? */
static int check_buffer(const gltf *g) {
    const cJSON *first = cJSON_GetArrayItem(member(g->json, "buffers"), 0);
    if (!member(first, "uri")) return 1;
    return builder_fail(g->b, 0, "its triangles are in another file; save all in one");
}

/* Extensions without which the triangles are right. */
static int check_extensions(const gltf *g) {
    static const char *const known[] = {"KHR_mesh_quantization", "EXT_mesh_gpu_instancing",
                                        "KHR_texture_transform", "KHR_lights_punctual",
                                        "EXT_texture_webp", "KHR_texture_basisu"};
    const cJSON *at;
    cJSON_ArrayForEach(at, member(g->json, "extensionsRequired")) {
        int is_known = 0;
        if (!cJSON_IsString(at)) continue;
        for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
            is_known |= !strcmp(at->valuestring, known[i]);
        if (!is_known && strncmp(at->valuestring, "KHR_materials_", 14) != 0)
            return builder_fail(g->b, 0, "it needs the extension %.40s; save it without",
                                at->valuestring);
    }
    return 1;
}

/* ---- accessors --------------------------------------------------------------------------- */

static size_t component_size(int component) {
    switch (component) {
    case GL_BYTE:
    case GL_UNSIGNED_BYTE: return 1;
    case GL_SHORT:
    case GL_UNSIGNED_SHORT: return 2;
    case GL_UNSIGNED_INT:
    case GL_FLOAT: return 4;
    default: return 0;
    }
}

static int width_of(const cJSON *type) {
    static const char *const names[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
    for (int i = 0; i < 4; i++) {
        if (cJSON_IsString(type) && !strcmp(type->valuestring, names[i])) return i + 1;
    }
    return 0;
}

/* The view of this number, or NULL if it is damaged. */
static const view *read_view(const gltf *g, size_t index) {
    const cJSON *json = g->views.of[index].json;
    view *v = &g->read_views[index];
    size_t buffer = 0;
    if (v->is_known) return v;
    if (!get_size(json, "buffer", 0, &buffer) || /* the one in this file */
        !get_size(json, "byteOffset", g->binary_size, &v->start) || !member(json, "byteLength") ||
        !get_size(json, "byteLength", g->binary_size - v->start, &v->length) ||
        !get_size(json, "byteStride", MOST_STRIDE, &v->stride))
        return NULL;
    v->is_known = 1;
    return v;
}

static int read_accessor(const gltf *g, size_t index, accessor *to) {
    const cJSON *json = g->accessors.of[index].json;
    accessor *a = &g->read_accessors[index];
    size_t component = 0, start = 0, view_index = 0;
    if (a->stride) {
        *to = *a;
        return 1;
    }
    if (member(json, "sparse"))
        return builder_fail(g->b, 0, "accessor %lu is sparse, which is not read",
                            (unsigned long)index);
    int ok = get_index(json, "bufferView", g->views.count, &view_index) &&
             get_index(json, "componentType", GL_FLOAT + 1, &component) &&
             get_size(json, "count", g->binary_size, &a->count) && a->count &&
             get_size(json, "byteOffset", g->binary_size, &start);
    a->component = (int)component;
    a->width = width_of(member(json, "type"));
    a->is_normalized = cJSON_IsTrue(member(json, "normalized"));
    const size_t element = component_size(a->component) * (size_t)a->width;
    const view *v = ok && element ? read_view(g, view_index) : NULL;
    const size_t stride = v && v->stride ? v->stride : element;
    ok = v && stride >= element && start <= v->length && element <= v->length - start &&
         a->count - 1 <= (v->length - start - element) / stride;
    if (!ok) return builder_fail(g->b, 0, "accessor %lu is out of range or damaged",
                                 (unsigned long)index);
    a->bytes = g->binary + v->start + start;
    a->stride = stride;
    *to = *a;
    return 1;
}

/* Component k of element i as it is meant; without is_normalized as it stands. */
static double value_at(const accessor *a, size_t i, int k) {
    const unsigned char *p = a->bytes + a->stride * i + component_size(a->component) * (size_t)k;
    const uint32_t two = a->component == GL_SHORT || a->component == GL_UNSIGNED_SHORT
                             ? (uint32_t)p[0] | (uint32_t)p[1] << 8
                             : 0;
    double value, most = 1;
    float single;
    switch (a->component) {
    case GL_BYTE:
        value = p[0] < 0x80 ? p[0] : p[0] - 0x100;
        most = 127;
        break;
    case GL_UNSIGNED_BYTE:
        value = p[0];
        most = 255;
        break;
    case GL_SHORT:
        value = two < 0x8000 ? (double)two : (double)two - 0x10000;
        most = 32767;
        break;
    case GL_UNSIGNED_SHORT:
        value = two;
        most = 65535;
        break;
    case GL_UNSIGNED_INT: return u32_at(p);
    default: {
        const uint32_t bits = u32_at(p);
        memcpy(&single, &bits, sizeof single);
        return (double)single;
    }
    }
    if (!a->is_normalized) return value;
    return value < -most ? -1 : value / most;
}

/* ---- vertices ---------------------------------------------------------------------------- */

/* Accessors of a primitive's vertices; SIZE_MAX where there is none. */
typedef struct attributes {
    size_t position, normal, uv, color;
} attributes;

/* A primitive's vertices, which the next one of its node may share. */
typedef struct vertices {
    attributes from;
    size_t first, count, first_uv; /* first_uv: SIZE_MAX if there are none */
} vertices;

static void put_through(const double *m, const double *p, double w, double *to) {
    for (int r = 0; r < 3; r++)
        to[r] = m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3] * w;
}

/* Cofactors of the linear part, which turn normals; row by row. */
static void cofactors_of(const double *m, double c[9]) {
    for (int r = 0; r < 3; r++) {
        const double *a = m + 4 * ((r + 1) % 3), *b = m + 4 * ((r + 2) % 3);
        for (int k = 0; k < 3; k++)
            c[3 * r + k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    }
}

static double determinant_of(const double *m) {
    double c[9];
    cofactors_of(m, c);
    return m[0] * c[0] + m[1] * c[1] + m[2] * c[2];
}

static int add_positions(const gltf *g, const accessor *a, const double *map) {
    builder *b = g->b;
    const size_t first = b->positions.count;
    double *to = (double *)list_add(&b->positions, a->count);
    if (!to) return builder_fail_memory(b);
    for (size_t i = 0; i < a->count; i++) {
        double p[3];
        for (int k = 0; k < 3; k++) p[k] = value_at(a, i, k);
        put_through(map, p, 1, to + 3 * i);
        if (!builder_check_position(b, first + i, 0)) return 0;
    }
    return 1;
}

/* Normals for so many new vertices; 0 0 0 where there are none. */
static int add_normals(const gltf *g, const accessor *a, const double *map, size_t count) {
    builder *b = g->b;
    double c[9];
    float *to = (float *)list_add(&b->normals, count);
    if (!to) return builder_fail_memory(b);
    cofactors_of(map, c);
    const double sign = determinant_of(map) < 0 ? -1 : 1;
    for (size_t i = 0; i < count; i++) {
        double n[3], turned[3], length = 0;
        for (int k = 0; k < 3; k++) n[k] = a ? value_at(a, i, k) : 0;
        for (int r = 0; r < 3; r++) {
            turned[r] = sign * (c[3 * r] * n[0] + c[3 * r + 1] * n[1] + c[3 * r + 2] * n[2]);
            length += turned[r] * turned[r];
        }
        length = sqrt(length);
        for (int r = 0; r < 3; r++) to[3 * i + (size_t)r] = length > 0 ? (float)(turned[r] / length) : 0;
    }
    return 1;
}

static int add_uvs(const gltf *g, const accessor *a) {
    float *to = (float *)list_add(&g->b->uvs, a->count);
    if (!to) return builder_fail_memory(g->b);
    for (size_t i = 0; i < 2 * a->count; i++) to[i] = (float)value_at(a, i / 2, (int)(i & 1));
    return 1;
}

/* Colors, which are linear in the file; white where there are none. */
static int add_colors(const gltf *g, const accessor *a, size_t count) {
    unsigned char *to = (unsigned char *)list_add(&g->b->colors, count);
    if (!to) return builder_fail_memory(g->b);
    memset(to, 255, 4 * count);
    for (size_t i = 0; i < count && a; i++) {
        for (int k = 0; k < a->width; k++) {
            const double v = value_at(a, i, k);
            const float value = (float)(v > 0 ? v < 1 ? v : 1 : 0); /* NaN: 0 */
            to[4 * i + (size_t)k] =
                (unsigned char)((k < 3 ? txm_linear_to_srgb(value) : value) * 255 + 0.5f);
        }
    }
    return 1;
}

/* White, or no normal, for all vertices so far if the list is still empty. */
static int fill_up(const gltf *g, list *l, int value) {
    const size_t missing = l->count ? 0 : g->b->positions.count;
    void *to = missing ? list_add(l, missing) : l;
    if (!to) return builder_fail_memory(g->b);
    if (missing) memset(to, value, missing * l->size);
    return 1;
}

static int fail_attribute(const gltf *g, const char *name) {
    return builder_fail(g->b, 0, "a primitive with %s of the wrong type or number", name);
}

/* An attribute of so many elements (0: any) and components. */
static int read_attribute(const gltf *g, size_t index, const char *name, size_t count, int least,
                          int most, accessor *a) {
    if (index == SIZE_MAX) return 1;
    if (!read_accessor(g, index, a)) return 0;
    if (a->width < least || a->width > most || a->component == GL_UNSIGNED_INT ||
        (count && a->count != count))
        return fail_attribute(g, name);
    return 1;
}

static int add_vertices(gltf *g, const attributes *from, const double *map, vertices *v) {
    accessor position, normal, uv, color;
    builder *b = g->b;
    if (!read_attribute(g, from->position, "positions", 0, 3, 3, &position) ||
        !read_attribute(g, from->normal, "normals", position.count, 3, 3, &normal) ||
        !read_attribute(g, from->uv, "texture coordinates", position.count, 2, 2, &uv) ||
        !read_attribute(g, from->color, "colors", position.count, 3, 4, &color))
        return 0;
    if (position.count > g->room)
        return builder_fail(b, 0, "its nodes repeat a mesh too often; write fewer copies");
    g->room -= position.count;
    const int has_normal = from->normal != SIZE_MAX, has_color = from->color != SIZE_MAX;
    if (has_normal && !fill_up(g, &b->normals, 0)) return 0;
    if (has_color && !fill_up(g, &b->colors, 255)) return 0;
    v->from = *from;
    v->first = b->positions.count;
    v->count = position.count;
    v->first_uv = from->uv != SIZE_MAX ? b->uvs.count : SIZE_MAX;
    if ((has_normal || b->normals.count) &&
        !add_normals(g, has_normal ? &normal : NULL, map, v->count))
        return 0;
    if ((has_color || b->colors.count) && !add_colors(g, has_color ? &color : NULL, v->count))
        return 0;
    if (from->uv != SIZE_MAX && !add_uvs(g, &uv)) return 0;
    return add_positions(g, &position, map);
}

/* ---- triangles --------------------------------------------------------------------------- */

static int add_triangle(const gltf *g, const vertices *v, const uint32_t *index, int is_mirrored) {
    const size_t first = g->b->corners.count;
    corner *c = (corner *)list_add(&g->b->corners, 3);
    if (!c) return builder_fail_memory(g->b);
    for (int k = 0; k < 3; k++) {
        const uint32_t i = index[is_mirrored && k ? 3 - k : k];
        if (i >= v->count) return builder_fail(g->b, 0, "an index that is out of range");
        c[k].vertex = (uint32_t)v->first + i;
        c[k].uv = v->first_uv != SIZE_MAX ? (uint32_t)v->first_uv + i : NO_UV;
    }
    return builder_add_polygon(g->b, first, 0);
}

/* The triangles of a list, a strip or a fan. */
static int add_triangles(gltf *g, const accessor *a, const vertices *v, size_t mode,
                         int is_mirrored) {
    const size_t count = a ? a->count : v->count;
    const size_t triangles = mode == GL_TRIANGLES ? count / 3 : count < 3 ? 0 : count - 2;
    if (triangles > g->room)
        return builder_fail(g->b, 0, "its nodes repeat a mesh too often; write fewer copies");
    g->room -= triangles;
    for (size_t t = 0; t < triangles; t++) {
        const size_t turn = mode == GL_STRIP ? t & 1 : 0; /* every second one */
        const size_t at[3] = {mode == GL_TRIANGLES ? 3 * t : mode == GL_FAN ? 0 : t + turn,
                              mode == GL_TRIANGLES ? 3 * t + 1 : t + 1 - turn,
                              mode == GL_TRIANGLES ? 3 * t + 2 : t + 2};
        uint32_t index[3];
        for (int k = 0; k < 3; k++) index[k] = a ? (uint32_t)value_at(a, at[k], 0) : (uint32_t)at[k];
        if (mode != GL_TRIANGLES && /* they join pieces of strips */
            (index[0] == index[1] || index[1] == index[2] || index[2] == index[0]))
            continue;
        if (!add_triangle(g, v, index, is_mirrored)) return 0;
    }
    return 1;
}

static int same_attributes(const attributes *a, const attributes *b) {
    return a->position == b->position && a->normal == b->normal && a->uv == b->uv &&
           a->color == b->color;
}

/* Use the material of a primitive, by its name. */
static int use_material(gltf *g, const cJSON *json) {
    builder *b = g->b;
    size_t index = 0;
    char number[40];
    b->material = NO_MATERIAL;
    if (!member(json, "material")) return 1;
    if (!get_index(json, "material", g->materials.count, &index))
        return builder_fail(b, 0, "a primitive whose material is out of range");
    const cJSON *name = member(g->materials.of[index].json, "name");
    snprintf(number, sizeof number, "material%lu", (unsigned long)index);
    const char *used = cJSON_IsString(name) ? name->valuestring : number;
    return builder_use_material(b, used, strlen(used));
}

/* Count what materials look like, which is not read: pictures, and colors other than white. */
static void count_looks(gltf *g) {
    const cJSON *at;
    g->b->left_out[LEFT_LOOKS] += (size_t)cJSON_GetArraySize(member(g->json, "images"));
    for (size_t i = 0; i < g->materials.count; i++) {
        const cJSON *look = member(g->materials.of[i].json, "pbrMetallicRoughness");
        int is_white = 1;
        cJSON_ArrayForEach(at, member(look, "baseColorFactor")) {
            is_white &= cJSON_IsNumber(at) && at->valuedouble >= 1;
        }
        g->b->left_out[LEFT_LOOKS] += !is_white;
    }
}

static int read_primitive(gltf *g, const cJSON *json, const double *map, vertices *v) {
    const cJSON *set = member(json, "attributes");
    attributes from = {SIZE_MAX, SIZE_MAX, SIZE_MAX, SIZE_MAX};
    const struct {
        const char *name;
        size_t *index;
    } lists[] = {{"POSITION", &from.position}, {"NORMAL", &from.normal},
                 {"TEXCOORD_0", &from.uv}, {"COLOR_0", &from.color}};
    accessor indices;
    size_t mode = GL_TRIANGLES, index = SIZE_MAX;
    const size_t accessors = g->accessors.count;
    if (!get_size(json, "mode", GL_FAN, &mode)) return builder_fail(g->b, 0, "a primitive of an unknown mode");
    if (mode < GL_TRIANGLES) { /* points and lines */
        g->b->left_out[LEFT_PRIMITIVES]++;
        return 1;
    }
    for (size_t k = 0; k < sizeof lists / sizeof lists[0]; k++) {
        if (member(set, lists[k].name) && !get_index(set, lists[k].name, accessors, lists[k].index))
            return builder_fail(g->b, 0, "a primitive whose %s is out of range", lists[k].name);
    }
    if (member(json, "indices") && !get_index(json, "indices", accessors, &index))
        return builder_fail(g->b, 0, "a primitive whose indices are out of range");
    if (from.position == SIZE_MAX) { /* glTF leaves to extensions what that means */
        g->b->left_out[LEFT_PRIMITIVES]++;
        return 1;
    }
    g->b->left_out[LEFT_TARGETS] += member(json, "targets") != NULL;
    if (index != SIZE_MAX) {
        if (!read_accessor(g, index, &indices)) return 0;
        if (indices.width != 1 ||
            (indices.component != GL_UNSIGNED_BYTE && indices.component != GL_UNSIGNED_SHORT &&
             indices.component != GL_UNSIGNED_INT))
            return builder_fail(g->b, 0, "indices that are no whole numbers");
        indices.is_normalized = 0;
    }
    if (!use_material(g, json)) return 0;
    if (!(v->count && same_attributes(&from, &v->from)) && !add_vertices(g, &from, map, v)) return 0;
    return add_triangles(g, index != SIZE_MAX ? &indices : NULL, v, mode, determinant_of(map) < 0);
}

static int read_mesh(gltf *g, size_t index, const double *map) {
    vertices v;
    const cJSON *at;
    memset(&v, 0, sizeof v);
    cJSON_ArrayForEach(at, member(g->meshes.of[index].json, "primitives")) {
        if (!read_primitive(g, at, map, &v)) return 0;
    }
    return 1;
}

/* ---- nodes ------------------------------------------------------------------------------- */

static void multiply(const double *a, const double *b, double *to) {
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 4; c++)
            to[4 * r + c] = a[4 * r] * b[c] + a[4 * r + 1] * b[4 + c] + a[4 * r + 2] * b[8 + c] +
                            (c == 3 ? a[4 * r + 3] : 0);
    }
}

/* The node's own map: a matrix, column by column in the file, or translation, rotation and scale. */
static int read_map(const gltf *g, size_t node, double *map) {
    const cJSON *json = g->nodes.of[node].json;
    double m[16], t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    if (!get_numbers(json, "matrix", 16, m) || !get_numbers(json, "translation", 3, t) ||
        !get_numbers(json, "rotation", 4, q) || !get_numbers(json, "scale", 3, s))
        return builder_fail(g->b, 0, "node %lu has no proper place", (unsigned long)node);
    if (member(json, "matrix")) {
        for (int k = 0; k < 12; k++) map[k] = m[4 * (k % 4) + k / 4];
        return 1;
    }
    const double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], f = n > 0 ? 2 / n : 0;
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double r[9] = {1 - f * (y * y + z * z), f * (x * y - z * w),     f * (x * z + y * w),
                         f * (x * y + z * w),     1 - f * (x * x + z * z), f * (y * z - x * w),
                         f * (x * z - y * w),     f * (y * z + x * w),     1 - f * (x * x + y * y)};
    for (int k = 0; k < 12; k++)
        map[k] = k % 4 == 3 ? t[k / 4] : r[3 * (k / 4) + k % 4] * s[k % 4];
    return 1;
}

static int push(gltf *g, size_t node, const double *parent) {
    double own[12];
    pending *p = (pending *)list_add(&g->stack, 1);
    if (!p) return builder_fail_memory(g->b);
    if (g->seen[node])
        return builder_fail(g->b, 0, "node %lu has two parents", (unsigned long)node);
    g->seen[node] = 1;
    p->node = node;
    if (!read_map(g, node, own)) return 0;
    if (parent) multiply(parent, own, p->map);
    else memcpy(p->map, own, sizeof own);
    return 1;
}

/* Push those of a list of node numbers. */
static int push_all(gltf *g, const cJSON *numbers, const double *parent) {
    const cJSON *at;
    cJSON_ArrayForEach(at, numbers) {
        const double n = cJSON_IsNumber(at) ? at->valuedouble : -1;
        if (!(n >= 0 && n < (double)g->nodes.count) || n != floor(n))
            return builder_fail(g->b, 0, "a node that is out of range");
        if (!push(g, (size_t)n, parent)) return 0;
    }
    return 1;
}

/* The roots: those of the scene, or if there is none, nodes that are no children. */
static int push_roots(gltf *g) {
    const cJSON *scenes = member(g->json, "scenes"), *at;
    size_t scene = 0;
    if (cJSON_IsArray(scenes) && cJSON_GetArraySize(scenes)) {
        if (!get_size(g->json, "scene", (size_t)cJSON_GetArraySize(scenes) - 1, &scene))
            return builder_fail(g->b, 0, "a scene that is out of range");
        return push_all(g, member(cJSON_GetArrayItem(scenes, (int)scene), "nodes"), NULL);
    }
    unsigned char *is_child = (unsigned char *)calloc(g->nodes.count + 1, 1);
    int ok = is_child ? 1 : builder_fail_memory(g->b);
    for (size_t i = 0; i < g->nodes.count && ok; i++) {
        cJSON_ArrayForEach(at, member(g->nodes.of[i].json, "children")) {
            const double n = cJSON_IsNumber(at) ? at->valuedouble : -1;
            if (n >= 0 && n < (double)g->nodes.count) is_child[(size_t)n] = 1;
        }
    }
    for (size_t i = 0; i < g->nodes.count && ok; i++) ok = is_child[i] || push(g, i, NULL);
    free(is_child);
    return ok;
}

static int read_node(gltf *g, const pending *p) {
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const cJSON *json = g->nodes.of[p->node].json;
    size_t mesh = 0;
    if (!push_all(g, member(json, "children"), p->map)) return 0;
    if (!member(json, "mesh")) return 1;
    if (member(member(json, "extensions"), "EXT_mesh_gpu_instancing")) {
        g->b->left_out[LEFT_INSTANCES]++;
        return 1;
    }
    if (!get_index(json, "mesh", g->meshes.count, &mesh))
        return builder_fail(g->b, 0, "node %lu has a mesh that is out of range",
                            (unsigned long)p->node);
    if (!member(json, "skin")) return read_mesh(g, mesh, p->map);
    /* a skin puts the mesh where its joints are; at rest that is where it was made */
    g->b->left_out[LEFT_SKINS]++;
    return read_mesh(g, mesh, identity);
}

static int read_scene(gltf *g) {
    g->seen = (unsigned char *)calloc(g->nodes.count + 1, 1);
    g->read_accessors = (accessor *)calloc(g->accessors.count + 1, sizeof(accessor));
    g->read_views = (view *)calloc(g->views.count + 1, sizeof(view));
    if (!g->seen || !g->read_accessors || !g->read_views) return builder_fail_memory(g->b);
    int ok = push_roots(g);
    while (ok && g->stack.count) {
        const pending p = ((const pending *)g->stack.items)[--g->stack.count];
        ok = read_node(g, &p);
    }
    if (!ok) return 0;
    if (g->b->polygons.count) return 1;
    return builder_fail(g->b, 0, "%s", g->b->left_out[LEFT_INSTANCES] ? "only instances in it, no surface"
                                                                      : "no triangles in it");
}

int mesh_read_glb(builder *b, const unsigned char *bytes, size_t size) {
    gltf g;
    memset(&g, 0, sizeof g);
    g.b = b;
    g.stack = list_of(sizeof(pending));
    g.room = least_of(size, SIZE_MAX / MOST_COPIES) * MOST_COPIES;
    if (g.room > 0x7fffffff) g.room = 0x7fffffff; /* vertices are numbered in 32 bits */
    b->v_runs_down = 1;
    const int ok = read_chunks(&g, bytes, size) && check_buffer(&g) && check_extensions(&g) &&
                   get_items(&g, "accessors", &g.accessors) &&
                   get_items(&g, "bufferViews", &g.views) && get_items(&g, "meshes", &g.meshes) &&
                   get_items(&g, "nodes", &g.nodes) &&
                   get_items(&g, "materials", &g.materials) && read_scene(&g);
    if (ok) count_looks(&g);
    cJSON_Delete(g.json);
    free(g.accessors.of);
    free(g.views.of);
    free(g.meshes.of);
    free(g.nodes.of);
    free(g.materials.of);
    free(g.seen);
    free(g.read_accessors);
    free(g.read_views);
    list_free(&g.stack);
    return ok;
}
