/* straighten.c - texkit straighten: a wall or floor as it looks from straight in front
   SPDX-License-Identifier: MIT OR Unlicense */
#include "straighten.h"
#include "files/image_io.h"

#include <stdio.h>

enum { MAX_STRAIGHT_MAPS = 15 };
static const double FILM_WIDTH = 36; /* mm, of 35 mm film */

static const cli_manual straighten_manual = {
    "straighten", "PHOTO -o OUT [options]",
    "make a wall or floor look as from straight in front",
    "For photographs of anything that repeats, in one direction at least: masonry, tiles, planks,\n"
    "roofs, cloth. Seen at an angle, turned by up to 20 degrees, through a lens that bends lines:\n"
    "OUT shows it upright, the largest part that fits a rectangle, as fine as the photograph is\n"
    "where it is finest. If nothing repeats, OUT is a copy of PHOTO, and a warning says so. OUT\n"
    "ends in .png, .tga, .bmp or .jpg and has the channels of PHOTO; .png keeps 16 bits.\n"
    "--maps M1,M2 are pictures in register with PHOTO. They are straightened with it and named\n"
    "  after the part of their name that PHOTO's lacks: bricks-normal.png becomes OUT-normal.png.\n"
    "--focal matters only for the proportions of what was photographed from the side.\n"
    "--periods cuts along each side along which the pattern repeats: what was 7.4 bricks wide becomes\n"
    "  5 or 6 wide, and its right border goes on at its left.\n"
    "'found' of --stats is 1 if there is a pattern; 'agreement', 0 to 1, is how well it agrees\n"
    "with a plane.\n",
    "  texkit straighten wall.jpg -o straight.png\n"
    "  texkit straighten floor.jpg -o floor.png --focal 26 --maps floor-height.png --data 1\n",
    1, "picture", 0, "take a smaller picture", NULL};

/* ---- for every command ---------------------------------------------------------------------- */

int straighten(cli *run, const char *path, const straight_picture *pictures, int count,
               const txm_image *mask, double focal, int whole, double *agreement) {
    texpatch_straight_desc desc = {0};
    texpatch_straight *straight = NULL;
    int width, height, status = CLI_DONE;
    desc.photo = *pictures[0].image;
    if (mask) desc.mask = *mask;
    desc.focal = (float)focal;
    desc.whole = whole;
    txm_status result = texpatch_straight_find(&desc, &run->env, &straight);
    if (result != TXM_OK) return check_result(run, result, path);
    const int found = texpatch_straight_found(straight, &width, &height);
    *agreement = texpatch_straight_agreement(straight);
    if (!found)
        cli_warn(run, "'%s': nothing in it repeats clearly; it is left as it is", path);
    else if (whole && !texpatch_straight_whole(straight))
        cli_warn(run, "'%s': nothing in it repeats upright or level; it is not cut", path);
    for (int i = 0; i < count && found && !status; i++) {
        txm_image *image = pictures[i].image, out;
        status = new_picture(run, width, height, image->channels, image->sample, &out);
        if (status) break;
        result = texpatch_straight_draw(straight, image, pictures[i].map, &run->env, &out);
        image_free(image);
        *image = out;
        status = check_result(run, result, path);
    }
    texpatch_straight_free(straight);
    return status;
}

/* ---- the command ---------------------------------------------------------------------------- */

typedef struct straighten_job {
    cli run;
    const char *map_list, *normals, *labels, *data, *mask_path, *focal;
    int directx, whole;
    int count; /* PHOTO and its maps */
    char names[1 + MAX_STRAIGHT_MAPS][MAX_PATH], outputs[1 + MAX_STRAIGHT_MAPS][MAX_PATH];
    texpatch_map kinds[1 + MAX_STRAIGHT_MAPS];
    txm_image pictures[1 + MAX_STRAIGHT_MAPS], mask;
} straighten_job;

/* The pictures, their kinds and the outputs' names. */
static int name_pictures(straighten_job *j) {
    int normals[MAX_STRAIGHT_MAPS + 1] = {0}, labels[MAX_STRAIGHT_MAPS + 1] = {0};
    int data[MAX_STRAIGHT_MAPS + 1] = {0}, status = CLI_DONE;
    const char *list = j->map_list;
    cli *run = &j->run;
    j->count = 1;
    snprintf(j->names[0], MAX_PATH, "%s", run->inputs[0]);
    for (; list; j->count++) {
        if (j->count > MAX_STRAIGHT_MAPS)
            return cli_fail(run, CLI_USAGE, "--maps: at most %d pictures", MAX_STRAIGHT_MAPS);
        cli_take_name(&list, ",", j->names[j->count]);
    }
    const int last = j->count - 1;
    status = mark_maps(run, "--normal", j->normals, 0, last, j->directx ? 2 : 1, normals);
    if (!status) status = mark_maps(run, "--label", j->labels, 0, last, 1, labels);
    if (!status) status = mark_maps(run, "--data", j->data, 0, last, 1, data);
    if (!status && j->directx && !j->normals)
        return cli_fail(run, CLI_USAGE, "--directx goes with --normal");
    for (int m = 0; m < j->count && !status; m++) {
        if ((normals[m] != 0) + labels[m] + data[m] > 1)
            return cli_fail(run, CLI_USAGE, "map %d: choose one of --normal, --label and --data", m);
        j->kinds[m].is_normal = normals[m];
        j->kinds[m].is_label = labels[m];
        j->kinds[m].is_data = data[m];
        status = path_of_map(run, m ? j->names[m] : NULL, run->inputs[0], "", j->outputs[m]);
        if (!status && m) status = cli_writes(run, j->outputs[m]);
    }
    return status;
}

