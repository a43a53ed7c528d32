/* test_mesh_io.c - mesh files read, written, read again; and files that are none
   SPDX-License-Identifier: MIT OR Unlicense

   Built with: tools/files/mesh*.c tools/files/image_io.c tools/files/stb.c                       */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "meshkit.h"

/* ---- OBJ ----------------------------------------------------------------------------------- */

static void obj_reads_what_others_write(void **state) {
    (void)state;
    static const uint32_t indices[] = {0, 1, 2, 0, 2, 3, 3, 2, 4};
    mesh_data m;
    read_text("# a comment\r\nmtllib x.mtl\r\no thing\r\n"
              "v 0 0 0\r\nv 1. 0 .0\r\nv +1 1e0 0\r\nv 0 10E-1 -0\r\nv 0.5\t2 0 1\r\n"
              "vt 0.25 0.75\r\nvt 1 0 0\r\nvt 0 0\r\nvn 0 0 1\r\ng part\r\nusemtl x\r\ns off\r\n"
              "f 1/1/1 2/2/1 \\\r\n  3/3 -2/1\r\nl 1 2\r\nf 4 -3//1 5//1 # and so on\r\n",
              &m);
    assert_int_equal(m.vertex_count, 5);
    assert_indices(&m, indices, 3);
    assert_null(m.colors);
    assert_null(m.normals);
    assert_float_equal(m.positions[6], 1, 0);
    assert_float_equal(m.positions[12], 0.5, 0);
    /* v runs downwards in memory; corners without texture coordinates get 0 0 */
    const float uvs[] = {0.25f, 0.25f, 1, 1, 0, 1, 0.25f, 0.25f, 0, 1, 0.25f, 0.25f};
    assert_memory_equal(m.uvs, uvs, sizeof uvs);
    for (int i = 12; i < 18; i++) assert_float_equal(m.uvs[i], 0, 0);
    mesh_free(&m);
    assert_null(m.positions);

    read_text("v 0 0 0\nv 1 0 0\nf 1 2 3\nv 0 1 0", &m); /* a face before its vertex */
    assert_int_equal(m.triangle_count, 1);
    mesh_free(&m);
}

static void obj_colors(void **state) {
    (void)state;
    mesh_data m;
    read_text("v 0 0 0\nv 1 0 0 1 0 0.5\nv 0 1 0 1 0 1 0\nv 1 1 1\nf 1 2 3\n", &m);
    const unsigned char colors[] = {255, 255, 255, 255, 255, 0,   128, 255,
                                    0,   255, 0,   255, 255, 255, 255, 255};
    assert_memory_equal(m.colors, colors, sizeof colors);
    mesh_free(&m);
    read_text("v 0 0 0 255 0 1\nv 1 0 0 17 0 2\nv 0 1 0 0 0 0\nf 1 2 3\n", &m); /* 0..255 */
    const unsigned char bytes[] = {255, 0, 1, 255, 17, 0, 2, 255, 0, 0, 0, 255};
    assert_memory_equal(m.colors, bytes, sizeof bytes);
    mesh_free(&m);
}

static void polygons_become_triangles(void **state) {
    (void)state;
    mesh_data m;
    /* a square, cut from its first corner; one that is hollow beside it is not */
    static const uint32_t square[] = {0, 1, 2, 0, 2, 3}, hollow[] = {0, 1, 3, 1, 2, 3};
    read_text("v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n", &m);
    assert_indices(&m, square, 2);
    mesh_free(&m);
    read_text("v 0 0 0\nv 1 2 0\nv 2 0 0\nv 1 3 0\nf 1 2 3 4\n", &m);
    assert_indices(&m, hollow, 2);
    mesh_free(&m);
    /* an L that a fan from its first corner would leave */
    read_text("v 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 0\nf 1 2 3 4 5 6\n", &m);
    assert_int_equal(m.triangle_count, 4);
    assert_float_equal(flat_area2(&m), 6, 1e-12);
    mesh_free(&m);
    /* a star with four points */
    read_text("v 3 0 0\nv 1 1 0\nv 0 3 0\nv -1 1 0\nv -3 0 0\nv -1 -1 0\nv 0 -3 0\nv 1 -1 0\n"
              "f 1 2 3 4 5 6 7 8\n", &m);
    assert_int_equal(m.triangle_count, 6);
    assert_float_equal(flat_area2(&m), 24, 1e-12);
    mesh_free(&m);
    /* one that crosses itself, one in a line: any triangles, as many as there must be */
    read_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\nf 1 1 2 2 1\n", &m);
    assert_int_equal(m.triangle_count, 2 + 3);
    mesh_free(&m);
}

