/* mesh_ply.c - PLY files, ascii and binary
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

#include <errno.h>
#include <stdio.h>

enum {
    MAX_ELEMENTS = 32,   /* of a file           */
    MAX_PROPERTIES = 256 /* of all its elements */
};

/* ---- reading: the header ----------------------------------------------------------------- */

typedef enum ply_format { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_format;

typedef enum ply_type {
    PLY_INT8, PLY_UINT8, PLY_INT16, PLY_UINT16, PLY_INT32, PLY_UINT32, PLY_INT64, PLY_UINT64,
    PLY_FLOAT, PLY_DOUBLE, PLY_NONE
} ply_type;

static const size_t ply_bytes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};

/* What a property of a vertex is to us. */
typedef enum ply_role {
    PLY_X, PLY_Y, PLY_Z, PLY_NX, PLY_NY, PLY_NZ, PLY_RED, PLY_GREEN, PLY_BLUE, PLY_ALPHA, PLY_U,
    PLY_V, PLY_QX, PLY_QY, PLY_QZ, PLY_QW, PLY_ROLES,
    PLY_CORNERS = PLY_ROLES, /* of a face: its vertices; of strips: theirs, -1 between two */
    PLY_TEXCOORD,            /* of a face: u v for each of them */
    PLY_TEXTURE,             /* of a face: the number of its texture or material */
    PLY_OTHER
} ply_role;

typedef struct ply_property {
    ply_type type, counted; /* counted: of a list, the type of its length; else PLY_NONE */
    ply_role role;
} ply_property;

typedef struct ply_element {
    size_t count, least; /* least: bytes that one takes in the file at least */
    int first, properties, has_list, is_vertex, is_face, is_strips;
} ply_element;

typedef struct ply {
    ply_format format;
    ply_element elements[MAX_ELEMENTS];
    ply_property properties[MAX_PROPERTIES];
    int element_count, property_count;
    int has_uvs; /* of its vertices */
} ply;

static ply_type ply_type_of(const char *word) {
    static const char *const names[][2] = {{"char", "int8"},     {"uchar", "uint8"},
                                           {"short", "int16"},   {"ushort", "uint16"},
                                           {"int", "int32"},     {"uint", "uint32"},
                                           {"long", "int64"},    {"ulong", "uint64"},
                                           {"float", "float32"}, {"double", "float64"}};
    for (int t = 0; t < PLY_NONE; t++) {
        if (!strcmp(word, names[t][0]) || !strcmp(word, names[t][1])) return (ply_type)t;
    }
    return PLY_NONE;
}

static ply_role ply_role_of(const ply_element *e, const ply_property *p, const char *word) {
    static const struct {
        const char *name;
        ply_role role;
    } names[] = {{"x", PLY_X},   {"y", PLY_Y},   {"z", PLY_Z},   {"nx", PLY_NX}, {"ny", PLY_NY},
                 {"nz", PLY_NZ}, {"u", PLY_U},   {"v", PLY_V},   {"s", PLY_U},   {"t", PLY_V},
                 {"texture_u", PLY_U},   {"texture_v", PLY_V},   {"red", PLY_RED},
                 {"green", PLY_GREEN},   {"blue", PLY_BLUE},     {"alpha", PLY_ALPHA},
                 {"r", PLY_RED}, {"g", PLY_GREEN},               {"b", PLY_BLUE},
                 {"diffuse_red", PLY_RED}, {"diffuse_green", PLY_GREEN},
                 {"diffuse_blue", PLY_BLUE}, {"qx", PLY_QX}, {"qy", PLY_QY}, {"qz", PLY_QZ},
                 {"qw", PLY_QW}};
    const int is_list = p->counted != PLY_NONE;
    const int is_faces = e->is_face || e->is_strips;
    if (is_faces && is_list && (!strcmp(word, "vertex_indices") || !strcmp(word, "vertex_index")))
        return PLY_CORNERS;
    if (e->is_face && is_list && !strcmp(word, "texcoord")) return PLY_TEXCOORD;
    if (e->is_face && !is_list &&
        (!strcmp(word, "texnumber") || !strcmp(word, "material_index")))
        return PLY_TEXTURE;
    if (!(e->is_vertex || e->is_face) || is_list) return PLY_OTHER;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (strcmp(word, names[i].name) != 0) continue;
        return e->is_vertex || (names[i].role >= PLY_RED && names[i].role <= PLY_ALPHA)
                   ? names[i].role
                   : PLY_OTHER;
    }
    return PLY_OTHER;
}

