/* test_mesh_dress.c - what corners and faces of mesh files carry: colors, coordinates, materials, seams
   SPDX-License-Identifier: MIT OR Unlicense

   Built with: tools/files/mesh*.c tools/files/image_io.c tools/files/stb.c                       */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "files/mesh_io.h"
#include "meshkit.h"

#include <stdio.h>

static void assert_colors(const unsigned char *colors, const unsigned char *expected, size_t count) {
    assert_non_null(colors);
    assert_memory_equal(colors, expected, 4 * count);
}

/* ---- colors of vertices -------------------------------------------------------------------- */

/* An OBJ with one triangle, whose vertices end in these numbers. */
static void read_obj(const char *a, const char *b, const char *c, mesh_data *m) {
    char file[400];
    snprintf(file, sizeof file, "v 0 0 0 %s\nv 1 0 0 %s\nv 0 1 0 %s\nf 1 2 3\n", a, b, c);
    read_text(file, m);
}

static void obj_colors_of_every_convention(void **state) {
    (void)state;
    static const struct {
        const char *v[3];
        unsigned char colors[12];
    } cases[] = {
        {{"1 0 0.5", "0 0 0", "0.2 0.4 0.6"},
         {255, 0, 128, 255, 0, 0, 0, 255, 51, 102, 153, 255}},
        {{"1.003922 0 0.5", "0 0 0", "0.2 0.4 0.6"}, /* a little above 1 */
         {255, 0, 128, 255, 0, 0, 0, 255, 51, 102, 153, 255}},
        {{"255 0 128", "0 0 0", "51 102 153"}, {255, 0, 128, 255, 0, 0, 0, 255, 51, 102, 153, 255}},
        {{"65535 0 32896", "0 0 0", "13107 26214 39321"},
         {255, 0, 128, 255, 0, 0, 0, 255, 51, 102, 153, 255}},
        {{"1 0 0.5 1", "0 0 0 1", "0.2 0.4 0.6 1"}, /* r g b a, opaque */
         {255, 0, 128, 255, 0, 0, 0, 255, 51, 102, 153, 255}},
        {{"1 0 0.5 0.2", "0 0 0 1", "0.2 0.4 0.6 0"},
         {255, 0, 128, 51, 0, 0, 0, 255, 51, 102, 153, 0}},
        {{"255 0 128 51", "0 0 0 255", "51 102 153 0"},
         {255, 0, 128, 51, 0, 0, 0, 255, 51, 102, 153, 0}},
        {{"255 0 128 0.2", "0 0 0 1", "51 102 153 0"}, /* alpha of 0..1 beside bytes */
         {255, 0, 128, 51, 0, 0, 0, 255, 51, 102, 153, 0}},
        {{"1 1 0 0.5", "1 0 0 0", "1 0.2 0.4 0.6"}, /* w r g b */
         {255, 0, 128, 255, 0, 0, 0, 255, 51, 102, 153, 255}},
        {{"1 1 0 0.5 0.2", "1 0 0 0 1", "1 0.2 0.4 0.6 0"}, /* w r g b a */
         {255, 0, 128, 51, 0, 0, 0, 255, 51, 102, 153, 0}},
        {{"1 0 0.5", "", "1"}, {255, 0, 128, 255, 255, 255, 255, 255, 255, 255, 255, 255}},
        {{"1 0 0.5", "nan 0 0", "-1 2 0"}, {255, 0, 128, 255, 255, 255, 255, 255, 0, 255, 0, 255}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        mesh_data m;
        read_obj(cases[i].v[0], cases[i].v[1], cases[i].v[2], &m);
        assert_colors(m.colors, cases[i].colors, 3);
        assert_int_equal(m.note[0] != 0, i == 11);
        mesh_free(&m);
    }
}

static void ply_colors_of_every_type(void **state) {
    (void)state;
    static const struct {
        const char *type, *v[3];
    } cases[] = {{"uchar", {"255 0 128 51", "0 0 0 255", "51 102 153 0"}},
                 {"char", {"-1 0 -128 51", "0 0 0 -1", "51 102 -103 0"}},
                 {"ushort", {"65535 0 32896 13107", "0 0 0 65535", "13107 26214 39321 0"}},
                 {"ushort", {"255 0 128 51", "0 0 0 255", "51 102 153 0"}},
                 {"int", {"255 0 128 51", "0 0 0 255", "51 102 153 0"}},
                 {"float", {"1 0 0.5 0.2", "0 0 0 1", "0.2 0.4 0.6 0"}},
                 {"float", {"1.0039 0 0.5 0.2", "0 0 0 1", "0.2 0.4 0.6 0"}},
                 {"double", {"255 0 128 51", "0 0 0 255", "51 102 153 0"}},
                 {"float", {"255 0 128 0.2", "0 0 0 1", "51 102 153 0"}}};
    const unsigned char colors[] = {255, 0, 128, 51, 0, 0, 0, 255, 51, 102, 153, 0};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        for (int of_faces = 0; of_faces < 2; of_faces++) {
            char file[900], declared[200];
            mesh_data m;
            snprintf(declared, sizeof declared,
                     "property %s red\nproperty %s green\nproperty %s blue\nproperty %s alpha\n",
                     cases[i].type, cases[i].type, cases[i].type, cases[i].type);
            snprintf(file, sizeof file,
                     "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                     "property float z\n%selement face %d\nproperty list uchar int vertex_indices\n%s"
                     "end_header\n0 0 0 %s\n1 0 0 %s\n0 1 0 %s\n3 0 1 2 %s\n",
                     of_faces ? "" : declared, of_faces ? 3 : 1, of_faces ? declared : "",
                     of_faces ? "" : cases[i].v[0], of_faces ? "" : cases[i].v[1],
                     of_faces ? "" : cases[i].v[2], of_faces ? cases[i].v[0] : "");
            for (int k = 1; of_faces && k < 3; k++) {
                const size_t n = strlen(file);
                snprintf(file + n, sizeof file - n, "3 0 1 2 %s\n", cases[i].v[k]);
            }
            read_text(file, &m);
            assert_colors(of_faces ? m.face_colors : m.colors, colors, 3);
            assert_null(of_faces ? m.colors : m.face_colors);
            mesh_free(&m);
        }
    }
}