static void obj_numbers_are_rounded_as_strtod_does(void **state) {
    (void)state;
    static const char *const words[] = {"0.1",
                                        "-0",
                                        "1e-45",
                                        "3.4028234e38",
                                        "1e-50",
                                        "123456789012345678901234567890",
                                        "0.000000000000000000000000000000000000000000001",
                                        "9007199254740993",
                                        "1.7976931348623157e-308",
                                        "16777217",
                                        "16777219",
                                        "0.30000001192092896",
                                        "1.00000005960464477540",
                                        "5e-324",
                                        "1e22",
                                        "1e23",
                                        "8.5e-23",
                                        "4.35",
                                        ".5",
                                        "5.",
                                        "+7",
                                        "1E+2",
                                        "00012",
                                        "2.2250738585072014e-308"};
    txm_rng rng = txm_rng_make(3, 0);
    for (int i = 0; i < 2000; i++) {
        char word[64], text[256];
        mesh_data m;
        if (i < (int)(sizeof words / sizeof words[0])) snprintf(word, sizeof word, "%s", words[i]);
        else
            snprintf(word, sizeof word, "%.*g", 1 + (int)txm_rng_below(&rng, 20),
                     (txm_rng_double(&rng) - 0.5) * pow(10, txm_rng_range(&rng, -30, 30)));
        snprintf(text, sizeof text, "v %s 0 0\nf 1 1 1", word);
        read_text(text, &m);
        const float expected = (float)strtod(word, NULL);
        if (memcmp(&expected, m.positions, sizeof expected) != 0) fail_msg("%s", word);
        mesh_free(&m);
    }
}

static void obj_says_what_is_wrong(void **state) {
    (void)state;
    const char *range = "line 2: a face with an index that is out of range or no number";
    assert_fails("", "the file is empty");
    assert_fails("hello\nworld", "no vertices in it; give an OBJ, PLY, STL, OFF or GLB file");
    assert_fails("\xff\xfev", "its text is in UTF-16; save it in UTF-8");
    assert_fails("v 0 0 0\n", "no faces in it");
    assert_fails("v 0 0\n", "line 1: a vertex has less than three coordinates");
    assert_fails("\n\nv 0 0 nan\nf 1 1 1",
                 "line 3: vertex 1 has a coordinate that is not a finite number");
    assert_fails("v 0 0 0\nv 0 -inf 0\nf 2 2 2\n",
                 "line 2: vertex 2 has a coordinate that is not a finite number");
    assert_fails("v 0 1e101 0\nf 1 1 1",
                 "line 1: vertex 1 has a coordinate that is not a finite number");
    assert_fails("v 0 0 0\nv 1e39 0 0\nv 1 0x1 0", "line 3: a coordinate is not a number");
    assert_fails("v 0 0 1,5.2\n", "line 1: a coordinate is not a number");
    assert_fails("v 0 0 1,5,2\n", "line 1: a coordinate is not a number");
    assert_fails("v 0 x 0\n", "line 1: a coordinate is not a number");
    assert_fails("v 0 1- 0\n", "line 1: a coordinate is not a number");
    assert_fails("vt x 0\n", "line 1: a texture coordinate is not a number");
    assert_fails("v 0 0 0\nf 0 1 1\n", range);
    assert_fails("v 0 0 0\nf -2 1 1\n", range);
    assert_fails("v 0 0 0\nf 1 1 99999999999999999999\n", range);
    assert_fails("v 0 0 0\nf 1 1 1/x\n", range);
    assert_fails("v 0 0 0\nf 1 1 1/1/1/1\n", range);
    assert_fails("v 0 0 0\nf 1 1\n", "no faces in it");
    assert_fails("v 0 0 0 \\\n\nf 1 1 2", "line 3: a face with vertex 2, but there are only 1");
    assert_fails("v 0 0 0\nf 1/1 1/1 1/1",
                 "line 2: a face with texture vertex 1, but there are only 0");
}