/* The next word of the line in lower case, or "" at its end; what is too long is cut off. */
static const char *next_word(text *in, char word[32]) {
    size_t n = 0;
    while (in->at < in->end && is_blank(*in->at)) in->at++;
    for (; in->at < in->end && !is_blank(*in->at) && !is_line_end(*in->at); in->at++) {
        if (n < 31) word[n++] = (char)(*in->at >= 'A' && *in->at <= 'Z' ? *in->at + 32 : *in->at);
    }
    word[n] = 0;
    return word;
}

static int read_ply_element(builder *b, ply *h, text *in) {
    char word[32], *stop;
    if (h->element_count == MAX_ELEMENTS) return builder_fail(b, in->line, "too many elements");
    ply_element *e = &h->elements[h->element_count++];
    memset(e, 0, sizeof *e);
    e->first = h->property_count;
    next_word(in, word);
    e->is_vertex = !strcmp(word, "vertex");
    e->is_face = !strcmp(word, "face");
    e->is_strips = !strcmp(word, "tristrips");
    next_word(in, word);
    errno = 0;
    const unsigned long long count = is_digit(word[0]) ? strtoull(word, &stop, 10) : 0;
    if (!is_digit(word[0]) || *stop || errno || count > 0x7fffffff)
        return builder_fail(b, in->line, "an element without a proper count");
    e->count = (size_t)count;
    return 1;
}

static int read_ply_property(builder *b, ply *h, text *in) {
    char word[32];
    if (h->element_count == 0) return builder_fail(b, in->line, "a property of nothing");
    if (h->property_count == MAX_PROPERTIES)
        return builder_fail(b, in->line, "too many properties");
    ply_element *e = &h->elements[h->element_count - 1];
    ply_property *p = &h->properties[h->property_count++];
    p->counted = PLY_NONE;
    next_word(in, word);
    if (!strcmp(word, "list")) {
        p->counted = ply_type_of(next_word(in, word));
        if (p->counted >= PLY_FLOAT)
            return builder_fail(b, in->line, "a list with a length of no known type");
        next_word(in, word);
        e->has_list = 1;
    }
    p->type = ply_type_of(word);
    if (p->type == PLY_NONE) return builder_fail(b, in->line, "a property of no known type");
    p->role = ply_role_of(e, p, next_word(in, word));
    e->properties++;
    if (h->format == PLY_ASCII) e->least += e->properties > 1 ? 2 : 1; /* a digit and a blank */
    else e->least += ply_bytes[p->counted == PLY_NONE ? p->type : p->counted];
    return 1;
}

/* Over the end of a header's line. Where lines end in \r, a \n behind the last of them is the first
   byte of the body; so the first line tells how all of them end. */
static void end_header_line(text *in, int ends_in_cr) {
    while (in->at < in->end && !is_line_end(*in->at)) in->at++;
    if (ends_in_cr && in->at < in->end && *in->at == '\r') {
        in->at++;
        in->line++;
    } else {
        text_end_line(in);
    }
}

static int read_ply_header(builder *b, ply *h, text *in) {
    int has_format = 0, ok = 1;
    memset(h, 0, sizeof *h);
    while (in->at < in->end && !is_line_end(*in->at)) in->at++;
    const int ends_in_cr = in->end - in->at > 1 && in->at[0] == '\r' && in->at[1] != '\n';
    end_header_line(in, ends_in_cr);
    while (ok) {
        char word[32];
        if (in->at == in->end) return builder_fail(b, in->line, "the header has no end");
        next_word(in, word);
        if (!strcmp(word, "end_header")) break;
        if (!strcmp(word, "format")) {
            next_word(in, word);
            h->format = !strcmp(word, "binary_little_endian") ? PLY_LITTLE
                        : !strcmp(word, "binary_big_endian")  ? PLY_BIG
                                                              : PLY_ASCII;
            has_format = h->format != PLY_ASCII || !strcmp(word, "ascii");
        } else if (!strcmp(word, "element") || !strcmp(word, "property")) {
            if (!has_format)
                return builder_fail(b, in->line, "no known format; ascii or binary is read");
            ok = word[0] == 'e' ? read_ply_element(b, h, in) : read_ply_property(b, h, in);
        }
        if (ok) end_header_line(in, ends_in_cr);
    }
    if (ok) end_header_line(in, ends_in_cr);
    return ok;
}

