/* mesh_file.h - what the readers and writers of mesh files share; users include mesh_io.h
   SPDX-License-Identifier: MIT OR Unlicense

   A reader gathers in a builder what a file has, polygons included; builder_triangulate and
   builder_finish make the mesh. A writer puts its bytes into a sink. mesh.c calls both.          */
#ifndef MESH_FILE_H
#define MESH_FILE_H

#include "mesh_io.h"

static const uint32_t NO_UV = 0xffffffffu, NO_VERTEX = 0xffffffffu, NO_MATERIAL = 0xffffffffu;

/* In memory v runs downwards, in OBJ and PLY files upwards; converts either way. */
static inline float turn_v(float v) {
    return 1 - v;
}

/* ---- lists that grow: mesh_bytes.c ------------------------------------------------------- */

typedef struct list {
    void *items;
    size_t count, capacity, size; /* size: bytes of an item */
} list;

list list_of(size_t size);

/* Room for exactly so many items in all, or more. */
int list_reserve(list *l, size_t capacity);

/* Room for more items at the end, to be filled; NULL if there is no memory. */
void *list_add(list *l, size_t more);

void list_free(list *l);

/* ---- what a reader has gathered: mesh_build.c -------------------------------------------- */

typedef struct corner {
    uint32_t vertex, uv; /* uv: into the list of texture coordinates, or NO_UV */
} corner;

typedef struct polygon {
    size_t first, count, line; /* its corners; line of the file */
    uint32_t material;         /* or NO_MATERIAL                */
} polygon;

/* A color as it stands in a file: red, green, blue, alpha. */
typedef struct shade {
    float c[4];
} shade;

/* As alpha: the color has none and is opaque; or there is no color, which becomes white. */
enum { SHADE_OPAQUE = -1, SHADE_NONE = -2 };

static inline shade shade_none(void) {
    const shade s = {{0, 0, 0, SHADE_NONE}};
    return s;
}

/* What is left out and counted, as it does no harm. */
enum {
    LEFT_FACES, LEFT_VERTICES, LEFT_UVS, LEFT_NORMALS, LEFT_FACET_BYTES, LEFT_PRIMITIVES,
    LEFT_INSTANCES, LEFT_SKINS, LEFT_TARGETS, LEFT_COLORS, LEFT_LIBRARIES, LEFT_LOOKS, LEFT_KINDS
};

/* A position that is not finite. */
typedef struct bad_position {
    size_t vertex, line; /* line of the file, or 0 */
} bad_position;

typedef struct builder {
    list positions; /* 3 doubles, which need not be finite where nothing uses them        */
    list normals, rotations, colors, uvs; /* 3, 4 floats, 4 bytes, 2 floats; uvs likewise */
    list corners, polygons;                          /* as they stand in the file         */
    list triangles;                                  /* 3 corners each                    */
    list bends, heap, sorted, boxes;                 /* scratch of mesh_polygon.c, which sets their sizes */
    list names, library;      /* of materials, as in mesh_data                            */
    list vertex_shades;       /* 1 shade per vertex, or none                              */
    list face_shades;         /* 1 shade per polygon, or none                             */
    list texcoords;           /* of the face at hand: floats                              */
    list faces;               /* 1 per triangle: its polygon, if polygons carry something */
    size_t polygon;           /* that is being triangulated                               */
    uint32_t material;        /* of the polygons that follow, or NO_MATERIAL              */
    uint32_t material_count;
    int whole_face_shades;    /* they are integers, 0..255 or 0..65535                    */
    list bad;                    /* lines of positions that are not finite, in their order */
    size_t left_out[LEFT_KINDS]; /* how many of each                                       */
    size_t commas;               /* decimal commas                                         */
    int unmoved;                 /* positions stay where they are                          */
    int v_runs_down;             /* in the list of uvs, as in memory                       */
    mesh_data *mesh;
    const char **why;
} builder;

void builder_init(builder *b, mesh_data *mesh, const char **why);
void builder_free(builder *b);

/* Say what is wrong, after "line 12: " if the line is not 0. Returns 0. */
int builder_fail(const builder *b, size_t line, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 3, 4)))
#endif
    ;

int builder_fail_memory(const builder *b);

/* Note where the last position of the list stands in the file, if it is not finite. 0: no memory. */
int builder_check_position(builder *b, size_t vertex, size_t line);

