/* mesh_io.c - mesh files in and out; mesh_io.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_io.h"
#include "image_io.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>

enum {
    MAX_EARS = 1000,     /* corners; longer polygons are taken for convex: ears take n^2 steps */
    MAX_ELEMENTS = 32,   /* of a PLY                                                           */
    MAX_PROPERTIES = 256 /* of all its elements                                                */
};

static const uint32_t NO_UV = 0xffffffffu;

/* Rows of pictures run down, v in OBJ and PLY files runs up: from either to the other. */
static float turn_v(float v) {
    return 1 - v;
}

/* ---- lists that grow ---------------------------------------------------------------------- */

typedef struct list {
    void *items;
    size_t count, capacity, size; /* size: bytes of an item */
} list;

static list list_of(size_t size) {
    list l = {NULL, 0, 0, 0};
    l.size = size;
    return l;
}

/* Room for exactly so many items in all, or more. */
static int list_reserve(list *l, size_t capacity) {
    size_t bytes;
    if (capacity <= l->capacity) return 1;
    if (!txm_mul(capacity, l->size, 1, &bytes) || bytes == 0) return 0;
    void *items = realloc(l->items, bytes);
    if (!items) return 0;
    l->items = items;
    l->capacity = capacity;
    return 1;
}

/* Room for more items at the end, to be filled; NULL if there is no memory. */
static void *list_add(list *l, size_t more) {
    size_t count;
    if (!txm_add(l->count, more, &count)) return NULL;
    if (count > l->capacity && !list_reserve(l, count + count / 2 + 16)) return NULL;
    void *place = (char *)l->items + l->count * l->size;
    l->count = count;
    return place;
}

static void list_free(list *l) {
    free(l->items);
    l->items = NULL;
    l->count = l->capacity = 0;
}

/* ---- what a reader has gathered ------------------------------------------------------------ */

typedef struct corner {
    uint32_t vertex, uv; /* uv: into the list of texture coordinates, or NO_UV */
} corner;

typedef struct polygon {
    size_t first, count, line; /* its corners; line of the file */
} polygon;

typedef struct builder {
    list positions, normals, rotations, colors, uvs; /* 3, 3, 4 floats, 4 bytes, 2 floats */
    list corners, polygons;                          /* as they stand in the file         */
    list triangles;                                  /* 3 corners each                    */
    list flat, around;                               /* scratch of triangulate            */
    mesh_data *mesh;
    const char **why;
} builder;

static void builder_init(builder *b, mesh_data *mesh, const char **why) {
    memset(b, 0, sizeof *b);
    b->positions = list_of(3 * sizeof(float));
    b->normals = list_of(3 * sizeof(float));
    b->rotations = list_of(4 * sizeof(float));
    b->colors = list_of(4);
    b->uvs = list_of(2 * sizeof(float));
    b->corners = list_of(sizeof(corner));
    b->polygons = list_of(sizeof(polygon));
    b->triangles = list_of(3 * sizeof(corner));
    b->flat = list_of(2 * sizeof(double));
    b->around = list_of(sizeof(size_t));
    b->mesh = mesh;
    b->why = why;
}

static void builder_free(builder *b) {
    list_free(&b->positions);
    list_free(&b->normals);
    list_free(&b->rotations);
    list_free(&b->colors);
    list_free(&b->uvs);
    list_free(&b->corners);
    list_free(&b->polygons);
    list_free(&b->triangles);
    list_free(&b->flat);
    list_free(&b->around);
}

/* Say what is wrong, after "line 12: " if the line is not 0. Returns 0. */
static int builder_fail(const builder *b, size_t line, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 3, 4)))
#endif
    ;

static int builder_fail(const builder *b, size_t line, const char *format, ...) {
    char *text = b->mesh->message;
    const size_t room = sizeof b->mesh->message;
    int n = line ? snprintf(text, room, "line %lu: ", (unsigned long)line) : 0;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + n, room - (size_t)n, format, arguments);
    va_end(arguments);
    *b->why = text;
    return 0;
}

static int builder_fail_memory(const builder *b) {
    return builder_fail(b, 0, "not enough memory for this mesh");
}

/* ---- polygons to triangles ---------------------------------------------------------------- */

typedef double point[2];