/* What other programs write, and what does no harm, is read and told in one line. */
static void text_as_people_have_it(void **state) {
    (void)state;
    static const char *const same[] = {
        "v 0 0 0\nv 1.5 0 0\nv 0 25 0\nf 1 2 3\n",
        "\xef\xbb\xbfv 0 0 0\nv 1.5 0 0\nv 0 25 0\nf 1 2 3\n",
        "# a\rv 0 0 0\rv 1.5 0 0\rv 0 25 0\rf 1 2 3\r",
        "v 0 0 0\r\nv 1.5 \\\r\n0 0\r\nv 0 25 0\r\nf 1 2\\  \r\n 3 \\",
        "# C:\\\nv 0 0 0\no a\\\nv 1.5 0 0 # \\\nv 0 25 0\nusemtl \\\nf 1 2 3 # \\\nfoo\\\n",
        "mtllib b\\\rv 0 0 0\rg\\\rv 1.5 0 0\rv 0 25 0\rf 1 2 3",
        "v 0 0D0 0.\nv 1.5D+00 0 0.d0\nv 0 2.5d1 0\nf 1 2 3\n",
        "v 0 0 0\nv 1,5 0 0,0\nv 0 25 0\nf 1 2 3\n",
        "v 0 0 0\nv 1.5 0 0\nv 0 25 0\nf 1 2\nf 3\nf 1 2 3\nf\n",
        "v 0 0 0\nv 1.5 0 0\nv 0 25 0\nv nan 0 inf\nv -1.#IND -nan(ind) 1.#QNAN\nf 1 2 3\n",
        "v 0 0 0\nv 1.5 0 0\nv 0 25 0\nvt nan 0\nvt -1.#IND 1\nf 1/2 2/1 3/1\n"};
    static const char *const notes[] = {
        "", "", "", "", "", "", "", "commas in numbers were taken for decimal points",
        "left out: faces with less than three corners (3)",
        "left out: unused vertices that are not finite (2)",
        "left out: texture coordinates that are not finite (2)"};
    const float positions[] = {0, 0, 0, 1.5f, 0, 0, 0, 25, 0};
    static const uint32_t indices[] = {0, 1, 2};
    for (size_t i = 0; i < sizeof same / sizeof same[0]; i++) {
        mesh_data m;
        read_text(same[i], &m);
        assert_indices(&m, indices, 1);
        assert_memory_equal(m.positions, positions, sizeof positions);
        assert_string_equal(m.note, notes[i]);
        assert_null(m.uvs);
        mesh_free(&m);
    }
}

/* A mesh far from zero has the shape that it has there; so has one that is very large or small. */
static void a_place_keeps_the_shape(void **state) {
    (void)state;
    const double places[][4] = {{455000.25, 5400000.125, 210.5, 1},
                                {-1e9, 1e9, 0, 1},
                                {0, 0, 0, 1e-30},
                                {0, 0, 0, 1e25},
                                {1e40, 0, 0, 1e36},
                                {3e-20, 0, 0, 1e-24}};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        const double *o = places[i], scale = o[3];
        const char *extensions[] = {".obj", ".ply"};
        char text[400];
        mesh_data m;
        snprintf(text, sizeof text,
                 "v 0 0 0\nv %.17g %.17g %.17g\nv %.17g %.17g %.17g\nv %.17g %.17g %.17g\nf 2 3 4\n",
                 o[0], o[1], o[2], o[0] + scale, o[1], o[2], o[0], o[1] + scale, o[2] + scale / 4);
        read_text(text, &m);
        for (int pass = 0; pass < 2; pass++) {
            mesh_scene scene = {0};
            unsigned char *out;
            size_t size;
            const char *why;
            const double s = mesh_place_scale(&m.place) / scale;
            const float *p = m.positions + 3; /* of the first that is used */
            assert_float_equal(s * ((double)p[3] - (double)p[0]), 1, 1e-6);
            assert_float_equal(s * ((double)p[7] - (double)p[1]), 1, 1e-6);
            assert_float_equal(s * ((double)p[8] - (double)p[2]), 0.25, 1e-6);
            for (int k = 0; k < 3; k++)
                assert_float_equal((mesh_place_out(&m.place, p[k], k) - o[k]) / scale, 0, 1e-6);
            scene.surface = &m;
            scene.place = m.place;
            assert_true(mesh_encode(extensions[pass], &scene, &out, &size, &why));
            mesh_free(&m);
            assert_true(decode(out, size, 0, &m, &why));
            free(out);
        }
        mesh_free(&m);
    }
}

static void lines_lie_with_the_mesh(void **state) {
    (void)state;
    const char *text = "v 455000.5 5400000 210\nv 455001 5400000.25 210\nv 455000 5400001 210\nf 1 2 3\n"
                       "l 1 \\\n 2\n";
    mesh_data m;
    mesh_lines lines;
    const char *why;
    read_text(text, &m);
    assert_true(mesh_decode_lines((const unsigned char *)text, strlen(text), &m.place, &lines, &why));
    assert_int_equal(lines.count, 1);
    assert_memory_equal(lines.points, m.positions, 6 * sizeof(float));
    mesh_lines_free(&lines);
    mesh_free(&m);
}

/* ---- PLY ----------------------------------------------------------------------------------- */

typedef struct bytes {
    unsigned char data[1 << 14];
    size_t size;
    int format; /* 0 ascii, 1 little, 2 big */
} bytes;

static void add_text(bytes *b, const char *text) {
    memcpy(b->data + b->size, text, strlen(text));
    b->size += strlen(text);
}

static const char *const type_names[] = {"char", "uint8", "short", "uint16",
                                         "int",  "uint",  "float", "double"};
static const size_t type_sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};

