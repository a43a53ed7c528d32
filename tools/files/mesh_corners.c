/* mesh_corners.c - equal corners share a vertex when a mesh is written
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

void split_free(split *s) {
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
    if ((by & BY_FACE) && memcmp(m->face_colors + 4 * (a / 3), m->face_colors + 4 * (b / 3), 4) != 0)
        return 0;
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
    if (by & BY_FACE) {
        memcpy(bits, m->face_colors + 4 * (c / 3), sizeof bits[0]);
        key = txm_hash(key ^ bits[0]);
    }
    if (by & BY_NORMAL) { /* two of the three suffice */
        memcpy(bits, m->corner_normals + 3 * c, sizeof bits);
        key = txm_hash(key ^ ((uint64_t)bits[0] << 32 | bits[1]));
    }
    return key;
}

/* A hash table with at least two places per corner and linear probing. */
int split_corners(const mesh_data *m, int by, split *s) {
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

/* ---- seams ------------------------------------------------------------------------------- */

#define UV_ROUNDING 1e-5 /* texture coordinates that differ by less are the same: a tenth of a pixel of a
                            picture 10,000 pixels wide */
#define UV_CELL 1e-3     /* of the grid in which they are looked for */

/* The place of a corner, its material, and the cell of its texture coordinates, shifted by the rounding
   times -1, 0 or 1. */
static uint64_t hash_seam(const mesh_data *m, size_t c, int right, int down) {
    const float *p = m->positions + 3 * (size_t)m->indices[c];
    uint64_t key = m->materials ? txm_hash(m->materials[c / 3]) : 0;
    for (int k = 0; k < 3; k++) {
        const float x = p[k] + 0.0f; /* -0 becomes 0 */
        uint32_t bits;
        memcpy(&bits, &x, sizeof bits);
        key = txm_hash(key ^ bits);
    }
    for (int k = 0; k < 2 && m->uvs; k++) {
        const double shift = UV_ROUNDING * (k ? down : right);
        const double cell = floor(((double)m->uvs[2 * c + (size_t)k] + shift) / UV_CELL) + 0.0;
        uint64_t bits;
        memcpy(&bits, &cell, sizeof bits);
        key = txm_hash(key ^ bits);
    }
    return key;
}

static int is_same_seam(const mesh_data *m, size_t a, size_t b) {
    const float *p = m->positions + 3 * (size_t)m->indices[a];
    const float *q = m->positions + 3 * (size_t)m->indices[b];
    if (m->materials && m->materials[a / 3] != m->materials[b / 3]) return 0;
    for (size_t k = 0; k < 2 && m->uvs; k++) {
        if (fabs((double)m->uvs[2 * a + k] - (double)m->uvs[2 * b + k]) > UV_ROUNDING) return 0;
    }
    return same_floats(p, q, 3);
}

/* The first corner before c that is the same but for rounding; else NO_UV. */
static uint32_t find_seam(const mesh_data *m, const uint32_t *table, size_t size, size_t c) {
    size_t at = (size_t)hash_seam(m, c, 0, 0) & (size - 1);
    while (table[at] != NO_UV && !is_same_seam(m, table[at], c)) at = (at + 1) & (size - 1);
    return table[at];
}

int mesh_seams(mesh_data *m, uint32_t *seams) {
    const size_t corners = 3 * m->triangle_count;
    size_t size = 16, bytes;
    while (size < 8 * corners) size *= 2; /* each corner in up to four cells, half of it free   */
    if (!txm_mul(size, sizeof(uint32_t), 1, &bytes)) return 0;
    uint32_t *table = (uint32_t *)malloc(bytes);
    if (!table) return 0;
    memset(table, 255, bytes);
    for (size_t c = 0; c < corners; c++) {
        const uint32_t same = find_seam(m, table, size, c);
        seams[c] = same == NO_UV ? (uint32_t)c : same;
        if (same != NO_UV && m->uvs)
            memcpy(m->uvs + 2 * c, m->uvs + 2 * (size_t)same, 2 * sizeof(float));
        for (int side = 0; side < 4 && same == NO_UV; side++) {
            size_t at = (size_t)hash_seam(m, c, side & 1 ? 1 : -1, side & 2 ? 1 : -1) & (size - 1);
            while (table[at] != NO_UV && table[at] != c) at = (at + 1) & (size - 1);
            table[at] = (uint32_t)c;
        }
    }
    free(table);
    return 1;
}

/* ---- meshes as formats have them --------------------------------------------------------- */

int flat_make(const mesh_data *m, int kept, flat_mesh *f) {
    const int by = (m->uvs ? BY_UV : 0) | (m->corner_normals ? kept & BY_NORMAL : 0) |
                   (m->face_colors ? kept & BY_FACE : 0);
    memset(f, 0, sizeof *f);
    f->mesh = m;
    f->count = m->vertex_count;
    if (!by) return 1;
    if (!split_corners(m, by | BY_VERTEX, &f->split)) return 0;
    f->count = f->split.count;
    return 1;
}

size_t flat_vertex(const flat_mesh *f, size_t i) {
    return f->split.first ? f->mesh->indices[f->split.first[i]] : i;
}

const float *flat_uv(const flat_mesh *f, size_t i) {
    return f->mesh->uvs + 2 * (size_t)f->split.first[i];
}

const unsigned char *flat_color(const flat_mesh *f, size_t i) {
    if (f->mesh->colors) return f->mesh->colors + 4 * flat_vertex(f, i);
    return f->mesh->face_colors + 4 * (size_t)(f->split.first[i] / 3);
}

uint32_t flat_index(const flat_mesh *f, size_t corner_index) {
    return f->split.index ? f->split.index[corner_index] : f->mesh->indices[corner_index];
}
