/* forest_gl - a forest in the wind, drawn by the graphics card
   SPDX-License-Identifier: MIT OR Unlicense

   forest_gl [--species NAME|FILE,...] [--count N] [--seed N] [--pieces N] [--bare]
             [--bark DIR|SHEET.png] [--leaf PICTURE.png]
             [--time T] [--wind SPEED] [--level MAX] [--half METRES] [--wire]
             [--cards METRES] [--orbit AZIMUTH,ELEVATION,DISTANCE] [--at X,Y,Z] [--size WxH] [--shaders DIR]
             [--headless OUT.png [--frames N [--loop SECONDS]] [--smooth N]]

   How a game uses treepieces.h and shaders/treepieces.glsl. The arrays of the forest are uploaded once,
   the bones once a frame. A frame is one instanced draw call for each type of piece, one for all leaf
   clouds, one for ground and sky, and, if the view has turned, one that renders the impostors of the
   clouds again: at most 10 for any number of trees, and one more where leaves are so near to the camera
   that they are drawn as cards. What the sun sees is drawn once, as shadows.

   In the window: drag to turn, wheel to zoom, right button to move, w shows the levels of tessellation,
   l toggles the leaves, space pauses the wind, Esc quits. --headless needs neither a window nor a
   graphics card; if OUT contains %d or %03d, it writes --frames pictures, 25 a second,
   or as many in the seconds of --loop, after which the first one follows on the last.

   --bark    a set of framed tiles from 'texkit tiles --kind frame', or a sheet of treepieces_bark
   --leaf    a picture with transparency, for all species
   --level   the level of tessellation at the eye; --half: the distance over which it halves
   --cards   leaves nearer than this are cards, those further away impostors, in between some of each
   --orbit   azimuth and elevation of the camera, and its distance from the middle of the forest or
             from --at
   --smooth  samples of a pixel, horizontally and vertically

   The files of the program; each calls only those below it:

     main.c                   options, then a window or pictures
     window.c  headless.c     SDL 2; EGL without a window, PNG files
     frame.c                  the draw calls of a frame
     buffers.c  camera.c      buffers and textures; the view
     light.c  shaders.c       shadows of the crowns on a grid; OpenGL programs
     pictures.c               bark and leaves
     trees.c                  species, forest, wind: calls treepieces.h
     options.c  files.c       the command line; errors, memory, files

   forest_gl.h has the struct that they share.                                                   */
#include "forest_gl.h"

#include <stdio.h>

static void close_forest(forest_gl *f) {
    for (int s = 0; s < MAX_SPECIES; s++) {
        free(f->sheets[s].pixels);
        free(f->leaves[s].pixels);
    }
    free(f->bones);
    free(f->sway);
    treepieces_forest_free(f->forest);
    treepieces_kit_free(f->kit);
    if (f->display != EGL_NO_DISPLAY) eglTerminate(f->display);
}

int main(int argc, char **argv) {
    static forest_gl f;
    int step = 1;
    f.o = default_options();
    for (int i = 1; i < argc && step; i += step)
        step = read_option(&f.o, argv[i], i + 1 < argc ? argv[i + 1] : NULL);
    if (!step || !options_are_valid(&f.o)) {
        fprintf(stderr,
                "usage: forest_gl [--species NAME|FILE,...] [--count N] [--seed N] [--pieces N]\n"
                "  [--bare] [--bark DIR|SHEET.png] [--leaf PNG] [--time T] [--wind SPEED]\n"
                "  [--level MAX] [--half METRES] [--wire] [--cards METRES] [--orbit AZIMUTH,ELEVATION,DISTANCE]\n"
                "  [--at X,Y,Z] [--size WxH] [--shaders DIR]\n"
                "  [--headless OUT.png [--frames N [--loop SECONDS], with %%d in OUT] [--smooth N]]\n");
        return 2;
    }
    if (read_species(&f) && grow_trees(&f) && make_pictures(&f)) {
        choose_view(&f);
        if (f.o.headless) {
            if (open_headless(&f) && upload_scene(&f, argv[0])) render_pictures(&f);
        } else {
#ifdef FOREST_WINDOW
            run_window(&f, argv[0]);
#else
            fail(&f, "built without a window; --headless OUT.png draws a picture");
#endif
        }
    }
    if (f.failed[0]) fprintf(stderr, "forest_gl: %s\n", f.failed);
    close_forest(&f);
    return f.failed[0] != 0;
}
