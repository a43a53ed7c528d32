/* test_treepieces_mesh.c - trees: levels of detail, the tessellator, baked meshes and their bark
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include "treepieces.h"

#include "growkit.h"

enum { MOST_POINTS = 4 * 64 + 63 * 63, MOST_TRIANGLES = 2 * 64 * 64 + 4 * 64, SHEET = 512 };

/* A tree of a preset, with its bones. */
static grown grow_preset(int preset, int pieces, float pose_amount, uint64_t seed) {
    treepieces_species species;
    treepieces_forest_desc d = describe(1, pieces);
    const char *text = treepieces_preset_text(preset);
    assert_int_equal(treepieces_species_parse(text, strlen(text), NULL, &species), TXM_OK);
    d.species = &species;
    d.seed = seed;
    return grow_posed(&d, pose_amount, 0);
}

/* its first tree, without tessellation */
static treepieces_bake_desc describe_bake(const grown *g) {
    treepieces_bake_desc d;
    memset(&d, 0, sizeof d);
    d.forest = g->forest;
    d.bones = g->bones;
    return d;
}

static int compare_keys(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* The sides of triangles as sorted keys: from << 32 | to. */
static uint64_t *sort_sides(const uint32_t *indices, size_t corners) {
    uint64_t *sides = (uint64_t *)room(corners, sizeof *sides);
    for (size_t i = 0; i < corners; i++)
        sides[i] = (uint64_t)indices[i] << 32 | indices[i % 3 == 2 ? i - 2 : i + 1];
    qsort(sides, corners, sizeof *sides, compare_keys);
    return sides;
}

static int has_side(const uint64_t *sides, size_t count, uint32_t from, uint32_t to) {
    const uint64_t key = (uint64_t)from << 32 | to;
    return bsearch(&key, sides, count, sizeof key, compare_keys) != NULL;
}

/* ---- the pattern --------------------------------------------------------------------------- */

/* One pattern: the vertices are where they should be, the triangles have the same orientation, fill
   the square and leave no crack: every side except those of the border belongs to two triangles. */
static void check_pattern(const int edges[4], int inner) {
    static float coords[2 * MOST_POINTS];
    static uint16_t indices[3 * MOST_TRIANGLES];
    static uint32_t wide[3 * MOST_TRIANGLES];
    int triangles, counted;
    const int points = treepieces_pattern(edges, inner, coords, indices, &triangles);
    assert_int_equal(treepieces_pattern(edges, inner, NULL, NULL, &counted), points);
    assert_int_equal(triangles, counted);
    assert_true(points <= MOST_POINTS && triangles <= MOST_TRIANGLES);
    double area = 0;
    for (int t = 0; t < triangles; t++) {
        const float *p[3];
        for (int k = 0; k < 3; k++) {
            assert_true(indices[3 * t + k] < points);
            p[k] = coords + 2 * indices[3 * t + k];
            wide[3 * t + k] = indices[3 * t + k];
        }
        /* (0, 0), (0, 1), (1, 1) is counter-clockwise from outside: v points down */
        const double twice = (double)(p[1][1] - p[0][1]) * (double)(p[2][0] - p[0][0]) -
                             (double)(p[1][0] - p[0][0]) * (double)(p[2][1] - p[0][1]);
        assert_true(twice > 0);
        area += twice / 2;
    }
    assert_true(fabs(area - 1) < 1e-6);
    uint64_t *sides = sort_sides(wide, 3 * (size_t)triangles);
    int border = 0;
    for (int i = 0; i < 3 * triangles; i++) {
        if (i) assert_true(sides[i] != sides[i - 1]);
        const uint32_t a = (uint32_t)(sides[i] >> 32), b = (uint32_t)sides[i];
        if (has_side(sides, 3 * (size_t)triangles, b, a)) continue;
        const float *p = coords + 2 * a, *q = coords + 2 * b;
        assert_true((p[0] == q[0] && (p[0] == 0 || p[0] == 1)) ||
                    (p[1] == q[1] && (p[1] == 0 || p[1] == 1)));
        border++;
    }
    const int outer = edges[0] + edges[1] + edges[2] + edges[3];
    const int inside = inner == 1 && outer > 4 ? 2 : inner; /* as OpenGL has it */
    assert_int_equal(border, outer);
    assert_int_equal(points, outer + (inside - 1) * (inside - 1));
    free(sides);
    for (int i = outer; i < points; i++) /* the grid, column by column */
        for (int axis = 0; axis < 2; axis++) {
            const int step = 1 + (axis ? (i - outer) % (inside - 1) : (i - outer) / (inside - 1));
            const float place = (float)step / (float)inside;
            /* the step is rounded to 2^-16, as on graphics cards, then multiplied */
            assert_true(fabsf(coords[2 * i + axis] - place) < 4e-6f * (float)inside + 1e-6f);
        }
    for (int k = 0, first = 0; k < 4; first += edges[k++]) /* positions along sides, symmetric */
        for (int i = 1; i < edges[k]; i++) {
            const float *a = coords + 2 * (first + i), *b = coords + 2 * (first + edges[k] - i);
            const int axis = k == 0 || k == 2;
            assert_true(a[axis] == 1 - b[axis] && b[axis] == 1 - a[axis]);
            const float along = k < 2 ? a[axis] : 1 - a[axis];
            assert_true(fabsf(along - (float)i / (float)edges[k]) < 4e-6f * (float)edges[k] + 1e-6f);
        }
}

static void test_pattern(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(3, 0);
    for (int i = 0; i < 10000; i++) { /* all levels of edges, each with one inner level */
        const int edges[4] = {1 + i % 10, 1 + i / 10 % 10, 1 + i / 100 % 10, 1 + i / 1000};
        check_pattern(edges, 1 + (i + i / 10 + i / 100 + i / 1000) % 10);
    }
    for (int i = 0; i < 60; i++) {
        int edges[4];
        for (int k = 0; k < 4; k++) edges[k] = txm_rng_range(&rng, 1, 64);
        check_pattern(edges, txm_rng_range(&rng, 1, 64));
    }
    const int one[4] = {1, 1, 1, 1};
    int triangles;
    assert_int_equal(treepieces_pattern(one, 1, NULL, NULL, &triangles), 4);
    assert_int_equal(triangles, 2);
}

/* Two quads that share an edge, in all orientations: the same level there, and the same points to
   the bit. */
static void test_shared_edges(void **state) {
    (void)state;
    txm_rng rng = txm_rng_make(8, 0);
    const treepieces_lod lod = {{0.3f, -0.2f, 0.1f}, 10, 0.8f, 0};
    static float coords[2][2 * MOST_POINTS];
    static const int other_inner[4] = {1, 3, 6, 9};
    for (int trial = 0; trial < 400; trial++) {
        float p[2][12], n[2][12];
        const int side[2] = {trial & 3, trial >> 2 & 3};
        for (int i = 0; i < 12; i++)
            for (int q = 0; q < 2; q++) {
                p[q][i] = 2 * txm_rng_float(&rng) - 1;
                n[q][i] = 2 * txm_rng_float(&rng) - 1;
            }
        for (int q = 0; q < 2; q++)
            for (int c = 0; c < 4; c++) {
                float *normal = n[q] + 3 * c;
                const float length = sqrtf(dot(normal, normal));
                for (int k = 0; k < 3; k++) normal[k] /= length;
            }
        for (int e = 0; e < 2; e++) { /* the second has the edge in the opposite direction */
            const int from = 3 * ((side[0] + e) % 4), to = 3 * ((side[1] + 1 - e) % 4);
            memcpy(p[1] + to, p[0] + from, 12);
            memcpy(n[1] + to, n[0] + from, 12);
        }
        int level[2], edges[2][4], first[2];
        for (int q = 0; q < 2; q++) {
            for (int k = 0; k < 4; k++)
                edges[q][k] = treepieces_edge_level(&lod, p[q] + 3 * k, p[q] + 3 * ((k + 1) % 4));
            level[q] = edges[q][side[q]];
            first[q] = 0;
            for (int k = 0; k < side[q]; k++) first[q] += edges[q][k];
            treepieces_pattern(edges[q], other_inner[(trial + q) % 4], coords[q], NULL, NULL);
        }
        assert_int_equal(level[0], level[1]);
        for (int i = 0; i <= level[0]; i++) {
            float a[2][3], b[2][3];
            for (int q = 0; q < 2; q++) {
                const int at = q ? level[1] - i : i;
                const int corner = side[q] == 3 ? 0 : first[q] + level[q];
                const float *uv = coords[q] + 2 * (at == level[q] ? corner : first[q] + at);
                treepieces_patch_point(p[q], n[q], i % 3 ? 0 : 0.9f, uv[0], uv[1], a[q], b[q]);
            }
            for (int k = 0; k < 3; k++) assert_true(a[0][k] == a[1][k] && b[0][k] == b[1][k]);
        }
    }
}

/* Levels halve over half_distance and agree with the formula. */
static void test_levels(void **state) {
    (void)state;
    treepieces_lod lod = {{0, 0, 0}, 10, 5, 0};
    for (int i = 0; i < 400; i++) {
        const float d = 0.1f * (float)i, a[3] = {d - 1, 0, 0}, b[3] = {d + 1, 0, 0};
        const double exact = 10 * pow(2, -(double)d / 5);
        const int level = treepieces_edge_level(&lod, a, b);
        assert_true(level >= 1 && (double)level >= exact - 1e-4);
        assert_true(level == 1 || level - 1 < exact + 1e-4);
        const float corners[12] = {d - 1, 0, 0, d + 1, 0, 0, d, 1, 0, d, -1, 0};
        assert_int_equal(treepieces_inner_level(&lod, corners), level);
        assert_int_equal(treepieces_edge_level(&lod, b, a), level);
    }
    txm_rng rng = txm_rng_make(5, 0);
    for (int i = 0; i < 200000; i++) { /* symmetric in the ends */
        float ends[6];
        for (int k = 0; k < 6; k++) ends[k] = 20 * txm_rng_float(&rng) - 10;
        assert_int_equal(treepieces_edge_level(&lod, ends, ends + 3),
                         treepieces_edge_level(&lod, ends + 3, ends));
    }
    lod.max_level = 0;
    const float here[3] = {0, 0, 0};
    assert_int_equal(treepieces_edge_level(&lod, here, here), 1);
}

/* Six flat sides become nearly round; shape 0 means 0.6. */
static void test_phong(void **state) {
    (void)state;
    const float c = 0.5f, s = 0.8660254f; /* a side of a hexagonal tube of radius 1 */
    const float p[12] = {1, 1, 0, 1, 0, 0, c, 0, -s, c, 1, -s};
    const float n[12] = {1, 0, 0, 1, 0, 0, c, 0, -s, c, 0, -s};
    for (int i = 0; i <= 20; i++) {
        float at[3], up[3], flat[3];
        treepieces_patch_point(p, n, 0, (float)i / 20, 0.3f, at, up);
        treepieces_patch_point(p, n, -1, (float)i / 20, 0.3f, flat, NULL);
        assert_true(fabsf(at[0] * at[0] + at[2] * at[2] - 1) < 0.03f);
        assert_true(flat[0] * flat[0] + flat[2] * flat[2] <= 1.000001f);
        assert_true(fabsf(dot(up, up) - 1) < 1e-5f);
        assert_true(fabsf(at[1] - 0.7f) < 1e-6f);
    }
}

/* ---- baked trees ---------------------------------------------------------------------------- */

static uint32_t find_root(uint32_t *root, uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
}

/* Connected, oriented, manifold, with borders only where expected; joints in range. */
static void audit(const treepieces_mesh *m, uint32_t nodes, size_t borders) {
    const size_t corners = 3 * m->triangle_count;
    uint64_t *sides = sort_sides(m->indices, corners);
    uint32_t *root = (uint32_t *)room(m->vertex_count, sizeof *root);
    size_t open = 0, components = 0;
    for (size_t i = 0; i < m->vertex_count; i++) root[i] = (uint32_t)i;
    for (size_t i = 0; i < corners; i++) {
        const uint32_t a = (uint32_t)(sides[i] >> 32), b = (uint32_t)sides[i];
        assert_true(a != b);
        if (i) assert_true(sides[i] != sides[i - 1]);
        open += !has_side(sides, corners, b, a);
        root[find_root(root, a)] = find_root(root, b);
    }
    for (size_t i = 0; i < m->vertex_count; i++) components += root[i] == i;
    assert_int_equal(components, 1);
    assert_int_equal(open, borders);
    for (size_t i = 0; i < m->vertex_count; i++) {
        float sum = 0;
        for (int k = 0; k < 4; k++) {
            const float w = m->weights[4 * i + (size_t)k];
            assert_true(m->joints[4 * i + (size_t)k] < nodes && w >= 0);
            if (w == 0) assert_int_equal(m->joints[4 * i + (size_t)k], 0);
            sum += w;
        }
        assert_true(fabsf(sum - 1) < 1e-4f);
        assert_true(fabsf(dot(m->normals + 3 * i, m->normals + 3 * i) - 1) < 1e-3f);
    }
    free(root);
    free(sides);
}

/* Every species: without tessellation, with levels from 10 to 1, and capped. */
static void test_species_meshes(void **state) {
    (void)state;
    for (int preset = 0; preset < treepieces_preset_count(); preset++) {
        for (int kind = 0; kind < 3; kind++) {
            grown g = grow_preset(preset, kind ? 60 : 500, kind ? 0.1f : 0, (uint64_t)preset + 40);
            const treepieces_lod lod = {{0.8f, 1, 0.5f}, 10, 1.2f, 0};
            treepieces_bake_desc d = describe_bake(&g);
            treepieces_mesh *m;
            d.lod = kind ? &lod : NULL;
            assert_int_equal(treepieces_bake(&d, NULL, &m), TXM_OK);
            size_t borders = 6;
            if (kind) { /* as many as the levels of the root rim give */
                const treepieces_node *n = &g.forest->nodes[0];
                const treepieces_piece *piece = treepieces_kit_piece(kit, n->type);
                float p[3 * TREEPIECES_MAX_VERTICES];
                treepieces_skin(g.forest, g.bones, n->type, 0, p, NULL);
                borders = 0;
                for (int j = 0; j < 6; j++)
                    borders += (size_t)treepieces_edge_level(&lod, p + 3 * piece->root_rim[j],
                                                             p + 3 * piece->root_rim[(j + 1) % 6]);
                assert_true(borders > 6);
            }
            audit(m, g.forest->node_count, borders);
            treepieces_mesh_free(m);
            if (kind == 2) {
                d.capped = 1;
                assert_int_equal(treepieces_bake(&d, NULL, &m), TXM_OK);
                audit(m, g.forest->node_count, 0);
                treepieces_mesh_free(m);
            }
            free_grown(&g);
        }
    }
}

/* The normal of a triangle, its length a measure of how well shaped it is; 0 if degenerate. */
static void face_direction(const treepieces_mesh *m, size_t t, double out[3]) {
    double a[3], b[3], longest = 0;
    const float *p[3];
    for (int k = 0; k < 3; k++) p[k] = m->positions + 3 * (size_t)m->indices[3 * t + (size_t)k];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)(p[1][k] - p[0][k]);
        b[k] = (double)(p[2][k] - p[0][k]);
        longest += a[k] * a[k] + b[k] * b[k];
    }
    for (int k = 0; k < 3; k++)
        out[k] = (a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]) / longest;
}