/* The corners from the first one on are a polygon, which begins in that line of the file (0: not
   known). With less than three corners it is left out. 0: no memory. */
int builder_add_polygon(builder *b, size_t first, size_t line);

/* ---- what faces carry: mesh_dress.c ------------------------------------------------------ */

/* Colors to bytes: floats of 0..1, 0..255 or 0..65535, as the largest of all says, or with is_whole
   integers of 0..255 or 0..65535; alpha likewise. Where there is none, white. Returns how many were not
   finite, and became white. */
size_t shades_to_bytes(shade *from, size_t count, int is_whole, unsigned char *to);

/* The polygons that follow have the material of this name. 0: no memory. */
int builder_use_material(builder *b, const char *name, size_t length);

/* The last polygon has this color. 0: no memory. */
int builder_face_shade(builder *b, const shade *s);

/* The triangles since the last call are those of the next polygon. 0: no memory. */
int builder_note_faces(builder *b);

/* Hand materials and colors of faces over to the mesh. */
int builder_finish_dress(builder *b);

/* A strip of triangles: each vertex makes one with the two before it, every second one turned. */
typedef struct strip {
    uint32_t last[2];
    size_t count; /* of vertices so far */
} strip;

static inline strip strip_begin(void) {
    const strip s = {{0, 0}, 0};
    return s;
}

/* The next vertex; triangles of two equal ones only join strips and are dropped. 0: no memory. */
int strip_add(builder *b, strip *s, uint32_t vertex);

/* Check what the polygons refer to, now that all of the file is known, and make triangles. */
int builder_triangulate(builder *b);

/* The lists as a mesh. */
int builder_finish(builder *b);

/* ---- polygons to triangles: mesh_polygon.c ----------------------------------------------- */

/* Add the triangles of a polygon, two less than it has corners, which are 3 or more: right for any
   that does not cross itself, whatever its shape, also with corners in a line, with holes that a
   doubled edge joins on, and not flat. O(n log n) steps. 0: no memory. */
int polygon_triangulate(builder *b, const corner *p, size_t n);

/* ---- text: mesh_text.c ------------------------------------------------------------------- */

typedef struct text {
    const char *at, *end;
    size_t line;   /* from 1                                                       */
    int joins;     /* a backslash at the end of a line joins the next one on, as in OBJ files */
    size_t commas; /* numbers so far with a decimal comma                          */
} text;

/* From the beginning, behind a byte order mark. */
text text_of(const void *bytes, size_t size);

static inline int is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

/* Lines end in \n, \r\n or \r. */
static inline int is_line_end(char c) {
    return c == '\n' || c == '\r';
}

static inline int is_digit(char c) {
    return c >= '0' && c <= '9';
}

/* To the next word of this line, across joined lines. */
void text_skip_blanks(text *in);

/* Over the end of a line, at which the text stands. */
void text_end_line(text *in);

/* To the beginning of the next line; nothing is joined on. */
void text_skip_line(text *in);

/* The same behind all lines that are joined on; those of a comment are not. */
void text_skip_rest(text *in);

/* To the next word, on whichever line. */
void text_skip_space(text *in);

int text_at_word_end(const char *p, const char *end);

/* The number that begins here, correctly rounded to double, which may be infinite or no number (nan,
   -1.#IND); exponents may have a D for the E, and a decimal comma is counted; 0: there is none. */
int text_number(text *in, double *value);

/* The same for a number that must be finite as a float. */
int text_to_float(double value, float *to);

static inline uint32_t u32_at(const unsigned char *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* ---- a file in the making: mesh_bytes.c -------------------------------------------------- */

/* Bytes of others, which stand in a file behind so many of its own. */
typedef struct loan {
    size_t behind;
    file_extent bytes;
} loan;

/* A file in the making; a failed allocation is seen at the end. */
typedef struct sink {
    list bytes;
    list loans;  /* by `behind` */
    list blocks; /* for free(), in which some of the loans lie */
    size_t lent; /* bytes of all loans */
    int failed;
} sink;

sink sink_new(void);
void sink_free(sink *s);
void sink_put(sink *s, const void *bytes, size_t n);

/* How many bytes it has. */
static inline size_t sink_size(const sink *s) {
    return s->bytes.count + s->lent;
}

/* All that is in from, which is empty then. Its bytes are not copied. */
void sink_move(sink *s, sink *from);

/* Formatted text of at most 255 characters; more is cut off. */
void sink_print(sink *s, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 2, 3)))
#endif
    ;

