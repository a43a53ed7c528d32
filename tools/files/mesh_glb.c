/* mesh_glb.c - GLB files: glTF 2.0 in one piece
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

#include <stdio.h>

enum { GL_UNSIGNED_SHORT = 5123, GL_UNSIGNED_INT = 5125, GL_FLOAT = 5126 };
enum { NORMALIZED = 1 << 16 }; /* with a component type: 0..65535 means 0..1 */
enum { GL_ARRAY = 34962, GL_ELEMENTS = 34963 };
enum { MAX_MATERIALS = 1024 };

/* A material of the document. */
typedef struct glb_look {
    const mesh_material *material; /* NULL: plain white */
    const char *name;              /* or NULL           */
} glb_look;

/* The parts of the document are written side by side and put together at the end. */
typedef struct glb {
    sink binary, views, accessors, meshes, nodes;
    sink more; /* skins and animations, each after a comma */
    int view_count, accessor_count, mesh_count, node_count;
    const mesh_place *place; /* of all nodes that have a mesh */
    glb_look materials[MAX_MATERIALS];
    int material_count;
} glb;

/* Text, in which nothing is lent. */
static void append(sink *to, const sink *from) {
    sink_put(to, from->bytes.items, from->bytes.count);
    to->failed |= from->failed;
}

/* The bytes since start become a view; target 0: none. Returns its number. */
static int glb_view(glb *g, size_t start, int target) {
    sink *s = &g->views;
    const size_t length = sink_size(&g->binary) - start;
    sink_print(s, "%s{\"buffer\":0,\"byteOffset\":%lu,\"byteLength\":%lu", g->view_count ? "," : "",
               (unsigned long)start, (unsigned long)length);
    if (target) sink_print(s, ",\"target\":%d", target);
    sink_print(s, "}");
    while (sink_size(&g->binary) % 4 && !g->binary.failed) sink_put(&g->binary, "\0", 1);
    return g->view_count++;
}

static void print_list(sink *s, const char *name, const float *values, int count) {
    sink_print(s, ",\"%s\":[", name);
    for (int i = 0; i < count; i++) sink_print(s, "%s%.9g", i ? "," : "", (double)values[i]);
    sink_print(s, "]");
}

/* Close a view and describe what lies in it. bounds: minima and maxima of a SCALAR or VEC3, or NULL.
   Returns the accessor's number. */
static int glb_accessor(glb *g, size_t start, int target, int component, size_t count,
                        const char *type, const float *bounds) {
    sink *s = &g->accessors;
    const int view = glb_view(g, start, target), width = type[0] == 'S' ? 1 : 3;
    sink_print(s, "%s{\"bufferView\":%d,\"componentType\":%d,\"count\":%lu,\"type\":\"%s\"",
               g->accessor_count ? "," : "", view, component & ~NORMALIZED, (unsigned long)count,
               type);
    if (component & NORMALIZED) sink_print(s, ",\"normalized\":true");
    if (bounds) {
        print_list(s, "min", bounds, width);
        print_list(s, "max", bounds + width, width);
    }
    sink_print(s, "}");
    return g->accessor_count++;
}

/* Its number among the materials of the document; the last one if there is no room for more. */
static int glb_material(glb *g, const mesh_material *material, const char *name) {
    int i = 0;
    while (i < g->material_count &&
           (g->materials[i].material != material || g->materials[i].name != name))
        i++;
    if (i == MAX_MATERIALS) return i - 1;
    if (i == g->material_count) {
        g->materials[i].material = material;
        g->materials[i].name = name;
        g->material_count++;
    }
    return i;
}

/* glTF requires unit normals, so zero becomes another one. */
static void unit_normal(const float *n, float unit[3]) {
    const double x = (double)n[0], y = (double)n[1], z = (double)n[2];
    const double length = sqrt(x * x + y * y + z * z);
    unit[0] = unit[1] = 0;
    unit[2] = 1;
    if (length > 1e-30) {
        unit[0] = (float)(x / length);
        unit[1] = (float)(y / length);
        unit[2] = (float)(z / length);
    }
}