/* The base is closed by faces that point down, whatever the levels and the shape of the rim. */
static void test_cap(void **state) {
    (void)state;
    grown g = grow_preset(0, 20, 0.1f, 5);
    static const float shapes[4] = {-1, 0.1f, 0, 1};
    for (int kind = 0; kind < 9; kind++) {
        const treepieces_lod lod = {
            {0.5f, 0.2f, 0.3f}, kind & 1 ? 10.0f : 3.0f, 0.6f, shapes[kind / 2 % 4]};
        treepieces_bake_desc d = describe_bake(&g);
        treepieces_mesh *open, *closed;
        d.lod = kind == 8 ? NULL : &lod;
        assert_int_equal(treepieces_bake(&d, NULL, &open), TXM_OK);
        d.capped = 1;
        assert_int_equal(treepieces_bake(&d, NULL, &closed), TXM_OK);
        audit(closed, g.forest->node_count, 0);
        const size_t n = open->triangle_count, more = closed->triangle_count - n;
        if (kind == 8) assert_int_equal(more, 4);
        assert_int_equal(closed->vertex_count - open->vertex_count, kind < 8); /* the centre */
        assert_memory_equal(open->indices, closed->indices, n * 12);
        assert_memory_equal(open->uvs, closed->uvs, n * 24);
        for (size_t t = n; t < n + more; t++) {
            double face[3], down = 0;
            face_direction(closed, t, face);
            for (int k = 0; k < 3; k++)
                down -= face[k] * (double)(g.bones[4 * k + 1] / g.forest->nodes[0].length);
            assert_true(down > 0.005);
            for (int k = 0; k < 3; k++) {
                const float *uv = closed->uvs + 6 * t + 2 * k;
                assert_true(uv[0] > 0 && uv[0] < 1 && uv[1] > 0 && uv[1] < 1.0f / TREEPIECES_OWN);
            }
        }
        treepieces_mesh_free(open);
        treepieces_mesh_free(closed);
    }
    free_grown(&g);
}

