/* patch.c - texkit patch: a photograph and its maps in, more of the same out
   SPDX-License-Identifier: MIT OR Unlicense

   run_job at the end shows the steps: read, turn strokes into guides, synthesise (a job, or a
   window of the endless plane), draw, write.                                                   */
#include "patch.h"
#include "files/image_io.h"

#include <stdio.h>

enum { MAX_LEVELS = 28 }; /* more than any picture has */

static const cli_manual patch_manual = {
    "patch", "EXEMPLAR -o OUT --size WxH [options]",
    "make new texture out of pieces of a picture, in register for all maps",
    "For textures whose structure must continue: bricks, weaves, cobbles, planks, stones.\n"
    "EXEMPLAR is a picture of 32 x 32 pixels or more; a lattice in it is found and kept. OUT\n"
    "ends in .png, .jpg, .tif, .webp, .tga or .bmp and has the channels of EXEMPLAR; .png and .tif\n"
    "keep 16 bits.\n"
    "--maps M1,M2 are pictures in register with EXEMPLAR. Each is made in register with OUT\n"
    "  and named after the part of its name that EXEMPLAR's lacks: bricks-normal.png becomes\n"
    "  OUT-normal.png. Options count maps from 0, which is EXEMPLAR.\n"
    "--exemplars E2,E3 are more pictures of the same material, of any size. Their maps follow\n"
    "  after semicolons: --maps 'M1,M2;E2-M1,E2-M2;E3-M1,E3-M2'.\n"
    "Uneven light of EXEMPLAR and of its maps of color (not those of --normal, --label and --data,\n"
    "  nor gray ones) is evened out, with a warning, if it would show; not by itself with --guide,\n"
    "  --control or --keep, as they may tell places apart by their light; see --even.\n"
    "--guide and --target say what goes where: each pixel of OUT comes from a place where the\n"
    "  guide of EXEMPLAR looks like the target.\n"
    "--control STROKES is a JSON file of lines that become edges of the texture:\n"
    "  {\"levels\": 4, \"smooth\": 0, \"least\": 0, \"background\": -1, \"disturb\": 1,\n"
    "   \"strokes\": [{\"layer\": 0, \"closed\": false, \"width\": 8,\n"
    "     \"points\": [[20,20], [200,90]]}]}\n"
    "  Only points are required; the other values here are the defaults. 'texkit edges' shows\n"
    "  the layers for the same levels, smooth and least; 0 is the darkest. A closed stroke\n"
    "  is filled with its layer, an open one is as wide as width says. background is the layer\n"
    "  elsewhere, -1 leaves it free; disturb, 0 to 4, is how much of the roughness of EXEMPLAR's\n"
    "  edges the strokes take on.\n"
    "--window X,Y,W,H is a part of an endless plane; all windows show the same plane.\n"
    "--lod K writes K coarser levels: OUT-1.png, OUT-2.png ... Each is half as wide and high,\n"
    "  rounded down, as graphics APIs want it. Colors are averaged in linear light. With --cutout\n"
    "  the same share of pixels as in OUT has an alpha of at least half, so that leaves and fences\n"
    "  that are drawn with an alpha test neither thin out nor close up.\n"
    "--sources FILE.pfm says where each pixel comes from, in three floats: x and y in the\n"
    "  exemplar; and 8 times the exemplar's number (EXEMPLAR is 0), plus 4 if it is mirrored,\n"
    "  plus the number of counter-clockwise quarter turns, or -1 if the pixel was kept.\n"
    "--straighten does with every exemplar what 'texkit straighten' does; --sources then counts\n"
    "  pixels of the straight pictures.\n"
    "'continuous' of --stats is the share of neighbours in OUT that are neighbours in EXEMPLAR.\n",
    "  texkit patch bricks.jpg -o wall.png --size 2048x1024 --tileable --lod 4\n"
    "  texkit patch bricks.png -o wall.png --size 512x512 --normal 1 --data 2 \\\n"
    "      --maps bricks-normal.png,bricks-height.png --weights 1,0,0.3\n",
    1, "exemplar", 0, "take a smaller size", NULL};

/* ---- synthesis ----------------------------------------------------------------------------- */

/* Room for the result. */
static int make_room(patch_job *j) {
    const texpatch_desc *d = &j->desc;
    int status = CLI_DONE;
    for (int m = 0; m < d->map_count && !status; m++)
        status = new_picture(&j->run, d->width, d->height, j->pictures[0][m].channels,
                             j->pictures[0][m].sample, &j->out[m]);
    if (!status && (j->sources || j->run.stats)) {
        size_t bytes;
        if (txm_mul((size_t)d->width, (size_t)d->height, sizeof *j->from, &bytes))
            j->from = (texpatch_source *)malloc(bytes);
        if (!j->from) status = fail_memory(&j->run);
    }
    return status;
}

