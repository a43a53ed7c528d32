/* fuzz_mesh_decode.c - hostile bytes into mesh_decode
   SPDX-License-Identifier: MIT OR Unlicense

   With clang: -fsanitize=fuzzer,address,undefined, run on a folder of files of all formats.
   With any compiler: -DFUZZ_STANDALONE; the program then mutates the files it is given itself,
   and what they are as binary PLY, as STL and as GLB:
   fuzz_mesh_decode RUNS FILE...

   Built with the mesh and image files of tools/files/. Whatever is accepted must be as mesh_io.h
   promises, be no larger than the file allows, and come back when it is written.                */
#include "files/mesh_io.h"

#include <stdio.h>

static long accepted; /* meshes so far */

enum {
    MOST_INPUT = 1 << 16,
    COPIES = 4 /* of a byte: nodes of a GLB may repeat meshes so often */
};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_floats(const float *values, size_t count) {
    for (size_t i = 0; i < count && values; i++) {
        if (!txm_is_finite((double)values[i])) abort();
    }
}

static void check(const mesh_data *m, size_t size) {
    if (!m->positions || m->vertex_count == 0 || m->vertex_count > COPIES * size)
        abort();
    if (m->triangle_count > COPIES * size || (m->triangle_count && !m->indices)) abort();
    check_floats(m->positions, 3 * m->vertex_count);
    check_floats(m->normals, 3 * m->vertex_count);
    check_floats(m->rotations, 4 * m->vertex_count);
    check_floats(m->uvs, 6 * m->triangle_count);
    for (size_t i = 0; i < 3 * m->triangle_count; i++) {
        if (m->indices[i] >= m->vertex_count) abort();
    }
}

/* The largest side of the box around the triangles, as it is in the file. */
static double extent_of(const mesh_data *m) {
    double most = 0;
    for (size_t k = 0; k < 3; k++) {
        double low = 0, high = 0;
        for (size_t c = 0; c < 3 * m->triangle_count; c++) {
            const double p = (double)m->positions[3 * (size_t)m->indices[c] + k];
            if (c == 0 || p < low) low = p;
            if (c == 0 || p > high) high = p;
        }
        most = fmax(most, high - low);
    }
    return most * mesh_place_scale(&m->place);
}

/* Written and read again: the same triangles, corner by corner, at the same place; that may be told
   in another way, as an origin may be. */
static void write_and_read(const mesh_data *m, const char *extension) {
    mesh_scene scene = {0};
    unsigned char *bytes;
    size_t size;
    mesh_data again;
    const char *why;
    scene.surface = m;
    scene.place = m->place;
    if (!mesh_encode(extension, &scene, &bytes, &size, &why)) abort();
    const double slack = extent_of(m) / (1 << 17);
    if (!mesh_decode(bytes, size, MESH_POINTS, &again, &why)) abort();
    check(&again, size);
    if (again.triangle_count != m->triangle_count) abort();
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        const float *p = m->positions + 3 * (size_t)m->indices[c];
        const float *q = again.positions + 3 * (size_t)again.indices[c];
        for (int k = 0; k < 3; k++) {
            const double a = mesh_place_out(&m->place, p[k], k);
            if (fabs(a - mesh_place_out(&again.place, q[k], k)) > slack) abort();
        }
    }
    mesh_free(&again);
    free(bytes);
}

