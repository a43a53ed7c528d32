/* test_mesh_formats.c - STL, OFF and GLB files read, and files that are damaged
   SPDX-License-Identifier: MIT OR Unlicense

   Built with: tools/files/mesh*.c tools/files/image_io.c tools/files/stb.c                       */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "meshkit.h"

typedef struct bytes {
    unsigned char data[1 << 14];
    size_t size;
} bytes;

static void add(bytes *b, const void *from, size_t n) {
    assert_true(b->size + n <= sizeof b->data);
    memcpy(b->data + b->size, from, n);
    b->size += n;
}

static void add_u32(bytes *b, uint32_t v) {
    const unsigned char raw[4] = {(unsigned char)(v & 255), (unsigned char)(v >> 8 & 255),
                                  (unsigned char)(v >> 16 & 255), (unsigned char)(v >> 24)};
    add(b, raw, 4);
}

static void add_float(bytes *b, float v) {
    uint32_t bits;
    memcpy(&bits, &v, 4);
    add_u32(b, bits);
}

static void read_bytes(const bytes *b, mesh_data *m) {
    const char *why;
    if (!decode(b->data, b->size, 0, m, &why)) fail_msg("%s", why);
}

static void assert_bytes_fail(const bytes *b, const char *expected) {
    mesh_data m;
    const char *why;
    assert_false(decode(b->data, b->size, 0, &m, &why));
    assert_string_equal(why, expected);
}

/* Every beginning of it is refused or read, whatever; the sanitizer looks on. */
static void cut_everywhere(const bytes *b) {
    for (size_t n = 0; n < b->size; n++) {
        mesh_data m;
        const char *why;
        if (decode(b->data, n, 0, &m, &why)) mesh_free(&m);
    }
}

/* ---- STL ----------------------------------------------------------------------------------- */

static const float tetrahedron[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const uint32_t faces[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
/* as they come, vertex by vertex */
static const uint32_t renumbered[] = {0, 1, 2, 0, 2, 3, 2, 1, 3, 0, 3, 1};

static void make_stl(bytes *b, const char *header, uint32_t told) {
    char text[80] = {0};
    memcpy(text, header, strlen(header));
    b->size = 0;
    add(b, text, sizeof text);
    add_u32(b, told);
    for (int t = 0; t < 4; t++) {
        for (int k = 0; k < 3; k++) add_float(b, 0);
        for (int c = 0; c < 3; c++) {
            for (int k = 0; k < 3; k++) {
                const float v = tetrahedron[faces[3 * t + c]][k];
                add_float(b, v == 0 && t == 2 ? -0.0f : v);
            }
        }
        add(b, "\0", 2);
    }
}

static void stl_binary_is_told_by_its_size(void **state) {
    (void)state;
    static const char *const headers[] = {"", "solid facet normal", "solid\nfacet", "ply\n", "OFF", "v 1"};
    static bytes b;
    mesh_data m;
    for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++) {
        make_stl(&b, headers[i], 4);
        read_bytes(&b, &m);
        assert_int_equal(m.vertex_count, 4);
        assert_indices(&m, renumbered, 4);
        mesh_free(&m);
    }
    make_stl(&b, "solid with more behind it", 4);
    add(&b, "more", 4);
    read_bytes(&b, &m);
    assert_int_equal(m.triangle_count, 4);
    mesh_free(&m);
    make_stl(&b, "one that is cut off", 5);
    assert_bytes_fail(&b, "an STL file that ends too early, or no mesh; get a whole copy");
    make_stl(&b, "", 0xffffffffu);
    assert_bytes_fail(&b, "an STL file that ends too early, or no mesh; get a whole copy");
    make_stl(&b, "", 4);
    b.data[84 + 48] = 1; /* a color, says one program */
    read_bytes(&b, &m);
    assert_string_equal(m.note, "left out: attributes of STL facets (1)");
    mesh_free(&m);
    make_stl(&b, "", 4);
    memset(b.data + 84 + 12, 255, 4);
    assert_bytes_fail(&b, "vertex 1 has a coordinate that is not a finite number");
    make_stl(&b, "", 4);
    cut_everywhere(&b);
}

static void stl_in_text(void **state) {
    (void)state;
    static const char *const texts[] = {
        "solid vertex facet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
        "vertex 0 1 0\nendloop\nendfacet\nendsolid vertex facet\n",
        "  SOLID\r\n\r\nFACET NORMAL nan nan nan\r\n OUTER LOOP\r\n  VERTEX 0e0 0 -0\r\n"
        "  VERTEX 1.0E+00 0 0\r\n\tVERTEX 0 1,0 0\r\nENDLOOP\r\nENDFACET\r\n",
        "\xef\xbb\xbfsolid\rfacet\router loop vertex 0 0 0 vertex 1 0 0\rvertex 0 1 0\rendloop\rendfacet",
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n"
        "endsolid a\nsolid b\\\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
        "vertex 0 1 0\nendloop\nendfacet\nendsolid\n"};
    static const uint32_t indices[] = {0, 1, 2};
    static const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        mesh_data m;
        read_text(texts[i], &m);
        assert_indices(&m, indices, 1);
        for (int k = 0; k < 9; k++) assert_float_equal(m.positions[k], positions[k], 0);
        assert_string_equal(m.note, i == 1   ? "commas in numbers were taken for decimal points"
                                    : i == 3 ? "left out: faces with less than three corners (1)"
                                             : "");
        mesh_free(&m);
    }
    assert_fails("solid\nendsolid", "no triangles in it");
    assert_fails("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n",
                 "line 6: the file ends too early; get a whole copy");
    assert_fails("solid\nfacet\nouter loop\nvertex 0 x 0\n", "line 4: a vertex without three numbers");
}