/* The normal of a vertex of a mesh that has some. */
static const float *normal_of(const mesh_data *m, const flat_mesh *f, size_t i) {
    return m->corner_normals ? m->corner_normals + 3 * (size_t)f->split.first[i]
                             : m->normals + 3 * flat_vertex(f, i);
}

/* Add to each corner of a triangle the direction in which u grows, and whether the picture is unmirrored
   there: v runs downwards, so that a triangle seen from outside then runs the other way in it. */
static void add_tangent(const mesh_data *m, const flat_mesh *f, size_t triangle, double *sums) {
    double edge[2][3], du[2], dv[2], along[3], length = 0;
    const size_t first = flat_index(f, 3 * triangle);
    for (size_t k = 0; k < 2; k++) {
        const size_t i = flat_index(f, 3 * triangle + k + 1);
        for (size_t a = 0; a < 3; a++)
            edge[k][a] = (double)m->positions[3 * flat_vertex(f, i) + a] -
                         (double)m->positions[3 * flat_vertex(f, first) + a];
        du[k] = (double)flat_uv(f, i)[0] - (double)flat_uv(f, first)[0];
        dv[k] = (double)flat_uv(f, i)[1] - (double)flat_uv(f, first)[1];
    }
    const double area = du[0] * dv[1] - du[1] * dv[0], sign = area < 0 ? -1 : 1;
    for (int a = 0; a < 3; a++) {
        along[a] = sign * (edge[0][a] * dv[1] - edge[1][a] * dv[0]);
        length += along[a] * along[a];
    }
    if (area == 0 || !(length > 0)) return;
    for (size_t k = 0; k < 3; k++) {
        double *sum = sums + 4 * flat_index(f, 3 * triangle + k);
        for (int a = 0; a < 3; a++) sum[a] += along[a] / sqrt(length);
        sum[3] -= sign;
    }
}

/* The directions of u on the surface, for normal maps: programs make their own differently. 0: no memory */
static int glb_tangents(glb *g, const mesh_data *m, const flat_mesh *f) {
    const size_t start = sink_size(&g->binary);
    double *sums = (double *)calloc(4 * f->count + 1, sizeof *sums);
    if (!sums) return 0;
    for (size_t t = 0; t < m->triangle_count; t++) add_tangent(m, f, t, sums);
    for (size_t i = 0; i < f->count; i++) {
        const double *sum = sums + 4 * i;
        float n[3], tangent[4] = {0, 0, 0, sum[3] < 0 ? -1.0f : 1.0f};
        unit_normal(normal_of(m, f, i), n);
        const txm_dvec3 normal = txm_d3((double)n[0], (double)n[1], (double)n[2]);
        txm_dvec3 u = txm_d3(sum[0], sum[1], sum[2]);
        u = txm_d3_sub(u, txm_d3_scale(normal, txm_d3_dot(u, normal)));
        if (txm_d3_dot(u, u) < 1e-12) /* any other direction on the surface */
            u = fabs(normal.x) < 0.6 ? txm_d3(0, normal.z, -normal.y) : txm_d3(-normal.z, 0, normal.x);
        u = txm_d3_unit(u);
        tangent[0] = (float)u.x;
        tangent[1] = (float)u.y;
        tangent[2] = (float)u.z;
        sink_floats(&g->binary, tangent, 4);
    }
    free(sums);
    sink_print(&g->meshes, ",\"TANGENT\":%d",
               glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f->count, "VEC4", NULL));
    return 1;
}

/* sRGB to linear, in 16 bits so that dark colors stay distinct. */
static void put_color(sink *s, const unsigned char *c) {
    for (int k = 0; k < 3; k++) {
        const float linear = txm_srgb_to_linear((float)c[k] / 255.0f);
        sink_u16(s, (uint32_t)(txm_clampf(linear, 0, 1) * 65535.0f + 0.5f));
    }
    sink_u16(s, (uint32_t)c[3] * 257);
}

/* Joints and weights. Rounded weights may not sum up to 1: the largest takes the difference. A joint
   without weight is written as joint 0, as validators require. */
