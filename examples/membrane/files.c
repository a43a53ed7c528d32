/* files.c - a membrane as beads, as a scene of instances, and as a picture
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "membrane.h"

#include "files/image_io.h"
#include "helpers/render.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *write_xyz(const membrane *m, const char *path) {
    FILE *file = fopen(path, "wb");
    size_t beads = 0;
    if (!file) return "cannot open the file";
    for (size_t i = 0; i < m->count; i++) beads += (size_t)lipids[m->lipids[i].prototype].count;
    fprintf(file, "%lu\n%lu lipids, Angstrom\n", (unsigned long)beads, (unsigned long)m->count);
    for (size_t i = 0; i < m->count; i++) {
        const uint32_t kind = m->lipids[i].prototype;
        for (int b = 0; b < lipids[kind].count; b++) {
            const bead *d = &lipids[kind].beads[b];
            const float from[3] = {d->x, d->y, d->z};
            float p[3];
            trimesh_instance_apply(&m->lipids[i], from, p);
            fprintf(file, "%s %.3f %.3f %.3f\n", d->element, (double)p[0], (double)p[1],
                    (double)p[2]);
        }
    }
    const int failed = ferror(file);
    return fclose(file) != 0 || failed ? "cannot write the file" : NULL;
}

/* Each kind of lipid as one mesh with many instances: a GLB, or a picture. */
const char *write_scene(const membrane *m, const char *extension, const char *path) {
    mesh_data meshes[KINDS];
    mesh_instances groups[KINDS];
    mesh_scene scene = {0};
    float *at = malloc(m->count * 3 * sizeof *at), *turn = malloc(m->count * 4 * sizeof *turn);
    unsigned char *bytes = NULL;
    size_t size = 0, n = 0;
    const char *why = NULL;
    const int is_picture = strcmp(extension, ".png") == 0;
    if (!at || !turn) why = "no memory";
    memset(groups, 0, sizeof groups);
    memset(meshes, 0, sizeof meshes);
    for (int k = 0; k < KINDS && !why; k++) {
        if (!make_lipid(k, is_picture ? 3 : 2, &meshes[k], &why)) break;
        groups[k].mesh = &meshes[k];
        groups[k].translations = at + 3 * n;
        groups[k].rotations = turn + 4 * n;
        for (size_t i = 0; i < m->count; i++) {
            if (m->lipids[i].prototype != (uint32_t)k) continue;
            memcpy(at + 3 * n, m->lipids[i].position, 3 * sizeof *at);
            memcpy(turn + 4 * n++, m->lipids[i].rotation, 4 * sizeof *turn);
            groups[k].count++;
        }
    }
    scene.instances = groups;
    scene.instance_count = KINDS;
    if (!why && is_picture) {
        /* so that one looks into the opening, if there is one */
        const render_desc view = {.width = 1200, .height = 900, .azimuth = 18, .elevation = 14,
                                  .colors = 1, .field = 30};
        txm_image picture;
        if (render(&scene, &view, &picture, &why)) {
            image_encode(NULL, extension, &picture, &bytes, &size, &why);
            image_free(&picture);
        }
    } else if (!why) {
        mesh_encode(extension, &scene, &bytes, &size, &why);
    }
    if (bytes && !file_write(path, bytes, size)) why = "cannot write the file";
    for (int k = 0; k < KINDS; k++) mesh_free(&meshes[k]);
    free(bytes);
    free(at);
    free(turn);
    return why;
}
