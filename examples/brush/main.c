/* brush - a window to paint in: each stroke becomes an edge of the texture
   SPDX-License-Identifier: MIT OR Unlicense

   brush EXEMPLAR [--script FILE] [--screenshot OUT.png]

   What an editor does with texpatch.h and texedges.h. A job advances in steps between frames, so
   the window keeps responding and shows the texture as it develops. A stroke takes on the roughness of the
   exemplar's own edges and becomes a guide of gray layers; only what the guide changes is made again.

     left button  draw a stroke           [ ]  narrower, wider        s    save a screenshot
     wheel, 0-9   layer, from dark        c    open or closed         r    another seed
                  to light                u    undo the last one      Esc  quit

   Each line "stroke LAYER WIDTH open|closed X Y X Y ..." of a script is played as if drawn by hand;
   then the screenshot is saved and the program ends.

   The files of the program; each calls only those below it:

     main.c                 arguments, main loop
     window.c  script.c     display, keys and mouse; strokes from a file
     strokes.c              the strokes that the mouse draws
     texture.c              from strokes to a guide to texture: calls texedges.h and texpatch.h  */
#include "brush.h"

#include <stb/stb_image.h>
#include <stdlib.h>
#include <string.h>

static void run(brush *b, FILE *script) {
    while (!b->failed && !b->is_over) {
        SDL_Event e;
        if (script && !b->more && !play_stroke(b, script)) {
            b->is_over = 1;
            b->shot_is_due = !b->failed && b->screenshot;
        }
        /* with no steps left the program sleeps until there is an event */
        int is_event = b->more || b->is_over ? SDL_PollEvent(&e) : SDL_WaitEvent(&e);
        for (; is_event && !b->failed; is_event = SDL_PollEvent(&e)) handle_event(b, &e);
        if (b->more && !b->failed) advance_texture(b);
        if (!b->failed) show_frame(b);
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
    if (!b.failed) begin_texture(&b);
    if (!b.failed) open_window(&b);
    run(&b, script);

    if (b.failed) fprintf(stderr, "brush: %s\n", b.failed);
    SDL_DestroyTexture(b.texture);
    SDL_DestroyRenderer(b.renderer);
    SDL_DestroyWindow(b.window);
    SDL_Quit();
    texpatch_free(b.job);
    texedges_set_free(b.edges);
    free(b.layers.pixels);
    stbi_image_free(b.photo.pixels);
    if (script) fclose(script);
    return b.failed != NULL;
}