static void glb_weights(glb *g, const mesh_data *m, const flat_mesh *f) {
    sink *bin = &g->binary, *s = &g->meshes;
    size_t start = sink_size(bin);
    for (size_t i = 0; i < f->count; i++) {
        const size_t v = 4 * flat_vertex(f, i);
        for (size_t k = 0; k < 4; k++) sink_u16(bin, m->weights[v + k] > 0 ? m->joints[v + k] : 0);
    }
    sink_print(s, ",\"JOINTS_0\":%d",
               glb_accessor(g, start, GL_ARRAY, GL_UNSIGNED_SHORT, f->count, "VEC4", NULL));
    start = sink_size(bin);
    for (size_t i = 0; i < f->count; i++) {
        const float *w = m->weights + 4 * flat_vertex(f, i);
        float unit[4] = {w[0], w[1], w[2], w[3]};
        int largest = 0;
        for (int k = 1; k < 4; k++)
            if (w[k] > w[largest]) largest = k;
        unit[largest] = 1;
        for (int k = 0; k < 4; k++)
            if (k != largest) unit[largest] -= unit[k];
        sink_floats(bin, unit, 4);
    }
    sink_print(s, ",\"WEIGHTS_0\":%d",
               glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f->count, "VEC4", NULL));
}

/* The triangles from `first` on that have the same material, or all; returns the end. */
static size_t same_material(const mesh_data *m, size_t first) {
    size_t end = m->materials ? first + 1 : m->triangle_count;
    while (end < m->triangle_count && m->materials && m->materials[end] == m->materials[first]) end++;
    return end;
}

/* The indices and the material of a primitive, whose attributes stand in the text of meshes from
   `opening` on. Where triangles have several materials, each run of them is a primitive with the same
   attributes. 0: no memory. */
static int glb_triangles(glb *g, const mesh_data *m, const flat_mesh *f, size_t opening,
                         const mesh_material *material) {
    sink *bin = &g->binary, *s = &g->meshes, attributes = sink_new();
    const int is_short = f->count < 65535; /* 65535 itself is not an index */
    if (!s->failed) sink_put(&attributes, (const char *)s->bytes.items + opening, s->bytes.count - opening);
    for (size_t first = 0, end; first < m->triangle_count || first == 0; first = end) {
        const size_t start = sink_size(bin);
        const char *name = m->materials ? mesh_material_name(m, m->materials[first])
                           : material   ? material->name
                                        : NULL;
        end = same_material(m, first);
        for (size_t c = 3 * first; c < 3 * end; c++) {
            if (is_short) sink_u16(bin, flat_index(f, c));
            else sink_u32(bin, flat_index(f, c));
        }
        if (first > 0) {
            sink_print(s, ",");
            append(s, &attributes);
        }
        sink_print(s, "},\"indices\":%d,\"material\":%d}",
                   glb_accessor(g, start, GL_ELEMENTS, is_short ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT,
                                3 * (end - first), "SCALAR", NULL),
                   glb_material(g, material, name));
        if (end == 0) break;
    }
    const int ok = !attributes.failed;
    sink_free(&attributes);
    return ok;
}

