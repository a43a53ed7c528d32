/* inpaint.c - texkit inpaint: completes what is missing in a picture or in the texture of a mesh
   SPDX-License-Identifier: MIT OR Unlicense

   run_job at the end shows the steps: read, complete (a job, or one of the simple fills), write. */
#include "inpaint.h"

#include <stdio.h>

static const cli_manual inpaint_manual = {
    "inpaint", "[IMAGE | --mesh MESH --texture T] --mask M -o OUT [options]",
    "complete what is missing in a picture or in the texture of a mesh",
    "What is white in M is missing. Lines that end at a hole are continued through it; along\n"
    "them, and then everywhere else, it is filled with pieces of its surroundings. No other\n"
    "pixel changes, but for the gutters of holes. OUT ends in .png, .jpg, .tif,\n"
    ".webp, .tga or .bmp and has the channels of the picture; .png and .tif keep 16 bits.\n"
    "Pictures and masks have the same size.\n"
    "--mesh completes on the surface of MESH, an OBJ, PLY or GLB with texture coordinates, across\n"
    "  the seams of its texture; vertices at equal positions count as one.\n"
    "--maps M1,M2 are pictures in register, completed from the same pieces. Each is named after\n"
    "  the part of its name that the picture's lacks: cow-normal.png becomes OUT-normal.png.\n"
    "--structure says what is made of lines that end at a hole: texture ignores them, picture\n"
    "  continues those that match, pattern joins each to another. auto, the default, tries these and\n"
    "  takes what suits the surroundings best.\n"
    "--guide FILE holds lines that were drawn in a picture, in pixels from its upper left corner:\n"
    "  {\"strokes\": [{\"closed\": false, \"points\": [[20,20], [200,90]]}]}\n"
    "  as in 'texkit patch --control', whose other fields are ignored here; \"lines\" of 'texkit\n"
    "  edges' will do, too. Completed lines follow them.\n"
    "--prior FILE does the same on a mesh, with lines on its surface: polylines of an OBJ file,\n"
    "  or the above with points [x,y,z]. --prior crest finds the ridges and valleys of MESH.\n"
    "--smooth fills with smooth colors only. --dilate fills the gutters only, here without limit:\n"
    "  texels outside the charts get the color of the nearest one inside; M is optional.\n"
    "--debug DIR receives numbered pictures of the steps: what was found, tried and chosen.\n"
    "Of --stats: 'structure' of the largest hole is 1 texture, 2 picture, 3 pattern; 'line_ends'\n"
    "at the holes; 'joins', lines that were continued; 'missing' texels on the surface; 'written'.\n",
    "  texkit inpaint photo.jpg --mask wires.png -o clean.png\n"
    "  texkit inpaint --mesh cow.obj --texture cow.png --mask hole.png -o cow-whole.png\n",
    1, NULL, 0, "take smaller pictures", NULL};

/* ---- options -------------------------------------------------------------------------------- */

/* An option that was given without what it needs. */
typedef struct conflict {
    int is_wrong;
    const char *text;
} conflict;

/* Refuse options that do not go together. */
static int check_pairs(inpaint_job *j) {
    const int on_mesh = j->mesh_path != NULL, is_simple = j->smooth || j->dilate;
    const char *picture = j->run.inputs[0];
    const conflict list[] = {
        {!on_mesh && j->texture, "--texture goes with --mesh; a plain picture is IMAGE"},
        {!picture && !on_mesh, "no picture given; name IMAGE, or --mesh and --texture"},
        {picture && on_mesh, "give IMAGE, or --mesh and --texture, not both"},
        {!picture && on_mesh && !j->texture, "--mesh needs its texture; add --texture T"},
        {j->smooth && j->dilate, "choose one of --smooth and --dilate"},
        {j->dilate && !on_mesh, "--dilate goes with --mesh"},
        {!j->mask && !j->dilate, "no mask given; add --mask M, white where the picture is missing"},
        {j->guide && on_mesh, "--guide is for pictures; on a mesh give --prior FILE"},
        {j->prior && !on_mesh && strcmp(j->prior, "none") != 0,
         "--prior goes with --mesh; in a picture give --guide FILE"},
        {j->gutter >= 0 && !on_mesh, "--gutter goes with --mesh"},
        {j->dilate && j->gutter == 0, "--dilate with --gutter 0 does nothing"},
        {j->directx && !j->normals, "--directx goes with --normal"},
        {(j->normals || j->labels) && !j->map_list, "--normal and --label go with --maps"},
        {is_simple && (j->source || j->structure || j->guide || j->prior || j->alpha ||
                       j->desc.beta || j->preview || j->debug),
         "--smooth and --dilate go only with --mesh, --mask, --maps and --gutter"},
    };
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
        if (list[i].is_wrong) return cli_fail(&j->run, CLI_USAGE, "%s", list[i].text);
    }
    return CLI_DONE;
}