/* Little-endian numbers. */
void sink_u16(sink *s, uint32_t v);
void sink_u32(sink *s, uint32_t v);
void sink_floats(sink *s, const float *v, size_t n);

/* The same numbers, which the sink need not copy: they stay as they are until the file is written. */
void sink_lend_floats(sink *s, const float *v, size_t n);
void sink_doubles(sink *s, const double *v, size_t n);

/* Its bytes for free(), or as extents. Either releases the sink. */
int sink_finish(sink *s, unsigned char **bytes, size_t *size, const char **why);
int sink_finish_extents(sink *s, mesh_file *file, const char **why);

/* ---- where a mesh lies: mesh_place.c ----------------------------------------------------- */

/* Choose the place of so many positions, 3 doubles each, those that is_used marks (NULL: all). */
mesh_place place_choose(const double *positions, const unsigned char *is_used, size_t count);

/* Can floats hold what lies at this place without its origin and scale? */
int place_is_plain(const mesh_place *place);

/* Digits of a coordinate in a text, so that floats come back. */
int place_digits(const mesh_place *place, const mesh_data *m);

/* ---- equal corners share a vertex: mesh_corners.c ---------------------------------------- */

/* What makes corners differ. */
enum { BY_VERTEX = 1, BY_UV = 2, BY_NORMAL = 4, BY_FACE = 8 /* its color */ };

/* The distinct corners of a mesh. */
typedef struct split {
    uint32_t *index; /* per corner: the distinct corner that it equals */
    uint32_t *first; /* per distinct corner: a corner that equals it   */
    size_t count;    /* of distinct corners                            */
} split;

void split_free(split *s);

/* 0: no memory */
int split_corners(const mesh_data *m, int by, split *s);

/* A mesh as in PLY and GLB, with all attributes per vertex. If the mesh has none per corner it is
   unchanged; else vertices are duplicated where needed, and unused ones are left out. */
typedef struct flat_mesh {
    const mesh_data *mesh;
    split split;
    size_t count; /* of vertices */
} flat_mesh;

/* kept: BY_NORMAL and BY_FACE, if normals of corners and colors of faces count too. */
int flat_make(const mesh_data *m, int kept, flat_mesh *f);
size_t flat_vertex(const flat_mesh *f, size_t i);
const float *flat_uv(const flat_mesh *f, size_t i);

/* That of the vertex, or of the face if vertices have none. */
const unsigned char *flat_color(const flat_mesh *f, size_t i);
uint32_t flat_index(const flat_mesh *f, size_t corner_index);

/* ---- what a scene holds: mesh.c ---------------------------------------------------------- */

/* The number of parts. The surface, if there is one, is the first. */
int scene_part_count(const mesh_scene *scene);

/* Part i; if it is the surface, its material is made in *own. */
mesh_part scene_part(const mesh_scene *scene, int i, mesh_material *own);

/* ---- the formats ------------------------------------------------------------------------- */

/* Does an OFF file begin here? */
int off_begins(const text *in);

/* Has this the size that a binary STL must have, whatever its first word is? */
int stl_has_size(const unsigned char *bytes, size_t size);

/* May it be one with bytes behind it, or one that is cut off: no text? */
int stl_may_be(const unsigned char *bytes, size_t size);

int mesh_read_obj(builder *b, text *in);                  /* mesh_obj.c */
int mesh_read_ply(builder *b, text *in, int points_too);  /* mesh_ply.c */
int mesh_read_off(builder *b, text *in);                  /* mesh_off.c */
int mesh_read_stl_text(builder *b, text *in);             /* mesh_stl.c */
int mesh_read_stl_binary(builder *b, const unsigned char *bytes, size_t size);
int mesh_read_glb(builder *b, const unsigned char *bytes, size_t size); /* mesh_gltf.c */
int mesh_write_stl(const mesh_scene *scene, sink *s);
int mesh_write_obj(const mesh_scene *scene, sink *s);
int mesh_write_ply(const mesh_data *m, const mesh_place *place, sink *s);
int mesh_write_glb(const mesh_scene *scene, sink *s);     /* mesh_glb.c */

#endif /* MESH_FILE_H */