/* A primitive of the mesh that is being written. */
static int glb_primitive(glb *g, const mesh_data *m, const mesh_material *material) {
    flat_mesh f;
    sink *bin = &g->binary, *s = &g->meshes;
    float bounds[6] = {0, 0, 0, 0, 0, 0};
    size_t start = sink_size(bin);
    if (!flat_make(m, BY_NORMAL | (m->colors ? 0 : BY_FACE), &f)) return 0;

    for (size_t i = 0; i < f.count; i++) {
        const float *p = m->positions + 3 * flat_vertex(&f, i);
        for (int k = 0; k < 3; k++) {
            if (i == 0 || p[k] < bounds[k]) bounds[k] = p[k];
            if (i == 0 || p[k] > bounds[3 + k]) bounds[3 + k] = p[k];
        }
        sink_floats(bin, p, 3);
    }
    const size_t opening = s->bytes.count;
    sink_print(s, "{\"attributes\":{\"POSITION\":%d",
               glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f.count, "VEC3", bounds));
    if (m->normals || m->corner_normals) {
        start = sink_size(bin);
        for (size_t i = 0; i < f.count; i++) {
            float unit[3];
            unit_normal(normal_of(m, &f, i), unit);
            sink_floats(bin, unit, 3);
        }
        sink_print(s, ",\"NORMAL\":%d",
                   glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f.count, "VEC3", NULL));
    }
    if (m->uvs) {
        start = sink_size(bin);
        for (size_t i = 0; i < f.count; i++) sink_floats(bin, flat_uv(&f, i), 2);
        sink_print(s, ",\"TEXCOORD_0\":%d",
                   glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f.count, "VEC2", NULL));
    }
    for (size_t set = 0; set < MESH_WIND / 2 && m->wind; set++) {
        start = sink_size(bin);
        for (size_t i = 0; i < f.count; i++)
            sink_floats(bin, m->wind + MESH_WIND * flat_vertex(&f, i) + 2 * set, 2);
        sink_print(s, ",\"TEXCOORD_%d\":%d", (int)set + 1,
                   glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f.count, "VEC2", NULL));
    }
    if (m->colors || m->face_colors) {
        start = sink_size(bin);
        for (size_t i = 0; i < f.count; i++) put_color(bin, flat_color(&f, i));
        sink_print(s, ",\"COLOR_0\":%d",
                   glb_accessor(g, start, GL_ARRAY, GL_UNSIGNED_SHORT | NORMALIZED, f.count, "VEC4",
                                NULL));
    }
    if (m->joints) glb_weights(g, m, &f);
    const int has_relief = material && material->relief && m->uvs && (m->normals || m->corner_normals);
    const int ok = (!has_relief || glb_tangents(g, m, &f)) && glb_triangles(g, m, &f, opening, material);
    split_free(&f.split);
    return ok;
}

static void glb_open_mesh(glb *g) {
    sink_print(&g->meshes, "%s{\"primitives\":[", g->mesh_count++ ? "," : "");
}

static void glb_close_mesh(glb *g) {
    sink_print(&g->meshes, "]}");
}

/* A string of JSON. */
static void print_string(sink *s, const char *from) {
    sink_put(s, "\"", 1);
    for (; *from; from++) {
        const unsigned char c = (unsigned char)*from;
        if (c == '"' || c == '\\') sink_print(s, "\\%c", c);
        else if (c < 32) sink_print(s, "\\u%04x", c);
        else sink_put(s, from, 1);
    }
    sink_put(s, "\"", 1);
}

/* Begin a node; what follows is more of its fields and the closing brace. */
static void glb_node(glb *g, const char *name) {
    sink_print(&g->nodes, "%s{", g->node_count++ ? "," : "");
    if (name) sink_print(&g->nodes, "\"name\":\"%.60s\",", name);
}

/* Where the meshes lie: floats hold their shape, a node's numbers the place. */
static void print_place(sink *s, const mesh_place *place) {
    const double scale = mesh_place_scale(place), *o = place->origin;
    if (o[0] != 0 || o[1] != 0 || o[2] != 0)
        sink_print(s, "\"translation\":[%.17g,%.17g,%.17g],", o[0], o[1], o[2]);
    if (scale != 1) sink_print(s, "\"scale\":[%.17g,%.17g,%.17g],", scale, scale, scale);
}