/* The maps, and how each is treated. */
static int take_maps(inpaint_job *j) {
    char name[MAX_PATH];
    int normals[TEXINPAINT_MAX_MAPS] = {0}, labels[TEXINPAINT_MAX_MAPS] = {0}, count = 0;
    for (const char *at = j->map_list; at; count++) {
        if (count == TEXINPAINT_MAX_MAPS - 1)
            return cli_fail(&j->run, CLI_USAGE, "--maps '%s': at most %d", j->map_list, count);
        if (!cli_take_name(&at, ",", name)) break; /* cannot be: they were announced */
        if (!j->names) j->names = (char(*)[MAX_PATH])new_array(TEXINPAINT_MAX_MAPS, MAX_PATH);
        if (!j->names) return fail_memory(&j->run);
        memcpy(j->names[count], name, sizeof name);
    }
    int status = mark_maps(&j->run, "--normal", j->normals, 1, count, j->directx ? 2 : 1, normals);
    if (!status) status = mark_maps(&j->run, "--label", j->labels, 1, count, 1, labels);
    for (int m = 0; m < count && !status; m++) {
        j->maps[m].is_normal = normals[m + 1];
        j->maps[m].is_label = labels[m + 1];
        if (normals[m + 1] && labels[m + 1])
            status = cli_fail(&j->run, CLI_USAGE, "map %d: choose one of --normal and --label",
                              m + 1);
    }
    j->desc.maps = j->maps;
    j->desc.map_count = count;
    return status;
}

static int check_options(inpaint_job *j) {
    static const char *const structures[] = {"auto", "texture", "picture", "pattern", NULL};
    texinpaint_desc *d = &j->desc;
    double alpha = 0;
    int status = check_pairs(j);
    if (status) return status;
    j->picture = j->texture ? j->texture : j->run.inputs[0];
    if (j->structure) d->structure = find_name(&j->run, "--structure", j->structure, structures);
    if (d->structure < 0) return CLI_USAGE;
    status = parse_number(&j->run, "--alpha", j->alpha, 1, 1e6, &alpha);
    if (!status) status = take_maps(j);
    if (!status) status = inpaint_name_outputs(j);
    if (!status && j->debug) status = inpaint_announce_shown(j);
    d->alpha = (float)alpha;
    d->seed = j->run.seed;
    d->gutter = j->gutter < 0 ? 0 : j->gutter == 0 ? -1 : j->gutter;
    if (j->guide) d->prior = TEXINPAINT_PRIOR_LINES;
    if (j->prior && !strcmp(j->prior, "crest")) {
        d->prior = TEXINPAINT_PRIOR_CREST;
    } else if (j->prior && strcmp(j->prior, "none") != 0 && !status) {
        d->prior = TEXINPAINT_PRIOR_LINES;
        status = cli_reads(&j->run, j->prior);
    }
    if (j->debug) {
        d->show = inpaint_show;
        d->show_user = j;
    }
    return status;
}

/* ---- completion ----------------------------------------------------------------------------- */

static void tell_figures(cli *run, const texinpaint_info *info) {
    cli_figure(run, "holes", info->holes);
    cli_figure(run, "windows", info->windows);
    cli_figure(run, "structure", info->structure);
    cli_figure(run, "line_ends", info->line_ends);
    cli_figure(run, "joins", info->joins);
    cli_figure(run, "missing", (double)info->missing);
    cli_figure(run, "written", (double)info->written);
}

static void describe(const texinpaint_info *info, char text[120]) {
    static const char *const names[] = {"nothing to do", "texture", "picture", "pattern"};
    snprintf(text, 120, "%d hole%s, %lu texels, %s, %d of %d lines joined", info->holes,
             info->holes == 1 ? "" : "s", (unsigned long)info->missing,
             names[info->structure >= 0 && info->structure <= 3 ? info->structure : 0],
             info->joins, info->line_ends);
}

static int complete(inpaint_job *j, char text[120]) {
    txm_env *env = &j->run.env;
    texinpaint_job *made = NULL;
    int more = 1;
    cli_stage(&j->run, "prepare");
    txm_status result = texinpaint_begin(&j->desc, env, &made);
    cli_stage(&j->run, "preview");
    if (result == TXM_OK) result = texinpaint_step(made, env, &more);
    if (!j->preview) cli_stage(&j->run, "complete");
    while (result == TXM_OK && more && !j->preview && !j->show_status)
        result = texinpaint_step(made, env, &more);
    cli_stage(&j->run, "draw");
    for (int m = 0; m <= j->desc.map_count && result == TXM_OK; m++)
        result = texinpaint_draw(made, m, env, &j->out[m]);
    if (result == TXM_OK) {
        const texinpaint_info info = texinpaint_info_of(made);
        tell_figures(&j->run, &info);
        describe(&info, text);
    }
    texinpaint_free(made);
    return j->show_status ? j->show_status : check_result(&j->run, result, j->picture);
}