/* Binary where floats hold the shape, else text; both come back. */
static void stl_is_written(void **state) {
    (void)state;
    for (int is_away = 0; is_away < 2; is_away++) {
        static bytes b;
        mesh_data m, again;
        mesh_scene scene = {0};
        unsigned char *out;
        size_t size;
        const char *why;
        make_stl(&b, "", 4);
        read_bytes(&b, &m);
        scene.surface = &m;
        if (is_away) scene.place.origin[0] = 5e6;
        assert_true(mesh_encode(".stl", &scene, &out, &size, &why));
        assert_int_equal(size == b.size, !is_away);
        assert_int_equal(memcmp(out, "solid", 5) == 0, is_away);
        if (!decode(out, size, 0, &again, &why)) fail_msg("%s", why);
        assert_indices(&again, renumbered, 4);
        for (size_t i = 0; i < 4; i++) {
            for (int k = 0; k < 3; k++) {
                const double was = mesh_place_out(&scene.place, m.positions[3 * i + (size_t)k], k);
                assert_float_equal(mesh_place_out(&again.place, again.positions[3 * i + (size_t)k], k),
                                   was, 1e-7);
            }
        }
        free(out);
        mesh_free(&m);
        mesh_free(&again);
    }
}

/* ---- OFF ----------------------------------------------------------------------------------- */

static void off_of_all_kinds(void **state) {
    (void)state;
    static const char *const texts[] = {
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "# a comment\n\nOFF # more\n# and more\n 3 1 # no edges\n\n0 0 0\n\n1 0 0 # here\n#\n0 1 0\n\n3 0 1 2",
        "OFF 3 1 0\r0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r",
        "\xef\xbb\xbfOFF\r\n3 1 0\r\n0 0 0\r\n1,0 0 0\r\n0 1 0\r\n3 0 1\r\n 2\r\n",
        "NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2",
        "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 128 9\n3 0 1 2\n",
        "OFF\n3 1 0\n0 0 0 1. 0 0\n1 0 0 0 1. 0\n0 1 0 0 0 .5\n3 0 1 2\n",
        "STCNOFF\n3 1 0\n0 0 0 0 0 1 1 0 0 1 .5 0\n1 0 0 0 0 1 0 1 0 1 0 0\n0 1 0 0 0 1 0 0 .5 0 0 1\n"
        "3 0 1 2\n",
        "OFF\n3 3 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n2 0 1\n0\n"};
    static const uint32_t indices[] = {0, 1, 2};
    static const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const unsigned char colors[] = {255, 0, 0, 0, 255, 0, 0, 0, 128};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        mesh_data m;
        read_text(texts[i], &m);
        assert_indices(&m, indices, 1);
        assert_memory_equal(m.positions, positions, sizeof positions);
        assert_int_equal(m.colors != NULL, i >= 5 && i <= 7);
        for (size_t k = 0; k < 9 && m.colors; k++)
            assert_int_equal(m.colors[k + k / 3], colors[k]);
        if (i == 5) assert_int_equal(m.colors[11], 9);
        assert_int_equal(m.normals != NULL, i == 4 || i == 7);
        if (m.normals) assert_float_equal(m.normals[8], 1, 0);
        assert_int_equal(m.uvs != NULL, i == 7);
        if (m.uvs) assert_float_equal(m.uvs[0], 0.5, 0);
        if (i == 8)
            assert_string_equal(m.note, "left out: faces with less than three corners (2)");
        assert_int_equal(m.face_colors != NULL, i == 8);
        if (i == 8) assert_memory_equal(m.face_colors, "\xff\0\0\xff", 4);
        mesh_free(&m);
    }
    assert_fails("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n",
                 "line 4: a vertex has less than three coordinates");
    assert_fails("OFF\n4 1 0\n0 0 0\n1 0 0\n0 1 0\n", "line 6: the file ends too early; get a whole copy");
    assert_fails("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
                 "line 6: a face with vertex 4, but there are only 3");
    assert_fails("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
                 "line 6: a face with an index that is out of range or no whole number");
    assert_fails("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2000000000 0 1 2\n",
                 "line 6: a face is longer than the file; get a whole copy");
    assert_fails("OFF\n2000000000 1 0\n0 0 0\n", "line 4: the file ends too early; get a whole copy");
    assert_fails("OFF BINARY\n", "line 1: a binary OFF is not read; save it as text");
    assert_fails("4OFF\n", "line 1: an OFF of more than three dimensions");
    assert_fails("OFF\n0 0 0\n", "no vertices in it");
}

