/* brush.c - a window to paint in: each stroke becomes an edge of the texture
   SPDX-License-Identifier: MIT OR Unlicense

   brush EXEMPLAR [--script FILE] [--screenshot OUT.png]

   What an editor does with texpatch.h. A job is stepped between the frames, so the window stays
   alive and shows the texture as it comes about. A stroke takes on the unrest of the exemplar's own
   edges and becomes a guide of gray layers, and only what the guide changes is made anew.

     left button  draw a stroke           [ ]  narrower, wider        s    save a screenshot
     wheel, 0-9   layer, from dark        c    strokes are closed     r    another seed
                  to light                u    take the last back     Esc  quit

   Each line "stroke LAYER WIDTH open|closed X Y X Y ..." of a script is played as if drawn by hand;
   then the screenshot is saved and the program ends.                                            */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include <SDL2/SDL.h>
#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdio.h>

enum {
    SIDE = 512,    /* pixels of the window and of the texture                                   */
    FRAME = 16,    /* milliseconds of work between two looks at the mouse                       */
    MARGIN = 16,   /* pixels around what a guide changes that are made anew with it             */
    SPACING = 3,   /* pixels that the mouse moves before a stroke gets another point            */
    LEVELS = 4,    /* gray layers                                                               */
    MAX_STROKES = 256,
    MAX_POINTS = 1 << 16, /* of all strokes together                                            */
    MAX_LINE = 1 << 16    /* bytes of a script's line                                           */
};

typedef struct brush {
    /* the texture and what it is made of */
    txm_image photo, layers;    /* the exemplar, and the layer of each of its pixels            */
    texpatch_exemplar exemplar; /* the two together                                             */
    texpatch_edges edges;       /* the boundaries between layers                                */
    texpatch_job *job;
    txm_env env; /* malloc, silent, one thread: more of them would go in here                   */
    uint64_t seed;
    int more;     /* the job has steps left                                                     */
    SDL_Rect box; /* the part of the picture that they change                                   */
    uint8_t picture[3 * SIDE * SIDE];
    uint8_t guide[SIDE * SIDE], mask[SIDE * SIDE]; /* what the job follows at present            */

    /* what is drawn: strokes lie one behind the other in points, that under way behind the last */
    texpatch_stroke strokes[MAX_STROKES + 1];
    txm_vec2 points[MAX_POINTS];
    int stroke_count, point_count, is_drawing;
    int layer, width, is_closed; /* of the next stroke                                          */
    Uint64 released;             /* when the last stroke ended; 0: its texture is finished       */
    double shown;                /* milliseconds from then to the first picture of it; 0: none   */

    /* the window */
    SDL_Window *window;
    SDL_Renderer *renderer;
    SDL_Texture *texture;
    const char *screenshot;
    int shot_is_due, is_over;
    const char *failed; /* what went wrong; NULL: nothing so far                                 */
} brush;

static int check(brush *b, txm_status status) {
    if (status != TXM_OK) b->failed = b->env.message;
    return status == TXM_OK;
}

static txm_image square(uint8_t *pixels, int channels) {
    const txm_image image = {pixels, SIDE, SIDE, channels, TXM_U8, 0};
    return image;
}

/* ---- the texture ------------------------------------------------------------------------- */

/* Layers of the exemplar, and a job that follows a guide that says nothing yet. */
static void begin(brush *b) {
    texpatch_edges_desc find = {0};
    find.image = b->photo;
    find.levels = LEVELS;
    find.smooth = 2;
    find.least = 32;
    b->layers = b->photo;
    b->layers.channels = 1;
    b->layers.pixels = malloc((size_t)b->photo.width * (size_t)b->photo.height);
    if (!b->layers.pixels) b->failed = "no memory";
    if (b->failed || !check(b, texpatch_edges_find(&find, &b->env, &b->edges)) ||
        !check(b, texpatch_layers(&find, &b->edges, &b->env, &b->layers)))
        return;
    for (int k = 0; k < LEVELS; k++)
        printf("layer %d: gray %.0f to %.0f\n", k,
               k ? 255 * (double)b->edges.thresholds[k - 1] : 0.0,
               k < LEVELS - 1 ? 255 * (double)b->edges.thresholds[k] : 255.0);

    texpatch_desc desc = {0}; /* zeros mean the defaults */
    b->exemplar.maps = &b->photo;
    b->exemplar.guide = b->layers;
    desc.exemplars = &b->exemplar;
    desc.exemplar_count = 1;
    desc.map_count = 1;
    desc.width = desc.height = SIDE;
    desc.guide = square(b->guide, 1);
    desc.guide_mask = square(b->mask, 1);
    desc.seed = b->seed;
    if (!check(b, texpatch_begin(&desc, &b->env, &b->job))) return;
    b->box.w = b->box.h = SIDE;
    b->more = 1;
}

/* The strokes or the seed have changed: a guide of all strokes, and the texture anew, everywhere or
   where the guide says something else than before. MARGIN pixels around that are included, so that
   joints find a good way. */