/* The weight of a joint at a vertex. */
static float weight_of(const treepieces_mesh *m, size_t i, uint32_t joint) {
    float sum = 0;
    for (size_t k = 4 * i; k < 4 * i + 4; k++)
        if (m->joints[k] == joint) sum += m->weights[k];
    return sum;
}

/* The two triangles of a quad have its corners, with their texture coordinates. */
static void check_quad(const treepieces_mesh *m, size_t t, const treepieces_quad *quad,
                       const float *p, uint32_t bands, int cell) {
    for (size_t i = 3 * t; i < 3 * t + 6; i++) {
        const float *at = m->positions + 3 * (size_t)m->indices[i];
        float uv[2];
        int corner = 0;
        while (corner < 4 && (at[0] != p[3 * quad->corners[corner]] ||
                              at[1] != p[3 * quad->corners[corner] + 1] ||
                              at[2] != p[3 * quad->corners[corner] + 2]))
            corner++;
        assert_true(corner < 4);
        const int layer = treepieces_quad_uv(quad, bands, cell, SHEET, corner, uv);
        assert_true(fabsf(m->uvs[2 * i] - uv[0]) < 1e-6f);
        assert_true(fabsf(m->uvs[2 * i + 1] * TREEPIECES_OWN - (float)layer - uv[1]) < 1e-5f);
    }
}