/* ---- GLB ----------------------------------------------------------------------------------- */

/* A GLB of this document and these bytes. */
static void make_glb(bytes *b, const char *json, const bytes *binary) {
    const uint32_t length = (uint32_t)strlen(json);
    b->size = 0;
    add(b, "glTF", 4);
    add_u32(b, 2);
    add_u32(b, (uint32_t)(12 + 8 + length + 8 + binary->size));
    add_u32(b, length);
    add(b, "JSON", 4);
    add(b, json, length);
    add_u32(b, (uint32_t)binary->size);
    add(b, "BIN\0", 4);
    add(b, binary->data, binary->size);
}

/* Five vertices, each with its position, three bytes of color and one of nothing: 16 bytes; then their
   numbers as bytes, shorts and whole words, and a triangle of the last three. */
static void make_binary(bytes *b) {
    static const float positions[5][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 2, 0}};
    b->size = 0;
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 3; k++) add_float(b, positions[i][k]);
        add_u32(b, i == 4 ? 0x00ffffffu : 0x00ff0000u); /* white, blue */
    }
    for (int i = 0; i < 5; i++) add(b, (const unsigned char[]){(unsigned char)i}, 1);
    add(b, "\0\0", 3); /* to 88 */
    for (int i = 0; i < 5; i++) add(b, (const unsigned char[]){(unsigned char)i, 0}, 2);
    add(b, "\0", 2); /* to 100 */
    for (uint32_t i = 0; i < 5; i++) add_u32(b, i);
    for (uint32_t i = 2; i < 5; i++) add_u32(b, i);
}

#define VIEWS "\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":132}],\"bufferViews\":[" \
              "{\"buffer\":0,\"byteLength\":80,\"byteStride\":16}," \
              "{\"buffer\":0,\"byteOffset\":80,\"byteLength\":52}],\"accessors\":[" \
              "{\"bufferView\":0,\"componentType\":5126,\"count\":5,\"type\":\"VEC3\"}," \
              "{\"bufferView\":0,\"byteOffset\":12,\"componentType\":5121,\"normalized\":true," \
              "\"count\":5,\"type\":\"VEC3\"}," \
              "{\"bufferView\":1,\"componentType\":5121,\"count\":5,\"type\":\"SCALAR\"}," \
              "{\"bufferView\":1,\"byteOffset\":8,\"componentType\":5123,\"count\":5,\"type\":" \
              "\"SCALAR\"}," \
              "{\"bufferView\":1,\"byteOffset\":20,\"componentType\":5125,\"count\":5,\"type\":" \
              "\"SCALAR\"}," \
              "{\"bufferView\":1,\"byteOffset\":40,\"componentType\":5125,\"count\":3,\"type\":" \
              "\"SCALAR\"}]"
#define SCENE ",\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}]"
#define ATTRIBUTES "{\"attributes\":{\"POSITION\":0,\"COLOR_0\":1}"