/* ---- what faces carry ---------------------------------------------------------------------- */

#define PLY_SQUARE                                                                                  \
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"                 \
    "property float z\nelement face 3\n"
#define SQUARE_VERTICES "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"

/* Polygons hand on what they carry to all of their triangles; those that are left out do not count. */
static void faces_carry_colors(void **state) {
    (void)state;
    mesh_data m;
    read_text(PLY_SQUARE "property uchar red\nproperty list uchar int vertex_index\n"
                         "property uchar green\nproperty uchar blue\n" SQUARE_VERTICES
                         "10 4 0 1 2 3 20 30\n7 2 0 1 7 7\n40 3 0 2 1 50 60\n", &m);
    const unsigned char colors[] = {10, 20, 30, 255, 10, 20, 30, 255, 40, 50, 60, 255};
    assert_int_equal(m.triangle_count, 3);
    assert_colors(m.face_colors, colors, 3);
    mesh_free(&m);
    read_text("OFF\n4 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 0.2 0.4 1\n3 0 1 2\n"
              "3 0 2 1 0 0 0 0.2 # black\n", &m);
    const unsigned char off[] = {51, 102, 255, 255, 51, 102, 255, 255, 255, 255, 255, 255,
                                 0,  0,   0,   51};
    assert_int_equal(m.triangle_count, 4);
    assert_colors(m.face_colors, off, 4);
    mesh_free(&m);
}

static void corners_of_ply_carry_uvs(void **state) {
    (void)state;
    mesh_data m;
    read_text(PLY_SQUARE "property list uchar float texcoord\nproperty uchar flags\n"
                         "property list uchar int vertex_indices\nproperty int texnumber\n"
                         SQUARE_VERTICES
                         "8 0 0 1 0 1 1 0 1 9 4 0 1 2 3 4\n0 9 3 0 1 2 5\n"
                         "6 0.5 0 0.25 0 0 1 9 3 0 1 2 4\n", &m);
    const float uvs[] = {0, 1, 1, 1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0,
                         0.5f, 1, 0.25f, 1, 0, 0};
    assert_int_equal(m.triangle_count, 4);
    for (int i = 0; i < 24; i++) assert_float_equal(m.uvs[i], uvs[i], 0);
    const uint32_t materials[] = {0, 0, 1, 0};
    assert_memory_equal(m.materials, materials, sizeof materials);
    assert_string_equal(mesh_material_name(&m, 1), "texture5");
    mesh_free(&m);
}

static void obj_faces_have_materials(void **state) {
    (void)state;
    mesh_data m;
    read_text("mtllib my materials.mtl \nmtllib other.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
              "f 1 2 3\nusemtl red paint\nf 1 2 3 4\nusemtl blue\\\nf 1 2\nf 1 3 4\nusemtl red paint\n"
              "f 2 3 4\n", &m);
    const uint32_t materials[] = {2, 0, 0, 1, 0};
    assert_int_equal(m.triangle_count, 5);
    assert_int_equal(m.material_count, 3);
    assert_memory_equal(m.materials, materials, sizeof materials);
    assert_string_equal(mesh_material_name(&m, 0), "red paint");
    assert_string_equal(mesh_material_name(&m, 1), "blue\\");
    assert_string_equal(mesh_material_name(&m, 2), "");
    assert_string_equal(m.library, "my materials.mtl");
    assert_non_null(strstr(m.note, "further material libraries (1)"));
    mesh_free(&m);
    read_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", &m);
    assert_null(m.materials);
    assert_null(m.library);
    mesh_free(&m);
}

