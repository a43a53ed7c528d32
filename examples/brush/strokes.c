/* strokes.c - the strokes that the mouse draws
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "brush.h"

#include <math.h>

void add_point(brush *b, int x, int y) {
    texedges_stroke *s = &b->strokes[b->stroke_count];
    const txm_vec2 p = txm_v2((float)x + 0.5f, (float)y + 0.5f);
    if (b->point_count + s->count == MAX_POINTS) return;
    if (s->count > 0) {
        const txm_vec2 last = s->points[s->count - 1];
        if (fabsf(p.x - last.x) + fabsf(p.y - last.y) < SPACING) return;
    }
    b->points[b->point_count + s->count++] = p;
}

void begin_stroke(brush *b, int x, int y) {
    const texedges_stroke stroke = {b->points + b->point_count, 0, b->is_closed, b->layer,
                                    (float)b->width};
    if (b->stroke_count == MAX_STROKES) return;
    b->strokes[b->stroke_count] = stroke;
    b->is_drawing = 1;
    add_point(b, x, y);
}

void end_stroke(brush *b) {
    const texedges_stroke *s = &b->strokes[b->stroke_count];
    if (!b->is_drawing) return;
    b->is_drawing = 0;
    if (s->count < (s->is_closed ? 3 : 2)) return; /* a click */
    b->point_count += s->count;
    b->stroke_count++;
    b->released = SDL_GetPerformanceCounter();
    b->shown = 0;
    follow_strokes(b, 0);
}

void undo_stroke(brush *b) {
    if (b->stroke_count == 0 || b->is_drawing) return;
    b->point_count -= b->strokes[--b->stroke_count].count;
    follow_strokes(b, 0);
}