/* Twice the area of a triangle in the plane, positive if counter-clockwise. */
static double area2(const double *a, const double *b, const double *c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static int same_point(const double *a, const double *b) {
    return a[0] == b[0] && a[1] == b[1];
}

/* The corners seen along the axis that the polygon faces most, so that they run
   counter-clockwise. */
static void flatten(const float *positions, const corner *p, size_t n, point *flat) {
    double normal[3] = {0, 0, 0};
    for (size_t i = 0; i < n; i++) { /* Newell's sum: right for any polygon, flat or not */
        const float *a = positions + 3 * (size_t)p[i].vertex;
        const float *b = positions + 3 * (size_t)p[i + 1 < n ? i + 1 : 0].vertex;
        for (int k = 0; k < 3; k++) {
            const int y = (k + 1) % 3, z = (k + 2) % 3;
            normal[k] += ((double)a[y] - (double)b[y]) * ((double)a[z] + (double)b[z]);
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++) {
        if (fabs(normal[k]) > fabs(normal[axis])) axis = k;
    }
    const int x = (axis + 1) % 3, y = (axis + 2) % 3;
    for (size_t i = 0; i < n; i++) {
        const float *a = positions + 3 * (size_t)p[i].vertex;
        flat[i][0] = (double)a[normal[axis] < 0 ? y : x];
        flat[i][1] = (double)a[normal[axis] < 0 ? x : y];
    }
}

static int is_convex(const point *flat, size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (!(area2(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) > 0)) return 0;
    }
    return 1;
}

/* Is the corner at place i of those left an ear: a left turn with none of the others in it? */
static int is_ear(const point *flat, const size_t *around, size_t left, size_t i) {
    const double *a = flat[around[(i + left - 1) % left]], *b = flat[around[i]];
    const double *c = flat[around[(i + 1) % left]];
    if (!(area2(a, b, c) > 0)) return 0;
    for (size_t k = 2; k + 1 < left; k++) {
        const double *q = flat[around[(i + k) % left]];
        if (area2(a, b, q) < 0 || area2(b, c, q) < 0 || area2(c, a, q) < 0) continue;
        if (!same_point(q, a) && !same_point(q, b) && !same_point(q, c)) return 0;
    }
    return 1;
}

static int add_triangle(builder *b, corner x, corner y, corner z) {
    corner *t = (corner *)list_add(&b->triangles, 1);
    if (!t) return builder_fail_memory(b);
    t[0] = x;
    t[1] = y;
    t[2] = z;
    return 1;
}

/* Convex polygons become fans; of the others ears are cut off as long as there are any. */
static int triangulate(builder *b, const corner *p, size_t n) {
    if (n == 3) return add_triangle(b, p[0], p[1], p[2]);
    size_t left = n, *around = NULL;
    if (n <= MAX_EARS) {
        b->flat.count = b->around.count = 0;
        point *flat = (point *)list_add(&b->flat, n);
        around = (size_t *)list_add(&b->around, n);
        if (!flat || !around) return builder_fail_memory(b);
        for (size_t i = 0; i < n; i++) around[i] = i;
        flatten((const float *)b->positions.items, p, n, flat);
        if (!is_convex((const point *)flat, n)) {
            size_t tries = 8 * n, i = 1; /* a polygon that crosses itself may run out of ears */
            for (; left > 3 && tries > 0; tries--) {
                if (!is_ear((const point *)flat, around, left, i % left)) {
                    i++;
                    continue;
                }
                i %= left;
                if (!add_triangle(b, p[around[(i + left - 1) % left]], p[around[i]],
                                  p[around[(i + 1) % left]]))
                    return 0;
                memmove(around + i, around + i + 1, (left - i - 1) * sizeof *around);
                left--;
            }
        }
    }
    for (size_t i = 1; i + 1 < left; i++) {
        const int ok = around ? add_triangle(b, p[around[0]], p[around[i]], p[around[i + 1]])
                              : add_triangle(b, p[0], p[i], p[i + 1]);
        if (!ok) return 0;
    }
    return 1;
}

/* Check what the polygons refer to, now that all of the file is known, and make triangles. */
static int builder_triangulate(builder *b) {
    const polygon *polygons = (const polygon *)b->polygons.items;
    const corner *corners = (const corner *)b->corners.items;
    if (!list_reserve(&b->triangles, b->polygons.count)) return builder_fail_memory(b);
    for (size_t i = 0; i < b->polygons.count; i++) {
        const polygon *f = &polygons[i];
        for (size_t k = f->first; k < f->first + f->count; k++) {
            if (corners[k].vertex >= b->positions.count)
                return builder_fail(b, f->line, "a face with vertex %lu, but there are only %lu",
                                    (unsigned long)corners[k].vertex + 1,
                                    (unsigned long)b->positions.count);
            if (corners[k].uv != NO_UV && corners[k].uv >= b->uvs.count)
                return builder_fail(b, f->line,
                                    "a face with texture vertex %lu, but there are only %lu",
                                    (unsigned long)corners[k].uv + 1, (unsigned long)b->uvs.count);
        }
        if (!triangulate(b, corners + f->first, f->count)) return 0;
    }
    return 1;
}

/* Hand the list's block over to the mesh. */
static void *take(list *l) {
    void *items = l->items;
    l->items = NULL;
    return items;
}

/* The lists as a mesh. */
static int builder_finish(builder *b) {
    mesh_data *mesh = b->mesh;
    const size_t count = b->triangles.count;
    const corner *corners = (const corner *)b->triangles.items;
    int has_uvs = 0;
    size_t bytes;
    for (size_t i = 0; i < 3 * count && !has_uvs; i++) has_uvs = corners[i].uv != NO_UV;
    if (count) {
        if (!txm_mul(count, 6, sizeof(float), &bytes)) return builder_fail_memory(b);
        mesh->indices = (uint32_t *)malloc(bytes / 2);
        if (has_uvs) mesh->uvs = (float *)malloc(bytes);
        if (!mesh->indices || (has_uvs && !mesh->uvs)) return builder_fail_memory(b);
    }
    for (size_t i = 0; i < 3 * count; i++) {
        mesh->indices[i] = corners[i].vertex;
        if (!has_uvs) continue;
        const float *uv = (const float *)b->uvs.items + 2 * (size_t)corners[i].uv;
        mesh->uvs[2 * i] = corners[i].uv == NO_UV ? 0 : uv[0];
        mesh->uvs[2 * i + 1] = corners[i].uv == NO_UV ? 0 : turn_v(uv[1]);
    }
    mesh->vertex_count = b->positions.count;
    mesh->triangle_count = count;
    mesh->positions = (float *)take(&b->positions);
    mesh->normals = (float *)take(&b->normals);
    mesh->rotations = (float *)take(&b->rotations);
    mesh->colors = (unsigned char *)take(&b->colors);
    return 1;
}

/* ---- text --------------------------------------------------------------------------------- */

typedef struct text {
    const char *at, *end;
    size_t line; /* from 1 */
} text;

static int is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

static int is_digit(char c) {
    return c >= '0' && c <= '9';
}

/* To the next word of this line; a backslash at the end of a line joins the next one on. */
static void text_skip_blanks(text *in) {
    while (in->at < in->end) {
        if (is_blank(*in->at)) {
            in->at++;
        } else if (*in->at == '\\') {
            const char *p = in->at + 1;
            if (p < in->end && *p == '\r') p++;
            if (p == in->end || *p != '\n') return;
            in->at = p + 1;
            in->line++;
        } else {
            return;
        }
    }
}

/* To the beginning of the next line. */
static void text_skip_line(text *in) {
    for (;;) {
        const char *newline = (const char *)memchr(in->at, '\n', (size_t)(in->end - in->at));
        if (!newline) {
            in->at = in->end;
            return;
        }
        const char *last = newline;
        if (last > in->at && last[-1] == '\r') last--;
        const int goes_on = last > in->at && last[-1] == '\\';
        in->at = newline + 1;
        in->line++;
        if (!goes_on) return;
    }
}

/* To the next word, on whichever line. */
static void text_skip_space(text *in) {
    while (in->at < in->end && (is_blank(*in->at) || *in->at == '\n')) {
        if (*in->at == '\n') in->line++;
        in->at++;
    }
}

static int text_at_word_end(const char *p, const char *end) {
    return p == end || is_blank(*p) || *p == '\n' || *p == '\\';
}

/* What read_number cannot do exactly by itself. */
static int read_number_slowly(text *in, double *value) {
    char word[512], *stop;
    size_t n = 0;
    while (!text_at_word_end(in->at + n, in->end)) {
        if (n + 1 == sizeof word) return 0;
        word[n] = in->at[n];
        n++;
    }
    word[n] = 0;
    if (n == 0) return 0;
    *value = strtod(word, &stop);
    in->at += n;
    return stop == word + n;
}

/* The number that begins here, correctly rounded to double. A decimal number of up to 15 digits is an
   integer times or over a power of ten that doubles hold exactly: one operation, one rounding. */
static int text_number(text *in, double *value) {
    static const double powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                    1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    const char *p = in->at;
    const uint64_t exact = (uint64_t)1 << 53;
    uint64_t digits = 0;
    int exponent = 0, any = 0, negative = 0;
    if (p < in->end && (*p == '-' || *p == '+')) negative = *p++ == '-';
    for (; p < in->end && is_digit(*p) && digits < exact; p++, any = 1)
        digits = 10 * digits + (uint64_t)(*p - '0');
    if (p < in->end && *p == '.') {
        for (p++; p < in->end && is_digit(*p) && digits < exact; p++, any = 1, exponent--)
            digits = 10 * digits + (uint64_t)(*p - '0');
    }
    if (any && p < in->end && (*p == 'e' || *p == 'E')) {
        int e = 0, down = 0;
        p++;
        if (p < in->end && (*p == '-' || *p == '+')) down = *p++ == '-';
        any = 0;
        for (; p < in->end && is_digit(*p) && e < 1000; p++, any = 1) e = 10 * e + (*p - '0');
        exponent += down ? -e : e;
    }
    if (!any || digits >= exact || exponent < -22 || exponent > 22 || !text_at_word_end(p, in->end))
        return read_number_slowly(in, value);
    const double d = (double)digits;
    const double v = exponent < 0 ? d / powers[-exponent] : d * powers[exponent];
    *value = negative ? -v : v;
    in->at = p;
    return 1;
}

/* The same for a number that must be finite as a float. */
static int text_to_float(double value, float *to) {
    *to = (float)value; /* beyond the largest: infinite, IEEE has no traps here */
    return txm_is_finite((double)*to);
}

/* ---- OBJ ---------------------------------------------------------------------------------- */

/* The numbers of the rest of the line, at most so many; -1 if one of them is none. */
static int read_numbers(text *in, double *values, int most) {
    int n = 0;
    for (;;) {
        text_skip_blanks(in);
        if (in->at == in->end || *in->at == '\n' || *in->at == '#' || n == most) return n;
        if (!text_number(in, &values[n++])) return -1;
    }
}

/* v x y z [w] [r g b]; colors are gathered as floats, for some write them 0..255. */
static int read_obj_vertex(builder *b, text *in, list *colors) {
    double v[7];
    const size_t line = in->line;
    const int n = read_numbers(in, v, 7);
    if (n < 0) return builder_fail(b, line, "a coordinate is not a number");
    if (n < 3) return builder_fail(b, line, "a vertex has less than three coordinates");
    float *p = (float *)list_add(&b->positions, 1);
    if (!p) return builder_fail_memory(b);
    for (int k = 0; k < 3; k++) {
        if (!text_to_float(v[k], &p[k]))
            return builder_fail(b, line, "a coordinate is not a finite number");
    }
    if (n < 6) return 1;
    while (colors->count < b->positions.count) { /* white for those before that had none */
        float *c = (float *)list_add(colors, 1);
        if (!c) return builder_fail_memory(b);
        c[0] = c[1] = c[2] = 1;
        if (colors->count < b->positions.count) continue;
        for (int k = 0; k < 3; k++) {
            if (!text_to_float(v[n - 3 + k], &c[k]))
                return builder_fail(b, line, "a color is not a finite number");
        }
    }
    return 1;
}

static int read_obj_uv(builder *b, text *in) {
    double v[3];
    const size_t line = in->line;
    const int n = read_numbers(in, v, 3);
    float *uv = (float *)list_add(&b->uvs, 1);
    if (!uv) return builder_fail_memory(b);
    uv[1] = 0;
    if (n < 1 || !text_to_float(v[0], &uv[0]) || (n > 1 && !text_to_float(v[1], &uv[1])))
        return builder_fail(b, line, "a texture coordinate is not a finite number");
    return 1;
}

/* An index as OBJ has it, from 1, or from -1 backwards from the last of count. */
static int read_obj_index(text *in, size_t count, uint32_t *index) {
    const int backwards = in->at < in->end && *in->at == '-';
    uint64_t v = 0;
    if (backwards) in->at++;
    if (in->at == in->end || !is_digit(*in->at)) return 0;
    while (in->at < in->end && is_digit(*in->at)) {
        v = 10 * v + (uint64_t)(*in->at++ - '0');
        if (v > 0x7fffffff) return 0;
    }
    if (v == 0 || (backwards && v > count)) return 0;
    *index = (uint32_t)(backwards ? (uint64_t)count - v : v - 1);
    return 1;
}

/* f v v v, f v/vt ..., f v//vn ..., f v/vt/vn ... */
static int read_obj_face(builder *b, text *in) {
    const size_t line = in->line, first = b->corners.count;
    for (;;) {
        uint32_t vertex, uv = NO_UV, normal;
        text_skip_blanks(in);
        if (in->at == in->end || *in->at == '\n' || *in->at == '#') break;
        int ok = read_obj_index(in, b->positions.count, &vertex);
        if (ok && in->at < in->end && *in->at == '/') {
            in->at++;
            if (in->at < in->end && *in->at != '/' && !text_at_word_end(in->at, in->end))
                ok = read_obj_index(in, b->uvs.count, &uv);
            if (ok && in->at < in->end && *in->at == '/') {
                in->at++; /* how many normals there are nobody counts */
                if (!text_at_word_end(in->at, in->end)) ok = read_obj_index(in, SIZE_MAX, &normal);
            }
        }
        if (!ok || !text_at_word_end(in->at, in->end))
            return builder_fail(b, line, "a face with an index that is out of range or no number");
        corner *c = (corner *)list_add(&b->corners, 1);
        if (!c) return builder_fail_memory(b);
        c->vertex = vertex;
        c->uv = uv;
    }
    polygon *f = (polygon *)list_add(&b->polygons, 1);
    if (!f) return builder_fail_memory(b);
    f->first = first;
    f->count = b->corners.count - first;
    f->line = line;
    return f->count >= 3 ? 1 : builder_fail(b, line, "a face with less than three corners");
}

/* Colors to bytes; all 0..1, or if any is above, all 0..255. */
static int obj_colors_to_bytes(builder *b, const list *colors) {
    const float *from = (const float *)colors->items;
    float most = 1;
    if (colors->count == 0) return 1;
    for (size_t i = 0; i < 3 * colors->count; i++) {
        if (from[i] > most) most = from[i];
    }
    const float scale = most > 1 ? 1 : 255;
    unsigned char *to = (unsigned char *)list_add(&b->colors, b->positions.count);
    if (!to) return builder_fail_memory(b);
    memset(to, 255, 4 * b->positions.count);
    for (size_t i = 0; i < colors->count; i++) {
        for (size_t k = 0; k < 3; k++)
            to[4 * i + k] = (unsigned char)(txm_clampf(from[3 * i + k] * scale, 0, 255) + 0.5f);
    }
    return 1;
}

static int mesh_read_obj(builder *b, text *in) {
    list colors = list_of(3 * sizeof(float));
    int ok = 1;
    while (ok && in->at < in->end) {
        text_skip_blanks(in);
        const char *word = in->at;
        while (!text_at_word_end(in->at, in->end)) in->at++;
        const ptrdiff_t n = in->at - word;
        if (n == 1 && word[0] == 'v') ok = read_obj_vertex(b, in, &colors);
        else if (n == 2 && word[0] == 'v' && word[1] == 't') ok = read_obj_uv(b, in);
        else if (n == 1 && word[0] == 'f') ok = read_obj_face(b, in);
        if (ok) text_skip_line(in);
    }
    ok = ok && obj_colors_to_bytes(b, &colors);
    list_free(&colors);
    if (ok && b->polygons.count == 0)
        return builder_fail(b, 0, "%s", b->positions.count
                                            ? "no faces in it"
                                            : "no vertices in it; give an OBJ or PLY file");
    return ok;
}

/* ---- PLY: the header ----------------------------------------------------------------------- */

typedef enum ply_format { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_format;

typedef enum ply_type {
    PLY_INT8, PLY_UINT8, PLY_INT16, PLY_UINT16, PLY_INT32, PLY_UINT32, PLY_FLOAT, PLY_DOUBLE,
    PLY_NONE
} ply_type;

static const size_t ply_bytes[] = {1, 1, 2, 2, 4, 4, 4, 8};

/* What a property of a vertex is to us. */
typedef enum ply_role {
    PLY_X, PLY_Y, PLY_Z, PLY_NX, PLY_NY, PLY_NZ, PLY_RED, PLY_GREEN, PLY_BLUE, PLY_ALPHA, PLY_U,
    PLY_V, PLY_QX, PLY_QY, PLY_QZ, PLY_QW, PLY_ROLES,
    PLY_CORNERS = PLY_ROLES, /* of a face: its vertices */
    PLY_OTHER
} ply_role;

typedef struct ply_property {
    ply_type type, counted; /* counted: of a list, the type of its length; else PLY_NONE */
    ply_role role;
} ply_property;

typedef struct ply_element {
    size_t count, least; /* least: bytes that one takes in the file at least */
    int first, properties, has_list, is_vertex, is_face;
} ply_element;

typedef struct ply {
    ply_format format;
    ply_element elements[MAX_ELEMENTS];
    ply_property properties[MAX_PROPERTIES];
    int element_count, property_count;
} ply;

static ply_type ply_type_of(const char *word) {
    static const char *const names[][2] = {{"char", "int8"},     {"uchar", "uint8"},
                                           {"short", "int16"},   {"ushort", "uint16"},
                                           {"int", "int32"},     {"uint", "uint32"},
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
    if (e->is_face && is_list && (!strcmp(word, "vertex_indices") || !strcmp(word, "vertex_index")))
        return PLY_CORNERS;
    if (!e->is_vertex || is_list) return PLY_OTHER;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (!strcmp(word, names[i].name)) return names[i].role;
    }
    return PLY_OTHER;
}

/* The next word of the line in lower case, or "" at its end; what is too long is cut off. */
static const char *next_word(text *in, char word[32]) {
    size_t n = 0;
    while (in->at < in->end && is_blank(*in->at)) in->at++;
    for (; in->at < in->end && !is_blank(*in->at) && *in->at != '\n'; in->at++) {
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

static int read_ply_header(builder *b, ply *h, text *in) {
    int has_format = 0, ok = 1;
    memset(h, 0, sizeof *h);
    text_skip_line(in);
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
        const char *newline = (const char *)memchr(in->at, '\n', (size_t)(in->end - in->at));
        in->at = newline ? newline + 1 : in->end;
        if (ok) in->line++;
    }
    if (!ok) return 0;
    if (in->at < in->end && *in->at == '\r') in->at++;
    if (in->at < in->end && *in->at == '\n') in->at++;
    in->line++;
    return 1;
}

/* ---- PLY: the body ------------------------------------------------------------------------- */

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

static unsigned char to_byte(double value, ply_type type) {
    if (type == PLY_FLOAT || type == PLY_DOUBLE) value *= 255;
    if (type == PLY_UINT16) value /= 257;
    return (unsigned char)(value > 0 ? value < 255 ? value + 0.5 : 255 : 0); /* NaN: 0 */
}

/* Do the vertices have all of a group of properties? */
static int has_roles(const unsigned char *has, ply_role first, int count) {
    for (int k = 0; k < count; k++) {
        if (!has[(int)first + k]) return 0;
    }
    return 1;
}

static int read_ply_vertices(builder *b, const ply *h, const ply_element *e, text *in) {
    unsigned char has[PLY_ROLES] = {0};
    ply_type types[PLY_ROLES] = {PLY_INT8};
    double v[PLY_ROLES] = {0};
    const ply_property *properties = h->properties + e->first;
    for (int i = 0; i < e->properties; i++) {
        if (properties[i].role >= PLY_ROLES) continue;
        has[properties[i].role] = 1;
        types[properties[i].role] = properties[i].type;
    }
    if (!has_roles(has, PLY_X, 3)) return builder_fail(b, 0, "its vertices have no x, y and z");
    const int has_normal = has_roles(has, PLY_NX, 3), has_color = has_roles(has, PLY_RED, 3);
    const int has_uv = has_roles(has, PLY_U, 2), has_rotation = has_roles(has, PLY_QX, 4);
    float *position = (float *)list_add(&b->positions, e->count);
    float *normal = has_normal ? (float *)list_add(&b->normals, e->count) : NULL;
    float *uv = has_uv ? (float *)list_add(&b->uvs, e->count) : NULL;
    float *rotation = has_rotation ? (float *)list_add(&b->rotations, e->count) : NULL;
    unsigned char *color = has_color ? (unsigned char *)list_add(&b->colors, e->count) : NULL;
    if (!position || (has_normal && !normal) || (has_uv && !uv) || (has_color && !color) ||
        (has_rotation && !rotation))
        return builder_fail_memory(b);

    for (size_t i = 0; i < e->count; i++) {
        int ok = 1;
        for (int k = 0; k < e->properties; k++) {
            if (properties[k].role >= PLY_ROLES) {
                if (!skip_property(b, h, in, &properties[k])) return 0;
            } else if (!read_scalar(h, in, properties[k].type, &v[properties[k].role])) {
                return fail_body(b, h, in);
            }
        }
        for (int k = 0; k < 3; k++) ok &= text_to_float(v[PLY_X + k], &position[3 * i + (size_t)k]);
        for (int k = 0; k < 3 && has_normal; k++)
            ok &= text_to_float(v[PLY_NX + k], &normal[3 * i + (size_t)k]);
        for (int k = 0; k < 2 && has_uv; k++)
            ok &= text_to_float(v[PLY_U + k], &uv[2 * i + (size_t)k]);
        for (int k = 0; k < 4 && has_rotation; k++)
            ok &= text_to_float(v[PLY_QX + k], &rotation[4 * i + (size_t)k]);
        if (!ok)
            return builder_fail(b, 0, "vertex %lu has a number that is not finite",
                                (unsigned long)i);
        for (int k = 0; k < 4 && has_color; k++)
            color[4 * i + (size_t)k] = k == 3 && !has[PLY_ALPHA]
                                           ? 255
                                           : to_byte(v[PLY_RED + k], types[PLY_RED + k]);
    }
    return 1;
}

static int read_ply_face(builder *b, const ply *h, const ply_property *p, text *in, size_t index) {
    size_t n;
    if (h->format == PLY_ASCII) text_skip_space(in);
    const size_t line = h->format == PLY_ASCII ? in->line : 0;
    if (!read_length(b, h, in, p, &n)) return 0;
    if (n < 3)
        return builder_fail(b, line, "face %lu has less than three corners", (unsigned long)index);
    polygon *f = (polygon *)list_add(&b->polygons, 1);
    if (!f) return builder_fail_memory(b);
    f->first = b->corners.count;
    f->count = n;
    f->line = line;
    corner *c = (corner *)list_add(&b->corners, n);
    if (!c) return builder_fail_memory(b);
    for (size_t k = 0; k < n; k++) {
        double value;
        if (!read_scalar(h, in, p->type, &value)) return fail_body(b, h, in);
        if (!(value >= 0 && value < 2147483648.0) || value != floor(value))
            return builder_fail(b, line, "face %lu has an index that is out of range",
                                (unsigned long)index);
        c[k].vertex = c[k].uv = (uint32_t)value;
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
    for (size_t i = 0; i < e->count; i++) {
        for (int k = 0; k < e->properties; k++) {
            const ply_property *p = &h->properties[e->first + k];
            const int ok = p->role == PLY_CORNERS ? read_ply_face(b, h, p, in, i)
                                                  : skip_property(b, h, in, p);
            if (!ok) return 0;
        }
    }
    return 1;
}

static int mesh_read_ply(builder *b, text *in, int points_too) {
    ply h;
    if (!read_ply_header(b, &h, in)) return 0;
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

/* ---- reading ------------------------------------------------------------------------------ */

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

/* ---- writing: bytes ------------------------------------------------------------------------ */

/* A file in the making; a failed allocation is seen at the end. */
typedef struct sink {
    list bytes;
    int failed;
} sink;

static sink sink_new(void) {
    sink s = {{NULL, 0, 0, 1}, 0};
    return s;
}

static void sink_put(sink *s, const void *bytes, size_t n) {
    void *place = s->failed || n == 0 ? NULL : list_add(&s->bytes, n);
    if (place) memcpy(place, bytes, n);
    else if (n) s->failed = 1;
}

/* Text; formatted numbers and our own words, at most 200 characters. */
static void sink_print(sink *s, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 2, 3)))
#endif
    ;

static void sink_print(sink *s, const char *format, ...) {
    char line[256];
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    sink_put(s, line, n < 0 ? 0 : n < (int)sizeof line ? (size_t)n : sizeof line - 1);
}

/* Little-endian numbers. */
static void sink_u16(sink *s, uint32_t v) {
    const unsigned char raw[2] = {(unsigned char)(v & 255), (unsigned char)(v >> 8 & 255)};
    sink_put(s, raw, 2);
}

static void sink_u32(sink *s, uint32_t v) {
    const unsigned char raw[4] = {(unsigned char)(v & 255), (unsigned char)(v >> 8 & 255),
                                  (unsigned char)(v >> 16 & 255), (unsigned char)(v >> 24)};
    sink_put(s, raw, 4);
}

static void sink_floats(sink *s, const float *v, size_t n) {
    for (size_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &v[i], 4);
        sink_u32(s, bits);
    }
}

static int sink_finish(sink *s, unsigned char **bytes, size_t *size, const char **why) {
    *bytes = NULL;
    if (s->failed) {
        list_free(&s->bytes);
        return *why = "not enough memory to write this mesh", 0;
    }
    *bytes = (unsigned char *)s->bytes.items;
    *size = s->bytes.count;
    return 1;
}

/* ---- writing: equal corners share a vertex --------------------------------------------------- */

/* What makes corners differ. */
enum { BY_VERTEX = 1, BY_UV = 2, BY_NORMAL = 4 };

/* Of each corner, which of the distinct ones it is; and of each distinct one a corner that has it. */
typedef struct split {
    uint32_t *index; /* 1 per corner            */
    uint32_t *first; /* 1 per distinct corner   */
    size_t count;    /* of distinct corners     */
} split;

static void split_free(split *s) {
    free(s->index);
    free(s->first);
}

static int same_floats(const float *a, const float *b, int count) {
    for (int k = 0; k < count; k++) {
        if (a[k] != b[k]) return 0;
    }
    return 1;
}

static int same_corner(const mesh_data *m, size_t a, size_t b, int by) {
    if ((by & BY_VERTEX) && m->indices[a] != m->indices[b]) return 0;
    if ((by & BY_UV) && !same_floats(m->uvs + 2 * a, m->uvs + 2 * b, 2)) return 0;
    return !(by & BY_NORMAL) ||
           same_floats(m->corner_normals + 3 * a, m->corner_normals + 3 * b, 3);
}

static uint64_t hash_corner(const mesh_data *m, size_t c, int by) {
    uint64_t key = by & BY_VERTEX ? txm_hash(m->indices[c]) : 0;
    uint32_t bits[2] = {0, 0};
    if (by & BY_UV) {
        memcpy(bits, m->uvs + 2 * c, sizeof bits);
        key = txm_hash(key ^ ((uint64_t)bits[0] << 32 | bits[1]));
    }
    if (by & BY_NORMAL) { /* two of three will do */
        memcpy(bits, m->corner_normals + 3 * c, sizeof bits);
        key = txm_hash(key ^ ((uint64_t)bits[0] << 32 | bits[1]));
    }
    return key;
}

/* A table twice as large as the number of corners, places tried one after the other. */
static int split_corners(const mesh_data *m, int by, split *s) {
    const size_t corners = 3 * m->triangle_count;
    size_t size = 16, bytes;
    memset(s, 0, sizeof *s);
    while (size < 2 * corners) size *= 2;
    if (!txm_mul(size, sizeof(uint32_t), 1, &bytes)) return 0;
    uint32_t *table = (uint32_t *)malloc(bytes);
    s->index = (uint32_t *)malloc(bytes);
    s->first = (uint32_t *)calloc(size, sizeof(uint32_t));
    if (!table || !s->index || !s->first) {
        free(table);
        split_free(s);
        return 0;
    }
    memset(table, 255, bytes);
    for (size_t c = 0; c < corners; c++) {
        size_t at = (size_t)hash_corner(m, c, by) & (size - 1);
        while (table[at] != NO_UV && !same_corner(m, s->first[table[at]], c, by))
            at = (at + 1) & (size - 1);
        if (table[at] == NO_UV) {
            s->first[s->count] = (uint32_t)c;
            table[at] = (uint32_t)s->count++;
        }
        s->index[c] = table[at];
    }
    free(table);
    return 1;
}

/* A mesh as PLY and GLB have it: all is per vertex. Where nothing is per corner it is the mesh itself;
   else vertices are doubled as need be, and unused ones left out. */
typedef struct flat_mesh {
    const mesh_data *mesh;
    split split;
    size_t count; /* of vertices */
} flat_mesh;

static int flat_make(const mesh_data *m, int with_corner_normals, flat_mesh *f) {
    const int by =
        (m->uvs ? BY_UV : 0) | (with_corner_normals && m->corner_normals ? BY_NORMAL : 0);
    memset(f, 0, sizeof *f);
    f->mesh = m;
    f->count = m->vertex_count;
    if (!by) return 1;
    if (!split_corners(m, by | BY_VERTEX, &f->split)) return 0;
    f->count = f->split.count;
    return 1;
}

static size_t flat_vertex(const flat_mesh *f, size_t i) {
    return f->split.first ? f->mesh->indices[f->split.first[i]] : i;
}

static const float *flat_uv(const flat_mesh *f, size_t i) {
    return f->mesh->uvs + 2 * (size_t)f->split.first[i];
}

static uint32_t flat_index(const flat_mesh *f, size_t corner_index) {
    return f->split.index ? f->split.index[corner_index] : f->mesh->indices[corner_index];
}

/* ---- writing: what a scene holds -------------------------------------------------------------- */

/* The surface is a part as well, the first. */
static int scene_part_count(const mesh_scene *scene) {
    return scene->part_count + (scene->surface != NULL);
}

/* Its material, if it is the surface, is made in *own. */
static mesh_part scene_part(const mesh_scene *scene, int i, mesh_material *own) {
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

/* ---- writing: OBJ --------------------------------------------------------------------------- */

/* A name on a line of its own: no control characters. */
static void print_name(sink *s, const char *name) {
    for (; *name; name++) {
        const unsigned char c = (unsigned char)*name;
        sink_put(s, c < 32 || c == 127 ? "_" : name, 1);
    }
    sink_put(s, "\n", 1);
}

/* How many positions, texture coordinates and normals the file has so far: it counts on. */
typedef struct obj_counts {
    size_t vertices, uvs, normals;
} obj_counts;

static void print_obj_vertices(sink *s, const mesh_data *m, const split *uvs, const split *normals,
                               size_t normal_count) {
    for (size_t i = 0; i < m->vertex_count; i++) {
        const float *p = m->positions + 3 * i;
        sink_print(s, "v %.9g %.9g %.9g", (double)p[0], (double)p[1], (double)p[2]);
        for (size_t k = 0; k < 3 && m->colors; k++)
            sink_print(s, " %.4g", m->colors[4 * i + k] / 255.0);
        sink_put(s, "\n", 1);
    }
    for (size_t i = 0; i < uvs->count; i++) {
        const float *uv = m->uvs + 2 * (size_t)uvs->first[i];
        sink_print(s, "vt %.9g %.9g\n", (double)uv[0], (double)turn_v(uv[1]));
    }
    for (size_t i = 0; i < normal_count; i++) {
        const float *n = normals->index ? m->corner_normals + 3 * (size_t)normals->first[i]
                                        : m->normals + 3 * i;
        sink_print(s, "vn %.6g %.6g %.6g\n", (double)n[0], (double)n[1], (double)n[2]);
    }
}

static int encode_obj_part(const mesh_scene *scene, const mesh_part *part, obj_counts *counts,
                           sink *s) {
    const mesh_data *m = part->mesh;
    split uvs, normals; /* of normals per vertex, none */
    memset(&uvs, 0, sizeof uvs);
    memset(&normals, 0, sizeof normals);
    if (m->uvs && !split_corners(m, BY_UV, &uvs)) return 0;
    if (m->corner_normals && !split_corners(m, BY_NORMAL, &normals)) {
        split_free(&uvs);
        return 0;
    }
    const int has_normals = m->normals || m->corner_normals;
    const size_t normal_count = normals.index ? normals.count : m->normals ? m->vertex_count : 0;
    if (scene->part_count) sink_print(s, "o %.60s\n", part->material->name);
    print_obj_vertices(s, m, &uvs, &normals, normal_count);
    if (scene->library) sink_print(s, "usemtl %.60s\n", part->material->name);
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        const size_t v = m->indices[c] + 1;
        sink_print(s, "%s%lu", c % 3 ? " " : "f ", (unsigned long)(counts->vertices + v));
        if (uvs.index) sink_print(s, "/%lu", (unsigned long)(counts->uvs + uvs.index[c] + 1));
        const size_t normal = counts->normals + (normals.index ? normals.index[c] + 1 : v);
        if (has_normals) sink_print(s, uvs.index ? "/%lu" : "//%lu", (unsigned long)normal);
        if (c % 3 == 2) sink_put(s, "\n", 1);
    }
    counts->vertices += m->vertex_count;
    counts->uvs += uvs.count;
    counts->normals += normal_count;
    split_free(&uvs);
    split_free(&normals);
    return 1;
}

static int mesh_write_obj(const mesh_scene *scene, sink *s) {
    obj_counts counts = {0, 0, 0};
    mesh_material own;
    if (scene->library) {
        sink_print(s, "mtllib ");
        print_name(s, scene->library);
    }
    for (int i = 0; i < scene_part_count(scene); i++) {
        const mesh_part part = scene_part(scene, i, &own);
        if (!encode_obj_part(scene, &part, &counts, s)) return 0;
    }
    return 1;
}

int mesh_encode_mtl(const mesh_scene *scene, unsigned char **bytes, size_t *size,
                    const char **why) {
    sink s = sink_new();
    mesh_material own;
    for (int i = 0; i < scene_part_count(scene); i++) {
        const mesh_material *m = scene_part(scene, i, &own).material;
        sink_print(&s, "newmtl %.60s\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 1\n", m->name);
        if (!m->texture) continue;
        sink_print(&s, "map_Kd ");
        print_name(&s, m->texture);
        if (!m->is_cut_out) continue;
        sink_print(&s, "map_d ");
        print_name(&s, m->texture);
    }
    return sink_finish(&s, bytes, size, why);
}

/* ---- writing: PLY --------------------------------------------------------------------------- */

static int mesh_write_ply(const mesh_data *m, sink *s) {
    flat_mesh f;
    if (!flat_make(m, 0, &f)) return 0;
    sink_print(s, "ply\nformat binary_little_endian 1.0\nelement vertex %lu\n",
               (unsigned long)f.count);
    sink_print(s, "property float x\nproperty float y\nproperty float z\n");
    if (m->normals) sink_print(s, "property float nx\nproperty float ny\nproperty float nz\n");
    if (m->colors)
        sink_print(s, "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                      "property uchar alpha\n");
    if (m->uvs) sink_print(s, "property float s\nproperty float t\n");
    if (m->triangle_count)
        sink_print(s, "element face %lu\nproperty list uchar int vertex_indices\n",
                   (unsigned long)m->triangle_count);
    sink_print(s, "end_header\n");
    for (size_t i = 0; i < f.count; i++) {
        const size_t v = flat_vertex(&f, i);
        sink_floats(s, m->positions + 3 * v, 3);
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
    }
    split_free(&f.split);
    return 1;
}

/* ---- writing: GLB --------------------------------------------------------------------------- */

enum { GL_UNSIGNED_SHORT = 5123, GL_UNSIGNED_INT = 5125, GL_FLOAT = 5126 };
enum { NORMALIZED = 1 << 16 }; /* with a component type: 0..65535 means 0..1 */
enum { GL_ARRAY = 34962, GL_ELEMENTS = 34963 };
enum { MAX_MATERIALS = 64 };

/* The parts of the document are written side by side and put together at the end. */
typedef struct glb {
    sink binary, views, accessors, meshes, nodes;
    sink more; /* skins and animations, each after a comma */
    int view_count, accessor_count, mesh_count, node_count;
    const mesh_material *materials[MAX_MATERIALS]; /* NULL: plain white */
    int material_count;
} glb;

/* The bytes since start become a view; target 0: none. Returns its number. */
static int glb_view(glb *g, size_t start, int target) {
    sink *s = &g->views;
    const size_t length = g->binary.bytes.count - start;
    sink_print(s, "%s{\"buffer\":0,\"byteOffset\":%lu,\"byteLength\":%lu", g->view_count ? "," : "",
               (unsigned long)start, (unsigned long)length);
    if (target) sink_print(s, ",\"target\":%d", target);
    sink_print(s, "}");
    while (g->binary.bytes.count % 4 && !g->binary.failed) sink_put(&g->binary, "\0", 1);
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

/* Its number among the materials of the document; past the last there is room for no more. */
static int glb_material(glb *g, const mesh_material *material) {
    int i = 0;
    while (i < g->material_count && g->materials[i] != material) i++;
    if (i == MAX_MATERIALS) return i - 1;
    if (i == g->material_count) g->materials[g->material_count++] = material;
    return i;
}

/* glTF wants unit normals, and finds fault with zero. */
static void put_normal(sink *s, const float *n) {
    const double x = (double)n[0], y = (double)n[1], z = (double)n[2];
    const double length = sqrt(x * x + y * y + z * z);
    float unit[3] = {0, 0, 1};
    if (length > 1e-30) {
        unit[0] = (float)(x / length);
        unit[1] = (float)(y / length);
        unit[2] = (float)(z / length);
    }
    sink_floats(s, unit, 3);
}

/* sRGB to linear, in 16 bits lest dark colors run together. */
static void put_color(sink *s, const unsigned char *c) {
    for (int k = 0; k < 3; k++) {
        const float linear = txm_srgb_to_linear((float)c[k] / 255.0f);
        sink_u16(s, (uint32_t)(txm_clampf(linear, 0, 1) * 65535.0f + 0.5f));
    }
    sink_u16(s, (uint32_t)c[3] * 257);
}

/* Joints and weights. The rounded weights of a vertex need not sum up to 1: the largest takes up the
   rest. A joint without weight is joint 0, lest validators warn. */
static void glb_weights(glb *g, const mesh_data *m, const flat_mesh *f) {
    sink *bin = &g->binary, *s = &g->meshes;
    size_t start = bin->bytes.count;
    for (size_t i = 0; i < f->count; i++) {
        const size_t v = 4 * flat_vertex(f, i);
        for (size_t k = 0; k < 4; k++) sink_u16(bin, m->weights[v + k] > 0 ? m->joints[v + k] : 0);
    }
    sink_print(s, ",\"JOINTS_0\":%d",
               glb_accessor(g, start, GL_ARRAY, GL_UNSIGNED_SHORT, f->count, "VEC4", NULL));
    start = bin->bytes.count;
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

/* A primitive of the mesh that is being written. */
static int glb_primitive(glb *g, const mesh_data *m, const mesh_material *material) {
    flat_mesh f;
    sink *bin = &g->binary, *s = &g->meshes;
    float bounds[6] = {0, 0, 0, 0, 0, 0};
    size_t start = bin->bytes.count;
    if (!flat_make(m, 1, &f)) return 0;

    for (size_t i = 0; i < f.count; i++) {
        const float *p = m->positions + 3 * flat_vertex(&f, i);
        for (int k = 0; k < 3; k++) {
            if (i == 0 || p[k] < bounds[k]) bounds[k] = p[k];
            if (i == 0 || p[k] > bounds[3 + k]) bounds[3 + k] = p[k];
        }
        sink_floats(bin, p, 3);
    }
    sink_print(s, "{\"attributes\":{\"POSITION\":%d",
               glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f.count, "VEC3", bounds));
    if (m->normals || m->corner_normals) {
        start = bin->bytes.count;
        for (size_t i = 0; i < f.count; i++)
            put_normal(bin, m->corner_normals ? m->corner_normals + 3 * (size_t)f.split.first[i]
                                              : m->normals + 3 * flat_vertex(&f, i));
        sink_print(s, ",\"NORMAL\":%d",
                   glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f.count, "VEC3", NULL));
    }
    if (m->uvs) {
        start = bin->bytes.count;
        for (size_t i = 0; i < f.count; i++) sink_floats(bin, flat_uv(&f, i), 2);
        sink_print(s, ",\"TEXCOORD_0\":%d",
                   glb_accessor(g, start, GL_ARRAY, GL_FLOAT, f.count, "VEC2", NULL));
    }
    if (m->colors) {
        start = bin->bytes.count;
        for (size_t i = 0; i < f.count; i++) put_color(bin, m->colors + 4 * flat_vertex(&f, i));
        sink_print(s, ",\"COLOR_0\":%d",
                   glb_accessor(g, start, GL_ARRAY, GL_UNSIGNED_SHORT | NORMALIZED, f.count, "VEC4",
                                NULL));
    }
    if (m->joints) glb_weights(g, m, &f);
    start = bin->bytes.count;
    const int is_short = f.count < 65535; /* 65535 itself is not an index */
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        if (is_short) sink_u16(bin, flat_index(&f, c));
        else sink_u32(bin, flat_index(&f, c));
    }
    sink_print(s, "},\"indices\":%d,\"material\":%d}",
               glb_accessor(g, start, GL_ELEMENTS, is_short ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT,
                            3 * m->triangle_count, "SCALAR", NULL),
               glb_material(g, material));
    split_free(&f.split);
    return 1;
}

static void glb_open_mesh(glb *g) {
    sink_print(&g->meshes, "%s{\"primitives\":[", g->mesh_count++ ? "," : "");
}

static void glb_close_mesh(glb *g) {
    sink_print(&g->meshes, "]}");
}

/* Begin a node; what follows is more of its fields and the closing brace. */
static void glb_node(glb *g, const char *name) {
    sink_print(&g->nodes, "%s{", g->node_count++ ? "," : "");
    if (name) sink_print(&g->nodes, "\"name\":\"%.60s\",", name);
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
    sink_print(s, "\"mesh\":%d,\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{",
               g->mesh_count - 1);
    for (int k = 0, written = 0; k < 3; k++) {
        if (!lists[k].values) continue;
        const size_t start = bin->bytes.count;
        sink_floats(bin, lists[k].values, lists[k].count * t->count);
        sink_print(s, "%s\"%s\":%d", written++ ? "," : "", lists[k].name,
                   glb_accessor(g, start, 0, GL_FLOAT, t->count, lists[k].type, NULL));
    }
    if (t->colors) { /* three floats: what viewers that know it at all can read */
        const size_t start = bin->bytes.count;
        for (size_t i = 0; i < t->count; i++) {
            float linear[3];
            for (size_t k = 0; k < 3; k++)
                linear[k] = txm_srgb_to_linear((float)t->colors[4 * i + k] / 255.0f);
            sink_floats(bin, linear, 3);
        }
        sink_print(s, ",\"_COLOR_0\":%d",
                   glb_accessor(g, start, 0, GL_FLOAT, t->count, "VEC3", NULL));
    }
    sink_print(s, "}}}}");
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
    size_t start = bin->bytes.count;
    for (int i = 0; i < k->joint_count; i++) sink_floats(bin, k->joints[i].bind, 16);
    sink_print(s, ",\"skins\":[{\"skeleton\":%d,\"inverseBindMatrices\":%d,\"joints\":[", first,
               glb_accessor(g, start, 0, GL_FLOAT, (size_t)k->joint_count, "MAT4", NULL));
    for (int i = 0; i < k->joint_count; i++) sink_print(s, "%s%d", i ? "," : "", first + i);
    sink_print(s, "]}]");
    if (k->key_count == 0) return;
    const size_t keys = (size_t)k->key_count;
    const float bounds[2] = {k->times[0], k->times[keys - 1]};
    start = bin->bytes.count;
    sink_floats(bin, k->times, keys);
    const int times = glb_accessor(g, start, 0, GL_FLOAT, keys, "SCALAR", bounds);
    sink_print(s, ",\"animations\":[{\"name\":\"%.60s\",\"samplers\":[", k->clip);
    for (int i = 0; i < k->joint_count; i++) {
        start = bin->bytes.count;
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

/* A PNG with nothing but its pixels: glTF ignores what it says of color spaces and pixel shapes, and
   a validator warns of that. What is no whole PNG stays as it is. */
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

static void append(sink *to, const sink *from) {
    sink_put(to, from->bytes.items, from->bytes.count);
    to->failed |= from->failed;
}

static void print_materials(glb *g, sink *json) {
    int textures = 0;
    sink_print(json, ",\"materials\":[");
    for (int i = 0; i < g->material_count; i++) {
        const mesh_material *m = g->materials[i];
        sink_print(json, "%s{", i ? "," : "");
        if (m && m->name) sink_print(json, "\"name\":\"%.60s\",", m->name);
        sink_print(json, "\"pbrMetallicRoughness\":{");
        if (m && (m->png || m->texture))
            sink_print(json, "\"baseColorTexture\":{\"index\":%d},", textures++);
        sink_print(json, "\"metallicFactor\":0,\"roughnessFactor\":1}");
        if (m && m->is_cut_out) sink_print(json, ",\"alphaMode\":\"MASK\",\"doubleSided\":true");
        sink_print(json, "}");
    }
    sink_print(json, "]");
    if (!textures) return;
    sink_print(json, ",\"textures\":[");
    for (int i = 0; i < textures; i++)
        sink_print(json, "%s{\"sampler\":%d,\"source\":%d}", i ? "," : "", i, i);
    sink_print(json, "],\"samplers\":[");
    for (int i = 0, written = 0; i < g->material_count; i++) {
        const mesh_material *m = g->materials[i];
        if (!m || !(m->png || m->texture)) continue;
        sink_print(json, "%s{\"magFilter\":9729,\"minFilter\":9987,\"wrapS\":%d,\"wrapT\":33071}",
                   written++ ? "," : "", m->repeats ? 10497 : 33071);
    }
    sink_print(json, "],\"images\":[");
    for (int i = 0, written = 0; i < g->material_count; i++) {
        const mesh_material *m = g->materials[i];
        if (!m || !(m->png || m->texture)) continue;
        sink_print(json, "%s{", written++ ? "," : "");
        if (m->png) {
            const size_t start = g->binary.bytes.count;
            put_png(&g->binary, m->png, m->png_size);
            sink_print(json, "\"bufferView\":%d,\"mimeType\":\"image/png\"}",
                       glb_view(g, start, 0));
        } else {
            sink_print(json, "\"uri\":\"");
            print_uri(json, m->texture);
            sink_print(json, "\"}");
        }
    }
    sink_print(json, "]");
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
    sink_print(json, "],\"buffers\":[{\"byteLength\":%lu}]}", (unsigned long)g->binary.bytes.count);
    while (json->bytes.count % 4 && !json->failed) sink_put(json, " ", 1);
}

/* All surfaces as one mesh, instances, joints: nodes in this order. Returns the first joint's node,
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
        sink_print(&g->nodes, k ? "\"mesh\":0,\"skin\":0}" : "\"mesh\":0}");
    }
    for (int i = 0; i < scene->instance_count; i++) {
        if (scene->instances[i].count && !glb_instances(g, &scene->instances[i])) return -1;
    }
    if (k) {
        joint = g->node_count;
        if (!glb_joints(g, k)) return -1;
        glb_skin(g, k, joint);
    }
    return joint;
}

static int mesh_write_glb(const mesh_scene *scene, sink *s) {
    glb g;
    mesh_material own;
    sink json = sink_new();
    int instanced = 0;
    memset(&g, 0, sizeof g);
    g.binary = g.views = g.accessors = g.meshes = g.nodes = g.more = sink_new();
    const int joint = glb_scene(&g, scene, &own);
    for (int i = 0; i < scene->instance_count; i++) instanced |= scene->instances[i].count > 0;
    if (joint >= 0) print_document(&g, scene, instanced, joint, &json);
    const int ok = joint >= 0 && g.binary.bytes.count <= 0x7fffffff; /* lengths are 32 bits */
    if (ok) {
        const size_t total = 12 + 8 + json.bytes.count + 8 + g.binary.bytes.count;
        sink_put(s, "glTF", 4);
        sink_u32(s, 2);
        sink_u32(s, (uint32_t)total);
        sink_u32(s, (uint32_t)json.bytes.count);
        sink_put(s, "JSON", 4);
        append(s, &json);
        sink_u32(s, (uint32_t)g.binary.bytes.count);
        sink_put(s, "BIN\0", 4);
        append(s, &g.binary);
    }
    list_free(&json.bytes);
    list_free(&g.binary.bytes);
    list_free(&g.views.bytes);
    list_free(&g.accessors.bytes);
    list_free(&g.meshes.bytes);
    list_free(&g.nodes.bytes);
    list_free(&g.more.bytes);
    return ok;
}

/* ---- writing ------------------------------------------------------------------------------ */

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

/* ---- normals and spheres ------------------------------------------------------------------- */

static txm_vec3 vector_at(const float *p) {
    return txm_v3(p[0], p[1], p[2]);
}

static void store(float *to, txm_vec3 v) {
    to[0] = v.x;
    to[1] = v.y;
    to[2] = v.z;
}

/* The normal of a corner from the corners around its vertex, itself among them. faces: of each
   triangle, its normal as long as its area. */
static txm_vec3 corner_normal(const mesh_data *m, const float *faces, const uint32_t *around,
                              size_t count, uint32_t own, float least_cosine) {
    const txm_vec3 n = vector_at(faces + 3 * (size_t)(own / 3));
    const float length = txm_vec3_length(n);
    txm_vec3 sum = txm_v3(0, 0, 0);
    int is_smooth = 1;
    for (size_t i = 0; i < count; i++) {
        const txm_vec3 other = vector_at(faces + 3 * (size_t)(around[i] / 3));
        if (txm_vec3_dot(n, other) >= least_cosine * length * txm_vec3_length(other))
            sum = txm_vec3_add(sum, other);
        else is_smooth = 0;
    }
    if (is_smooth && m->normals) return vector_at(m->normals + 3 * (size_t)m->indices[own]);
    return txm_vec3_normalize(sum);
}

int mesh_crease(mesh_data *m, float degrees) {
    const size_t corners = 3 * m->triangle_count;
    const float least_cosine = (float)cos((double)degrees * 3.14159265358979 / 180);
    float *faces = (float *)malloc((corners + 1) * sizeof(float));
    float *normals = (float *)malloc(3 * (corners + 1) * sizeof(float));
    uint32_t *lists = (uint32_t *)malloc((corners + 1) * sizeof(uint32_t));
    size_t *first = (size_t *)calloc(m->vertex_count + 2, sizeof(size_t));
    const int ok = faces && normals && lists && first;
    for (size_t t = 0; t < m->triangle_count && ok; t++) {
        txm_vec3 p[3];
        for (size_t k = 0; k < 3; k++)
            p[k] = vector_at(m->positions + 3 * (size_t)m->indices[3 * t + k]);
        store(faces + 3 * t, txm_vec3_cross(txm_vec3_sub(p[1], p[0]), txm_vec3_sub(p[2], p[0])));
    }
    if (ok) { /* the corners of each vertex, one list after the other */
        for (size_t c = 0; c < corners; c++) first[m->indices[c] + 2]++;
        for (size_t i = 2; i < m->vertex_count + 2; i++) first[i] += first[i - 1];
        for (size_t c = 0; c < corners; c++) lists[first[m->indices[c] + 1]++] = (uint32_t)c;
    }
    for (size_t c = 0; c < corners && ok; c++) {
        const size_t at = first[m->indices[c]], count = first[m->indices[c] + 1] - at;
        store(normals + 3 * c,
              corner_normal(m, faces, lists + at, count, (uint32_t)c, least_cosine));
    }
    free(faces);
    free(lists);
    free(first);
    if (!ok) {
        free(normals);
        return 0;
    }
    free(m->corner_normals);
    m->corner_normals = normals;
    return 1;
}

/* An octahedron, its eighths divided and blown up. */
int mesh_sphere(int steps, mesh_data *m) {
    const int n = steps, corners = (n + 1) * (n + 2) / 2;
    const size_t side = (size_t)steps;
    memset(m, 0, sizeof *m);
    m->vertex_count = 8 * (size_t)corners;
    m->triangle_count = 8 * side * side;
    m->positions = (float *)malloc(m->vertex_count * 3 * sizeof(float));
    m->normals = (float *)malloc(m->vertex_count * 3 * sizeof(float));
    m->colors = (unsigned char *)malloc(m->vertex_count * 4);
    m->indices = (uint32_t *)malloc(m->triangle_count * 3 * sizeof(uint32_t));
    if (!m->positions || !m->normals || !m->colors || !m->indices) {
        mesh_free(m);
        return 0;
    }
    float *p = m->positions;
    uint32_t *t = m->indices;
    for (int eighth = 0; eighth < 8; eighth++) {
        const float sign[3] = {eighth & 1 ? -1.0f : 1.0f, eighth & 2 ? -1.0f : 1.0f,
                               eighth & 4 ? -1.0f : 1.0f};
        const int mirrored = sign[0] * sign[1] * sign[2] < 0;
        uint32_t row = (uint32_t)eighth * (uint32_t)corners;
        for (int i = 0; i <= n; row += (uint32_t)(n + 1 - i), i++) {
            for (int k = 0; k <= n - i; k++, p += 3) {
                store(p, txm_vec3_normalize(txm_v3(sign[0] * (float)(n - i - k),
                                                   sign[1] * (float)i, sign[2] * (float)k)));
                const uint32_t a = row + (uint32_t)k, b = a + (uint32_t)(n + 1 - i);
                for (int half = 0; half < 2 && k + half < n - i; half++, t += 3) {
                    const uint32_t second = half ? b + 1 : b; /* b: in the next row */
                    t[0] = half ? b : a;
                    t[1] = mirrored ? a + 1 : second;
                    t[2] = mirrored ? second : a + 1;
                }
            }
        }
    }
    memcpy(m->normals, m->positions, m->vertex_count * 3 * sizeof(float));
    memset(m->colors, 255, m->vertex_count * 4);
    return 1;
}

/* ---- baking ------------------------------------------------------------------------------- */

/* What all copies have; their number of vertices and triangles. */
static int bake_allocate(const mesh_instances *t, int count, mesh_data *mesh) {
    int normals = 1, colors = 1, uvs = 1;
    size_t vertices = 0, triangles = 0, n, bytes;
    for (int i = 0; i < count; i++) {
        const mesh_data *m = t[i].mesh;
        normals &= m->normals != NULL;
        colors &= m->colors != NULL;
        uvs &= m->uvs != NULL;
        if (!txm_mul(m->vertex_count, t[i].count, 1, &n) || !txm_add(vertices, n, &vertices))
            return 0;
        if (!txm_mul(m->triangle_count, t[i].count, 1, &n) || !txm_add(triangles, n, &triangles))
            return 0;
    }
    if (vertices == 0 || vertices > 0x7fffffff || triangles > 0x7fffffff) return 0;
    if (!txm_mul(vertices, 3, sizeof(float), &bytes)) return 0;
    mesh->positions = (float *)malloc(bytes);
    if (normals) mesh->normals = (float *)malloc(bytes);
    if (colors) mesh->colors = (unsigned char *)malloc(4 * vertices);
    if (!txm_mul(triangles, 6, sizeof(float), &bytes)) return 0;
    if (triangles) mesh->indices = (uint32_t *)malloc(bytes / 2);
    if (triangles && uvs) mesh->uvs = (float *)malloc(bytes);
    mesh->vertex_count = vertices;
    mesh->triangle_count = triangles;
    return mesh->positions && (!normals || mesh->normals) && (!colors || mesh->colors) &&
           (!triangles || (mesh->indices && (!uvs || mesh->uvs)));
}

static txm_vec3 bake_normal(txm_quat q, const float *scale, const float *n) {
    txm_vec3 v = txm_v3(n[0], n[1], n[2]);
    if (scale) v = txm_v3(v.x / scale[0], v.y / scale[1], v.z / scale[2]);
    return txm_vec3_normalize(txm_quat_rotate(q, v));
}

int mesh_bake(const mesh_instances *t, int count, mesh_data *mesh, const char **why) {
    size_t vertex = 0, index = 0;
    memset(mesh, 0, sizeof *mesh);
    if (!bake_allocate(t, count, mesh)) {
        mesh_free(mesh);
        return *why = "too many copies for the memory, or none; write a .glb, which refers to them",
               0;
    }
    for (int i = 0; i < count; i++) {
        const mesh_data *m = t[i].mesh;
        for (size_t c = 0; c < t[i].count; c++) {
            const float *r = t[i].rotations ? t[i].rotations + 4 * c : NULL;
            const float *scale = t[i].scales ? t[i].scales + 3 * c : NULL;
            const float *move = t[i].translations + 3 * c;
            txm_quat q = {0, 0, 0, 1};
            if (r) {
                q.x = r[0];
                q.y = r[1];
                q.z = r[2];
                q.w = r[3];
            }
            const size_t base = vertex;
            for (size_t k = 0; k < m->vertex_count; k++, vertex++) {
                const float *p = m->positions + 3 * k;
                txm_vec3 v = txm_v3(p[0], p[1], p[2]);
                if (scale) v = txm_v3(v.x * scale[0], v.y * scale[1], v.z * scale[2]);
                v = txm_vec3_add(txm_quat_rotate(q, v), txm_v3(move[0], move[1], move[2]));
                store(mesh->positions + 3 * vertex, v);
                if (mesh->normals)
                    store(mesh->normals + 3 * vertex, bake_normal(q, scale, m->normals + 3 * k));
                if (mesh->colors) memcpy(mesh->colors + 4 * vertex, m->colors + 4 * k, 4);
            }
            if (mesh->uvs)
                memcpy(mesh->uvs + 2 * index, m->uvs, 6 * m->triangle_count * sizeof(float));
            for (size_t k = 0; k < 3 * m->triangle_count; k++)
                mesh->indices[index++] = (uint32_t)(base + m->indices[k]);
        }
    }
    return 1;
}