/* A node with copies of a mesh of their own. */
static int glb_instances(glb *g, const mesh_instances *t) {
    sink *s = &g->nodes, *bin = &g->binary;
    const struct {
        const char *name, *type;
        const float *values;
        size_t count;
    } lists[] = {{"TRANSLATION", "VEC3", t->translations, 3},
                 {"ROTATION", "VEC4", t->rotations, 4},
                 {"SCALE", "VEC3", t->scales, 3}};
    glb_open_mesh(g);
    if (!glb_primitive(g, t->mesh, t->material)) return 0;
    glb_close_mesh(g);
    glb_node(g, t->name);
    print_place(s, g->place);
    sink_print(s, "\"mesh\":%d,\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{",
               g->mesh_count - 1);
    for (int k = 0, written = 0; k < 3; k++) {
        if (!lists[k].values) continue;
        const size_t start = sink_size(bin);
        sink_lend_floats(bin, lists[k].values, lists[k].count * t->count);
        sink_print(s, "%s\"%s\":%d", written++ ? "," : "", lists[k].name,
                   glb_accessor(g, start, 0, GL_FLOAT, t->count, lists[k].type, NULL));
    }
    if (t->colors) { /* three floats, which all viewers that support it can read */
        const size_t start = sink_size(bin);
        float linear[256], color[3];
        for (int v = 0; v < 256; v++) linear[v] = txm_srgb_to_linear((float)v / 255.0f);
        if (!list_reserve(&bin->bytes, bin->bytes.count + sizeof color * t->count)) bin->failed = 1;
        for (size_t i = 0; i < t->count; i++) {
            for (size_t k = 0; k < 3; k++) color[k] = linear[t->colors[4 * i + k]];
            sink_floats(bin, color, 3);
        }
        sink_print(s, ",\"_COLOR_0\":%d",
                   glb_accessor(g, start, 0, GL_FLOAT, t->count, "VEC3", NULL));
    }
    sink_print(s, "}}}}");
    return 1;
}

/* A mesh and the plain nodes that refer to it. */
static int glb_object(glb *g, const mesh_object *o) {
    const double size = mesh_place_scale(g->place);
    sink *s = &g->nodes;
    char name[64];
    glb_open_mesh(g);
    for (int i = 0; i < o->part_count; i++) {
        if (i) sink_print(&g->meshes, ",");
        if (!glb_primitive(g, o->parts[i].mesh, o->parts[i].material)) return 0;
    }
    sink_print(&g->meshes, "],\"name\":");
    print_string(&g->meshes, o->name);
    sink_print(&g->meshes, "}");
    for (size_t i = 0; i < o->count; i++) {
        double place[3];
        for (int k = 0; k < 3; k++)
            place[k] = mesh_place_out(g->place, o->translations[3 * i + (size_t)k], k);
        snprintf(name, sizeof name, "%.40s-%lu", o->name, (unsigned long)i + 1);
        glb_node(g, NULL);
        sink_print(s, "\"name\":");
        print_string(s, name);
        sink_print(s, ",\"mesh\":%d,\"translation\":[%.17g,%.17g,%.17g]", g->mesh_count - 1, place[0],
                   place[1], place[2]);
        print_list(s, "rotation", o->rotations + 4 * i, 4);
        const double scale = size * (double)o->scales[i];
        sink_print(s, ",\"scale\":[%.9g,%.9g,%.9g]}", scale, scale, scale);
    }
    return 1;
}

/* The joints as nodes from the next one on, with their children; 0: no memory. */
static int glb_joints(glb *g, const mesh_skeleton *k) {
    sink *s = &g->nodes;
    const int n = k->joint_count, first = g->node_count;
    int *child = (int *)malloc(2 * sizeof(int) * ((size_t)n + 1));
    if (!child) return 0;
    int *sibling = child + n;
    for (int i = 0; i < n; i++) child[i] = sibling[i] = -1;
    for (int i = n - 1; i > 0; i--) { /* backwards, so that the lists run forwards */
        sibling[i] = child[k->joints[i].parent];
        child[k->joints[i].parent] = i;
    }
    for (int i = 0; i < n; i++) {
        const mesh_joint *j = &k->joints[i];
        glb_node(g, j->name);
        if (child[i] >= 0) {
            sink_print(s, "\"children\":[");
            for (int c = child[i]; c >= 0; c = sibling[c])
                sink_print(s, "%s%d", c == child[i] ? "" : ",", first + c);
            sink_print(s, "],");
        }
        sink_print(s, "\"translation\":[%.9g,%.9g,%.9g]", (double)j->translation[0],
                   (double)j->translation[1], (double)j->translation[2]);
        print_list(s, "rotation", j->rotation, 4);
        sink_print(s, "}");
    }
    free(child);
    return 1;
}