/* ---- reading: the body ------------------------------------------------------------------- */

/* One number, converted from its type; ascii if there is none. */
static int read_scalar(const ply *h, text *in, ply_type type, double *value) {
    unsigned char raw[8];
    uint64_t bits = 0;
    if (h->format == PLY_ASCII) {
        text_skip_space(in);
        return text_number(in, value);
    }
    const size_t n = ply_bytes[type];
    if ((size_t)(in->end - in->at) < n) return 0;
    memcpy(raw, in->at, n);
    in->at += n;
    for (size_t i = 0; i < n; i++)
        bits = bits << 8 | raw[h->format == PLY_BIG ? i : n - 1 - i];
    switch (type) {
    case PLY_INT8: *value = bits < 0x80 ? (double)bits : (double)bits - 0x100; break;
    case PLY_INT16: *value = bits < 0x8000 ? (double)bits : (double)bits - 0x10000; break;
    case PLY_INT32: *value = bits < 0x80000000u ? (double)bits : (double)bits - 4294967296.0; break;
    case PLY_INT64: *value = bits >> 63 ? -(double)(~bits + 1) : (double)bits; break;
    case PLY_FLOAT: {
        const uint32_t low = (uint32_t)bits;
        float f;
        memcpy(&f, &low, 4);
        *value = (double)f;
        break;
    }
    case PLY_DOUBLE: memcpy(value, &bits, 8); break;
    default: *value = (double)bits;
    }
    return 1;
}

static int fail_body(const builder *b, const ply *h, const text *in) {
    if (h->format != PLY_ASCII)
        return builder_fail(b, 0, "the file ends too early; get a whole copy");
    if (in->at == in->end)
        return builder_fail(b, in->line, "the file ends too early; get a whole copy");
    return builder_fail(b, in->line, "not a number");
}

/* The length of a list, which must fit into what is left of the file. */
static int read_length(const builder *b, const ply *h, text *in, const ply_property *p, size_t *n) {
    double value;
    if (!read_scalar(h, in, p->counted, &value)) return fail_body(b, h, in);
    const size_t left = (size_t)(in->end - in->at);
    const size_t room = h->format == PLY_ASCII ? left : left / ply_bytes[p->type];
    if (!(value >= 0 && value <= (double)room) || value != floor(value))
        return builder_fail(b, h->format == PLY_ASCII ? in->line : 0,
                            "a list is longer than the file; get a whole copy");
    *n = (size_t)value;
    return 1;
}

static int skip_property(const builder *b, const ply *h, text *in, const ply_property *p) {
    double value;
    size_t n = 1;
    if (p->counted != PLY_NONE && !read_length(b, h, in, p, &n)) return 0;
    if (h->format != PLY_ASCII) { /* of a list it is known that it is all there */
        if ((size_t)(in->end - in->at) / ply_bytes[p->type] < n) return fail_body(b, h, in);
        in->at += n * ply_bytes[p->type];
        return 1;
    }
    for (; n > 0; n--) {
        if (!read_scalar(h, in, p->type, &value)) return fail_body(b, h, in);
    }
    return 1;
}

/* Do the vertices have all of a group of properties? */
static int has_roles(const unsigned char *has, ply_role first, int count) {
    for (int k = 0; k < count; k++) {
        if (!has[(int)first + k]) return 0;
    }
    return 1;
}

/* The roles that an element has, and how its colors are written. */
typedef struct ply_roles {
    unsigned char has[PLY_ROLES];
    ply_type types[PLY_ROLES];
    int whole; /* colors are integers                                     */
    int mixed; /* of several types: then each is brought to 0..1 by its own */
} ply_roles;

static ply_roles find_roles(const ply *h, const ply_element *e) {
    const ply_property *p = h->properties + e->first;
    ply_roles r;
    memset(&r, 0, sizeof r);
    r.whole = 1;
    for (int i = 0; i < e->properties; i++) {
        if (p[i].role >= PLY_ROLES) continue;
        r.has[p[i].role] = 1;
        r.types[p[i].role] = p[i].type;
    }
    for (int k = PLY_RED; k <= PLY_ALPHA; k++) {
        if (!r.has[k]) continue;
        r.whole &= r.types[k] != PLY_FLOAT && r.types[k] != PLY_DOUBLE;
        r.mixed |= r.types[k] != r.types[PLY_RED];
    }
    r.whole &= !r.mixed;
    return r;
}