static void add_value(bytes *b, int type, double value) {
    uint64_t bits = (uint64_t)(int64_t)value;
    const float single = (float)value;
    uint32_t single_bits;
    memcpy(&single_bits, &single, 4);
    if (type == 6) bits = single_bits;
    if (type == 7) memcpy(&bits, &value, 8);
    if (b->format == 0) {
        char word[40];
        snprintf(word, sizeof word, "%.17g ", value);
        add_text(b, word);
        return;
    }
    const size_t n = type_sizes[type];
    for (size_t i = 0; i < n; i++)
        b->data[b->size++] = (unsigned char)(bits >> 8 * (b->format == 1 ? i : n - 1 - i));
}

/* A square with everything, its faces behind a list and an element that nobody knows. */
static void make_ply(bytes *b, int format, int type) {
    static const char *const formats[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    char line[400];
    b->size = 0;
    b->format = format;
    snprintf(line, sizeof line,
             "ply\nformat %s 1.0\ncomment element face 7\nelement junk 2\nproperty %s a\n"
             "property list uchar %s b\nelement vertex 4\nproperty %s x\nproperty %s y\n"
             "property %s z\nproperty list char int more\nproperty uchar red\n",
             formats[format], type_names[type], type_names[type], type_names[type],
             type_names[type], type_names[type]);
    add_text(b, line);
    add_text(b, "property ushort green\nproperty float blue\nproperty float s\nproperty double t\n"
                "element face 1\nproperty int flags\nproperty list uchar uint vertex_indices\n"
                "property list uchar float texcoord\nend_header\n");
    for (int i = 0; i < 2; i++) {
        add_value(b, type, 100);
        add_value(b, 1, 2);
        add_value(b, type, 1);
        add_value(b, type, 2);
    }
    for (int i = 0; i < 4; i++) {
        add_value(b, type, i == 1 || i == 2);
        add_value(b, type, i / 2);
        add_value(b, type, 3);
        add_value(b, 0, i);
        for (int k = 0; k < i; k++) add_value(b, 4, -7);
        add_value(b, 1, 10 * i);
        add_value(b, 3, 257 * 20 * i);
        add_value(b, 6, i / 4.0);
        add_value(b, 6, i / 4.0);
        add_value(b, 7, 0.25);
    }
    add_value(b, 4, -1);
    add_value(b, 1, 4);
    for (int i = 0; i < 4; i++) add_value(b, 5, i);
    add_value(b, 1, 2);
    add_value(b, 6, 0.5);
    add_value(b, 6, 0.5);
}

static void ply_of_all_formats_and_types(void **state) {
    (void)state;
    static bytes b;
    static const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    const unsigned char colors[] = {0,  0,  0,   255, 10, 20, 64,  255,
                                    20, 40, 128, 255, 30, 60, 191, 255};
    const float uvs[] = {0, 0.75f, 0.25f, 0.75f, 0.5f, 0.75f, 0, 0.75f, 0.5f, 0.75f, 0.75f, 0.75f};
    const float positions[] = {0, 0, 3, 1, 0, 3, 1, 1, 3, 0, 1, 3};
    for (int format = 0; format < 3; format++) {
        for (int type = 0; type < 8; type++) {
            mesh_data m;
            const char *why;
            make_ply(&b, format, type);
            if (!decode(b.data, b.size, 0, &m, &why)) fail_msg("%d %d: %s", format, type, why);
            assert_indices(&m, indices, 2);
            assert_memory_equal(m.positions, positions, sizeof positions);
            assert_memory_equal(m.colors, colors, sizeof colors);
            assert_memory_equal(m.uvs, uvs, sizeof uvs);
            mesh_free(&m);
        }
    }
}

/* Line ends and blanks of headers, 64 bits, strips. */
static void ply_as_people_have_it(void **state) {
    (void)state;
    static const char body[] = "\n\0\0\0\0\0\0\0"; /* begins with a line end that is none */
    static const char *const ends[] = {"\n", "\r\n", "\r", " \n", "\t \r\n", "  \r"};
    for (size_t e = 0; e < sizeof ends / sizeof ends[0]; e++) {
        static bytes b;
        const char *lines[] = {"ply", "format  binary_little_endian 1.0", "element vertex 11",
                               "property uchar x", "property uchar y", "property uchar z",
                               "element face 1", "property list uchar int64 vertex_indices",
                               "element tristrips 1", "property list int int vertex_indices",
                               "end_header"};
        static const double strip[] = {0, 1, 2, 3, -1, 4, 5, 6, 6, 7};
        static const uint32_t indices[] = {10, 2, 3, 0, 1, 2, 2, 1, 3, 4, 5, 6};
        mesh_data m;
        const char *why;
        b.size = 0;
        b.format = 1;
        for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
            add_text(&b, lines[i]);
            add_text(&b, ends[e]);
        }
        memcpy(b.data + b.size, body, 8);
        b.size += 8;
        for (int i = 8; i < 33; i++) add_value(&b, 1, i);
        add_value(&b, 1, 3);
        for (int i = 0; i < 3; i++) {
            add_value(&b, 5, indices[i]);
            add_value(&b, 5, 0);
        }
        add_value(&b, 4, 10);
        for (int i = 0; i < 10; i++) add_value(&b, 4, strip[i]);
        if (!decode(b.data, b.size, 0, &m, &why)) fail_msg("%d: %s", (int)e, why);
        assert_indices(&m, indices, 4);
        assert_float_equal(m.positions[0], 10, 0);
        assert_float_equal(m.positions[32], 32, 0);
        mesh_free(&m);
    }
}