/* The skin, and the animation if there is one; first: node of joint 0. */
static void glb_skin(glb *g, const mesh_skeleton *k, int first) {
    sink *s = &g->more, *bin = &g->binary;
    size_t start = sink_size(bin);
    for (int i = 0; i < k->joint_count; i++) sink_floats(bin, k->joints[i].bind, 16);
    sink_print(s, ",\"skins\":[{\"skeleton\":%d,\"inverseBindMatrices\":%d,\"joints\":[", first,
               glb_accessor(g, start, 0, GL_FLOAT, (size_t)k->joint_count, "MAT4", NULL));
    for (int i = 0; i < k->joint_count; i++) sink_print(s, "%s%d", i ? "," : "", first + i);
    sink_print(s, "]}]");
    if (k->key_count == 0) return;
    const size_t keys = (size_t)k->key_count;
    const float bounds[2] = {k->times[0], k->times[keys - 1]};
    start = sink_size(bin);
    sink_floats(bin, k->times, keys);
    const int times = glb_accessor(g, start, 0, GL_FLOAT, keys, "SCALAR", bounds);
    sink_print(s, ",\"animations\":[{\"name\":\"%.60s\",\"samplers\":[", k->clip);
    for (int i = 0; i < k->joint_count; i++) {
        start = sink_size(bin);
        sink_floats(bin, k->turns + 4 * keys * (size_t)i, 4 * keys);
        sink_print(s, "%s{\"input\":%d,\"output\":%d}", i ? "," : "", times,
                   glb_accessor(g, start, 0, GL_FLOAT, keys, "VEC4", NULL));
    }
    sink_print(s, "],\"channels\":[");
    for (int i = 0; i < k->joint_count; i++)
        sink_print(s, "%s{\"sampler\":%d,\"target\":{\"node\":%d,\"path\":\"rotation\"}}",
                   i ? "," : "", i, first + i);
    sink_print(s, "]}]");
}

/* A file name as a URI in a JSON string. */
static void print_uri(sink *s, const char *name) {
    for (; *name; name++) {
        const unsigned char c = (unsigned char)*name;
        const int is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                             (c >= '0' && c <= '9') || strchr("/._-~", c) != NULL;
        if (is_plain) sink_put(s, name, 1);
        else sink_print(s, "%%%02X", c);
    }
}

/* A PNG without ancillary chunks: glTF ignores color spaces and pixel shapes in it, and validators
   warn about them. What is not a complete PNG stays as it is. */
static void put_png(sink *s, const unsigned char *png, size_t size) {
    static const char *const kept[] = {"IHDR", "PLTE", "tRNS", "IDAT", "IEND"};
    size_t at = 8;
    sink_put(s, png, size < at ? size : at);
    while (at < size) {
        const unsigned char *p = png + at;
        size_t n = size - at;
        int keep = 1;
        if (n >= 12) {
            const size_t length =
                (size_t)p[0] << 24 | (size_t)p[1] << 16 | (size_t)p[2] << 8 | p[3];
            if (length <= n - 12) {
                n = length + 12; /* length, name and checksum around it */
                keep = 0;
                for (int k = 0; k < 5; k++) keep |= !memcmp(p + 4, kept[k], 4);
            }
        }
        if (keep) sink_put(s, p, n);
        at += n;
    }
}

/* Does material i have a picture? *first: that of the first material with the same one. */
static int has_picture(const glb *g, int i, int *first) {
    const mesh_material *m = g->materials[i].material;
    if (!m || !(m->png || m->texture)) return 0;
    *first = 0;
    while (g->materials[*first].material != m) ++*first;
    return 1;
}

static void print_png(glb *g, const unsigned char *png, size_t size, sink *json) {
    const size_t start = sink_size(&g->binary);
    put_png(&g->binary, png, size);
    sink_print(json, "{\"bufferView\":%d,\"mimeType\":\"image/png\"}", glb_view(g, start, 0));
}

static void print_picture(glb *g, const mesh_material *m, sink *json) {
    if (m->png) {
        print_png(g, m->png, m->png_size, json);
    } else {
        sink_print(json, "{\"uri\":\"");
        print_uri(json, m->texture);
        sink_print(json, "\"}");
    }
}