static int fill_simply(inpaint_job *j, char text[120]) {
    cli_stage(&j->run, j->smooth ? "smooth" : "dilate");
    snprintf(text, 120, j->smooth ? "filled smoothly" : "gutters filled");
    const txm_status result = j->smooth ? texinpaint_harmonic(&j->desc, &j->run.env, j->out)
                                        : texinpaint_dilate(&j->desc, &j->run.env, j->out);
    return check_result(&j->run, result, j->picture);
}

/* ---- the command ----------------------------------------------------------------------------- */

static int run_job(inpaint_job *j, int argc, char **argv) {
    cli *run = &j->run;
    char text[120] = "";
    int status;
    const cli_option options[] = {
        {CLI_INPUT, "--mask", "M", "white where the picture is missing", &j->mask, 0, 0},
        {CLI_INPUT, "--mesh", "MESH", "complete on this surface", &j->mesh_path, 0, 0},
        {CLI_INPUT, "--texture", "T", "the picture on MESH", &j->texture, 0, 0},
        {CLI_INPUT, "--source", "S", "take texture only from where this picture is white", &j->source, 0,
         0},
        {CLI_INPUTS, "--maps", "M1,M2,...", "pictures in register, completed along with it",
         &j->map_list, 0, 0},
        {CLI_TEXT, "--normal", "I,J,...", "these of --maps, counted from 1, are normal maps",
         &j->normals, 0, 0},
        {CLI_FLAG, "--directx", NULL, "y of normals points down; default: up, as in OpenGL",
         &j->directx, 0, 0},
        {CLI_TEXT, "--label", "I,J,...", "these of --maps hold labels, which must not be mixed",
         &j->labels, 0, 0},
        {CLI_TEXT, "--structure", "HOW", "auto (default), texture, picture or pattern", &j->structure, 0,
         0},
        {CLI_INPUT, "--guide", "FILE", "lines drawn in the picture, which completed ones follow",
         &j->guide, 0, 0},
        {CLI_TEXT, "--prior", "HOW", "none (default), crest, or a file of lines on MESH", &j->prior, 0,
         0},
        {CLI_TEXT, "--alpha", "D",
         "do not join line ends farther apart than D texels; default 1.5 times the hole", &j->alpha, 0,
         0},
        {CLI_INT, "--beta", "N", "rounds of votes for the lines in a hole, at most; default 64",
         &j->desc.beta, 1, 4096},
        {CLI_INT, "--gutter", "N", "texels to fill around charts, 0 = none; default 8", &j->gutter, 0,
         TEXINPAINT_MAX_SIDE},
        {CLI_FLAG, "--preview", NULL, "stop after the first step: smooth colors with the lines in them",
         &j->preview, 0, 0},
        {CLI_FLAG, "--smooth", NULL, "smooth colors only", &j->smooth, 0, 0},
        {CLI_FLAG, "--dilate", NULL, "the gutters only", &j->dilate, 0, 0},
        {CLI_TEXT, "--debug", "DIR", "write pictures of the steps into this folder", &j->debug, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(run, &inpaint_manual, options, argc, argv, &status)) return status;
    status = check_options(j);
    if (status) return status;

    cli_stage(run, "read");
    status = inpaint_read_all(j);
    if (!status && j->desc.prior == TEXINPAINT_PRIOR_LINES)
        status = inpaint_read_lines(j, j->guide ? j->guide : j->prior);
    if (status) return status;
    cli_figure(run, "width", j->desc.image.width);
    cli_figure(run, "height", j->desc.image.height);
    cli_figure(run, "maps", 1 + j->desc.map_count);
    status = j->smooth || j->dilate ? fill_simply(j, text) : complete(j, text);
    if (!status) status = inpaint_write_outputs(j);
    if (!status && !run->quiet)
        printf("%s: %s, %.1f s\n", run->output, text, cli_seconds(run));
    return status;
}

static void free_job(inpaint_job *j) {
    image_free(&j->desc.image);
    image_free(&j->desc.mask);
    image_free(&j->desc.source);
    for (int m = 0; m < TEXINPAINT_MAX_MAPS; m++) {
        image_free(&j->maps[m].image);
        image_free(&j->out[m]);
    }
    for (size_t i = 0; i < j->shown_count; i++) free(j->shown[i].bytes);
    free(j->shown);
    mesh_free(&j->mesh);
    mesh_lines_free(&j->drawn);
    free(j->corners);
    free(j->lines);
    free(j->names);
    free(j->paths);
    free(j);
}

static int run_inpaint(int argc, char **argv) {
    inpaint_job *j = (inpaint_job *)calloc(1, sizeof *j); /* too large for a small stack */
    if (!j) {
        fprintf(stderr, "texkit inpaint: out of memory\n");
        return CLI_FAILED;
    }
    j->gutter = -1;
    const int status = run_job(j, argc, argv);
    free_job(j);
    return status;
}

const command inpaint_command = {&inpaint_manual, run_inpaint};