static void ply_cut_short_is_refused(void **state) {
    (void)state;
    static bytes b;
    for (int format = 0; format < 3; format++) {
        make_ply(&b, format, 6);
        const size_t least = format ? b.size : b.size - 4; /* of ascii, the last digits may go */
        for (size_t n = 0; n < least; n++) {
            mesh_data m;
            const char *why;
            assert_false(decode(b.data, n, 0, &m, &why));
        }
    }
}

static void ply_points(void **state) {
    (void)state;
    const char *text = "ply\r\nformat ascii 1.0\r\nelement vertex 2\r\nproperty float x\r\n"
                       "property float y\r\nproperty float z\r\nproperty float nx\r\n"
                       "property float ny\r\nproperty float nz\r\nproperty float qx\r\n"
                       "property float qy\r\nproperty float qz\r\nproperty float qw\r\n"
                       "property uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\n"
                       "property uchar alpha\r\nend_header\r\n"
                       "1 2 3 0 0 1 0 0 0 1 9 8 7 6\r\n4 5 6 0 1 0 1 0 0 0 1 2 3 4";
    const float rotations[] = {0, 0, 0, 1, 1, 0, 0, 0};
    const unsigned char colors[] = {9, 8, 7, 6, 1, 2, 3, 4};
    mesh_data m;
    const char *why;
    assert_true(decode(text, strlen(text), 1, &m, &why));
    assert_int_equal(m.vertex_count, 2);
    assert_int_equal(m.triangle_count, 0);
    assert_float_equal(m.normals[4], 1, 0);
    assert_memory_equal(m.rotations, rotations, sizeof rotations);
    assert_memory_equal(m.colors, colors, sizeof colors);
    mesh_free(&m);
    assert_fails(text, "no faces in it");
}

#define PLY "ply\nformat ascii 1.0\n"
#define XYZ "property float x\nproperty float y\nproperty float z\n"

static void ply_says_what_is_wrong(void **state) {
    (void)state;
    const char *early = "the file ends too early; get a whole copy";
    assert_fails("ply\n", "line 2: the header has no end");
    assert_fails("ply\nformat text 1.0\nelement vertex 1\n",
                 "line 3: no known format; ascii or binary is read");
    assert_fails(PLY "element vertex\n", "line 3: an element without a proper count");
    assert_fails(PLY "element vertex -1\n", "line 3: an element without a proper count");
    assert_fails(PLY "element vertex 99999999999\n", "line 3: an element without a proper count");
    assert_fails(PLY "property float x\n", "line 3: a property of nothing");
    assert_fails(PLY "element vertex 1\nproperty real x\n", "line 4: a property of no known type");
    assert_fails(PLY "element vertex 1\nproperty list float int x\n",
                 "line 4: a list with a length of no known type");
    assert_fails(PLY "element vertex 1\nproperty float x\nend_header\n1\n",
                 "its vertices have no x, y and z");
    assert_fails(PLY "element vertex 0\n" XYZ "end_header\n", "no vertices in it");
    /* a size is believed only as far as the file goes */
    assert_fails(PLY "element vertex 2000000000\n" XYZ "end_header\n1 2 3\n", early);
    assert_fails("ply\nformat binary_big_endian 1.0\nelement vertex 2000000000\n" XYZ
                 "end_header\n....",
                 early);
    assert_fails(PLY "element vertex 1\n" XYZ "end_header\n1 2 x\n", "line 8: not a number");
    assert_fails(PLY "element vertex 1\n" XYZ "end_header\n1 2 nan\n",
                 "no faces in it");
#define FACE PLY "element vertex 1\n" XYZ "element face 1\nproperty list int int vertex_index\n" \
             "end_header\n1 2 3\n"
    assert_fails(FACE "3 0 0 1", "line 11: a face with vertex 2, but there are only 1");
    assert_fails(FACE "3 0 0 -1", "line 11: a face with an index that is out of range");
    assert_fails(FACE "3 0 0 0.5", "line 11: a face with an index that is out of range");
    assert_fails(FACE "2 0 0", "no faces in it");
    assert_fails(PLY "element vertex 1\n" XYZ "element face 1\nproperty list int int "
                 "vertex_index\nend_header\n1 nan 3\n3 0 0 0",
                 "line 10: vertex 1 has a coordinate that is not a finite number");
    assert_fails(FACE "2000000000 0 0",
                 "line 11: a list is longer than the file; get a whole copy");
    assert_fails(FACE "-1 0 0", "line 11: a list is longer than the file; get a whole copy");
}