/* A channel. Signed bytes below 0 are meant to be unsigned. */
static float channel_of(const ply_roles *r, int role, double v) {
    const ply_type type = r->types[role];
    if (type == PLY_INT8 && v < 0) v += 256;
    if (!r->mixed || type == PLY_FLOAT || type == PLY_DOUBLE) return (float)v;
    return (float)(v / (type == PLY_INT16 || type == PLY_UINT16 ? 65535 : 255));
}

/* A color from the values of its roles. */
static shade shade_of(const ply_roles *r, const double *v) {
    shade s = {{0, 0, 0, SHADE_OPAQUE}};
    for (int k = 0; k < 4; k++) {
        const int role = PLY_RED + k;
        if (r->has[role]) s.c[k] = channel_of(r, role, v[role]);
    }
    if (r->has[PLY_ALPHA]) s.c[3] = txm_maxf(s.c[3], 0);
    return s;
}

static int read_ply_vertices(builder *b, const ply *h, const ply_element *e, text *in) {
    const ply_roles roles = find_roles(h, e);
    const unsigned char *has = roles.has;
    double v[PLY_ROLES] = {0};
    const ply_property *properties = h->properties + e->first;
    if (!has_roles(has, PLY_X, 3)) return builder_fail(b, 0, "its vertices have no x, y and z");
    const int has_normal = has_roles(has, PLY_NX, 3), has_color = has_roles(has, PLY_RED, 3);
    const int has_uv = has_roles(has, PLY_U, 2), has_rotation = has_roles(has, PLY_QX, 4);
    double *position = (double *)list_add(&b->positions, e->count);
    float *normal = has_normal ? (float *)list_add(&b->normals, e->count) : NULL;
    float *uv = has_uv ? (float *)list_add(&b->uvs, e->count) : NULL;
    float *rotation = has_rotation ? (float *)list_add(&b->rotations, e->count) : NULL;
    shade *shades = has_color ? (shade *)list_add(&b->vertex_shades, e->count) : NULL;
    unsigned char *color = has_color ? (unsigned char *)list_add(&b->colors, e->count) : NULL;
    if (!position || (has_normal && !normal) || (has_uv && !uv) || (has_color && !color) ||
        (has_color && !shades) || (has_rotation && !rotation))
        return builder_fail_memory(b);

    for (size_t i = 0; i < e->count; i++) {
        int ok = 1;
        if (h->format == PLY_ASCII) text_skip_space(in);
        const size_t line = h->format == PLY_ASCII ? in->line : 0;
        for (int k = 0; k < e->properties; k++) {
            if (properties[k].role >= PLY_ROLES) {
                if (!skip_property(b, h, in, &properties[k])) return 0;
            } else if (!read_scalar(h, in, properties[k].type, &v[properties[k].role])) {
                return fail_body(b, h, in);
            }
        }
        memcpy(position + 3 * i, v + PLY_X, 3 * sizeof *position);
        if (!builder_check_position(b, i, line)) return 0;
        for (int k = 0; k < 3 && has_normal; k++) normal[3 * i + (size_t)k] = (float)v[PLY_NX + k];
        for (int k = 0; k < 2 && has_uv; k++) uv[2 * i + (size_t)k] = (float)v[PLY_U + k];
        for (int k = 0; k < 4 && has_rotation; k++)
            ok &= text_to_float(v[PLY_QX + k], &rotation[4 * i + (size_t)k]);
        if (!ok)
            return builder_fail(b, 0, "vertex %lu has a rotation that is not finite",
                                (unsigned long)i + 1);
        if (has_color) shades[i] = shade_of(&roles, v);
    }
    if (has_color) b->left_out[LEFT_COLORS] += shades_to_bytes(shades, e->count, roles.whole, color);
    return 1;
}

/* An index of a list, from 0; of strips also -1, as NO_VERTEX. */
static int read_ply_index(const builder *b, const ply *h, const ply_property *p, text *in,
                          int is_strip, uint32_t *index) {
    double value;
    if (!read_scalar(h, in, p->type, &value)) return fail_body(b, h, in);
    *index = NO_VERTEX;
    if (is_strip && (value == -1 || value == 4294967295.0)) return 1; /* -1 without a sign */
    if (!(value >= 0 && value < 2147483648.0) || value != floor(value))
        return builder_fail(b, h->format == PLY_ASCII ? in->line : 0,
                            "a face with an index that is out of range");
    *index = (uint32_t)value;
    return 1;
}

