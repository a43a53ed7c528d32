/* mesh_stl.c - STL files, ascii and binary
   SPDX-License-Identifier: MIT OR Unlicense

   Each triangle has three vertices of its own; equal ones are made one.                         */
#include "mesh_file.h"

enum {
    HEADER_BYTES = 80, /* of a binary file: any text, which may begin with "solid" as well */
    FACET_BYTES = 50,  /* a normal, three corners, two bytes that may hold anything        */
    DATA_START = HEADER_BYTES + 4
};

/* ---- which of the two -------------------------------------------------------------------- */

/* How many triangles a binary file says that it has. */
static uint64_t facets_told(const unsigned char *bytes) {
    return u32_at(bytes + HEADER_BYTES);
}

int stl_has_size(const unsigned char *bytes, size_t size) {
    return size > DATA_START && DATA_START + FACET_BYTES * facets_told(bytes) == size;
}

int stl_may_be(const unsigned char *bytes, size_t size) {
    return size >= DATA_START && memchr(bytes, 0, DATA_START) != NULL;
}

/* ---- equal vertices ---------------------------------------------------------------------- */

/* The distinct vertices so far, by a hash with linear probing; at least half of it is empty. */
typedef struct vertex_table {
    uint32_t *slots; /* vertex numbers, or NO_VERTEX */
    size_t size;     /* a power of two */
} vertex_table;

static size_t slot_of(const vertex_table *t, const double *p) {
    uint64_t key = 0;
    for (int k = 0; k < 3; k++) {
        const double value = p[k] + 0.0; /* -0 is 0 */
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        key = txm_hash(key ^ bits);
    }
    return (size_t)key & (t->size - 1);
}

/* Make the table twice as large; 0: no memory. */
static int grow_table(vertex_table *t, const double *positions, size_t count) {
    vertex_table larger;
    size_t bytes;
    larger.size = t->size ? 2 * t->size : 64;
    if (!txm_mul(larger.size, sizeof(uint32_t), 1, &bytes)) return 0;
    larger.slots = (uint32_t *)malloc(bytes);
    if (!larger.slots) return 0;
    memset(larger.slots, 255, bytes);
    for (size_t i = 0; i < count; i++) {
        size_t at = slot_of(&larger, positions + 3 * i);
        while (larger.slots[at] != NO_VERTEX) at = (at + 1) & (larger.size - 1);
        larger.slots[at] = (uint32_t)i;
    }
    free(t->slots);
    *t = larger;
    return 1;
}

/* Add a corner at this position; its vertex is new only if none is there. */
static int add_corner(builder *b, vertex_table *t, const double *p, size_t line) {
    const size_t count = b->positions.count;
    if (2 * (count + 1) > t->size && !grow_table(t, (const double *)b->positions.items, count))
        return builder_fail_memory(b);
    const double *positions = (const double *)b->positions.items;
    size_t at = slot_of(t, p);
    while (t->slots[at] != NO_VERTEX) {
        const double *q = positions + 3 * (size_t)t->slots[at];
        if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2]) break; /* one that is no number never is */
        at = (at + 1) & (t->size - 1);
    }
    if (t->slots[at] == NO_VERTEX) {
        double *to = count < NO_VERTEX ? (double *)list_add(&b->positions, 1) : NULL;
        if (!to) return builder_fail_memory(b);
        memcpy(to, p, 3 * sizeof *to);
        if (!builder_check_position(b, count, line)) return 0;
        t->slots[at] = (uint32_t)count;
    }
    corner *c = (corner *)list_add(&b->corners, 1);
    if (!c) return builder_fail_memory(b);
    c->vertex = t->slots[at];
    c->uv = NO_UV;
    return 1;
}

/* ---- reading ----------------------------------------------------------------------------- */

static int read_facet(builder *b, vertex_table *t, const unsigned char *facet) {
    const size_t first = b->corners.count;
    for (int c = 0; c < 3; c++) {
        double p[3];
        for (int k = 0; k < 3; k++) {
            const uint32_t bits = u32_at(facet + 12 + 12 * c + 4 * k); /* behind the normal */
            float value;
            memcpy(&value, &bits, sizeof value);
            p[k] = (double)value;
        }
        if (!add_corner(b, t, p, 0)) return 0;
    }
    b->left_out[LEFT_FACET_BYTES] += facet[48] || facet[49];
    return builder_add_polygon(b, first, 0);
}

int mesh_read_stl_binary(builder *b, const unsigned char *bytes, size_t size) {
    vertex_table t = {NULL, 0};
    const uint64_t count = facets_told(bytes);
    int ok = 1;
    if (count == 0) return builder_fail(b, 0, "no triangles in it");
    if (count > (size - DATA_START) / FACET_BYTES)
        return builder_fail(b, 0, "an STL file that ends too early, or no mesh; get a whole copy");
    for (size_t i = 0; i < count && ok; i++)
        ok = read_facet(b, &t, bytes + DATA_START + FACET_BYTES * i);
    free(t.slots);
    return ok;
}

