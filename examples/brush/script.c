/* script.c - strokes from a file, as if drawn by hand
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "brush.h"

#include <string.h>

static void push_event(Uint32 type, int x, int y) {
    SDL_Event e = {0};
    e.type = type;
    if (type == SDL_MOUSEMOTION) {
        e.motion.x = x;
        e.motion.y = y;
    } else {
        e.button.button = SDL_BUTTON_LEFT;
        e.button.x = x;
        e.button.y = y;
    }
    SDL_PushEvent(&e);
}

/* Queue the mouse events of the next stroke of the script; 0: there are no more strokes. */
int play_stroke(brush *b, FILE *script) {
    static char line[MAX_LINE];
    char how[8];
    int length = 0, x, y, used;
    do {
        if (!fgets(line, sizeof line, script)) return 0;
    } while (line[strspn(line, " \t\r\n")] == 0 || line[0] == '#');
    if (sscanf(line, "stroke %d %d %7s%n", &b->layer, &b->width, how, &length) != 3 ||
        b->layer < 0 || b->layer >= LEVELS || b->width < 2 || b->width > 256 ||
        (strcmp(how, "open") != 0 && strcmp(how, "closed") != 0)) {
        b->failed = "the script has a line that is not 'stroke LAYER WIDTH open|closed X Y ...'";
        return 0;
    }
    b->is_closed = how[0] == 'c';
    Uint32 type = SDL_MOUSEBUTTONDOWN;
    for (const char *at = line + length; sscanf(at, "%d %d%n", &x, &y, &used) == 2; at += used) {
        push_event(type, x, y);
        type = SDL_MOUSEMOTION;
    }
    push_event(SDL_MOUSEBUTTONUP, 0, 0);
    return 1;
}
