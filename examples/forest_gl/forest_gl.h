/* forest_gl.h - what the rooms of forest_gl share: one struct, and what each room does with it
   SPDX-License-Identifier: MIT OR Unlicense  */
#ifndef FOREST_GL_H
#define FOREST_GL_H

#include "treepieces.h"

#define GL_GLEXT_PROTOTYPES
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/gl.h>
#include <GL/glext.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    MAX_SPECIES = 16,
    BARK_TILES = 24,   /* drawn if there are none                                               */
    BARK_SIDE = 64,    /* pixels of a tile                                                      */
    LEAF_SIDE = 512,   /* pixels of a leaf picture                                              */
    CLOUDS = 8,        /* different leaf clouds a species                                       */
    CLOUD_SIDE = 256,  /* pixels of an impostor                                                 */
    MAX_CELLS = 1200000 /* of the light's texture                                                */
};

typedef struct options {
    const char *species, *bark, *leaf, *shaders, *headless;
    int count, pieces, is_bare, is_wire, width, height, frames, smooth;
    uint64_t seed;
    double time;
    float wind, level, half;
    float orbit[3]; /* degrees, degrees, metres; distance 0: as far as shows it all             */
    float at[3];
    int has_at;
} options;

/* What all shaders know of a frame: frame_block in forest.glsl. */
typedef struct frame_data {
    float view_projection[16]; /* column by column                                              */
    float eye[4], right[4], up[4], forward[4], sun[4], box_low[4], box_scale[4], lod[4];
} frame_data;

/* A type of piece as treepieces.glsl wants it. */
typedef struct kind_data {
    float building[3][4], rotation[3][4];
    uint32_t first, stride, quads, leaves;
} kind_data;

typedef struct card_data {
    float center[4], right[4], up[4], normal[4];
} card_data;

enum { BONES, RECORDS, KINDS, QUADS, LOOKS, CLUSTERS, CARDS, BUFFERS }; /* bindings                */
enum { BARK, LEAVES, IMPOSTORS, DEPTHS, LIGHT, CARD_DEPTHS, TEXTURES }; /* the same                */
enum { PIECES, WIRE, CARD, CLOUD, LAND, PROGRAMS };

typedef struct forest_gl {
    options o;
    txm_env env;
    char failed[400]; /* what went wrong; empty: nothing so far                                 */

    /* the forest */
    treepieces_species species[MAX_SPECIES];
    int species_count;
    treepieces_kit *kit;
    treepieces_forest *forest;
    float *bones, *sway;
    double now;
    txm_image sheets[MAX_SPECIES], leaves[MAX_SPECIES];
    float low[3], high[3]; /* the box around it                                                 */

    /* the view */
    frame_data frame;
    float near_plane, far_plane;
    float seen_from[3]; /* direction that the impostors are for                                 */
    int has_impostors;

    /* OpenGL */
    GLuint programs[PROGRAMS], buffers[BUFFERS], textures[TEXTURES];
    GLuint block, vertices, indices, array, card_frame;
    int first_index[TREEPIECES_MAX_TYPES], card_count, draws;
    EGLDisplay display;
} forest_gl;

/* What can fail returns 0, and a message is in f->failed. */

/* ---- options.c ---- */
options defaults(void);
int read_option(options *o, const char *name, const char *value);
int is_sound(const options *o);

/* ---- files.c ---- */
int fail(forest_gl *f, const char *format, ...);
int check(forest_gl *f, txm_status status);
void *need(forest_gl *f, size_t count, size_t bytes);
char *read_text(const char *path);
txm_image image_of(void *pixels, int width, int height, int channels);
int new_image(forest_gl *f, txm_image *image, int width, int height, int channels);
int read_picture(forest_gl *f, const char *path, int channels, txm_image *image);

/* ---- trees.c ---- */
int read_species(forest_gl *f);
int grow(forest_gl *f);
int blow(forest_gl *f, double time);
void axis_point(const forest_gl *f, uint32_t node, float along, float p[3]);

/* ---- pictures.c ---- */
int make_pictures(forest_gl *f);

/* ---- shaders.c ---- */
char *read_shader(forest_gl *f, const char *name, const char *program);
int add_stage(forest_gl *f, GLuint program, GLenum type, const char *stage, const char *defines,
              const char *library, const char *body);
int make_programs(forest_gl *f, const char *path);

/* ---- light.c ---- */
int make_light(forest_gl *f);

/* ---- buffers.c ---- */
int prepare(forest_gl *f, const char *program);
int upload_pieces(forest_gl *f);
int upload_trees(forest_gl *f);
void upload_bones(forest_gl *f);
void *at_offset(size_t bytes);

/* ---- camera.c ---- */
void choose_view(forest_gl *f);
void aim(forest_gl *f, int width, int height);

/* ---- frame.c ---- */
void draw_frame(forest_gl *f, GLuint target, int width, int height);

/* ---- headless.c ---- */
int open_headless(forest_gl *f);
int render_pictures(forest_gl *f);

/* ---- window.c ---- */
void run_window(forest_gl *f, const char *program);

static inline float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#endif