/* ---- writing ------------------------------------------------------------------------------- */

/* Two triangles of a square, texture coordinates torn apart along the diagonal. */
static float square_positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0.1f, 0, 1, 0};
static float square_normals[] = {0, 0, 1, 0, 0, 2, 0, 0, 0, 0, 1, 0};
static unsigned char square_colors[] = {255, 0, 0, 255, 0, 128, 0, 255, 1, 2, 3, 255, 4, 5, 6, 255};
static uint32_t square_indices[] = {0, 1, 2, 0, 2, 3};
static float square_uvs[] = {0, 1, 0.5f, 1, 0.5f, 0.25f, 0.5f, 1, 1, 0.25f, 0.5f, 0.25f};

static mesh_data square(void) {
    mesh_data m;
    memset(&m, 0, sizeof m);
    m.vertex_count = 4;
    m.triangle_count = 2;
    m.positions = square_positions;
    m.normals = square_normals;
    m.colors = square_colors;
    m.indices = square_indices;
    m.uvs = square_uvs;
    return m;
}

static void encode(const char *extension, const mesh_scene *scene, unsigned char **out,
                   size_t *size) {
    const char *why = NULL;
    if (!mesh_encode(extension, scene, out, size, &why)) fail_msg("%s", why);
}

/* The file in extents has the same bytes, and so many of these are in the arrays of the scene. */
static void assert_same_extents(const mesh_scene *scene, const char *extension, const unsigned char *bytes,
                                size_t size, const void *array, int lent) {
    mesh_file file;
    const char *why;
    size_t at = 0;
    int found = 0;
    assert_true(mesh_encode_extents(extension, scene, &file, &why));
    assert_int_equal(file.size, size);
    for (int i = 0; i < file.count; i++) {
        assert_true(file.extents[i].size > 0 && file.extents[i].size <= size - at);
        assert_memory_equal(file.extents[i].bytes, bytes + at, file.extents[i].size);
        at += file.extents[i].size;
        found += file.extents[i].bytes == array;
    }
    assert_int_equal(at, size);
    assert_int_equal(found, lent);
    mesh_file_free(&file);
}

/* Corner by corner, as vertices may have been doubled. */
static void assert_same_corners(const mesh_data *a, const mesh_data *b) {
    assert_int_equal(a->triangle_count, b->triangle_count);
    for (size_t c = 0; c < 3 * a->triangle_count; c++) {
        const size_t v = a->indices[c], w = b->indices[c];
        assert_memory_equal(a->positions + 3 * v, b->positions + 3 * w, 3 * sizeof(float));
        assert_memory_equal(a->colors + 4 * v, b->colors + 4 * w, 4);
        assert_memory_equal(a->uvs + 2 * c, b->uvs + 2 * c, 2 * sizeof(float));
    }
}

static void obj_and_ply_come_back(void **state) {
    (void)state;
    static const char *const extensions[] = {".obj", ".ply"};
    for (int i = 0; i < 2; i++) {
        const mesh_data m = square();
        mesh_data again;
        mesh_scene scene = {0};
        unsigned char *out;
        size_t size;
        const char *why;
        scene.surface = &m;
        encode(extensions[i], &scene, &out, &size);
        if (!decode(out, size, 0, &again, &why)) fail_msg("%s", why);
        assert_int_equal(again.vertex_count, i ? 6 : 4); /* PLY: two are doubled */
        assert_same_corners(&m, &again);
        free(out);
        mesh_free(&again);
    }
}

static void obj_refers_to_its_material(void **state) {
    (void)state;
    const mesh_data m = square();
    mesh_scene scene = {0};
    unsigned char *out;
    size_t size;
    const char *why;
    scene.surface = &m;
    scene.library = "a b.mtl";
    scene.texture = "t.png";
    encode(".obj", &scene, &out, &size);
    assert_memory_equal(out, "mtllib a b.mtl\nv ", 17);
    free(out);
    assert_true(mesh_encode_mtl(&scene, &out, &size, &why));
    const char *end = "map_Kd t.png\n";
    assert_memory_equal(out + size - strlen(end), end, strlen(end));
    free(out);
}

