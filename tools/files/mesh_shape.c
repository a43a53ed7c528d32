/* mesh_shape.c - meshes made and changed: normals at creases, spheres, baked copies
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_io.h"

/* ---- normals and spheres ----------------------------------------------------------------- */

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

/* An octahedron whose eight faces are subdivided and projected onto the sphere. */
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

/* ---- baking ------------------------------------------------------------------------------ */

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

static txm_vec3 turned(txm_quat q, txm_vec3 v) {
    const txm_dvec3 r = txm_quat_rotate(q, txm_d3(v.x, v.y, v.z));
    return txm_v3(txm_float(r.x), txm_float(r.y), txm_float(r.z));
}

static txm_vec3 bake_normal(txm_quat q, const float *scale, const float *n) {
    txm_vec3 v = txm_v3(n[0], n[1], n[2]);
    if (scale) v = txm_v3(v.x / scale[0], v.y / scale[1], v.z / scale[2]);
    return txm_vec3_normalize(turned(q, v));
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
                v = txm_vec3_add(turned(q, v), txm_v3(move[0], move[1], move[2]));
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