static void read_glb(const char *json, mesh_data *m) {
    static bytes b, binary;
    make_binary(&binary);
    make_glb(&b, json, &binary);
    read_bytes(&b, m);
}

static void glb_strips_fans_and_lists(void **state) {
    (void)state;
    static const char *const modes[] = {"5,\"indices\":2", "5,\"indices\":3", "5,\"indices\":4", "5",
                                        "6", "4,\"indices\":5", "4"};
    static const uint32_t strip[] = {0, 1, 2, 2, 1, 3, 2, 3, 4}, fan[] = {0, 1, 2, 0, 2, 3, 0, 3, 4};
    static const uint32_t last[] = {2, 3, 4};
    for (int i = 0; i < 7; i++) {
        char json[2048];
        mesh_data m;
        snprintf(json, sizeof json, "{" VIEWS SCENE ",\"meshes\":[{\"primitives\":[" ATTRIBUTES
                 ",\"mode\":%s}]}]}", modes[i]);
        read_glb(json, &m);
        assert_int_equal(m.vertex_count, 5);
        if (i < 4) assert_indices(&m, strip, 3);
        else if (i == 4) assert_indices(&m, fan, 3);
        else assert_indices(&m, i == 5 ? last : strip, 1);
        assert_float_equal(m.positions[13], 2, 0);
        assert_int_equal(m.colors[2], 255);
        assert_int_equal(m.colors[0], 0);
        assert_int_equal(m.colors[16], 255);
        assert_int_equal(m.colors[3], 255);
        mesh_free(&m);
    }
}

/* Nodes put their meshes elsewhere; mirrored ones turn the triangles round. */
static void glb_nodes_place_their_meshes(void **state) {
    (void)state;
    const char *json =
        "{" VIEWS ",\"scenes\":[{\"nodes\":[3]},{\"nodes\":[0]}],\"scene\":1,\"nodes\":["
        "{\"children\":[1,2],\"translation\":[10,0,0],\"rotation\":[0,0,0.70710678118654752,"
        "0.70710678118654752]},{\"mesh\":0,\"scale\":[2,2,-2]},"
        "{\"mesh\":1,\"matrix\":[1,0,0,0,0,0,1,0,0,-1,0,0,0,0,5,1]},{\"mesh\":0}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":5},"
        "{\"attributes\":{\"POSITION\":0},\"indices\":5,\"mode\":1},"
        "{\"attributes\":{\"POSITION\":0},\"mode\":5}]},"
        "{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"COLOR_0\":1},\"indices\":5}]}]}";
    mesh_data m;
    read_glb(json, &m);
    assert_int_equal(m.vertex_count, 10); /* primitives of a mesh share their vertices */
    assert_int_equal(m.triangle_count, 1 + 1 + 3);
    assert_string_equal(m.note, "left out: points and lines (1)");
    /* node 2 comes first: 0 1 0 turned to 0 0 1, lifted by 5, turned about z, moved by 10 */
    static const uint32_t indices[] = {2, 3, 4, 7, 9, 8, 5, 7, 6, 7, 8, 6, 7, 9, 8};
    assert_indices(&m, indices, 5);
    const float third[] = {10, 0, 6}, ninth[] = {8, 2, 0};
    for (int k = 0; k < 3; k++) {
        assert_float_equal(m.positions[6 + k], third[k], 1e-6);
        assert_float_equal(m.positions[24 + k], ninth[k], 1e-6);
    }
    assert_int_equal(m.colors[0], 0);
    assert_int_equal(m.colors[20], 255); /* that have none are white */
    mesh_free(&m);
}

/* A skin's node is nowhere: joints hold the mesh. */
static void glb_skins_are_left_out(void **state) {
    (void)state;
    mesh_data m;
    read_glb("{" VIEWS ",\"nodes\":[{\"mesh\":0,\"skin\":0,\"translation\":[7,0,0]}],\"meshes\":[{"
             "\"primitives\":[" ATTRIBUTES ",\"indices\":5,\"targets\":[{}]}]}]}", &m);
    assert_int_equal(m.triangle_count, 1);
    assert_float_equal(m.positions[3], 1, 0);
    assert_string_equal(m.note, "left out: skins (1), morph targets (1)");
    mesh_free(&m);
}