/* ---- written ------------------------------------------------------------------------------- */

/* Two squares of two materials, with colors of faces, as OBJ, PLY and GLB. */
static void what_faces_carry_is_written(void **state) {
    (void)state;
    static const char *const extensions[] = {".obj", ".ply", ".glb"};
    mesh_data m;
    read_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nusemtl say \"a\"\n"
              "f 1 2 3 4\nusemtl b\nf 2 5 6 3\n", &m);
    m.face_colors = (unsigned char *)calloc(4, 4);
    assert_non_null(m.face_colors);
    for (int i = 0; i < 16; i++) m.face_colors[i] = (unsigned char)(i < 8 ? 255 : i % 4 == 3 ? 128 : 40);
    for (int i = 0; i < 3; i++) {
        mesh_scene scene = {0};
        mesh_data again;
        unsigned char *out;
        size_t size;
        const char *why;
        scene.surface = &m;
        assert_true(mesh_encode(extensions[i], &scene, &out, &size, &why));
        assert_true(mesh_decode(out, size, 0, &again, &why));
        assert_int_equal(again.triangle_count, 4);
        if (i != 1) {
            assert_int_equal(again.material_count, 2);
            assert_memory_equal(again.materials, m.materials, 4 * sizeof(uint32_t));
            assert_string_equal(mesh_material_name(&again, 0), "say \"a\"");
            assert_string_equal(mesh_material_name(&again, 1), "b");
        }
        if (i == 0) assert_string_equal(again.library, "a.mtl");
        if (i == 1) assert_colors(again.face_colors, m.face_colors, 4);
        if (i == 2) {
            for (size_t c = 0; c < 12; c++)
                assert_colors(again.colors + 4 * (size_t)again.indices[c], m.face_colors + 4 * (c / 3),
                              1);
        }
        mesh_free(&again);
        free(out);
    }
    mesh_free(&m);
}

/* Alpha is written where there is some; pictures that repeat do so both ways, and are there once. */
static void alpha_and_repeats_are_written(void **state) {
    (void)state;
    mesh_data m;
    mesh_scene scene = {0};
    unsigned char *out;
    size_t size;
    const char *why;
    char json[4000];
    read_text("v 0 0 0 1 0 0 0.2\nv 1 0 0 0 1 0 1\nv 1 1 0 0 0 1 0.4\nvt 0 0\nvt 8 0\nvt 8 4\n"
              "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 2/2\n", &m);
    scene.surface = &m;
    assert_true(mesh_encode(".obj", &scene, &out, &size, &why));
    assert_memory_equal(out, "v 0 0 0 1 0 0 0.2\n", 18);
    free(out);
    scene.texture = "t.png";
    scene.repeats = 1;
    assert_true(mesh_encode(".glb", &scene, &out, &size, &why));
    snprintf(json, sizeof json, "%.*s", (int)(size - 20 < sizeof json ? size - 20 : sizeof json - 1),
             (const char *)out + 20);
    free(out);
    assert_non_null(strstr(json, "\"wrapS\":10497,\"wrapT\":10497}],\"images\":[{\"uri\":\"t.png\"}]"));
    assert_non_null(strstr(json, "\"textures\":[{\"sampler\":0,\"source\":0}]"));
    mesh_free(&m);
}

/* ---- seams --------------------------------------------------------------------------------- */

/* Corners with the same coordinates but for rounding are the same, those of two vertices in one place
   too, but not those of two materials. */
static void seams_are_found(void **state) {
    (void)state;
    mesh_data m;
    uint32_t seams[12];
    read_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 1 -0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
              "vt 0.000004 0\nvt 1.000004 0.999996\nvt 0.5 0\nf 1/1 2/2 3/3\nf 1/5 5/6 4/4\n"
              "f 1/7 2/2 5/3\nusemtl x\nf 1/1 2/2 3/3\n", &m);
    assert_true(mesh_seams(&m, seams));
    const uint32_t expected[] = {0, 1, 2, 0, 2, 5, 6, 1, 2, 9, 10, 11};
    assert_memory_equal(seams, expected, sizeof expected);
    assert_memory_equal(m.uvs + 6, m.uvs, 2 * sizeof(float)); /* the very same */
    assert_memory_equal(m.uvs + 8, m.uvs + 4, 2 * sizeof(float));
    mesh_free(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_colors_of_every_convention),
        cmocka_unit_test(ply_colors_of_every_type),
        cmocka_unit_test(faces_carry_colors),
        cmocka_unit_test(corners_of_ply_carry_uvs),
        cmocka_unit_test(obj_faces_have_materials),
        cmocka_unit_test(what_faces_carry_is_written),
        cmocka_unit_test(alpha_and_repeats_are_written),
        cmocka_unit_test(seams_are_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