static int read_ply_face(builder *b, const ply *h, const ply_property *p, text *in) {
    size_t n;
    const size_t first = b->corners.count;
    if (h->format == PLY_ASCII) text_skip_space(in);
    const size_t line = h->format == PLY_ASCII ? in->line : 0;
    if (!read_length(b, h, in, p, &n)) return 0;
    corner *c = (corner *)list_add(&b->corners, n);
    if (!c) return builder_fail_memory(b);
    for (size_t k = 0; k < n; k++) {
        if (!read_ply_index(b, h, p, in, 0, &c[k].vertex)) return 0;
        c[k].uv = h->has_uvs ? c[k].vertex : NO_UV;
    }
    return builder_add_polygon(b, first, line);
}

/* The u v of the corners of the face that is being read, for read_ply_dress. */
static int read_ply_texcoords(builder *b, const ply *h, const ply_property *p, text *in) {
    size_t n;
    if (!read_length(b, h, in, p, &n)) return 0;
    b->texcoords.count = 0;
    float *to = (float *)list_add(&b->texcoords, n);
    if (!to) return builder_fail_memory(b);
    for (size_t k = 0; k < n; k++) {
        double value;
        if (!read_scalar(h, in, p->type, &value)) return fail_body(b, h, in);
        to[k] = (float)value;
    }
    return 1;
}

/* Give the corners of the last face their texture coordinates. */
static int take_texcoords(builder *b) {
    const polygon *f = (const polygon *)b->polygons.items + b->polygons.count - 1;
    corner *c = (corner *)b->corners.items + f->first;
    if (b->texcoords.count != 2 * f->count) return 1; /* none of its own */
    const size_t first = b->uvs.count;
    float *to = (float *)list_add(&b->uvs, f->count);
    if (!to) return builder_fail_memory(b);
    memcpy(to, b->texcoords.items, 2 * f->count * sizeof(float));
    for (size_t k = 0; k < f->count; k++) c[k].uv = (uint32_t)(first + k);
    return 1;
}

static int use_texture(builder *b, double number) {
    char name[32];
    const int n = snprintf(name, sizeof name, "texture%.0f", number);
    return builder_use_material(b, name, (size_t)n);
}

/* A face with all that it carries, in whatever order. */
static int read_ply_polygon(builder *b, const ply *h, const ply_element *e, text *in,
                            const ply_roles *roles) {
    double v[PLY_ROLES] = {0}, texture = -1;
    const size_t before = b->polygons.count;
    b->texcoords.count = 0;
    for (int k = 0; k < e->properties; k++) {
        const ply_property *p = &h->properties[e->first + k];
        int ok;
        if (p->role == PLY_CORNERS) ok = read_ply_face(b, h, p, in);
        else if (p->role == PLY_TEXCOORD) ok = read_ply_texcoords(b, h, p, in);
        else if (p->role == PLY_TEXTURE || p->role < PLY_ROLES)
            ok = read_scalar(h, in, p->type, p->role == PLY_TEXTURE ? &texture : &v[p->role])
                     ? 1
                     : fail_body(b, h, in);
        else ok = skip_property(b, h, in, p);
        if (!ok) return 0;
    }
    if (b->polygons.count == before) return 1;
    if (has_roles(roles->has, PLY_RED, 3)) {
        const shade s = shade_of(roles, v);
        b->whole_face_shades = roles->whole;
        if (!builder_face_shade(b, &s)) return 0;
    }
    if (texture >= 0 && texture < 1e9) {
        if (!use_texture(b, floor(texture))) return 0;
        ((polygon *)b->polygons.items)[before].material = b->material;
    }
    return take_texcoords(b);
}

/* Triangles of three successive vertices each, every second one turned round. -1 begins anew. */
static int read_ply_strips(builder *b, const ply *h, const ply_property *p, text *in) {
    size_t n;
    strip s = strip_begin();
    if (!read_length(b, h, in, p, &n)) return 0;
    for (size_t k = 0; k < n; k++) {
        uint32_t index = NO_VERTEX;
        if (!read_ply_index(b, h, p, in, 1, &index)) return 0;
        if (index == NO_VERTEX) s = strip_begin();
        else if (!strip_add(b, &s, index)) return 0;
    }
    return 1;
}

