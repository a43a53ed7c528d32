/* window.c - a window, with SDL 2; left out without it
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

#ifdef FOREST_WINDOW
#include <SDL2/SDL.h>
#include <stdio.h>

/* Returns 0 if the window is to be closed. */
static int handle_event(forest_gl *f, const SDL_Event *e, int *is_paused) {
    float *orbit = f->o.orbit;
    if (e->type == SDL_QUIT) return 0;
    if (e->type == SDL_MOUSEWHEEL) orbit[2] *= powf(0.9f, (float)e->wheel.y);
    if (e->type == SDL_MOUSEMOTION && (e->motion.state & SDL_BUTTON_LMASK)) {
        orbit[0] -= 0.3f * (float)e->motion.xrel;
        orbit[1] = txm_clampf(orbit[1] + 0.3f * (float)e->motion.yrel, -5, 89);
    } else if (e->type == SDL_MOUSEMOTION && (e->motion.state & SDL_BUTTON_RMASK)) {
        const float step = 0.0015f * orbit[2];
        for (int k = 0; k < 3; k++)
            f->o.at[k] += step * (f->frame.up[k] * (float)e->motion.yrel -
                                  f->frame.right[k] * (float)e->motion.xrel);
    } else if (e->type == SDL_KEYDOWN) {
        const SDL_Keycode key = e->key.keysym.sym;
        if (key == SDLK_ESCAPE) return 0;
        if (key == SDLK_w) f->o.is_wire = !f->o.is_wire;
        if (key == SDLK_l) f->o.is_bare = !f->o.is_bare;
        if (key == SDLK_SPACE) *is_paused = !*is_paused;
    }
    return 1;
}

void run_window(forest_gl *f, const char *program) {
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MAJOR_VERSION, 4);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MINOR_VERSION, 3);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_PROFILE_MASK, SDL_GL_CONTEXT_PROFILE_CORE);
    SDL_GL_SetAttribute(SDL_GL_DEPTH_SIZE, 24);
    SDL_GL_SetAttribute(SDL_GL_MULTISAMPLEBUFFERS, 1);
    SDL_GL_SetAttribute(SDL_GL_MULTISAMPLESAMPLES, 4);
    SDL_Window *window = NULL;
    SDL_GLContext context = NULL;
    if (SDL_Init(SDL_INIT_VIDEO) != 0 ||
        !(window = SDL_CreateWindow("forest_gl", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                                    f->o.width, f->o.height,
                                    SDL_WINDOW_OPENGL | SDL_WINDOW_RESIZABLE)) ||
        !(context = SDL_GL_CreateContext(window)))
        fail(f, "%s", SDL_GetError());
    else upload_scene(f, program);
    if (!f->failed[0]) SDL_GL_SetSwapInterval(1);
    Uint64 before = SDL_GetPerformanceCounter();
    int is_open = !f->failed[0], is_paused = 0, shown = 0;
    while (is_open && !f->failed[0]) {
        SDL_Event e;
        int width, height;
        while (is_open && SDL_PollEvent(&e)) is_open = handle_event(f, &e, &is_paused);
        const Uint64 now = SDL_GetPerformanceCounter();
        const double step = (double)(now - before) / (double)SDL_GetPerformanceFrequency();
        before = now;
        if (!is_paused && !advance_wind(f, f->now + (step < 0.2 ? step : 0.2))) break;
        upload_bones(f);
        if (!shown) draw_shadows(f);
        SDL_GL_GetDrawableSize(window, &width, &height);
        draw_frame(f, 0, width, height);
        SDL_GL_SwapWindow(window);
        if (++shown % 16 == 0) {
            char title[120];
            snprintf(title, sizeof title, "forest_gl: %d trees, %u pieces, %d draw calls, %.1f ms",
                     f->forest->tree_count, f->forest->node_count, f->draws, 1e3 * step);
            SDL_SetWindowTitle(window, title);
        }
    }
    if (context) SDL_GL_DeleteContext(context);
    if (window) SDL_DestroyWindow(window);
    SDL_Quit();
}
#endif
