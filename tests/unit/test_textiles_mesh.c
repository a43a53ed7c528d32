/* test_textiles_mesh.c - a made triangle set on a sphere: the texture goes on across every edge
   SPDX-License-Identifier: MIT OR Unlicense

   The faces are drawn as a renderer would, by face_uv and bilinear filtering of the atlas.      */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "textiles.h"
#include "testkit.h"

enum { PHOTO = 160, SIZE = 40, FACES = 320, MOST_VERTICES = 1000 };

/* ---- an exemplar and a mesh ---- */

/* Blurred noise: steps of a texel are well below its contrast. */
static void draw_photo(uint8_t *photo) {
    static float a[PHOTO * PHOTO], b[PHOTO * PHOTO];
    txm_rng rng = txm_rng_make(3, 3);
    for (int i = 0; i < PHOTO * PHOTO; i++) a[i] = txm_rng_float(&rng);
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < PHOTO * PHOTO; i++) {
            const int x = i % PHOTO, y = i / PHOTO;
            float sum = 0;
            for (int k = 0; k < 9; k++)
                sum += a[(y + PHOTO + k / 3 - 1) % PHOTO * PHOTO + (x + PHOTO + k % 3 - 1) % PHOTO];
            b[i] = sum / 9;
        }
        memcpy(a, b, sizeof a);
    }
    for (int i = 0; i < PHOTO * PHOTO; i++)
        photo[i] = (uint8_t)txm_clampi((int)(128 + 900 * (a[i] - 0.5f)), 0, 255);
}

typedef struct mesh {
    txm_vec3 at[MOST_VERTICES];
    uint32_t faces[FACES * 3];
    int vertices, count;
} mesh;

static uint32_t add_vertex(mesh *m, txm_vec3 v) {
    v = txm_vec3_normalize(v);
    for (int i = 0; i < m->vertices; i++) {
        if (txm_vec3_length(txm_vec3_sub(m->at[i], v)) < 1e-4f) return (uint32_t)i;
    }
    assert_true(m->vertices < MOST_VERTICES);
    m->at[m->vertices] = v;
    return (uint32_t)m->vertices++;
}