/* The mesh is what skinning gives, to the bit, with the weights of the pieces: vertices of a rim
   are bound to one joint, that of the piece above it. Triangles are in the order of pieces and
   quads. */
static void test_mesh_is_skin(void **state) {
    (void)state;
    grown g = grow_preset(5, 80, 0.1f, 3);
    treepieces_bake_desc d = describe_bake(&g);
    treepieces_mesh *m;
    assert_int_equal(treepieces_bake(&d, NULL, &m), TXM_OK);
    char *seen = (char *)room(m->vertex_count, 1);
    size_t triangles = 0;
    for (int type = 0; type < g.forest->type_count; type++) {
        const treepieces_batch *batch = &g.forest->batches[type];
        const treepieces_piece *piece = treepieces_kit_piece(kit, type);
        for (uint32_t i = 0; i < batch->count; i++) {
            const uint32_t *words = batch->words + (size_t)i * batch->stride;
            const uint32_t more[4] = {0, words[1] & 0xffffu, words[1] >> 16, words[2] & 0xffffu};
            float p[3 * TREEPIECES_MAX_VERTICES], n[3 * TREEPIECES_MAX_VERTICES];
            treepieces_skin(g.forest, g.bones, type, i, p, n);
            for (int q = 0; q < piece->quad_count; q++, triangles += 2)
                check_quad(m, triangles, &piece->quads[q], p, words[3],
                           (int)(words[4 + q / 4] >> (8 * (q & 3)) & 255u));
            for (int v = 0; v < piece->vertex_count; v++) {
                const treepieces_vertex *from = &piece->vertices[v];
                size_t at = 0;
                while (at < m->vertex_count && (m->positions[3 * at] != p[3 * v] ||
                                                m->positions[3 * at + 1] != p[3 * v + 1] ||
                                                m->positions[3 * at + 2] != p[3 * v + 2]))
                    at++;
                assert_true(at < m->vertex_count);
                seen[at] = 1;
                for (int k = 0; k < 3; k++)
                    assert_true(fabsf(m->normals[3 * at + (size_t)k] - n[3 * v + k]) < 1e-6f);
                for (int k = 0; k <= piece->leaf_count; k++) {
                    const float weight = weight_of(m, at, words[0] + more[k]);
                    assert_true(fabsf(weight - from->weights[k]) < 1e-6f);
                    if (from->rim >= 0 && k == 1 + from->rim / TREEPIECES_RIM)
                        assert_true(weight == 1);
                }
            }
        }
    }
    assert_int_equal(triangles, m->triangle_count);
    for (size_t i = 0; i < m->vertex_count; i++) assert_true(seen[i]);
    free(seen);
    treepieces_mesh_free(m);
    free_grown(&g);
}

