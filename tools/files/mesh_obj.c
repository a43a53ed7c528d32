/* mesh_obj.c - OBJ files and their materials
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

/* ---- reading ----------------------------------------------------------------------------- */

/* Behind the last word of this line? */
static int at_end(const text *in) {
    return in->at == in->end || is_line_end(*in->at) || *in->at == '#';
}

/* The numbers of the rest of the line, at most so many; -1 if one of them is none. */
static int read_numbers(text *in, double *values, int most) {
    int n = 0;
    for (;;) {
        text_skip_blanks(in);
        if (at_end(in) || n == most) return n;
        if (!text_number(in, &values[n++])) return -1;
    }
}

/* What stands behind x y z: nothing, w, r g b, w r g b or r g b a, w r g b a. */
typedef struct obj_shade {
    float v[5];
    int count;
} obj_shade;

/* v x y z [w] [r g b [a]]; extra: a list of obj_shade, which begins with the first one that has any. */
static int read_obj_vertex(builder *b, text *in, list *extra) {
    double v[8];
    const size_t line = in->line;
    const int n = read_numbers(in, v, 8);
    if (n < 0) return builder_fail(b, line, "a coordinate is not a number");
    if (n < 3) return builder_fail(b, line, "a vertex has less than three coordinates");
    double *p = (double *)list_add(&b->positions, 1);
    if (!p) return builder_fail_memory(b);
    memcpy(p, v, 3 * sizeof *p);
    if (!builder_check_position(b, b->positions.count - 1, line)) return 0;
    if (n < 6) return 1;
    while (extra->count < b->positions.count) { /* none for those before that had none */
        obj_shade *s = (obj_shade *)list_add(extra, 1);
        if (!s) return builder_fail_memory(b);
        s->count = 0;
        if (extra->count < b->positions.count) continue;
        s->count = n - 3;
        for (int k = 0; k < s->count; k++) s->v[k] = (float)v[3 + k];
    }
    return 1;
}