static void follow_strokes(brush *b, int everywhere) {
    static uint8_t guide[SIDE * SIDE], mask[SIDE * SIDE], again[SIDE * SIDE];
    const txm_image guide_image = square(guide, 1), mask_image = square(mask, 1);
    const txm_image where = square(again, 1);
    texpatch_edges disturbed = {0};
    texpatch_control control = {0};
    control.edges = &b->edges;
    control.strokes = b->strokes;
    control.stroke_count = b->stroke_count;
    control.background = -1; /* away from the strokes the texture is as it likes to be */
    control.seed = b->seed;
    if (!check(b, texpatch_disturb(&control, SIDE, SIDE, &b->env, &disturbed))) return;
    const int is_made = check(b, texpatch_control_guide(&control, &disturbed, &b->env, &guide_image,
                                                        &mask_image));
    texpatch_edges_free(&disturbed);
    if (!is_made) return;

    const SDL_Rect all = {0, 0, SIDE, SIDE};
    SDL_Rect box = {0, 0, 0, 0};
    memset(again, 0, sizeof again);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0, end; x < SIDE; x = end) { /* x..end-1 change */
            for (end = x; end < SIDE; end++) {
                const int i = SIDE * y + end;
                if (!everywhere && mask[i] == b->mask[i] && (!mask[i] || guide[i] == b->guide[i]))
                    break;
            }
            SDL_Rect around = {x - MARGIN, y - MARGIN, end - x + 2 * MARGIN, 2 * MARGIN + 1};
            if (end++ == x) continue;
            SDL_IntersectRect(&around, &all, &around);
            for (int v = 0; v < around.h; v++)
                memset(again + SIDE * (around.y + v) + around.x, 255, (size_t)around.w);
            SDL_UnionRect(&around, &box, &box); /* an empty one does not count */
        }
    }
    memcpy(b->guide, guide, sizeof guide);
    memcpy(b->mask, mask, sizeof mask);
    /* steps that are left of an earlier stroke are done now, and shown together with the new ones */
    if (box.w > 0 && !check(b, texpatch_again(b->job, &where, &guide_image, &mask_image, b->seed,
                                              &b->env)))
        return;
    if (b->more) SDL_UnionRect(&b->box, &box, &box);
    b->box = box;
    b->more |= box.w > 0;
}

/* As many steps as a frame has time for; whatever they have reached is a picture to show. */
static void work(brush *b) {
    const Uint32 start = SDL_GetTicks();
    while (b->more && SDL_GetTicks() - start < FRAME)
        if (!check(b, texpatch_step(b->job, &b->env, &b->more))) return;
    uint8_t *corner = b->picture + 3 * (SIDE * b->box.y + b->box.x);
    const txm_image part = {corner, b->box.w, b->box.h, 3, TXM_U8, 3 * SIDE};
    if (!check(b, texpatch_draw(b->job, 0, b->box.x, b->box.y, &b->env, part))) return;
    SDL_UpdateTexture(b->texture, &b->box, corner, 3 * SIDE);
}

/* ---- strokes ------------------------------------------------------------------------------ */

static void add_point(brush *b, int x, int y) {
    texpatch_stroke *s = &b->strokes[b->stroke_count];
    const txm_vec2 p = txm_v2((float)x + 0.5f, (float)y + 0.5f);
    if (b->point_count + s->count == MAX_POINTS) return;
    if (s->count > 0) {
        const txm_vec2 last = s->points[s->count - 1];
        if (fabsf(p.x - last.x) + fabsf(p.y - last.y) < SPACING) return;
    }
    b->points[b->point_count + s->count++] = p;
}

static void begin_stroke(brush *b, int x, int y) {
    const texpatch_stroke stroke = {b->points + b->point_count, 0, b->is_closed, b->layer,
                                    (float)b->width};
    if (b->stroke_count == MAX_STROKES) return;
    b->strokes[b->stroke_count] = stroke;
    b->is_drawing = 1;
    add_point(b, x, y);
}

static void end_stroke(brush *b) {
    const texpatch_stroke *s = &b->strokes[b->stroke_count];
    if (!b->is_drawing) return;
    b->is_drawing = 0;
    if (s->count < (s->is_closed ? 3 : 2)) return; /* a click */
    b->point_count += s->count;
    b->stroke_count++;
    b->released = SDL_GetPerformanceCounter();
    b->shown = 0;
    follow_strokes(b, 0);
}

static void undo(brush *b) {
    if (b->stroke_count == 0 || b->is_drawing) return;
    b->point_count -= b->strokes[--b->stroke_count].count;
    follow_strokes(b, 0);
}

/* ---- the window --------------------------------------------------------------------------- */

static void show_settings(const brush *b) {
    char title[80];
    snprintf(title, sizeof title, "brush: layer %d of 0-%d, %d pixels, %s", b->layer, LEVELS - 1,
             b->width, b->is_closed ? "closed" : "open");
    SDL_SetWindowTitle(b->window, title);
}