/* Is number i the first of the materials with its picture? */
static int owns_picture(const glb *g, int i) {
    int first = -1;
    return has_picture(g, i, &first) && first == i;
}

static int has_relief(const glb *g, int i) {
    return owns_picture(g, i) && g->materials[i].material->relief;
}

/* The pictures, then the normal maps, of those materials that own them. */
static void print_textures(glb *g, sink *json) {
    enum { CLAMP = 33071, REPEAT = 10497 };
    int written = 0, samplers = 0;
    sink_print(json, ",\"textures\":[");
    for (int i = 0; i < g->material_count; i++)
        if (owns_picture(g, i)) {
            sink_print(json, "%s{\"sampler\":%d,\"source\":%d}", written ? "," : "", written, written);
            written++;
        }
    for (int i = 0; i < g->material_count; i++) {
        if (has_relief(g, i)) {
            sink_print(json, ",{\"sampler\":%d,\"source\":%d}", samplers, written);
            written++;
        }
        samplers += owns_picture(g, i);
    }
    sink_print(json, "],\"samplers\":[");
    samplers = 0;
    for (int i = 0; i < g->material_count; i++) {
        const mesh_material *m = g->materials[i].material;
        if (!owns_picture(g, i)) continue;
        sink_print(json, "%s{\"magFilter\":9729,\"minFilter\":9987,\"wrapS\":%d,\"wrapT\":%d}",
                   samplers++ ? "," : "", m->repeats ? REPEAT : CLAMP, m->repeats_down ? REPEAT : CLAMP);
    }
    sink_print(json, "],\"images\":[");
    written = 0;
    for (int i = 0; i < g->material_count; i++) {
        if (!owns_picture(g, i)) continue;
        if (written++) sink_print(json, ",");
        print_picture(g, g->materials[i].material, json);
    }
    for (int i = 0; i < g->material_count; i++) {
        const mesh_material *m = g->materials[i].material;
        if (!has_relief(g, i)) continue;
        sink_print(json, ",");
        print_png(g, m->relief, m->relief_size, json);
    }
    sink_print(json, "]");
}

static void print_materials(glb *g, sink *json) {
    int number[MAX_MATERIALS], relief[MAX_MATERIALS], textures = 0, first = 0; /* of its textures */
    for (int i = 0; i < g->material_count; i++) {
        number[i] = -1;
        if (has_picture(g, i, &first)) number[i] = first == i ? textures++ : number[first];
    }
    for (int i = 0, reliefs = textures; i < g->material_count; i++) {
        relief[i] = -1;
        if (has_relief(g, i)) relief[i] = reliefs++;
        else if (has_picture(g, i, &first) && first < i) relief[i] = relief[first];
    }
    sink_print(json, ",\"materials\":[");
    for (int i = 0; i < g->material_count; i++) {
        const mesh_material *m = g->materials[i].material;
        sink_print(json, "%s{", i ? "," : "");
        if (g->materials[i].name) {
            sink_print(json, "\"name\":");
            print_string(json, g->materials[i].name);
            sink_print(json, ",");
        }
        sink_print(json, "\"pbrMetallicRoughness\":{");
        if (number[i] >= 0) sink_print(json, "\"baseColorTexture\":{\"index\":%d},", number[i]);
        sink_print(json, "\"metallicFactor\":0,\"roughnessFactor\":1}");
        if (relief[i] >= 0) sink_print(json, ",\"normalTexture\":{\"index\":%d}", relief[i]);
        if (m && m->is_cut_out) sink_print(json, ",\"alphaMode\":\"MASK\",\"doubleSided\":true");
        sink_print(json, "}");
    }
    sink_print(json, "]");
    if (textures) print_textures(g, json);
}