/* A tree in a forest is baked as if it were alone. */
static void test_company(void **state) {
    (void)state;
    treepieces_species species[2];
    treepieces_place places[3];
    treepieces_mesh *mesh[2];
    const treepieces_lod lod = {{4, 1, 0}, 6, 2, 0};
    for (int i = 0; i < 2; i++) {
        const char *text = treepieces_preset_text(i);
        assert_int_equal(treepieces_species_parse(text, strlen(text), NULL, &species[i]), TXM_OK);
    }
    memset(places, 0, sizeof places);
    for (int i = 0; i < 3; i++) {
        places[i].position[0] = 4 * (float)i;
        places[i].species = i & 1;
        places[i].seed = 77 + (uint64_t)i;
    }
    for (int alone = 0; alone < 2; alone++) {
        treepieces_forest_desc d = describe(alone ? 1 : 3, 90);
                d.species = species;
        d.species_count = 2;
        d.places = places + alone;
        grown g = grow_posed(&d, 0, 0);
        treepieces_bake_desc b = describe_bake(&g);
        b.tree = alone ? 0 : 1;
        b.lod = &lod;
        b.capped = 1;
        assert_int_equal(treepieces_bake(&b, NULL, &mesh[alone]), TXM_OK);
        free_grown(&g);
    }
    const size_t n = mesh[0]->vertex_count, t = mesh[0]->triangle_count;
    assert_int_equal(n, mesh[1]->vertex_count);
    assert_int_equal(t, mesh[1]->triangle_count);
    assert_memory_equal(mesh[0]->positions, mesh[1]->positions, 12 * n);
    assert_memory_equal(mesh[0]->normals, mesh[1]->normals, 12 * n);
    assert_memory_equal(mesh[0]->joints, mesh[1]->joints, 16 * n);
    assert_memory_equal(mesh[0]->weights, mesh[1]->weights, 16 * n);
    assert_memory_equal(mesh[0]->indices, mesh[1]->indices, 12 * t);
    assert_memory_equal(mesh[0]->uvs, mesh[1]->uvs, 24 * t);
    for (int i = 0; i < 2; i++) treepieces_mesh_free(mesh[i]);
}