static void open_window(brush *b) {
    /* drawn by the processor: a picture of this size needs no graphics card */
    if (SDL_Init(SDL_INIT_VIDEO) != 0 ||
        !(b->window = SDL_CreateWindow("brush", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                                       SIDE, SIDE, 0)) ||
        !(b->renderer = SDL_CreateRenderer(b->window, -1, SDL_RENDERER_SOFTWARE)) ||
        !(b->texture = SDL_CreateTexture(b->renderer, SDL_PIXELFORMAT_RGB24,
                                         SDL_TEXTUREACCESS_STREAMING, SIDE, SIDE)))
        b->failed = SDL_GetError();
    else show_settings(b);
}

/* The texture, and the stroke under way over it; all of it into a file if that is asked for. */
static void show(brush *b) {
    const texpatch_stroke *s = &b->strokes[b->stroke_count];
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
    printf("stroke %d: %d x %d pixels anew, shown after %.1f ms, finished after %.1f ms\n",
           b->stroke_count, b->box.w, b->box.h, b->shown, now);
    fflush(stdout);
    b->released = 0;
}

static void press(brush *b, SDL_Keycode key) {
    if (key >= SDLK_0 && key < SDLK_0 + LEVELS) b->layer = key - SDLK_0;
    if (key == SDLK_LEFTBRACKET) b->width = SDL_max(b->width - 2, 2);
    if (key == SDLK_RIGHTBRACKET) b->width = SDL_min(b->width + 2, 256);
    if (key == SDLK_c) b->is_closed = !b->is_closed;
    if (key == SDLK_u) undo(b);
    if (key == SDLK_s) b->shot_is_due = 1;
    if (key == SDLK_r) {
        b->seed++;
        follow_strokes(b, 1);
    }
    if (key == SDLK_ESCAPE) b->is_over = 1;
    show_settings(b);
}

static void handle(brush *b, const SDL_Event *e) {
    if (e->type == SDL_QUIT) {
        b->is_over = 1;
    } else if (e->type == SDL_KEYDOWN) {
        press(b, e->key.keysym.sym);
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

/* ---- scripts ------------------------------------------------------------------------------ */

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

/* Put a stroke of the script into the queue of events, as the mouse would; 0: there are no more. */
static int play_stroke(brush *b, FILE *script) {
    static char line[MAX_LINE];
    char how[8];
    int length = 0, x, y, used;
    do {
        if (!fgets(line, sizeof line, script)) return 0;
    } while (line[strspn(line, " \t\r\n")] == 0 || line[0] == '#');
    if (sscanf(line, "stroke %d %d %7s%n", &b->layer, &b->width, how, &length) != 3 ||
        b->layer < 0 || b->layer >= LEVELS || b->width < 2 || b->width > 256 ||
        (strcmp(how, "open") != 0 && strcmp(how, "closed") != 0)) {
        b->failed = "the script has a line that is no 'stroke LAYER WIDTH open|closed X Y ...'";
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

static void run(brush *b, FILE *script) {
    while (!b->failed && !b->is_over) {
        SDL_Event e;
        if (script && !b->more && !play_stroke(b, script)) {
            b->is_over = 1;
            b->shot_is_due = !b->failed && b->screenshot;
        }
        /* with nothing to do the program sleeps until something happens */
        int is_event = b->more || b->is_over ? SDL_PollEvent(&e) : SDL_WaitEvent(&e);
        for (; is_event && !b->failed; is_event = SDL_PollEvent(&e)) handle(b, &e);
        if (b->more && !b->failed) work(b);
        if (!b->failed) show(b);
    }
}

int main(int argc, char **argv) {
    static brush b;
    FILE *script = NULL;
    b.screenshot = "brush.png";
    b.width = 16;
    b.seed = 1;
    for (int i = 2; i < argc; i += 2) {
        if (i + 1 < argc && !strcmp(argv[i], "--screenshot")) b.screenshot = argv[i + 1];
        else if (i + 1 < argc && !strcmp(argv[i], "--script")) {
            if (script) fclose(script);
            script = fopen(argv[i + 1], "r");
            if (!script) b.failed = "cannot read the script";
        } else argc = 0;
    }
    if (argc < 2) {
        fprintf(stderr, "usage: brush EXEMPLAR [--script FILE] [--screenshot OUT.png]\n");
        if (script) fclose(script);
        return 2;
    }
    b.photo.pixels = stbi_load(argv[1], &b.photo.width, &b.photo.height, NULL, 3);
    b.photo.channels = 3;
    if (!b.photo.pixels) b.failed = stbi_failure_reason();
    if (!b.failed) begin(&b);
    if (!b.failed) open_window(&b);
    run(&b, script);

    if (b.failed) fprintf(stderr, "brush: %s\n", b.failed);
    SDL_DestroyTexture(b.texture);
    SDL_DestroyRenderer(b.renderer);
    SDL_DestroyWindow(b.window);
    SDL_Quit();
    texpatch_free(b.job);
    texpatch_edges_free(&b.edges);
    free(b.layers.pixels);
    stbi_image_free(b.photo.pixels);
    if (script) fclose(script);
    return b.failed != NULL;
}
