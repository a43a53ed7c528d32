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

int flat_make(const mesh_data *m, int with_corner_normals, flat_mesh *f) {
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

size_t flat_vertex(const flat_mesh *f, size_t i) {
    return f->split.first ? f->mesh->indices[f->split.first[i]] : i;
}

const float *flat_uv(const flat_mesh *f, size_t i) {
    return f->mesh->uvs + 2 * (size_t)f->split.first[i];
}

uint32_t flat_index(const flat_mesh *f, size_t corner_index) {
    return f->split.index ? f->split.index[corner_index] : f->mesh->indices[corner_index];
}
