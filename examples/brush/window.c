/* window.c - display, keys and mouse
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "brush.h"

#include <stb/stb_image_write.h>
#include <stdio.h>

static void show_settings(const brush *b) {
    char title[80];
    snprintf(title, sizeof title, "brush: layer %d of 0-%d, %d pixels, %s", b->layer, LEVELS - 1,
             b->width, b->is_closed ? "closed" : "open");
    SDL_SetWindowTitle(b->window, title);
}

void open_window(brush *b) {
    /* rendered by the CPU, which is enough for a picture of this size */
    if (SDL_Init(SDL_INIT_VIDEO) != 0 ||
        !(b->window = SDL_CreateWindow("brush", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                                       SIDE, SIDE, 0)) ||
        !(b->renderer = SDL_CreateRenderer(b->window, -1, SDL_RENDERER_SOFTWARE)) ||
        !(b->texture = SDL_CreateTexture(b->renderer, SDL_PIXELFORMAT_RGB24,
                                         SDL_TEXTUREACCESS_STREAMING, SIDE, SIDE)))
        b->failed = SDL_GetError();
    else show_settings(b);
}

/* Draw the texture and, over it, the unfinished stroke; save a screenshot if one is due. */
void show_frame(brush *b) {
    const texedges_stroke *s = &b->strokes[b->stroke_count];
    SDL_RenderCopy(b->renderer, b->texture, NULL, NULL);
    SDL_SetRenderDrawColor(b->renderer, 255, 160, 0, 255);
    for (int i = 1; b->is_drawing && i < s->count + s->is_closed; i++) {
        const txm_vec2 p = s->points[i - 1], q = s->points[i % s->count];
        SDL_RenderDrawLineF(b->renderer, p.x, p.y, q.x, q.y);
    }
    if (b->shot_is_due) {
        static uint8_t shot[3 * SIDE * SIDE];
        b->shot_is_due = 0;
        if (SDL_RenderReadPixels(b->renderer, NULL, SDL_PIXELFORMAT_RGB24, shot, 3 * SIDE) != 0 ||
            !stbi_write_png(b->screenshot, SIDE, SIDE, 3, shot, 0))
            b->failed = "cannot save the screenshot";
    }
    SDL_RenderPresent(b->renderer);
    if (!b->released) return;
    const double now = 1e3 * (double)(SDL_GetPerformanceCounter() - b->released) /
                       (double)SDL_GetPerformanceFrequency();
    if (b->shown <= 0) b->shown = now;
    if (b->more) return;
    printf("stroke %d: %d x %d pixels made again, shown after %.1f ms, finished after %.1f ms\n",
           b->stroke_count, b->box.w, b->box.h, b->shown, now);
    fflush(stdout);
    b->released = 0;
}

static void press_key(brush *b, SDL_Keycode key) {
    if (key >= SDLK_0 && key < SDLK_0 + LEVELS) b->layer = key - SDLK_0;
    if (key == SDLK_LEFTBRACKET) b->width = SDL_max(b->width - 2, 2);
    if (key == SDLK_RIGHTBRACKET) b->width = SDL_min(b->width + 2, 256);
    if (key == SDLK_c) b->is_closed = !b->is_closed;
    if (key == SDLK_u) undo_stroke(b);
    if (key == SDLK_s) b->shot_is_due = 1;
    if (key == SDLK_r) {
        b->seed++;
        follow_strokes(b, 1);
    }
    if (key == SDLK_ESCAPE) b->is_over = 1;
    show_settings(b);
}

void handle_event(brush *b, const SDL_Event *e) {
    if (e->type == SDL_QUIT) {
        b->is_over = 1;
    } else if (e->type == SDL_KEYDOWN) {
        press_key(b, e->key.keysym.sym);
    } else if (e->type == SDL_MOUSEWHEEL) {
        b->layer = txm_clampi(b->layer + (e->wheel.y > 0) - (e->wheel.y < 0), 0, LEVELS - 1);
        show_settings(b);
    } else if (e->type == SDL_MOUSEBUTTONDOWN && e->button.button == SDL_BUTTON_LEFT) {
        begin_stroke(b, e->button.x, e->button.y);
    } else if (e->type == SDL_MOUSEMOTION && b->is_drawing) {
        add_point(b, e->motion.x, e->motion.y);
    } else if (e->type == SDL_MOUSEBUTTONUP && e->button.button == SDL_BUTTON_LEFT) {
        end_stroke(b);
    }
}