/* A value and the area where it holds. */
typedef struct share {
    double value, area;
} share;

static int compare_shares(const void *a, const void *b) {
    const double x = ((const share *)a)->value, y = ((const share *)b)->value;
    return x < y ? -1 : x > y;
}

/* The quantile of the values weighted by area; sorts the shares. */
static double quantile(share *shares, size_t count, double part) {
    double all = 0, sum = 0;
    qsort(shares, count, sizeof *shares, compare_shares);
    for (size_t i = 0; i < count; i++) all += shares[i].area;
    for (size_t i = 0; i < count; i++) {
        sum += shares[i].area;
        if (sum >= part * all) return shares[i].value;
    }
    return 0;
}

/* Texels per metre on a triangle, and their anisotropy: the ratio of the singular values of the map
   from the surface to texels. Returns the area of the triangle. */
static double measure_texels(const treepieces_mesh *m, size_t t, double *density, double *ratio) {
    const float *p[3], *uv = m->uvs + 6 * t;
    double a[3], b[3], n[3];
    for (int k = 0; k < 3; k++) p[k] = m->positions + 3 * (size_t)m->indices[3 * t + (size_t)k];
    for (int k = 0; k < 3; k++) {
        a[k] = (double)(p[1][k] - p[0][k]);
        b[k] = (double)(p[2][k] - p[0][k]);
    }
    n[0] = a[1] * b[2] - a[2] * b[1];
    n[1] = a[2] * b[0] - a[0] * b[2];
    n[2] = a[0] * b[1] - a[1] * b[0];
    const double area = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2;
    const double high = SHEET * (double)TREEPIECES_OWN; /* the sheet's layers */
    const double u1 = (double)(uv[2] - uv[0]) * SHEET, v1 = (double)(uv[3] - uv[1]) * high;
    const double u2 = (double)(uv[4] - uv[0]) * SHEET, v2 = (double)(uv[5] - uv[1]) * high;
    const double x1 = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    const double x2 = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / x1, y2 = 2 * area / x1;
    const double m00 = u1 / x1, m01 = (u2 - u1 * x2 / x1) / y2;
    const double m10 = v1 / x1, m11 = (v2 - v1 * x2 / x1) / y2;
    const double q = sqrt((m00 + m11) * (m00 + m11) + (m10 - m01) * (m10 - m01));
    const double r = sqrt((m00 - m11) * (m00 - m11) + (m10 + m01) * (m10 + m01));
    *density = sqrt(fabs(m00 * m11 - m01 * m10));
    *ratio = (q + r) / fabs(q - r);
    return area;
}

