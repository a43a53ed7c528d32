/* mesh_off.c - OFF files, as Geomview and others write them
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

enum { MOST_NUMBERS = 12 }; /* of a vertex: position, normal, four of a color, two of a texture */

/* What each vertex has, as the first word says: STCNOFF has all. */
typedef struct off_kind {
    int has_uv, has_color, has_normal;
} off_kind;

/* ---- the first word ---------------------------------------------------------------------- */

/* To the next word, over lines and comments. */
static void skip_space(text *in) {
    for (text_skip_space(in); in->at < in->end && *in->at == '#'; text_skip_space(in))
        text_skip_line(in);
}

/* Read [ST][C][N][4][n]OFF; 0: it is something else. */
static int read_kind(text *in, off_kind *kind, int *is_3d) {
    const char *p = in->at;
    const size_t left = (size_t)(in->end - p);
    memset(kind, 0, sizeof *kind);
    *is_3d = 1;
    if (left > 2 && p[0] == 'S' && p[1] == 'T') {
        kind->has_uv = 1;
        p += 2;
    }
    if (p < in->end && *p == 'C') kind->has_color = *p++ == 'C';
    if (p < in->end && *p == 'N') kind->has_normal = *p++ == 'N';
    if (p < in->end && *p == '4') *is_3d = *p++ != '4';
    if (p < in->end && *p == 'n') *is_3d = *p++ != 'n';
    if (in->end - p < 3 || memcmp(p, "OFF", 3) != 0) return 0;
    p += 3;
    if (!text_at_word_end(p, in->end) && *p != '#') return 0;
    in->at = p;
    return 1;
}

int off_begins(const text *in) {
    text copy = *in;
    off_kind kind;
    int is_3d;
    skip_space(&copy);
    return read_kind(&copy, &kind, &is_3d);
}

/* ---- numbers ----------------------------------------------------------------------------- */

/* The next number, on whichever line. */
static int read_number(const builder *b, text *in, double *value) {
    skip_space(in);
    if (in->at == in->end)
        return builder_fail(b, in->line, "the file ends too early; get a whole copy");
    if (!text_number(in, value)) return builder_fail(b, in->line, "not a number");
    return 1;
}

/* A whole number of 0 to 2^31 - 1. */
static int read_count(const builder *b, text *in, const char *what, uint32_t *count) {
    double value;
    if (!read_number(b, in, &value)) return 0;
    if (!(value >= 0 && value < 2147483648.0) || value != floor(value))
        return builder_fail(b, in->line, "%s that is out of range or no whole number", what);
    *count = (uint32_t)value;
    return 1;
}

/* ---- vertices and faces ------------------------------------------------------------------ */

/* A vertex takes a line: x y z, a normal, a color of three or four, two of a texture. What the first
   word does not tell of is a color, as many programs leave out the C. */
static int read_vertex(builder *b, const off_kind *kind, text *in, list *colors) {
    double v[MOST_NUMBERS];
    int n = 0;
    skip_space(in);
    const size_t line = in->line;
    if (in->at == in->end)
        return builder_fail(b, line, "the file ends too early; get a whole copy");
    for (text_skip_blanks(in); in->at < in->end && !is_line_end(*in->at) && *in->at != '#' &&
                               n < MOST_NUMBERS;
         text_skip_blanks(in)) {
        if (!text_number(in, &v[n++])) return builder_fail(b, line, "not a number");
    }
    text_skip_line(in);
    if (n < 3) return builder_fail(b, line, "a vertex has less than three coordinates");
    double *p = (double *)list_add(&b->positions, 1);
    if (!p) return builder_fail_memory(b);
    memcpy(p, v, 3 * sizeof *p);
    if (!builder_check_position(b, b->positions.count - 1, line)) return 0;
    int at = 3, end = n;
    if (kind->has_normal && end - at >= 3) {
        float *to = (float *)list_add(&b->normals, 1);
        if (!to) return builder_fail_memory(b);
        for (int k = 0; k < 3; k++) to[k] = (float)v[at++];
    }
    if (kind->has_uv && end - at >= 2) {
        float *to = (float *)list_add(&b->uvs, 1);
        if (!to) return builder_fail_memory(b);
        end -= 2;
        to[0] = (float)v[end];
        to[1] = (float)v[end + 1];
    }
    if (end - at < 3) return 1;
    shade *s = (shade *)list_add(colors, 1);
    if (!s) return builder_fail_memory(b);
    s->c[3] = SHADE_OPAQUE;
    for (int k = 0; k < 4 && at < end; k++) s->c[k] = (float)v[at++];
    if (s->c[3] < 0 && s->c[3] > SHADE_OPAQUE) s->c[3] = 0;
    return 1;
}