/* What is written is read again, with all that it has, at its place. */
static void glb_comes_back(void **state) {
    (void)state;
    static float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0.25f, 0, 1, 0};
    static float normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    static unsigned char colors[] = {255, 0, 0, 255, 0, 128, 0, 255, 1, 2, 3, 255, 4, 5, 6, 77};
    static uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    static float uvs[] = {0, 1, 0.5f, 1, 0.5f, 0.1f, 0.5f, 1, 1, 0.25f, 0.3f, 0.25f};
    for (int is_away = 0; is_away < 2; is_away++) {
        mesh_data m, again;
        mesh_instances copies;
        mesh_scene scene = {0};
        static float translations[6];
        unsigned char *out;
        size_t size;
        const char *why;
        memset(&m, 0, sizeof m);
        memset(&copies, 0, sizeof copies);
        m.vertex_count = 4;
        m.triangle_count = 2;
        m.positions = positions;
        m.normals = normals;
        m.colors = colors;
        m.indices = indices;
        m.uvs = uvs;
        copies.mesh = &m;
        copies.count = 2;
        copies.translations = translations;
        scene.surface = &m;
        scene.instances = &copies;
        scene.instance_count = is_away;
        if (is_away) {
            scene.place.origin[1] = 5400000.125;
            scene.place.scale = 4;
        }
        assert_true(mesh_encode(".glb", &scene, &out, &size, &why));
        if (!decode(out, size, 0, &again, &why)) fail_msg("%s", why);
        assert_int_equal(again.triangle_count, 2);
        assert_string_equal(again.note, is_away ? "left out: instanced meshes (1)" : "");
        for (size_t c = 0; c < 6; c++) {
            const size_t v = indices[c], w = again.indices[c];
            for (size_t k = 0; k < 3; k++) {
                assert_float_equal(mesh_place_out(&again.place, again.positions[3 * w + k], (int)k),
                                   mesh_place_out(&scene.place, positions[3 * v + k], (int)k), 1e-9);
                assert_float_equal(again.normals[3 * w + k], normals[3 * v + k], 1e-6);
            }
            assert_memory_equal(again.colors + 4 * w, colors + 4 * v, 4);
            assert_memory_equal(again.uvs + 2 * c, uvs + 2 * c, 2 * sizeof(float));
        }
        mesh_free(&again);
        if (is_away) { /* only instances */
            free(out);
            scene.surface = NULL;
            assert_true(mesh_encode(".glb", &scene, &out, &size, &why));
            assert_false(decode(out, size, 0, &again, &why));
            assert_string_equal(why, "only instances in it, no surface");
        }
        free(out);
    }
}

static void assert_glb_fails(const char *json, const char *expected) {
    static bytes b, binary;
    make_binary(&binary);
    make_glb(&b, json, &binary);
    assert_bytes_fail(&b, expected);
}