/* An icosahedron, each face divided in four, twice. */
static void make_sphere(mesh *m) {
    static const int faces[20][3] = {
        {0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
        {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
        {3, 8, 9},  {4, 9, 5},  {2, 4, 11},  {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    const float t = 1.618034f;
    memset(m, 0, sizeof *m);
    const float corners[12][3] = {{-1, t, 0}, {1, t, 0}, {-1, -t, 0}, {1, -t, 0},
                                  {0, -1, t}, {0, 1, t}, {0, -1, -t}, {0, 1, -t},
                                  {t, 0, -1}, {t, 0, 1}, {-t, 0, -1}, {-t, 0, 1}};
    for (int i = 0; i < 12; i++) add_vertex(m, txm_v3(corners[i][0], corners[i][1], corners[i][2]));
    for (int i = 0; i < 60; i++) m->faces[i] = (uint32_t)faces[i / 3][i % 3];
    m->count = 20;
    for (int level = 0; level < 2; level++) {
        uint32_t old[FACES * 3];
        memcpy(old, m->faces, sizeof old);
        const int count = m->count;
        m->count = 0;
        for (int f = 0; f < count; f++) {
            uint32_t c[3], e[3];
            for (int k = 0; k < 3; k++) c[k] = old[3 * f + k];
            for (int k = 0; k < 3; k++)
                e[k] = add_vertex(m, txm_vec3_add(m->at[c[k]], m->at[c[(k + 1) % 3]]));
            const uint32_t parts[12] = {c[0], e[0], e[2], c[1], e[1], e[0],
                                        c[2], e[2], e[1], e[0], e[1], e[2]};
            memcpy(m->faces + 3 * m->count, parts, sizeof parts);
            m->count += 4;
        }
    }
    assert_int_equal(m->count, FACES);
    assert_int_equal(m->vertices, FACES / 2 + 2);
}

/* ---- drawing ---- */

static double bilinear(const txm_image *atlas, double u, double v) {
    const double x = u * atlas->width - 0.5, y = v * atlas->height - 0.5;
    const int i = (int)floor(x), j = (int)floor(y);
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        const double w = (k & 1 ? x - i : 1 - (x - i)) * (k & 2 ? y - j : 1 - (y - j));
        sum += w * 255 *
               txm_image_get(atlas, txm_clampi(i + (k & 1), 0, atlas->width - 1),
                             txm_clampi(j + k / 2, 0, atlas->height - 1), 0);
    }
    return sum;
}

/* The colour of a face at depth rows from its side k, share t of the way along it. */
static double color_at(const txm_image *atlas, float uv[4][2], int k, double t, double depth) {
    double w[3], u = 0, v = 0;
    const double inward = depth / SIZE;
    w[(k + 2) % 3] = inward;
    w[k] = (1 - t) * (1 - inward);
    w[(k + 1) % 3] = t * (1 - inward);
    for (int c = 0; c < 3; c++) {
        u += w[c] * uv[c][0];
        v += w[c] * uv[c][1];
    }
    return bilinear(atlas, u, v);
}

/* Mean step of one row across the edges of the mesh over that inside the faces. With shuffle the
   tiles lie anyhow. */
static double edge_ratio(const textiles_set *set, const mesh *m, const textiles_layout *layout,
                         const txm_image *atlas, int shuffle) {
    static int tiles[FACES], rotations[FACES];
    double across = 0, inside = 0;
    int edges = 0;
    assert_int_equal(textiles_assign_triangles(set, m->faces, FACES, (size_t)m->vertices, 9, NULL,
                                               tiles, rotations), TXM_OK);
    for (int f = 0; f < FACES && shuffle; f++) tiles[f] = f * 7 % textiles_count(set);
    for (int f = 0; f < FACES; f++) {
        for (int g = f + 1; g < FACES; g++) {
            for (int i = 0; i < 3; i++) {
                for (int k = 0; k < 3; k++) {
                    if (m->faces[3 * f + i] != m->faces[3 * g + (k + 1) % 3] ||
                        m->faces[3 * f + (i + 1) % 3] != m->faces[3 * g + k])
                        continue;
                    float a[4][2], b[4][2];
                    assert_int_equal(textiles_face_uv(layout, tiles[f], rotations[f], a), 3);
                    assert_int_equal(textiles_face_uv(layout, tiles[g], rotations[g], b), 3);
                    edges++;
                    for (int s = 4; s + 4 < SIZE; s++) {
                        const double t = (s + 0.25) / SIZE;
                        across += fabs(color_at(atlas, a, i, t, 0.5) -
                                       color_at(atlas, b, k, 1 - t, 0.5));
                        for (int d = 3; d < 9; d++)
                            inside += fabs(color_at(atlas, a, i, t, d + 0.5) -
                                           color_at(atlas, a, i, t, d - 0.5)) / 6;
                    }
                }
            }
        }
    }
    assert_int_equal(edges, FACES * 3 / 2);
    return across / inside;
}

static void test_sphere(void **state) {
    (void)state;
    static uint8_t photo[PHOTO * PHOTO];
    static mesh m;
    txm_image picture = {photo, PHOTO, PHOTO, 1, TXM_U8, 0}, atlas = {NULL, 0, 0, 1, TXM_U8, 0};
    textiles_exemplar exemplar = {&picture, 1};
    textiles_desc desc;
    textiles_layout layout;
    textiles_set *set;
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(&desc, 0, sizeof desc);
    draw_photo(photo);
    make_sphere(&m);
    desc.kind = TEXTILES_TRIANGLE;
    desc.exemplars = &exemplar;
    desc.exemplar_count = 1;
    desc.size = SIZE;
    desc.variants = 2;
    assert_int_equal(textiles_make(&desc, &env, &set), TXM_OK);
    assert_int_equal(textiles_layout_make(set, TEXTILES_PACKED, 4, &env, &layout), TXM_OK);
    atlas.width = layout.width;
    atlas.height = layout.height;
    atlas.pixels = malloc((size_t)atlas.width * (size_t)atlas.height);
    assert_non_null(atlas.pixels);
    assert_int_equal(textiles_draw_atlas(set, &layout, 0, &env, atlas), TXM_OK);
    const double ratio = edge_ratio(set, &m, &layout, &atlas, 0);
    const double shuffled = edge_ratio(set, &m, &layout, &atlas, 1);
    print_message("# step across edges over inside: %.3f; of tiles laid anyhow: %.3f\n", ratio,
                  shuffled);
    assert_true(ratio > 0.8 && ratio <= 1.1);
    assert_true(shuffled > 1.3);
    free(atlas.pixels);
    textiles_set_free(set);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sphere)};
    return cmocka_run_group_tests_name("textiles_mesh", tests, NULL, NULL);
}
