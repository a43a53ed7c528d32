/* forest_gl.h - the struct that all files share, and the functions of each file
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
    BARK_TILES = 24,   /* of a bark that is drawn, and at most of one that is read              */
    BARK_SIDE = 64,    /* pixels of a tile                                                      */
    LEAF_SIDE = 512,   /* pixels of a leaf picture                                              */
    CLOUDS = 8,        /* different leaf clouds of a species                                    */
    CLOUD_SIDE = 256,  /* pixels of an impostor                                                 */
    SHADOW_SIDE = 3072, /* pixels of the picture that the sun sees                              */
    MAX_CELLS = 1200000 /* of the 3D texture of light                                           */
};

typedef struct options {
    const char *species;        /* names or files, separated by commas                          */
    const char *bark, *leaf;    /* NULL: drawn by treepieces.h                                  */
    const char *shaders;        /* folder; NULL: it is searched                                 */
    const char *headless;       /* pattern of file names; NULL: a window                        */
    int count, pieces;          /* trees; pieces of a tree, 0 = the default of treepieces.h     */
    int is_bare, is_wire;       /* without leaves; levels of tessellation as colours            */
    int width, height, frames, smooth;
    uint64_t seed;
    double time;                /* seconds                                                      */
    float loop;                 /* seconds in which the pictures repeat themselves; 0: never    */
    float wind, level, half;    /* m/s; of tessellation; metres over which it halves            */
    float cards;                /* metres from the camera up to which leaves are drawn as cards  */
    float orbit[3];             /* azimuth, elevation in degrees; distance in metres, 0: all of
                                   the forest is visible                                        */
    float at[3];                /* the point that the camera orbits, if has_at                  */
    int has_at;
} options;

/* The uniform block frame_block of forest.glsl. */
typedef struct frame_data {
    float view_projection[16]; /* column-major                                                  */
    float sun_projection[16];  /* of the picture of shadows                                     */
    float eye[4], right[4], up[4], forward[4], sun[4], box_low[4], box_scale[4], lod[4];
    float shimmer[4];
} frame_data;

/* A type of piece, as treepieces.glsl reads it. */
typedef struct kind_data {
    float building[3][4], rotation[3][4];
    uint32_t first, stride, quads, leaves;
} kind_data;

typedef struct card_data {
    float center[4], right[4], up[4], normal[4];
} card_data;

/* bindings of buffers and of textures in the shaders */
enum { BONES, RECORDS, KINDS, QUADS, LOOKS, CLUSTERS, CARDS, NEAR, BUFFERS };
enum { BARK, LEAVES, IMPOSTORS, DEPTHS, LIGHT, CARD_DEPTHS, SHADOWS, TEXTURES };
enum { PIECES, WIRE, CARD, CLOUD, NEAR_CARD, LAND, PIECE_SHADOW, CLOUD_SHADOW, PROGRAMS };

typedef struct forest_gl {
    options o;
    txm_env env;
    char failed[400]; /* the message of an error; empty: none                                  */

    /* the forest: trees.c */
    treepieces_species species[MAX_SPECIES];
    int species_count;
    treepieces_kit *kit;
    treepieces_forest *forest;
    float *bones, *sway; /* of all nodes, changed by advance_wind                               */
    double now;          /* seconds                                                             */
    float low[3], high[3]; /* bounding box                                                      */

    /* the view: camera.c */
    frame_data frame;
    float near_plane, far_plane;
    float seen_from[3]; /* direction of the view that the impostors were rendered for           */
    int has_impostors;

    /* pictures.c */
    txm_image sheets[MAX_SPECIES], leaves[MAX_SPECIES];

    /* OpenGL: buffers.c, shaders.c */
    GLuint programs[PROGRAMS], buffers[BUFFERS], textures[TEXTURES];
    GLuint block, vertices, indices, array, card_frame, shadow_frame;
    int first_index[TREEPIECES_MAX_TYPES], card_count, draws;
    int first_cards[MAX_SPECIES * CLOUDS + 1]; /* of each cloud                                 */
    EGLDisplay display;
} forest_gl;

/* A function that fails returns 0 (or NULL) and sets f->failed. */

/* ---- options.c: the command line ---- */
options default_options(void);
int read_option(options *o, const char *name, const char *value);
int options_are_valid(const options *o);

/* ---- files.c: errors, memory, files ---- */
int fail(forest_gl *f, const char *format, ...);
int check(forest_gl *f, txm_status status);
void *allocate(forest_gl *f, size_t count, size_t bytes);
char *read_file(const char *path);
txm_image image_of(void *pixels, int width, int height, int channels);
int new_image(forest_gl *f, txm_image *image, int width, int height, int channels);
int read_picture(forest_gl *f, const char *path, int channels, txm_image *image);

/* ---- trees.c: species, forest, wind ---- */
int read_species(forest_gl *f);
int grow_trees(forest_gl *f);
int advance_wind(forest_gl *f, double time);
void axis_point(const forest_gl *f, uint32_t node, float along, float p[3]);

/* ---- pictures.c: bark and leaves ---- */
int make_pictures(forest_gl *f);

/* ---- shaders.c: OpenGL programs ---- */
char *read_shader(forest_gl *f, const char *name, const char *program);
int add_stage(forest_gl *f, GLuint program, GLenum type, const char *stage, const char *defines,
              const char *library, const char *body);
int make_programs(forest_gl *f, const char *path);

/* ---- light.c: shadows of the crowns ---- */
int make_light(forest_gl *f);

/* ---- buffers.c: buffers and textures ---- */
int upload_scene(forest_gl *f, const char *program);
int upload_pieces(forest_gl *f);
int upload_trees(forest_gl *f);
void upload_bones(forest_gl *f);
int upload_near(forest_gl *f);
void *at_offset(size_t bytes);

/* ---- camera.c: the view ---- */
void choose_view(forest_gl *f);
void aim_camera(forest_gl *f, int width, int height);
void aim_sun(forest_gl *f);

/* ---- frame.c: draw calls ---- */
void draw_shadows(forest_gl *f);
void draw_frame(forest_gl *f, GLuint target, int width, int height);

/* ---- headless.c: pictures without a window ---- */
int open_headless(forest_gl *f);
int render_pictures(forest_gl *f);

/* ---- window.c: only with FOREST_WINDOW ---- */
void run_window(forest_gl *f, const char *program);

static inline float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#endif