/* Behind the corners of a face: a color of three or four numbers, or the number of one of a map of
   colors that no file holds. */
static int read_face_color(text *in, shade *s) {
    double v[4];
    int n = 0;
    while (n < 4) {
        text_skip_blanks(in);
        if (in->at == in->end || is_line_end(*in->at) || *in->at == '#') break;
        if (!text_number(in, &v[n])) break;
        n++;
    }
    for (int k = 0; k < n && n >= 3; k++) s->c[k] = (float)v[k];
    if (n == 4) s->c[3] = txm_maxf(s->c[3], 0);
    return n >= 3;
}

static int read_face(builder *b, text *in, int has_uv) {
    const size_t first = b->corners.count;
    uint32_t n;
    skip_space(in);
    const size_t line = in->line;
    if (!read_count(b, in, "a face with a number of corners", &n)) return 0;
    if (n > (size_t)(in->end - in->at))
        return builder_fail(b, line, "a face is longer than the file; get a whole copy");
    corner *c = (corner *)list_add(&b->corners, n);
    if (!c) return builder_fail_memory(b);
    for (uint32_t k = 0; k < n; k++) {
        if (!read_count(b, in, "a face with an index", &c[k].vertex)) return 0;
        c[k].uv = has_uv ? c[k].vertex : NO_UV;
    }
    const size_t before = b->polygons.count;
    shade s = {{0, 0, 0, SHADE_OPAQUE}};
    const int found = read_face_color(in, &s);
    text_skip_line(in);
    if (!builder_add_polygon(b, first, line)) return 0;
    return found && b->polygons.count > before ? builder_face_shade(b, &s) : 1;
}

static int take_colors(builder *b, const list *colors) {
    unsigned char *to = (unsigned char *)list_add(&b->colors, colors->count);
    if (!to) return builder_fail_memory(b);
    b->left_out[LEFT_COLORS] += shades_to_bytes((shade *)colors->items, colors->count, 0, to);
    return 1;
}

/* ---- the file ---------------------------------------------------------------------------- */

int mesh_read_off(builder *b, text *in) {
    list colors = list_of(sizeof(shade));
    off_kind kind;
    int is_3d;
    uint32_t vertices, faces;
    skip_space(in);
    if (!read_kind(in, &kind, &is_3d)) return builder_fail(b, in->line, "the word OFF is missing");
    if (!is_3d) return builder_fail(b, in->line, "an OFF of more than three dimensions");
    skip_space(in);
    if (in->end - in->at >= 6 && !memcmp(in->at, "BINARY", 6))
        return builder_fail(b, in->line, "a binary OFF is not read; save it as text");
    if (!read_count(b, in, "a number of vertices", &vertices) ||
        !read_count(b, in, "a number of faces", &faces))
        return 0;
    text_skip_line(in); /* a number of edges, which nobody fills in */
    int ok = 1;
    for (uint32_t i = 0; i < vertices && ok; i++) ok = read_vertex(b, &kind, in, &colors);
    const int has_uv = ok && b->uvs.count == vertices;
    for (uint32_t i = 0; i < faces && ok; i++) ok = read_face(b, in, has_uv);
    if (ok && colors.count && colors.count == vertices) ok = take_colors(b, &colors);
    if (b->normals.count != vertices) b->normals.count = 0;
    list_free(&colors);
    if (ok && vertices == 0) return builder_fail(b, 0, "no vertices in it");
    if (ok && b->polygons.count == 0) return builder_fail(b, 0, "no faces in it");
    return ok;
}
