/* brush.h - the struct that all files share, and the functions of each file
   SPDX-License-Identifier: MIT OR Unlicense  */
#ifndef BRUSH_H
#define BRUSH_H

#include "texedges.h"
#include "texpatch.h"

#include <SDL2/SDL.h>
#include <stdio.h>

enum {
    SIDE = 512,    /* pixels of the window and of the texture                                   */
    FRAME = 16,    /* milliseconds of work between two frames                                   */
    MARGIN = 16,   /* pixels around a change of the guide that are made again with it           */
    SPACING = 3,   /* pixels that the mouse moves before a stroke gets another point            */
    LEVELS = 4,    /* gray layers                                                               */
    MAX_STROKES = 256,
    MAX_POINTS = 1 << 16, /* of all strokes together                                            */
    MAX_LINE = 1 << 16    /* bytes of a script's line                                           */
};

typedef struct brush {
    /* the texture and what it is made of: texture.c */
    txm_image photo, layers;    /* the exemplar, and the layer of each of its pixels            */
    texpatch_exemplar exemplar; /* the two together                                             */
    texedges_set *edges;        /* the boundaries between layers                                */
    texpatch_job *job;
    txm_env env; /* malloc, silent, one thread; a thread pool would be set here                 */
    uint64_t seed;
    int more;     /* the job has steps left                                                     */
    SDL_Rect box; /* the part of the picture that those steps change                            */
    uint8_t picture[3 * SIDE * SIDE];
    uint8_t guide[SIDE * SIDE], mask[SIDE * SIDE]; /* of the job, as it is now                   */

    /* the strokes, whose points lie one after the other in points; the last one may be unfinished:
       strokes.c */
    texedges_stroke strokes[MAX_STROKES + 1];
    txm_vec2 points[MAX_POINTS];
    int stroke_count, point_count, is_drawing;
    int layer, width, is_closed; /* of the next stroke                                          */
    Uint64 released;             /* when the last stroke ended; 0: its texture is finished       */
    double shown;                /* milliseconds from then to the first picture of it; 0: none   */

    /* the window: window.c */
    SDL_Window *window;
    SDL_Renderer *renderer;
    SDL_Texture *texture;
    const char *screenshot;
    int shot_is_due, is_over;
    const char *failed; /* the message of an error; NULL: none                                   */
} brush;

/* ---- texture.c ---- */
void begin_texture(brush *b);
void follow_strokes(brush *b, int everywhere);
void advance_texture(brush *b);

/* ---- strokes.c ---- */
void add_point(brush *b, int x, int y);
void begin_stroke(brush *b, int x, int y);
void end_stroke(brush *b);
void undo_stroke(brush *b);

/* ---- window.c ---- */
void open_window(brush *b);
void show_frame(brush *b);
void handle_event(brush *b, const SDL_Event *e);

/* ---- script.c ---- */
int play_stroke(brush *b, FILE *script);

#endif