static int read_pictures(straighten_job *j) {
    static const mask_role role = {"the mask", "is looked at", TXM_MASK_ALLOWS, 0};
    cli *run = &j->run;
    int status = CLI_DONE;
    cli_stage(run, "read");
    for (int m = 0; m < j->count && !status; m++) {
        txm_image *image = &j->pictures[m];
        status = read_picture(run, j->names[m], 0, TXM_U16, image);
        if (!status && m)
            status = check_extent(run, "the map", j->names[m], image, j->pictures[0].width,
                                  j->pictures[0].height, run->inputs[0]);
        if (!status)
            status = check_picture_fits(run, j->outputs[m], image->width, image->height, image);
    }
    if (status) return status;
    return read_mask(run, &role, j->mask_path, j->pictures[0].width, j->pictures[0].height,
                     run->inputs[0], &j->mask);
}

static int write_pictures(straighten_job *j) {
    cli_file files[1 + MAX_STRAIGHT_MAPS] = {{0}};
    unsigned char *bytes[1 + MAX_STRAIGHT_MAPS] = {NULL};
    int status = CLI_DONE;
    cli_stage(&j->run, "encode");
    for (int m = 0; m < j->count && !status; m++) {
        files[m].name = j->outputs[m];
        status = encode_picture(&j->run, j->outputs[m], &j->pictures[m], &bytes[m], &files[m].size);
        files[m].bytes = bytes[m];
    }
    if (!status) status = cli_finish_files(&j->run, files, j->count);
    for (int m = 0; m < j->count; m++) free(bytes[m]);
    return status;
}

static int run_job(straighten_job *j, int argc, char **argv) {
    cli *run = &j->run;
    straight_picture pictures[1 + MAX_STRAIGHT_MAPS];
    double focal = 0, agreement = 0;
    int status;
    const cli_option options[] = {
        {CLI_INPUTS, "--maps", "M1,M2,...", "pictures in register with PHOTO, made straight with it",
         &j->map_list, 0, 0},
        {CLI_TEXT, "--normal", "I,J,...", "these maps are normal maps; PHOTO is number 0", &j->normals,
         0, 0},
        {CLI_FLAG, "--directx", NULL, "y of normals points down; default: up, as in OpenGL",
         &j->directx, 0, 0},
        {CLI_TEXT, "--label", "I,J,...", "these maps hold labels, which must not be mixed",
         &j->labels, 0, 0},
        {CLI_TEXT, "--data", "I,J,...", "these maps hold quantities (height, roughness), not colors",
         &j->data, 0, 0},
        {CLI_INPUT, "--mask", "M", "look for the pattern only where this picture is not black",
         &j->mask_path, 0, 0},
        {CLI_TEXT, "--focal", "MM", "focal length of the camera, that for 35 mm film; default 31",
         &j->focal, 0, 0},
        {CLI_FLAG, "--periods", NULL, "cut OUT to whole periods of the pattern, so that it tiles",
         &j->whole, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(run, &straighten_manual, options, argc, argv, &status)) return status;
    status = parse_number(run, "--focal", j->focal, 5, 3000, &focal);
    if (!status) status = check_picture_path(run, run->output, 0, 0, 0);
    if (!status) status = name_pictures(j);
    if (!status) status = read_pictures(j);
    if (status) return status;
    for (int m = 0; m < j->count; m++) {
        pictures[m].image = &j->pictures[m];
        pictures[m].map = &j->kinds[m];
    }
    cli_stage(run, "straighten");
    status = straighten(run, run->inputs[0], pictures, j->count, &j->mask, focal / FILM_WIDTH,
                        j->whole, &agreement);
    if (status) return status;
    cli_figure(run, "found", agreement > 0);
    cli_figure(run, "agreement", agreement);
    cli_figure(run, "width", j->pictures[0].width);
    cli_figure(run, "height", j->pictures[0].height);
    status = write_pictures(j);
    if (!status && !run->quiet)
        printf("%s: %d x %d pixels, %s, %.1f s\n", run->output, j->pictures[0].width,
               j->pictures[0].height, agreement > 0 ? "straight" : "a copy", cli_seconds(run));
    return status;
}

static int run_straighten(int argc, char **argv) {
    straighten_job *j = (straighten_job *)new_array(1, sizeof *j);
    if (!j) {
        fprintf(stderr, "texkit straighten: out of memory\n");
        return CLI_FAILED;
    }
    const int status = run_job(j, argc, argv);
    for (int m = 0; m <= MAX_STRAIGHT_MAPS; m++) image_free(&j->pictures[m]);
    image_free(&j->mask);
    free(j);
    return status;
}

const command straighten_command = {&straighten_manual, run_straighten};