/* joint: node of the skeleton's root, or 0 */
static void print_document(glb *g, const mesh_scene *scene, int instanced, int joint, sink *json) {
    const int roots = joint ? joint + 1 : g->node_count;
    sink_print(json, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"texkit\"},\"scene\":0");
    if (instanced)
        sink_print(json, ",\"extensionsUsed\":[\"EXT_mesh_gpu_instancing\"],"
                         "\"extensionsRequired\":[\"EXT_mesh_gpu_instancing\"]");
    sink_print(json, ",\"scenes\":[{\"nodes\":[");
    for (int i = 0; i < roots; i++) sink_print(json, "%s%d", i ? "," : "", i);
    sink_print(json, "]");
    if (scene->extras) {
        sink_print(json, ",\"extras\":");
        sink_put(json, scene->extras, strlen(scene->extras));
    }
    sink_print(json, "}],\"nodes\":[");
    append(json, &g->nodes);
    sink_print(json, "],\"meshes\":[");
    append(json, &g->meshes);
    sink_print(json, "]");
    append(json, &g->more);
    print_materials(g, json);
    sink_print(json, ",\"accessors\":[");
    append(json, &g->accessors);
    sink_print(json, "],\"bufferViews\":[");
    append(json, &g->views);
    sink_print(json, "],\"buffers\":[{\"byteLength\":%lu}]}", (unsigned long)sink_size(&g->binary));
    while (sink_size(json) % 4 && !json->failed) sink_put(json, " ", 1);
}

/* All surfaces as one mesh, instances, objects, joints: nodes in this order. Returns the first joint's node,
   0 if there is none, -1 without memory. */
static int glb_scene(glb *g, const mesh_scene *scene, mesh_material *own) {
    const mesh_skeleton *k = scene->skeleton;
    int joint = 0;
    for (int i = 0; i < scene_part_count(scene); i++) {
        const mesh_part part = scene_part(scene, i, own);
        if (i == 0) glb_open_mesh(g);
        else sink_print(&g->meshes, ",");
        if (!glb_primitive(g, part.mesh, part.material)) return -1;
    }
    if (scene_part_count(scene)) {
        glb_close_mesh(g);
        glb_node(g, k ? k->name : NULL);
        if (!k) print_place(&g->nodes, g->place); /* a skin puts its mesh where the joints are */
        sink_print(&g->nodes, k ? "\"mesh\":0,\"skin\":0}" : "\"mesh\":0}");
    }
    for (int i = 0; i < scene->instance_count; i++) {
        if (scene->instances[i].count && !glb_instances(g, &scene->instances[i])) return -1;
    }
    for (int i = 0; i < scene->object_count; i++)
        if (scene->objects[i].count && !glb_object(g, &scene->objects[i])) return -1;
    if (k) {
        joint = g->node_count;
        if (!glb_joints(g, k)) return -1;
        glb_skin(g, k, joint);
    }
    return joint;
}

int mesh_write_glb(const mesh_scene *scene, sink *s) {
    glb g;
    mesh_material own;
    sink json = sink_new();
    int instanced = 0;
    memset(&g, 0, sizeof g);
    g.place = &scene->place;
    g.binary = g.views = g.accessors = g.meshes = g.nodes = g.more = sink_new();
    const int joint = glb_scene(&g, scene, &own);
    for (int i = 0; i < scene->instance_count; i++) instanced |= scene->instances[i].count > 0;
    if (joint >= 0) print_document(&g, scene, instanced, joint, &json);
    const int ok = joint >= 0 && sink_size(&g.binary) <= 0x7fffffff; /* lengths are 32 bits */
    if (ok) {
        const size_t length = sink_size(&json), total = 12 + 8 + length + 8 + sink_size(&g.binary);
        sink_put(s, "glTF", 4);
        sink_u32(s, 2);
        sink_u32(s, (uint32_t)total);
        sink_u32(s, (uint32_t)length);
        sink_put(s, "JSON", 4);
        sink_move(s, &json);
        sink_u32(s, (uint32_t)sink_size(&g.binary));
        sink_put(s, "BIN\0", 4);
        sink_move(s, &g.binary);
    }
    sink_free(&json);
    sink_free(&g.binary);
    sink_free(&g.views);
    sink_free(&g.accessors);
    sink_free(&g.meshes);
    sink_free(&g.nodes);
    sink_free(&g.more);
    return ok;
}
