/* scales.c - a mesh in, the same surface covered with scales out
   SPDX-License-Identifier: MIT OR Unlicense

   scales MESH.obj OUT.obj [VERTICES]

   How trimesh_relax.h and trimesh_cover.h work together. The first turns any mesh into one of nearly
   equilateral and equal triangles; the second places a scale on each of them, its tip towards the
   lowest corner. As the triangles are alike, so are the scales, and they overlap evenly.        */
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"
#define TRIMESH_COVER_IMPLEMENTATION
#include "trimesh_cover.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A scale: x to its right, y towards its tip, z away from the surface; lengths in triangle sides. */
enum { CORNERS = 5, FACES = 4 };
static const float corners[CORNERS][3] = {
    {-0.7f, -0.1f, 0.02f}, {0, -0.6f, 0}, {0.7f, -0.1f, 0.02f}, {0, 0.75f, 0.25f}, {0, 0, 0.18f}};
static const int faces[FACES][3] = {{1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {0, 1, 4}};

typedef struct input {
    float *positions;
    uint32_t *indices;
    size_t vertex_count, triangle_count;
} input;

/* Room for one more entry of `bytes`: the array doubles whenever count reaches a power of two. */
static int grow(void **array, size_t count, size_t bytes) {
    if (count & (count - 1)) return 1; /* there is room */
    void *more = realloc(*array, (count ? 2 * count : 1) * bytes);
    if (more) *array = more;
    return more != NULL;
}

/* The v and f lines of an OBJ file; faces of more than three corners are cut into triangles. */
static const char *read_obj(const char *path, input *in) {
    char line[4096];
    FILE *file = fopen(path, "r");
    if (!file) return "cannot read the mesh";
    const char *failed = NULL;
    while (!failed && fgets(line, sizeof line, file)) {
        float p[3];
        if (sscanf(line, "v %f %f %f", &p[0], &p[1], &p[2]) == 3) {
            void *array = in->positions;
            if (!grow(&array, in->vertex_count, sizeof p)) failed = "no memory";
            in->positions = array;
            if (!failed) memcpy(in->positions + 3 * in->vertex_count++, p, sizeof p);
        } else if (line[0] == 'f' && line[1] == ' ') {
            uint32_t fan[3];
            int count = 0;
            for (char *word = strtok(line + 2, " \t\r\n"); word && !failed; word = strtok(NULL, " \t\r\n")) {
                const long number = strtol(word, NULL, 10); /* counts from 1; from -1: backwards */
                const long index = number < 0 ? number + (long)in->vertex_count : number - 1;
                if (index < 0 || index >= (long)in->vertex_count) failed = "a face has no such vertex";
                fan[count < 2 ? count : 2] = (uint32_t)index;
                if (failed || ++count < 3) continue;
                void *array = in->indices;
                if (!grow(&array, in->triangle_count, sizeof fan)) failed = "no memory";
                in->indices = array;
                if (!failed) memcpy(in->indices + 3 * in->triangle_count++, fan, sizeof fan);
                fan[1] = fan[2];
            }
        }
    }
    fclose(file);
    return failed;
}

/* How each triangle's scale is turned, so that its tip, which points to corner 2 of the patch, points
   to the lowest corner: corner k of the triangle is corner (k + rotation) mod 3 of the patch. */
static void aim_down(const trimesh_mesh *m, int *rotations) {
    for (size_t t = 0; t < m->triangle_count; t++) {
        const uint32_t *c = m->indices + 3 * t;
        int lowest = 0;
        for (int k = 1; k < 3; k++)
            if (m->positions[3 * c[k] + 1] < m->positions[3 * c[lowest] + 1]) lowest = k;
        rotations[t] = (2 - lowest + 3) % 3;
    }
}

static const char *write_scales(const trimesh_instance *scales, size_t count, const char *path) {
    FILE *file = fopen(path, "w");
    if (!file) return "cannot write the scales";
    for (size_t i = 0; i < count; i++) {
        for (int k = 0; k < CORNERS; k++) {
            float p[3];
            trimesh_instance_apply(&scales[i], corners[k], p);
            fprintf(file, "v %g %g %g\n", (double)p[0], (double)p[1], (double)p[2]);
        }
        for (int k = 0; k < FACES; k++) {
            const int *f = faces[k]; /* numbers below 0 count backwards */
            fprintf(file, "f %d %d %d\n", f[0] - CORNERS, f[1] - CORNERS, f[2] - CORNERS);
        }
    }
    const int is_bad = ferror(file);
    return fclose(file) != 0 || is_bad ? "cannot write the scales" : NULL;
}

int main(int argc, char **argv) {
    if (argc < 3 || argc > 4) {
        fprintf(stderr, "usage: scales MESH.obj OUT.obj [VERTICES]\n");
        return 2;
    }
    txm_env env = {0}; /* malloc, silent, one thread */
    input in = {0};
    trimesh_mesh *mesh = NULL;
    trimesh_instance *scales = NULL;
    int *rotations = NULL;
    size_t count = 0;
    const char *failed = read_obj(argv[1], &in);

    /* retile: zeros mean the defaults */
    trimesh_desc desc = {0};
    desc.surface.positions = in.positions;
    desc.surface.indices = in.indices;
    desc.surface.vertex_count = in.vertex_count;
    desc.surface.face_count = in.triangle_count;
    desc.vertices = argc > 3 ? strtoul(argv[3], NULL, 10) : 1000;
    if (!failed && trimesh_retile(&desc, &env, &mesh) != TXM_OK) failed = env.message;

    /* place: a patch with one thing, in the middle of the triangle, on every triangle */
    const trimesh_point middle = {1 / 3.0f, 1 / 3.0f, 0, 1, {0, 0, 0, 1}, 0};
    const trimesh_patch patch = {&middle, 1};
    trimesh_scatter_desc scatter = {0};
    if (!failed) {
        rotations = malloc(mesh->triangle_count * sizeof *rotations);
        scales = malloc(mesh->triangle_count * sizeof *scales);
        if (!rotations || !scales) failed = "no memory";
    }
    if (!failed) {
        aim_down(mesh, rotations);
        scatter.mesh = trimesh_as_view(mesh);
        scatter.normals = mesh->normals;
        scatter.patches = &patch;
        scatter.patch_count = 1;
        scatter.rotations = rotations;
        scatter.curve = 1; /* stand on the smooth surface, not on the flat triangles */
        if (trimesh_scatter(&scatter, &env, scales, mesh->triangle_count, &count) != TXM_OK)
            failed = env.message;
    }
    if (!failed) failed = write_scales(scales, count, argv[2]);

    if (failed) fprintf(stderr, "scales: %s\n", failed);
    else printf("%s: %lu scales\n", argv[2], (unsigned long)count);
    trimesh_mesh_free(mesh);
    free(scales);
    free(rotations);
    free(in.positions);
    free(in.indices);
    return failed != NULL;
}