/* An exact copy on the heap, so that the sanitizer sees any read beyond it. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    mesh_data mesh;
    const char *why = NULL;
    if (size > MOST_INPUT) return 0;
    uint8_t *copy = (uint8_t *)malloc(size ? size : 1);
    if (!copy) return 0;
    if (size) memcpy(copy, data, size);
    const int ok = mesh_decode(copy, size, MESH_POINTS, &mesh, &why);
    free(copy);
    if (!ok) {
        if (!why || !why[0] || strchr(why, '\n') || mesh.positions || mesh.indices) abort();
        return 0;
    }
    accepted++;
    check(&mesh, size);
    if (mesh.triangle_count) {
        write_and_read(&mesh, ".obj");
        write_and_read(&mesh, ".glb");
        write_and_read(&mesh, ".stl");
    }
    write_and_read(&mesh, ".ply");
    mesh_free(&mesh);
    return 0;
}

#ifdef FUZZ_STANDALONE
/* Copy one of the seeds and change it in one to four places. */
static size_t mutate(txm_rng *rng, const uint8_t *seed, size_t size, uint8_t *data) {
    static const char *const words[] = {"-1", "0", "4294967296", "nan", "1e999", "\\\n", "/", "//",
                                        "\n", "list ", "property ", "element face 2", "v ", "f ",
                                        "facet ", "endloop", "vertex ", "OFF ", "C", "\r", "1,5", "1D9",
                                        "[0]", "{}", "5121", "5123", "5125", "5126", "\"mesh\"",
                                        "\"mode\":5", "\"mode\":6", "SCALAR", "VEC3", "tristrips",
                                        "int64", "\"children\"", "\"scale\"", "1e99", "1e-99"};
    memcpy(data, seed, size);
    for (uint32_t n = 1 + txm_rng_below(rng, 4); n > 0 && size > 0; n--) {
        size_t at = txm_rng_below(rng, (uint32_t)size);
        const char *word = words[txm_rng_below(rng, sizeof words / sizeof words[0])];
        if (txm_rng_below(rng, 2)) at %= 400; /* the header, half of the time */
        if (at >= size) at = 0;
        switch (txm_rng_below(rng, 6)) {
        case 0: data[at] = (uint8_t)txm_rng_next(rng); break;
        case 1: data[at] ^= (uint8_t)(1u << txm_rng_below(rng, 8)); break;
        case 2: data[at] = txm_rng_below(rng, 2) ? 0xff : 0; break;
        case 3: /* cut off, one time in eight */
            if (txm_rng_below(rng, 8) == 0) size = at;
            break;
        case 4:
            if (at + strlen(word) <= size) memcpy(data + at, word, strlen(word));
            break;
        default: /* a piece moved elsewhere */
            memmove(data + at, data + size / 2, (size - at) / 3 < size / 2 ? (size - at) / 3 : 0);
        }
    }
    return size;
}

static void fuzz(txm_rng *rng, const uint8_t *seed, size_t size, long runs) {
    static uint8_t data[MOST_INPUT];
    for (long i = 0; i < runs && size <= MOST_INPUT; i++)
        LLVMFuzzerTestOneInput(data, mutate(rng, seed, size, data));
}

int main(int argc, char **argv) {
    enum { FORMATS = 4 };
    static const char *const formats[FORMATS] = {"", ".ply", ".stl", ".glb"};
    static uint8_t seed[MOST_INPUT];
    long runs = argc > 2 ? atol(argv[1]) : 0;
    int files = argc - 2;
    txm_rng rng = txm_rng_make(1, 0);
    if (runs < 1) {
        fprintf(stderr, "usage: fuzz_mesh_decode RUNS FILE...\n");
        return 2;
    }
    for (int f = 0; f < files; f++) {
        FILE *file = fopen(argv[2 + f], "rb");
        size_t size = file ? fread(seed, 1, sizeof seed, file) : 0;
        mesh_data mesh;
        const char *why = "cannot be opened";
        if (!file || fclose(file) != 0 || !mesh_decode(seed, size, MESH_POINTS, &mesh, &why)) {
            fprintf(stderr, "cannot read '%s': %s\n", argv[2 + f], why);
            return 2;
        }
        fuzz(&rng, seed, size, runs / files / FORMATS);
        for (int k = 1; k < FORMATS; k++) {
            mesh_scene scene = {0};
            unsigned char *binary;
            scene.surface = &mesh;
            scene.place = mesh.place;
            if (k > 1 && mesh.triangle_count == 0) continue;
            if (!mesh_encode(formats[k], &scene, &binary, &size, &why)) return 2;
            fuzz(&rng, binary, size, runs / files / FORMATS);
            free(binary);
        }
        mesh_free(&mesh);
    }
    printf("%ld runs, %ld accepted\n", runs, accepted);
    return accepted > runs / 100 ? 0 : 1; /* else the seeds are too fragile to try anything */
}
#endif