/* Does a triangle face away from where the normals of its corners point? */
static int faces_away(const treepieces_mesh *m, size_t t) {
    double face[3], sum = 0;
    face_direction(m, t, face);
    for (size_t k = 0; k < 3; k++)
        for (size_t c = 0; c < 3; c++)
            sum += face[c] * (double)m->normals[3 * (size_t)m->indices[3 * t + k] + c];
    return sum < 0;
}

/* Texel density is about the same everywhere, texels are not stretched, and faces are on the side
   of the normals of their corners. */
static void test_bark_on_species(void **state) {
    (void)state;
    for (int preset = 0; preset < treepieces_preset_count(); preset++) {
        for (int pieces = 165; pieces <= 1320; pieces *= 2) {
            grown g = grow_preset(preset, pieces, 0, 9);
            treepieces_bake_desc d = describe_bake(&g);
            treepieces_mesh *m;
            size_t away = 0;
            assert_int_equal(treepieces_bake(&d, NULL, &m), TXM_OK);
            share *density = (share *)room(m->triangle_count, sizeof *density);
            share *ratio = (share *)room(m->triangle_count, sizeof *ratio);
            for (size_t t = 0; t < m->triangle_count; t++) {
                density[t].area = ratio[t].area =
                    measure_texels(m, t, &density[t].value, &ratio[t].value);
                away += faces_away(m, t);
            }
            const double spread = quantile(density, m->triangle_count, 0.99) /
                                  quantile(density, m->triangle_count, 0.01);
            const double drawn = quantile(ratio, m->triangle_count, 0.99);
            if (spread > 7 || drawn > 6 || away * 1000 > m->triangle_count)
                fail_msg("%s, %d pieces: density p99/p1 %.2f, anisotropy p99 %.2f, %d of %d faces "
                         "away", g.forest->species->name, pieces, spread, drawn, (int)away,
                         (int)m->triangle_count);
            free(density);
            free(ratio);
            treepieces_mesh_free(m);
            free_grown(&g);
        }
    }
}