static void tell_lattice(patch_job *j, const texpatch_job *made, char text[80]) {
    float v[4] = {0, 0, 0, 0};
    const int has = texpatch_lattice(made, v);
    cli *run = &j->run;
    cli_figure(run, "lattice", has);
    cli_figure(run, "lattice_ax", (double)v[0]);
    cli_figure(run, "lattice_ay", (double)v[1]);
    cli_figure(run, "lattice_bx", (double)v[2]);
    cli_figure(run, "lattice_by", (double)v[3]);
    snprintf(text, 80, has ? "lattice %.1f,%.1f %.1f,%.1f" : "no lattice", (double)v[0],
             (double)v[1], (double)v[2], (double)v[3]);
}

static int make_picture(patch_job *j, char text[80]) {
    const texpatch_desc *d = &j->desc;
    texpatch_job *made = NULL;
    txm_env *env = &j->run.env;
    int more = 1;
    cli_stage(&j->run, "prepare");
    txm_status result = texpatch_begin(d, env, &made);
    if (result == TXM_OK) {
        tell_lattice(j, made, text);
        cli_stage(&j->run, "synthesise");
        while (more && result == TXM_OK) result = texpatch_step(made, env, &more);
        cli_stage(&j->run, "draw");
    }
    for (int k = 0; k < d->map_count && result == TXM_OK; k++)
        result = texpatch_draw(made, k, 0, 0, env, j->out[k]);
    for (int k = 0; k < d->map_count && result == TXM_OK; k++) {
        const texpatch_map *kind = &j->maps[k];
        if (!kind->is_label && !kind->is_normal && !kind->is_data)
            result = txm_image_bleed(&j->out[k], d->tileable, env);
    }
    for (int y = 0; y < d->height && result == TXM_OK && j->from; y++) {
        for (int x = 0; x < d->width; x++)
            j->from[(size_t)y * (size_t)d->width + (size_t)x] = texpatch_source_at(made, x, y);
    }
    texpatch_free(made);
    return check_result(&j->run, result, j->run.inputs[0]);
}

static int make_window(patch_job *j, char text[80]) {
    texpatch_plane *plane = NULL;
    cli_stage(&j->run, "prepare");
    txm_status result = texpatch_plane_make(&j->desc, &j->run.env, &plane);
    if (result == TXM_OK) {
        cli_figure(&j->run, "cell", texpatch_plane_cell(plane));
        snprintf(text, 80, "cells of %d pixels", texpatch_plane_cell(plane));
        cli_stage(&j->run, "synthesise");
        result = texpatch_plane_draw(plane, j->window_x, j->window_y, &j->run.env, j->out, j->from);
    }
    texpatch_plane_free(plane);
    return check_result(&j->run, result, j->run.inputs[0]);
}

/* ---- the command ---------------------------------------------------------------------------- */