static int read_ply_elements(builder *b, const ply *h, const ply_element *e, text *in) {
    const size_t left = (size_t)(in->end - in->at);
    if (e->properties == 0 || e->count == 0) return 1;
    if (e->count > left / e->least + (h->format == PLY_ASCII)) /* no blank after the last number */
        return builder_fail(b, 0, "the file ends too early; get a whole copy");
    if (e->is_vertex && b->positions.count == 0) return read_ply_vertices(b, h, e, in);
    if (!e->has_list && h->format != PLY_ASCII) {
        in->at += e->count * e->least;
        return 1;
    }
    if (e->is_face && !list_reserve(&b->corners, b->corners.count + 3 * e->count))
        return builder_fail_memory(b);
    const ply_roles roles = find_roles(h, e);
    for (size_t i = 0; i < e->count; i++) {
        if (e->is_face && !read_ply_polygon(b, h, e, in, &roles)) return 0;
        for (int k = 0; k < e->properties && !e->is_face; k++) {
            const ply_property *p = &h->properties[e->first + k];
            const int ok = p->role == PLY_CORNERS ? read_ply_strips(b, h, p, in)
                                                  : skip_property(b, h, in, p);
            if (!ok) return 0;
        }
    }
    return 1;
}

int mesh_read_ply(builder *b, text *in, int points_too) {
    ply h;
    if (!read_ply_header(b, &h, in)) return 0;
    for (int i = 0; i < h.element_count; i++) {
        const ply_roles roles = find_roles(&h, &h.elements[i]);
        if (h.elements[i].is_vertex) h.has_uvs |= has_roles(roles.has, PLY_U, 2);
    }
    for (int i = 0; i < h.element_count; i++) {
        if (!read_ply_elements(b, &h, &h.elements[i], in)) return 0;
    }
    if (b->positions.count == 0) return builder_fail(b, 0, "no vertices in it");
    if (b->polygons.count == 0 && !points_too) return builder_fail(b, 0, "no faces in it");
    if (b->uvs.count) return 1;
    corner *c = (corner *)b->corners.items;
    for (size_t i = 0; i < b->corners.count; i++) c[i].uv = NO_UV;
    return 1;
}

/* ---- writing ----------------------------------------------------------------------------- */

int mesh_write_ply(const mesh_data *m, const mesh_place *place, sink *s) {
    const int is_plain = place_is_plain(place); /* else floats would lose the shape */
    const char *type = is_plain ? "float" : "double";
    const char *colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                         "property uchar alpha\n";
    flat_mesh f;
    if (!flat_make(m, 0, &f)) return 0;
    sink_print(s, "ply\nformat binary_little_endian 1.0\nelement vertex %lu\n",
               (unsigned long)f.count);
    sink_print(s, "property %s x\nproperty %s y\nproperty %s z\n", type, type, type);
    if (m->normals) sink_print(s, "property float nx\nproperty float ny\nproperty float nz\n");
    if (m->colors) sink_print(s, "%s", colors);
    if (m->uvs) sink_print(s, "property float s\nproperty float t\n");
    if (m->triangle_count)
        sink_print(s, "element face %lu\nproperty list uchar int vertex_indices\n%s",
                   (unsigned long)m->triangle_count, m->face_colors ? colors : "");
    sink_print(s, "end_header\n");
    for (size_t i = 0; i < f.count; i++) {
        const size_t v = flat_vertex(&f, i);
        double p[3];
        for (int k = 0; k < 3; k++) p[k] = mesh_place_out(place, m->positions[3 * v + (size_t)k], k);
        const float single[3] = {(float)p[0], (float)p[1], (float)p[2]};
        if (is_plain) sink_floats(s, single, 3);
        else sink_doubles(s, p, 3);
        if (m->normals) sink_floats(s, m->normals + 3 * v, 3);
        if (m->colors) sink_put(s, m->colors + 4 * v, 4);
        if (m->uvs) {
            const float uv[2] = {flat_uv(&f, i)[0], turn_v(flat_uv(&f, i)[1])};
            sink_floats(s, uv, 2);
        }
    }
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        if (c % 3 == 0) sink_put(s, "\3", 1);
        sink_u32(s, flat_index(&f, c));
        if (c % 3 == 2 && m->face_colors) sink_put(s, m->face_colors + 4 * (c / 3), 4);
    }
    split_free(&f.split);
    return 1;
}