/* Under failing allocations and cancelled reports nothing leaks and nothing is made. */
static txm_status bake(void *context, txm_env *env) {
    treepieces_mesh *m = (treepieces_mesh *)env;
    const txm_status status = treepieces_bake((const treepieces_bake_desc *)context, env, &m);
    if (status != TXM_OK) assert_null(m);
    treepieces_mesh_free(m);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    grown g = grow_preset(0, 200, 0, 1);
    const treepieces_lod lod = {{0, 1, 0}, 3, 2, 0};
    treepieces_bake_desc d = describe_bake(&g);
    d.lod = &lod;
    assert_true(tk_sweep(bake, &d, TK_ALLOCATION) > 7);
    assert_true(tk_sweep(bake, &d, TK_ONWARD) > 7);
    assert_true(tk_sweep(bake, &d, TK_CANCEL) > 7);
    for (int i = 0; i < 8; i++) {
        treepieces_bake_desc bad = d;
        treepieces_lod far = lod;
        treepieces_mesh *m = (treepieces_mesh *)1;
        switch (i) {
        case 0: bad.forest = NULL; break;
        case 1: bad.tree = 1; break;
        case 2: bad.bones = NULL; break;
        case 3: bad.sheet_layers = 65; break;
        case 4: bad.sheet_size = -1; break;
        case 5: far.max_level = 65; break;
        case 6: far.shape = 2; break;
        default: far.half_distance = (float)NAN; break;
        }
        bad.lod = &far;
        assert_int_equal(treepieces_bake(&bad, NULL, &m), TXM_BAD_ARGUMENT);
        assert_null(m);
    }
    treepieces_mesh_free(NULL);
    free_grown(&g);
}

/* Bones that are not finite and meshes that are too large are refused; nothing stays allocated. */
static void test_refusals(void **state) {
    (void)state;
    static const float bad[4] = {(float)NAN, (float)INFINITY, -3e38f, 0};
    for (int kind = 0; kind < 8; kind++) {
        grown g = grow_preset(1, 60, 0, 2);
        const treepieces_lod lod = {{0, 1, 0}, 4, 2, 0};
        tk_memory memory;
        treepieces_bake_desc d = describe_bake(&g);
        treepieces_mesh *m = (treepieces_mesh *)1;
        memset(&memory, 0, sizeof memory);
        txm_env env = tk_env(&memory, NULL);
        d.capped = 1;
        d.lod = kind & 4 ? &lod : NULL;
        for (int i = 0; i < TREEPIECES_BONE; i++)
            g.bones[TREEPIECES_BONE * (g.forest->node_count / 2) + (uint32_t)i] = bad[kind & 3];
        assert_int_equal(treepieces_bake(&d, &env, &m), TXM_BAD_ARGUMENT);
        assert_null(m);
        assert_non_null(strstr(env.message, "bones"));
        assert_int_equal(tk_leaks(&memory), 0);
        free_grown(&g);
    }
    grown g = grow_preset(3, 12000, 0, 2);
    const treepieces_lod fine = {{0, 0, 0}, 64, 1e30f, 0};
    tk_memory memory;
    treepieces_bake_desc d = describe_bake(&g);
    treepieces_mesh *m = (treepieces_mesh *)1;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    d.lod = &fine;
    assert_int_equal(treepieces_bake(&d, &env, &m), TXM_TOO_LARGE);
    assert_null(m);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_true(memory.peak_bytes < 1 << 20);
    free_grown(&g);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pattern),         cmocka_unit_test(test_shared_edges),
        cmocka_unit_test(test_levels),          cmocka_unit_test(test_phong),
        cmocka_unit_test(test_species_meshes),  cmocka_unit_test(test_bark_on_species),
        cmocka_unit_test(test_cap),             cmocka_unit_test(test_mesh_is_skin),
        cmocka_unit_test(test_company),         cmocka_unit_test(test_faults),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