static int run_job(patch_job *j, int argc, char **argv) {
    cli *run = &j->run;
    texpatch_desc *d = &j->desc;
    char text[80] = "";
    int status;
    const cli_option options[] = {
        {CLI_EXTENT, "--size", "WxH", "width and height of the result in pixels", j->extent, 1,
         TEXPATCH_MAX_PIXELS},
        {CLI_TEXT, "--window", "X,Y,W,H", "instead of --size: a window of the endless plane",
         &j->window, 0, 0},
        {CLI_FLAG, "--tileable", NULL, "the result continues across its own borders", &j->tileable,
         0, 0},
        {CLI_FLAG, "--tileable-x", NULL, "only across the left and right borders", &j->tileable_x,
         0, 0},
        {CLI_FLAG, "--tileable-y", NULL, "only across the upper and lower borders", &j->tileable_y,
         0, 0},
        {CLI_GROUPS, "--maps", "M1,M2,...", "pictures in register with EXEMPLAR, made in register",
         &j->map_list, 0, 0},
        {CLI_TEXT, "--weights", "W0,W1,...",
         "how much EXEMPLAR and the maps count in matching, 0 to 16; default 1,0,...", &j->weights, 0,
         0},
        {CLI_TEXT, "--normal", "I,J,...", "these maps are normal maps", &j->normals, 0, 0},
        {CLI_FLAG, "--directx", NULL, "y of normals points down; default: up, as in OpenGL",
         &j->directx, 0, 0},
        {CLI_TEXT, "--label", "I,J,...", "these maps hold labels, which must not be mixed",
         &j->labels, 0, 0},
        {CLI_TEXT, "--data", "I,J,...", "these maps hold quantities (height, roughness), not colors",
         &j->data, 0, 0},
        {CLI_INPUTS, "--exemplars", "E2,...", "more exemplars, up to 8 in all", &j->more, 0, 0},
        {CLI_INPUTS, "--mask", "M", "use EXEMPLAR only where this picture is white; one for each",
         &j->masks, 0, 0},
        {CLI_INT, "--even", "R", EVEN_HELP, &j->even, 0, EVEN_MOST},
        {CLI_FLAG, "--straighten", NULL,
         "make EXEMPLAR straight first, a wall or floor seen at an angle", &j->straighten, 0, 0},
        {CLI_INT, "--patch", "N",
         "side of the first patches in pixels; default: chosen for EXEMPLAR", &d->patch, 8,
         TEXPATCH_MAX_SIDE},
        {CLI_INT, "--passes", "P", "optimisation passes, 1 to 16; 0 = none; default 3, at full size 2",
         &j->passes, 0, 16},
        {CLI_TEXT, "--lattice", "HOW", "auto (default), none, or its two steps: AX,AY,BX,BY",
         &j->lattice, 0, 0},
        {CLI_INT, "--turns", "N", "pieces may be turned: 2 = by half turns, 4 = by quarter turns",
         &d->turns, 1, 4},
        {CLI_FLAG, "--mirror", NULL, "pieces may be mirrored", &d->mirror, 0, 0},
        {CLI_TEXT, "--novelty", "V", "0 to 1: avoid copying large pieces of EXEMPLAR; default 0",
         &j->novelty, 0, 0},
        {CLI_INPUTS, "--guide", "G", "a picture in register with EXEMPLAR; one for each exemplar",
         &j->guides, 0, 0},
        {CLI_INPUT, "--target", "T", "what the guide should look like in OUT", &j->target, 0, 0},
        {CLI_INPUT, "--target-mask", "M", "the target counts only where this picture is white",
         &j->target_mask, 0, 0},
        {CLI_TEXT, "--guide-weight", "V", "relative to a map of weight 1; above 0, up to 16; default 2",
         &j->guide_weight, 0, 0},
        {CLI_INPUT, "--control", "STROKES", "lines that become edges of the texture", &j->control, 0,
         0},
        {CLI_INPUTS, "--keep", "K0,K1,...",
         "pictures of OUT's size, one for each map, to keep parts of", &j->kept_list, 0, 0},
        {CLI_INPUT, "--keep-mask", "M", "they are kept where this picture is white", &j->keep, 0,
         0},
        {CLI_INT, "--lod", "K", "coarser levels to write, each half as wide", &j->lod, 0,
         MAX_LEVELS},
        {CLI_FLAG, "--cutout", NULL, "coarser levels keep the share of pixels that an alpha test draws",
         &j->cutout, 0, 0},
        {CLI_OUTPUT, "--sources", "FILE.pfm", "where each pixel comes from", &j->sources, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(run, &patch_manual, options, argc, argv, &status)) return status;
    status = patch_check_options(j);
    if (!status) status = patch_name_outputs(j);
    if (status) return status;

    cli_stage(run, "read");
    status = patch_read_all(j);
    if (!status && j->control) status = patch_take_strokes(j);
    if (!status) status = make_room(j);
    if (status) return status;
    cli_figure(run, "width", d->width);
    cli_figure(run, "height", d->height);
    cli_figure(run, "maps", d->map_count);
    cli_figure(run, "exemplars", d->exemplar_count);
    status = j->window ? make_window(j, text) : make_picture(j, text);
    if (!status && run->stats) cli_figure(run, "continuous", patch_continuous(j));
    if (!status) status = patch_write_outputs(j);
    if (!status && !run->quiet)
        printf("%s: %d x %d pixels, %s, %.1f s\n", run->output, d->width, d->height, text,
               cli_seconds(run));
    return status;
}

static void free_job(patch_job *j) {
    for (int e = 0; e < TEXPATCH_MAX_EXEMPLARS; e++) {
        for (int m = 0; m < TEXPATCH_MAX_MAPS; m++) image_free(&j->pictures[e][m]);
        image_free(&j->exemplars[e].guide);
        image_free(&j->exemplars[e].mask);
        free(j->map_names[e].storage);
    }
    for (int m = 0; m < TEXPATCH_MAX_MAPS; m++) {
        image_free(&j->kept[m]);
        free(j->out[m].pixels);
    }
    image_free(&j->desc.guide);
    image_free(&j->desc.guide_mask);
    image_free(&j->desc.keep);
    free(j->exemplar_names.storage);
    free(j->paths);
    free(j->from);
    free(j);
}

static int run_patch(int argc, char **argv) {
    patch_job *j = (patch_job *)calloc(1, sizeof *j); /* too large for a small stack */
    if (!j) {
        fprintf(stderr, "texkit patch: out of memory\n");
        return CLI_FAILED;
    }
    j->passes = -1;
    j->even = EVEN_AUTO;
    const int status = run_job(j, argc, argv);
    free_job(j);
    return status;
}

const command patch_command = {&patch_manual, run_patch};