static int read_obj_uv(builder *b, text *in) {
    double v[3];
    const size_t line = in->line;
    const int n = read_numbers(in, v, 3);
    float *uv = (float *)list_add(&b->uvs, 1);
    if (!uv) return builder_fail_memory(b);
    if (n < 1) return builder_fail(b, line, "a texture coordinate is not a number");
    uv[0] = (float)v[0];
    uv[1] = n > 1 ? (float)v[1] : 0;
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
        if (at_end(in)) break;
        int ok = read_obj_index(in, b->positions.count, &vertex);
        if (ok && in->at < in->end && *in->at == '/') {
            in->at++;
            if (in->at < in->end && *in->at != '/' && !text_at_word_end(in->at, in->end))
                ok = read_obj_index(in, b->uvs.count, &uv);
            if (ok && in->at < in->end && *in->at == '/') {
                in->at++; /* normals are not read, so any index will do */
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
    return builder_add_polygon(b, first, line);
}

/* Of four numbers behind x y z, is the first one w? It is if it is 1 in all of the file, and the last
   one, which may be alpha, is not. */
static int has_weights(const list *extra) {
    const obj_shade *s = (const obj_shade *)extra->items;
    int weights = 1, alphas = 1;
    for (size_t i = 0; i < extra->count; i++) {
        if (s[i].count != 4) continue;
        weights &= s[i].v[0] >= 1 && s[i].v[0] <= 1;
        alphas &= s[i].v[3] >= 1 && s[i].v[3] <= 1;
    }
    return weights && !alphas;
}

static int obj_colors_to_bytes(builder *b, const list *extra) {
    const obj_shade *from = (const obj_shade *)extra->items;
    const int weights = has_weights(extra);
    if (extra->count == 0) return 1;
    shade *shades = (shade *)malloc(b->positions.count * sizeof *shades);
    unsigned char *to = (unsigned char *)list_add(&b->colors, b->positions.count);
    if (!shades || !to) {
        free(shades);
        return builder_fail_memory(b);
    }
    for (size_t i = 0; i < b->positions.count; i++) {
        const int n = i < extra->count ? from[i].count : 0;
        const int first = n == 5 || (n == 4 && weights), has_alpha = n - first == 4;
        shades[i] = shade_none();
        if (n == 0) continue;
        for (int k = 0; k < 3; k++) shades[i].c[k] = from[i].v[first + k];
        shades[i].c[3] = has_alpha ? txm_maxf(from[i].v[first + 3], 0) : SHADE_OPAQUE;
    }
    b->left_out[LEFT_COLORS] += shades_to_bytes(shades, b->positions.count, 0, to);
    free(shades);
    return 1;
}

/* The rest of the line, without blanks at either end. */
static size_t read_obj_name(text *in, const char **name) {
    while (in->at < in->end && is_blank(*in->at)) in->at++;
    *name = in->at;
    while (in->at < in->end && !is_line_end(*in->at)) in->at++;
    const char *end = in->at;
    while (end > *name && is_blank(end[-1])) end--;
    return (size_t)(end - *name);
}

static int read_obj_material(builder *b, text *in) {
    const char *name;
    const size_t n = read_obj_name(in, &name);
    return builder_use_material(b, name, n);
}

/* The first one counts; the others are said to be left out. */
static int read_obj_library(builder *b, text *in) {
    const char *name;
    const size_t n = read_obj_name(in, &name);
    if (b->library.count || n == 0) {
        b->left_out[LEFT_LIBRARIES] += n > 0;
        return 1;
    }
    char *to = (char *)list_add(&b->library, n + 1);
    if (!to) return builder_fail_memory(b);
    memcpy(to, name, n);
    to[n] = 0;
    return 1;
}

/* The first word of a line; returns its length. */
static size_t read_obj_word(text *in, const char **word) {
    text_skip_blanks(in);
    *word = in->at;
    while (!text_at_word_end(in->at, in->end)) in->at++;
    return (size_t)(in->at - *word);
}

static int is_word(const char *word, size_t n, const char *other) {
    return n == strlen(other) && !memcmp(word, other, n);
}

/* Only lines of these numbers are joined; a name or a comment may end in a backslash of its own. */
static void skip_obj_line(text *in, const char *word, size_t n) {
    static const char *const numbers[] = {"v", "vt", "vn", "vp", "f", "fo", "l", "p"};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        if (!is_word(word, n, numbers[i])) continue;
        text_skip_rest(in);
        return;
    }
    text_skip_line(in);
}

int mesh_read_obj(builder *b, text *in) {
    list colors = list_of(sizeof(obj_shade));
    int ok = 1;
    in->joins = 1;
    while (ok && in->at < in->end) {
        const char *word;
        const size_t n = read_obj_word(in, &word);
        if (is_word(word, n, "v")) ok = read_obj_vertex(b, in, &colors);
        else if (is_word(word, n, "vt")) ok = read_obj_uv(b, in);
        else if (is_word(word, n, "f") || is_word(word, n, "fo")) ok = read_obj_face(b, in);
        else if (is_word(word, n, "usemtl")) ok = read_obj_material(b, in);
        else if (is_word(word, n, "mtllib")) ok = read_obj_library(b, in);
        if (ok) skip_obj_line(in, word, n);
    }
    ok = ok && obj_colors_to_bytes(b, &colors);
    list_free(&colors);
    if (ok && b->polygons.count == 0)
        return builder_fail(b, 0, "%s", b->positions.count
                                            ? "no faces in it"
                                            : "no vertices in it; give an OBJ, PLY, STL, OFF or GLB file");
    return ok;
}

/* ---- reading lines ------------------------------------------------------------------------ */

/* l v v v ..., or l v/vt v/vt ... */
static int read_obj_line(builder *b, text *in, const mesh_place *place, list *points,
                         list *firsts) {
    const size_t line = in->line, before = points->count;
    for (;;) {
        uint32_t vertex, uv;
        text_skip_blanks(in);
        if (at_end(in)) break;
        int ok = read_obj_index(in, b->positions.count, &vertex) && vertex < b->positions.count;
        if (ok && in->at < in->end && *in->at == '/') {
            in->at++;
            ok = read_obj_index(in, SIZE_MAX, &uv);
        }
        if (!ok || !text_at_word_end(in->at, in->end))
            return builder_fail(b, line, "a line with an index that is out of range or no number");
        float *p = (float *)list_add(points, 1);
        if (!p) return builder_fail_memory(b);
        const double *from = (const double *)b->positions.items + 3 * (size_t)vertex;
        for (int k = 0; k < 3; k++) {
            p[k] = mesh_place_in(place, from[k], k);
            if (!txm_is_finite((double)p[k]))
                return builder_fail(b, line, "a line with a point that is not finite");
        }
    }
    if (points->count < before + 2) return builder_fail(b, line, "a line with less than two points");
    size_t *first = (size_t *)list_add(firsts, 1);
    if (!first) return builder_fail_memory(b);
    *first = points->count;
    return 1;
}

int mesh_decode_lines(const unsigned char *bytes, size_t size, const mesh_place *place,
                      mesh_lines *lines, const char **why) {
    builder b;
    mesh_data message;
    text in = text_of(bytes, size);
    list colors = list_of(sizeof(obj_shade)), points = list_of(3 * sizeof(float));
    list firsts = list_of(sizeof(size_t));
    memset(lines, 0, sizeof *lines);
    memset(&message, 0, sizeof message);
    builder_init(&b, &message, why);
    in.joins = 1;
    size_t *first = (size_t *)list_add(&firsts, 1);
    int ok = first ? 1 : builder_fail_memory(&b);
    if (first) *first = 0;
    while (ok && in.at < in.end) {
        const char *word;
        const size_t n = read_obj_word(&in, &word);
        if (is_word(word, n, "v")) ok = read_obj_vertex(&b, &in, &colors);
        else if (is_word(word, n, "l")) ok = read_obj_line(&b, &in, place, &points, &firsts);
        if (ok) skip_obj_line(&in, word, n);
    }
    if (ok && firsts.count == 1) ok = builder_fail(&b, 0, "no lines in it; lines begin with an l");
    if (ok) {
        lines->count = firsts.count - 1;
        lines->points = (float *)points.items;
        lines->first = (size_t *)firsts.items;
    } else {
        list_free(&points);
        list_free(&firsts);
        if (*why == message.message) {
            memcpy(lines->message, message.message, sizeof lines->message);
            *why = lines->message;
        }
    }
    list_free(&colors);
    builder_free(&b);
    mesh_free(&message);
    return ok;
}

void mesh_lines_free(mesh_lines *lines) {
    free(lines->points);
    free(lines->first);
    lines->points = NULL;
    lines->first = NULL;
    lines->count = 0;
}

/* ---- writing ----------------------------------------------------------------------------- */

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

/* How many numbers of a color the vertices have: alpha only if some of it is not opaque. */
static size_t color_width(const mesh_data *m) {
    if (!m->colors) return 0;
    for (size_t i = 0; i < m->vertex_count; i++) {
        if (m->colors[4 * i + 3] != 255) return 4;
    }
    return 3;
}

static void print_obj_vertices(sink *s, const mesh_data *m, const mesh_place *place,
                               const split *uvs, const split *normals, size_t normal_count) {
    const size_t width = color_width(m);
    const int digits = place_digits(place, m);
    for (size_t i = 0; i < m->vertex_count; i++) {
        const float *p = m->positions + 3 * i;
        sink_print(s, "v %.*g %.*g %.*g", digits, mesh_place_out(place, p[0], 0), digits,
                   mesh_place_out(place, p[1], 1), digits, mesh_place_out(place, p[2], 2));
        for (size_t k = 0; k < width; k++)
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
    print_obj_vertices(s, m, &scene->place, &uvs, &normals, normal_count);
    const int is_named = scene->library || m->materials; /* a name for all, or of each triangle */
    if (is_named && !m->materials) sink_print(s, "usemtl %.60s\n", part->material->name);
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        const size_t v = m->indices[c] + 1, t = c / 3;
        if (c % 3 == 0 && m->materials && (t == 0 || m->materials[t] != m->materials[t - 1])) {
            sink_print(s, "usemtl ");
            print_name(s, mesh_material_name(m, m->materials[t]));
        }
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

int mesh_write_obj(const mesh_scene *scene, sink *s) {
    obj_counts counts = {0, 0, 0};
    mesh_material own;
    const char *library = scene->library;
    if (!library && scene->surface && scene->surface->materials) library = scene->surface->library;
    if (library) {
        sink_print(s, "mtllib ");
        print_name(s, library);
    }
    for (int i = 0; i < scene_part_count(scene); i++) {
        const mesh_part part = scene_part(scene, i, &own);
        if (!encode_obj_part(scene, &part, &counts, s)) return 0;
    }
    return 1;
}

static void print_material(sink *s, const char *name, const mesh_material *m) {
    sink_print(s, "newmtl ");
    print_name(s, name);
    sink_print(s, "Ka 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 1\n");
    if (!m->texture) return;
    sink_print(s, "map_Kd ");
    print_name(s, m->texture);
    if (!m->is_cut_out) return;
    sink_print(s, "map_d ");
    print_name(s, m->texture);
}

int mesh_encode_mtl(const mesh_scene *scene, unsigned char **bytes, size_t *size,
                    const char **why) {
    sink s = sink_new();
    mesh_material own;
    for (int i = 0; i < scene_part_count(scene); i++) {
        const mesh_part part = scene_part(scene, i, &own);
        const size_t count = part.mesh->materials ? part.mesh->material_count : 0;
        for (size_t k = 0; k < count; k++)
            print_material(&s, mesh_material_name(part.mesh, k), part.material);
        if (count == 0) print_material(&s, part.material->name, part.material);
    }
    return sink_finish(&s, bytes, size, why);
}