/* The next word, in lower case; what is too long is cut off. */
static void next_word(text *in, char word[12]) {
    size_t n = 0;
    for (text_skip_space(in); in->at < in->end && !is_blank(*in->at) && !is_line_end(*in->at);
         in->at++) {
        if (n < 11) word[n++] = (char)(*in->at >= 'A' && *in->at <= 'Z' ? *in->at + 32 : *in->at);
    }
    word[n] = 0;
}

static int read_vertex(builder *b, vertex_table *t, text *in) {
    double p[3];
    for (int k = 0; k < 3; k++) {
        text_skip_space(in);
        if (!text_number(in, &p[k]))
            return builder_fail(b, in->line, "a vertex without three numbers");
    }
    return add_corner(b, t, p, in->line);
}

/* Words in any lines: a loop of vertices is a polygon. Names, which may be anything, end a line. */
int mesh_read_stl_text(builder *b, text *in) {
    vertex_table t = {NULL, 0};
    size_t first = 0, line = 0;
    int ok = 1, is_open = 0; /* between facet or outer, and endloop */
    while (ok) {
        char word[12];
        next_word(in, word);
        if (word[0] == 0) break;
        if (!strcmp(word, "solid") || !strcmp(word, "endsolid")) {
            text_skip_line(in);
        } else if (!strcmp(word, "vertex")) {
            ok = read_vertex(b, &t, in);
        } else if (!strcmp(word, "facet") || !strcmp(word, "outer")) {
            if (!is_open) line = in->line;
            is_open = 1;
        } else if (is_open && (!strcmp(word, "endloop") || !strcmp(word, "endfacet"))) {
            ok = builder_add_polygon(b, first, line);
            first = b->corners.count;
            is_open = 0;
        }
    }
    free(t.slots);
    if (ok && is_open && b->corners.count > first)
        return builder_fail(b, in->line, "the file ends too early; get a whole copy");
    if (ok && b->polygons.count == 0) return builder_fail(b, 0, "no triangles in it");
    return ok;
}

/* ---- writing ----------------------------------------------------------------------------- */

/* The unit normal of a triangle, or 0 0 0. */
static void normal_of(const float *a, const float *b, const float *c, float normal[3]) {
    double u[3], v[3], n[3], length = 0;
    for (int k = 0; k < 3; k++) {
        u[k] = (double)b[k] - (double)a[k];
        v[k] = (double)c[k] - (double)a[k];
    }
    for (int k = 0; k < 3; k++) {
        n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
        length += n[k] * n[k];
    }
    length = sqrt(length);
    for (int k = 0; k < 3; k++) normal[k] = length > 0 ? (float)(n[k] / length) : 0;
}

static void put_facet(sink *s, const mesh_place *place, const float *normal,
                      const float *const corners[3]) {
    sink_floats(s, normal, 3);
    for (int c = 0; c < 3; c++) {
        float p[3];
        for (int k = 0; k < 3; k++) p[k] = (float)mesh_place_out(place, corners[c][k], k);
        sink_floats(s, p, 3);
    }
    sink_u16(s, 0);
}

static void print_facet(sink *s, const mesh_place *place, int digits, const float *normal,
                        const float *const corners[3]) {
    sink_print(s, "facet normal %.6g %.6g %.6g\nouter loop\n", (double)normal[0],
               (double)normal[1], (double)normal[2]);
    for (int c = 0; c < 3; c++)
        sink_print(s, "vertex %.*g %.*g %.*g\n", digits, mesh_place_out(place, corners[c][0], 0),
                   digits, mesh_place_out(place, corners[c][1], 1), digits,
                   mesh_place_out(place, corners[c][2], 2));
    sink_print(s, "endloop\nendfacet\n");
}

/* Binary; in text where floats would lose the shape, as a binary file has nothing else. */
int mesh_write_stl(const mesh_scene *scene, sink *s) {
    static const char header[HEADER_BYTES] = "made by texkit";
    const int is_binary = place_is_plain(&scene->place);
    mesh_material own;
    size_t triangles = 0;
    for (int i = 0; i < scene_part_count(scene); i++)
        triangles += scene_part(scene, i, &own).mesh->triangle_count;
    if (triangles > 0xffffffffu) return 0;
    if (is_binary) {
        sink_put(s, header, sizeof header);
        sink_u32(s, (uint32_t)triangles);
    } else {
        sink_print(s, "solid texkit\n");
    }
    for (int i = 0; i < scene_part_count(scene); i++) {
        const mesh_data *m = scene_part(scene, i, &own).mesh;
        const int digits = place_digits(&scene->place, m);
        for (size_t t = 0; t < m->triangle_count; t++) {
            const float *corners[3];
            float normal[3];
            for (size_t k = 0; k < 3; k++)
                corners[k] = m->positions + 3 * (size_t)m->indices[3 * t + k];
            normal_of(corners[0], corners[1], corners[2], normal);
            if (is_binary) put_facet(s, &scene->place, normal, corners);
            else print_facet(s, &scene->place, digits, normal, corners);
        }
    }
    if (!is_binary) sink_print(s, "endsolid texkit\n");
    return 1;
}