static uint32_t u32_at(const unsigned char *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static void glb_is_made_of_whole_chunks(void **state) {
    (void)state;
    const mesh_data m = square();
    const float translations[] = {0, 0, 0, 5, 0, 0}, scales[] = {1, 1, 1, 2, 2, 2};
    const mesh_instances copies = {&m, 2, translations, NULL, scales, NULL, NULL, NULL};
    mesh_scene scene = {0};
    unsigned char *out;
    size_t size;
    char json[4096];
    scene.surface = &m;
    scene.instances = &copies;
    scene.instance_count = 1;
    scene.texture = "a b\".png";
    encode(".glb", &scene, &out, &size);
    assert_memory_equal(out, "glTF", 4);
    assert_int_equal(u32_at(out + 4), 2);
    assert_int_equal(u32_at(out + 8), size);
    const size_t length = u32_at(out + 12);
    assert_int_equal(length % 4, 0);
    assert_memory_equal(out + 16, "JSON", 4);
    assert_true(length < sizeof json);
    memcpy(json, out + 20, length);
    json[length] = 0;
    assert_non_null(strstr(json, "\"min\":[0,0,0],\"max\":[1,1,0.100000001]"));
    assert_non_null(strstr(json, "\"uri\":\"a%20b%22.png\""));
    assert_non_null(strstr(json, "\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":"
                                 "{\"TRANSLATION\":10,\"SCALE\":11}}}"));
    assert_int_equal(u32_at(out + 20 + length) % 4, 0);
    assert_memory_equal(out + 24 + length, "BIN\0", 4);
    assert_int_equal(28 + length + u32_at(out + 20 + length), size);
    assert_same_extents(&scene, ".glb", out, size, translations, 1);
    free(out);
    scene.instances = NULL;
    scene.instance_count = 0;
    encode(".obj", &scene, &out, &size);
    assert_same_extents(&scene, ".obj", out, size, translations, 0);
    free(out);
}

/* Two surfaces with materials of their own. */
static void obj_has_parts(void **state) {
    (void)state;
    const mesh_data m = square();
    const mesh_material bark = {.name = "bark", .texture = "b.png", .repeats = 1};
    const mesh_material leaves = {.name = "leaves", .texture = "l.png", .is_cut_out = 1};
    const mesh_part parts[] = {{&m, &bark}, {&m, &leaves}};
    mesh_scene scene = {0};
    mesh_data again;
    unsigned char *out;
    size_t size;
    const char *why;
    scene.parts = parts;
    scene.part_count = 2;
    scene.library = "a.mtl";
    encode(".obj", &scene, &out, &size);
    if (!decode(out, size, 0, &again, &why)) fail_msg("%s", why);
    assert_int_equal(again.vertex_count, 8); /* numbers count on from part to part */
    assert_int_equal(again.triangle_count, 4);
    for (size_t c = 0; c < 6; c++) {
        assert_int_equal(again.indices[6 + c], again.indices[c] + 4);
        assert_memory_equal(again.uvs + 2 * (6 + c), again.uvs + 2 * c, 2 * sizeof(float));
    }
    mesh_free(&again);
    free(out);
    assert_true(mesh_encode_mtl(&scene, &out, &size, &why));
    const char *end = "illum 1\nmap_Kd l.png\nmap_d l.png\n";
    assert_memory_equal(out + size - strlen(end), end, strlen(end));
    free(out);
}

/* A joint on another, and a clip that turns it. */
static void glb_has_a_skeleton(void **state) {
    (void)state;
    static const float times[] = {0, 1}, turns[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0};
    mesh_joint joints[2] = {
        {"foot", -1, {0, 0, 0}, {0, 0, 0, 1}, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}},
        {"top", 0, {0, 2, 0}, {0, 0, 0, 1}, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -2, 0, 1}}};
    const mesh_skeleton skeleton = {"tree", joints, 2, "wind", 2, times, turns};
    uint32_t bound[16] = {0, 1, 7, 0};
    float weights[16] = {0.75f, 0.25f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const mesh_material bark = {.name = "bark"};
    mesh_data m = square();
    const mesh_part part = {&m, &bark};
    mesh_scene scene = {0};
    unsigned char *out;
    size_t size;
    char json[8192];
    m.uvs = NULL;
    m.joints = bound;
    m.weights = weights;
    scene.parts = &part;
    scene.part_count = 1;
    scene.skeleton = &skeleton;
    scene.extras = "{\"seed\":7}";
    encode(".glb", &scene, &out, &size);
    const size_t length = u32_at(out + 12);
    assert_true(length < sizeof json);
    memcpy(json, out + 20, length);
    json[length] = 0;
    assert_non_null(strstr(json, "\"scenes\":[{\"nodes\":[0,1],\"extras\":{\"seed\":7}}]"));
    assert_non_null(strstr(json, "{\"name\":\"tree\",\"mesh\":0,\"skin\":0}"));
    assert_non_null(strstr(json, "{\"name\":\"foot\",\"children\":[2],"));
    assert_non_null(strstr(json, "\"joints\":[1,2]"));
    assert_non_null(strstr(json, "\"min\":[0],\"max\":[1]"));
    assert_non_null(strstr(json, "{\"sampler\":1,\"target\":{\"node\":2,\"path\":\"rotation\"}}"));
    /* the joints of vertex 0, behind positions, normals, colors: without weight it is joint 0 */
    static const unsigned char first[] = {0, 0, 1, 0, 0, 0, 0, 0};
    assert_memory_equal(out + 28 + length + 4 * (12 + 12 + 8), first, sizeof first);
    free(out);
}

