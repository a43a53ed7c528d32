/* repair.c - a model with holes in its texture in, the whole texture and pictures of it out
   SPDX-License-Identifier: MIT OR Unlicense

   repair MODEL.obj TEXTURE.png MASK.png OUT

   A scan has places that no camera saw; there MASK is white. Everything is done step by step, as an
   editor does: the first step is a preview that is there at once, smooth colours with the lines in
   them. OUT.png is the texture; OUT-0.png and OUT-1.png show the model from two sides, in three
   columns: before, the preview, after.                                                          */
#define TEXINPAINT_IMPLEMENTATION
#include "texinpaint.h"

#include "files/image_io.h"
#include "helpers/render.h"

#include <stdio.h>

enum { SIDE = 480, STATES = 3 }; /* pixels of a view; before, preview, after */

typedef struct work {
    mesh_data mesh;
    uint32_t *corners; /* 0, 1, 2, ... */
    txm_image states[STATES], mask;
    const char *failed; /* why, or NULL */
} work;

static void read_all(work *w, char **argv) {
    if (!mesh_read(argv[1], 0, &w->mesh, &w->failed)) return;
    if (!w->mesh.uvs) w->failed = "the model has no texture coordinates";
    w->corners = malloc(3 * w->mesh.triangle_count * sizeof *w->corners);
    if (!w->corners) w->failed = "no memory";
    for (size_t c = 0; c < 3 * w->mesh.triangle_count && !w->failed; c++) w->corners[c] = (uint32_t)c;
    if (!w->failed) image_read(argv[2], 3, &w->states[0], &w->failed);
    if (!w->failed) image_read(argv[3], 1, &w->mask, &w->failed);
    for (int i = 1; i < STATES && !w->failed; i++) {
        if (!image_new(w->states[0].width, w->states[0].height, 3, TXM_U8, &w->states[i]))
            w->failed = "no memory";
    }
}

/* The mesh and its coordinates as the library takes them: here each corner of a triangle has its own. The
   charts still hang together, for where coordinates of neighbours are equal there is no seam. */
static texinpaint_desc describe(const work *w) {
    texinpaint_desc desc = {0};
    desc.image = w->states[0];
    desc.mask = w->mask;
    desc.mesh = mesh_view(&w->mesh);
    desc.uv = w->mesh.uvs;
    desc.uv_count = 3 * w->mesh.triangle_count;
    desc.uv_indices = w->corners;
    desc.seed = 1;
    return desc;
}

static void complete(work *w) {
    static txm_env env; /* malloc, silent, one thread; receives the message after a failure */
    const texinpaint_desc desc = describe(w);
    texinpaint_job *job = NULL;
    int more = 1;
    txm_status status = texinpaint_begin(&desc, &env, &job);
    if (status == TXM_OK) status = texinpaint_step(job, &env, &more);
    if (status == TXM_OK) status = texinpaint_draw(job, 0, &env, &w->states[1]);
    while (status == TXM_OK && more) status = texinpaint_step(job, &env, &more);
    if (status == TXM_OK) status = texinpaint_draw(job, 0, &env, &w->states[2]);
    if (status == TXM_OK) {
        const texinpaint_info info = texinpaint_info_of(job);
        printf("repair: %d holes of %lu texels; %d lines continued\n", info.holes,
               (unsigned long)info.missing, info.joins);
    } else {
        w->failed = env.message;
    }
    texinpaint_free(job);
}

/* The direction in which the missing part faces: azimuth and elevation as render.h has them. */
static void find_side(const work *w, float angles[2]) {
    const mesh_data *m = &w->mesh;
    txm_dvec3 sum = txm_d3(0, 0, 0);
    for (size_t t = 0; t < m->triangle_count; t++) {
        const float *uv = m->uvs + 6 * t;
        const int x = (int)((uv[0] + uv[2] + uv[4]) / 3 * (float)w->mask.width);
        const int y = (int)((uv[1] + uv[3] + uv[5]) / 3 * (float)w->mask.height);
        if (x < 0 || y < 0 || x >= w->mask.width || y >= w->mask.height) continue;
        if (((const unsigned char *)txm_image_row_const(&w->mask, y))[x] < 128) continue;
        txm_dvec3 p[3];
        for (size_t k = 0; k < 3; k++) {
            const float *q = m->positions + 3 * (size_t)m->indices[3 * t + k];
            p[k] = txm_d3(q[0], q[1], q[2]);
        }
        sum = txm_d3_add(sum, txm_d3_area2(p[0], p[1], p[2]));
    }
    angles[0] = (float)(atan2(sum.x, sum.z) * 180 / TXM_PI);
    angles[1] = (float)(atan2(sum.y, sqrt(sum.x * sum.x + sum.z * sum.z)) * 180 / TXM_PI);
}

/* A row of views of all states, from one side. */
static void draw_states(work *w, float azimuth, float elevation, const char *path) {
    txm_image row = {0}, view = {0};
    mesh_scene scene = {0};
    render_desc desc = {0};
    scene.surface = &w->mesh;
    desc.width = desc.height = SIDE;
    desc.azimuth = azimuth;
    desc.elevation = elevation;
    if (!image_new(STATES * SIDE, SIDE, 3, TXM_U8, &row)) w->failed = "no memory";
    for (int i = 0; i < STATES && !w->failed; i++) {
        desc.texture = &w->states[i];
        if (!render(&scene, &desc, &view, &w->failed)) break;
        for (int y = 0; y < SIDE; y++)
            memcpy((unsigned char *)txm_image_row(&row, y) + (size_t)(3 * SIDE * i),
                   txm_image_row_const(&view, y), 3 * SIDE);
        image_free(&view);
    }
    if (!w->failed) image_write(path, &row, &w->failed);
    image_free(&row);
}

int main(int argc, char **argv) {
    char path[1024];
    float side[2];
    work w = {0};
    if (argc != 5) {
        fprintf(stderr, "usage: repair MODEL.obj TEXTURE.png MASK.png OUT\n");
        return 2;
    }
    read_all(&w, argv);
    if (!w.failed) complete(&w);
    snprintf(path, sizeof path, "%s.png", argv[4]);
    if (!w.failed) image_write(path, &w.states[STATES - 1], &w.failed);
    if (!w.failed && !mesh_crease(&w.mesh, 60)) w.failed = "no memory";
    for (int i = 0; i < 2 && !w.failed; i++) {
        find_side(&w, side);
        snprintf(path, sizeof path, "%s-%d.png", argv[4], i);
        draw_states(&w, side[0] + (i ? 55.0f : 0.0f), side[1] * (i ? 0.5f : 1.0f), path);
    }
    if (w.failed) fprintf(stderr, "repair: %s\n", w.failed);
    for (int i = 0; i < STATES; i++) image_free(&w.states[i]);
    image_free(&w.mask);
    mesh_free(&w.mesh);
    free(w.corners);
    return w.failed != NULL;
}