static void glb_says_what_is_wrong(void **state) {
    (void)state;
    static bytes b, binary;
    const char *good = "{" VIEWS SCENE ",\"meshes\":[{\"primitives\":[" ATTRIBUTES ",\"indices\":5}]}]}";
    make_binary(&binary);
    make_glb(&b, good, &binary);
    cut_everywhere(&b);
    b.data[4] = 1;
    assert_bytes_fail(&b, "glTF of version 1; version 2 is read");
    assert_fails("{\"asset\":{}}", "a .gltf has its triangles in other files; save it as .glb");
    assert_glb_fails("[]", "its JSON is damaged");
    assert_glb_fails("{", "its JSON is damaged");
    assert_glb_fails("{}", "no triangles in it");
    assert_glb_fails("{\"buffers\":[{\"uri\":\"x.bin\"}]}",
                     "its triangles are in another file; save all in one");
    assert_glb_fails("{\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]}",
                     "it needs the extension KHR_draco_mesh_compression; save it without");
    assert_glb_fails("{\"nodes\":[{\"children\":[1]},{\"children\":[1]}]}", "node 1 has two parents");
    assert_glb_fails("{\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"children\":[0]}]}",
                     "node 0 has two parents");
    assert_glb_fails("{\"scenes\":[{\"nodes\":[-1]}],\"nodes\":[{}]}", "a node that is out of range");
    assert_glb_fails("{\"nodes\":[{\"mesh\":0}]}", "node 0 has a mesh that is out of range");
    assert_glb_fails("{\"nodes\":[{\"matrix\":[1]}]}", "node 0 has no proper place");
#define PRIMITIVE(text) "{" VIEWS SCENE ",\"meshes\":[{\"primitives\":[" text "]}]}"
    assert_glb_fails(PRIMITIVE("{\"attributes\":{\"POSITION\":9}}"),
                     "a primitive whose POSITION is out of range");
    assert_glb_fails(PRIMITIVE("{\"attributes\":{\"POSITION\":2}}"),
                     "a primitive with positions of the wrong type or number");
    assert_glb_fails(PRIMITIVE("{\"attributes\":{\"POSITION\":0},\"indices\":0}"),
                     "indices that are no whole numbers");
    assert_glb_fails(PRIMITIVE("{\"attributes\":{\"POSITION\":0},\"mode\":7}"),
                     "a primitive of an unknown mode");
    /* sizes of the file are not believed */
    static const char *const accessors[] = {
        "\"bufferView\":0,\"componentType\":5126,\"count\":4000000000",
        "\"bufferView\":0,\"componentType\":5126,\"count\":12",
        "\"bufferView\":0,\"componentType\":5126,\"count\":1,\"byteOffset\":121",
        "\"bufferView\":0,\"componentType\":5126,\"count\":1,\"byteOffset\":-4",
        "\"bufferView\":0,\"componentType\":5126,\"count\":1.5",
        "\"bufferView\":0,\"componentType\":5124,\"count\":1",
        "\"bufferView\":1,\"componentType\":5126,\"count\":1",
        "\"bufferView\":2,\"componentType\":5126,\"count\":1",
        "\"componentType\":5126,\"count\":1", "\"bufferView\":0,\"componentType\":5126,\"count\":0"};
    for (size_t i = 0; i < sizeof accessors / sizeof accessors[0]; i++) {
        char json[1024];
        snprintf(json, sizeof json,
                 "{\"bufferViews\":[{\"buffer\":0,\"byteLength\":132},{\"buffer\":0,\"byteOffset\":132,"
                 "\"byteLength\":1},{\"buffer\":0,\"byteLength\":132,\"byteStride\":8}],\"accessors\":"
                 "[{%s,\"type\":\"VEC3\"}]" SCENE ",\"meshes\":[{\"primitives\":[{\"attributes\":"
                 "{\"POSITION\":0}}]}]}", accessors[i]);
        assert_glb_fails(json, "accessor 0 is out of range or damaged");
    }
}

/* A mesh that nodes repeat is not repeated beyond what the file's size allows. */
static void glb_copies_are_limited(void **state) {
    (void)state;
    static bytes b, binary;
    static char json[1 << 13];
    size_t n;
    mesh_data m;
    for (int copies = 8; copies <= 512; copies *= 64) {
        n = (size_t)snprintf(json, sizeof json, "{" VIEWS ",\"meshes\":[{\"primitives\":[" ATTRIBUTES
                             ",\"mode\":5}");
        for (int i = 1; i < (copies > 8 ? 40 : 1); i++)
            n += (size_t)snprintf(json + n, sizeof json - n, ",{\"attributes\":{\"POSITION\":%d},"
                                  "\"mode\":5}", i % 2 ? 0 : 0);
        n += (size_t)snprintf(json + n, sizeof json - n, "]}],\"nodes\":[{\"mesh\":0}");
        for (int i = 1; i < copies; i++)
            n += (size_t)snprintf(json + n, sizeof json - n, ",{\"mesh\":0}");
        snprintf(json + n, sizeof json - n, "]}");
        make_binary(&binary);
        make_glb(&b, json, &binary);
        if (copies == 8) {
            read_bytes(&b, &m);
            assert_int_equal(m.triangle_count, 3 * copies);
            mesh_free(&m);
        } else {
            assert_bytes_fail(&b, "its nodes repeat a mesh too often; write fewer copies");
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stl_binary_is_told_by_its_size),
        cmocka_unit_test(stl_in_text),
        cmocka_unit_test(stl_is_written),
        cmocka_unit_test(off_of_all_kinds),
        cmocka_unit_test(glb_strips_fans_and_lists),
        cmocka_unit_test(glb_nodes_place_their_meshes),
        cmocka_unit_test(glb_skins_are_left_out),
        cmocka_unit_test(glb_comes_back),
        cmocka_unit_test(glb_says_what_is_wrong),
        cmocka_unit_test(glb_copies_are_limited),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