static void copies_are_baked(void **state) {
    (void)state;
    const mesh_data m = square();
    const float translations[] = {0, 0, 0, 5, 0, 0}, scales[] = {1, 1, 1, 2, 2, 2};
    const float rotations[] = {0, 0, 0, 1, 0, 0, 0.70710678f, 0.70710678f};
    const mesh_instances copies = {&m, 2, translations, rotations, scales, NULL, NULL, NULL};
    mesh_data baked;
    const char *why;
    assert_true(mesh_bake(&copies, 1, &baked, &why));
    assert_int_equal(baked.vertex_count, 8);
    assert_int_equal(baked.triangle_count, 4);
    assert_memory_equal(baked.positions, square_positions, sizeof square_positions);
    const float *p = baked.positions + 3 * 5; /* 1 0 0 twice as large and a quarter round */
    assert_float_equal(p[0], 5, 1e-6);
    assert_float_equal(p[1], 2, 1e-6);
    assert_float_equal(p[2], 0, 1e-6);
    assert_int_equal(baked.indices[6], 4);
    assert_memory_equal(baked.uvs + 12, square_uvs, sizeof square_uvs);
    assert_memory_equal(baked.colors + 16, square_colors, sizeof square_colors);
    mesh_free(&baked);
    const mesh_instances none = {&m, 0, translations, NULL, NULL, NULL, NULL, NULL};
    assert_false(mesh_bake(&none, 1, &baked, &why));
    assert_null(baked.positions);
}

static void creases_keep_faces_apart(void **state) {
    (void)state;
    mesh_data m;
    mesh_scene scene = {0};
    unsigned char *out;
    size_t size, count = 0;
    read_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
              "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n", &m);
    assert_true(mesh_crease(&m, 40));
    for (size_t c = 0; c < 36; c++) { /* the normal of its face, which is along an axis */
        const float *n = m.corner_normals + 3 * c;
        assert_float_equal(fabs((double)n[0]) + fabs((double)n[1]) + fabs((double)n[2]), 1, 1e-6);
    }
    scene.surface = &m;
    encode(".obj", &scene, &out, &size);
    for (size_t i = 0; i + 3 < size; i++) count += !memcmp(out + i, "\nvn ", 4);
    assert_int_equal(count, 6);
    free(out);
    assert_true(mesh_crease(&m, 120)); /* all smooth */
    assert_float_equal(fabs((double)m.corner_normals[0]), sqrt(1.0 / 3), 0.2);
    mesh_free(&m);
}

static void a_sphere_is_round_and_faces_outwards(void **state) {
    (void)state;
    mesh_data m;
    double volume = 0;
    assert_true(mesh_sphere(12, &m));
    for (size_t t = 0; t < m.triangle_count; t++) {
        const float *p[3];
        for (size_t k = 0; k < 3; k++) p[k] = m.positions + 3 * (size_t)m.indices[3 * t + k];
        const double six = (double)p[0][0] * (double)(p[1][1] * p[2][2] - p[1][2] * p[2][1]) +
                           (double)p[0][1] * (double)(p[1][2] * p[2][0] - p[1][0] * p[2][2]) +
                           (double)p[0][2] * (double)(p[1][0] * p[2][1] - p[1][1] * p[2][0]);
        assert_true(six > 0);
        volume += six / 6;
    }
    assert_float_equal(volume, 4 * 3.14159265 / 3, 0.06);
    mesh_free(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_reads_what_others_write),
        cmocka_unit_test(obj_colors),
        cmocka_unit_test(polygons_become_triangles),
        cmocka_unit_test(text_as_people_have_it),
        cmocka_unit_test(a_place_keeps_the_shape),
        cmocka_unit_test(lines_lie_with_the_mesh),
        cmocka_unit_test(ply_as_people_have_it),
        cmocka_unit_test(obj_numbers_are_rounded_as_strtod_does),
        cmocka_unit_test(obj_says_what_is_wrong),
        cmocka_unit_test(ply_of_all_formats_and_types),
        cmocka_unit_test(ply_cut_short_is_refused),
        cmocka_unit_test(ply_points),
        cmocka_unit_test(ply_says_what_is_wrong),
        cmocka_unit_test(obj_and_ply_come_back),
        cmocka_unit_test(obj_refers_to_its_material),
        cmocka_unit_test(glb_is_made_of_whole_chunks),
        cmocka_unit_test(obj_has_parts),
        cmocka_unit_test(glb_has_a_skeleton),
        cmocka_unit_test(copies_are_baked),
        cmocka_unit_test(creases_keep_faces_apart),
        cmocka_unit_test(a_sphere_is_round_and_faces_outwards),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
