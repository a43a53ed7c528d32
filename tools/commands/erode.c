/* erode.c - texkit erode: cracks like those of a weathered exemplar, to any level
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "files/image_io.h"
#include "texsyn.h"

#include <stdio.h>

static const cli_manual erode_manual = {
    "erode", "IMAGE --weathered EXEMPLAR --level L -o OUT [options]",
    "add cracks like those of a weathered exemplar",
    "The cracks and pits of EXEMPLAR, what is darker there than its surroundings, are laid over\n"
    "IMAGE, which may have any size. At level 1 they cover a tenth of it (--share); each level's\n"
    "are part of the next one's, so a series of levels with the same --seed shows erosion going\n"
    "on. OUT ends in .png, .jpg, .tif, .webp, .tga or .bmp; it has the channels of IMAGE, and .png\n"
    "and .tif keep 16 bits.\n"
    "--levels FILE is a picture of IMAGE's size: the level is multiplied by its gray, pixel by\n"
    "  pixel, so that stone erodes more where it is brighter.\n"
    "--intact FILE receives a mask that is white where EXEMPLAR has no cracks. With it as the --mask\n"
    "  of 'texkit learn', the polished stone is learned from a weathered one.\n",
    "  texkit erode stone.png --weathered wall.jpg --level 0.5 -o old.png --cracks cracks.png\n"
    "  texkit erode new.png --weathered wall.jpg --level 1 --levels foot.png -o old.png\n",
    1, "picture", 0, "take a smaller picture", NULL};

typedef struct erode_job {
    cli run;
    const char *weathered, *level_text, *levels_path, *share_text, *mask_path, *cracks, *intact;
    texsyn_erosion_desc desc;
    double level, share;
    txm_image image, levels, out, cracks_out, intact_out;
    texsyn_erosion *erosion;
} erode_job;

static int check_options(erode_job *j) {
    cli *run = &j->run;
    if (!j->weathered)
        return cli_fail(run, CLI_USAGE, "no exemplar of cracks given; add --weathered EXEMPLAR");
    if (!j->level_text)
        return cli_fail(run, CLI_USAGE, "no level given; add --level L, such as --level 0.5");
    int status = parse_number(run, "--level", j->level_text, 0, 1, &j->level);
    if (!status) status = parse_number(run, "--share", j->share_text, 0.001, 0.5, &j->share);
    if (!status) status = check_picture_path(run, run->output, 0, 0, 0);
    if (!status && j->cracks) status = check_picture_path(run, j->cracks, 0, 0, 1);
    if (!status && j->intact) status = check_picture_path(run, j->intact, 0, 0, 1);
    j->desc.share = (float)j->share;
    j->desc.seed = run->seed;
    return status;
}

/* A gray picture of the size of another one. */
static int read_gray(erode_job *j, const char *what, const char *path, const txm_image *like,
                     const char *like_path, txm_image *gray) {
    if (!path) return CLI_DONE;
    const int status = read_picture(&j->run, path, 1, TXM_U16, gray);
    return status ? status
                  : check_extent(&j->run, what, path, gray, like->width, like->height, like_path);
}

static int read_all(erode_job *j) {
    static const mask_role role = {"the mask", "shows cracks", TXM_MASK_ALLOWS, 0};
    cli *run = &j->run;
    cli_stage(run, "read");
    int status = read_picture(run, run->inputs[0], 0, TXM_U16, &j->image);
    if (!status)
        status = check_picture_fits(run, run->output, j->image.width, j->image.height, &j->image);
    if (!status) status = read_picture(run, j->weathered, 0, TXM_U16, &j->desc.weathered);
    if (!status)
        status = read_gray(j, "the picture of levels", j->levels_path, &j->image, run->inputs[0],
                           &j->levels);
    if (!status)
        status = read_mask(run, &role, j->mask_path, j->desc.weathered.width, j->desc.weathered.height,
                           j->weathered, &j->desc.mask);
    j->desc.width = j->image.width;
    j->desc.height = j->image.height;
    return status;
}

/* the pictures that are wanted, empty */
static int make_outputs(erode_job *j) {
    const txm_image *im = &j->image, *w = &j->desc.weathered;
    int status = new_picture(&j->run, im->width, im->height, im->channels, im->sample, &j->out);
    if (!status && j->cracks)
        status = new_picture(&j->run, im->width, im->height, 1, TXM_U8, &j->cracks_out);
    if (!status && j->intact)
        status = new_picture(&j->run, w->width, w->height, 1, TXM_U8, &j->intact_out);
    return status;
}

static int erode(erode_job *j) {
    cli *run = &j->run;
    const txm_image *levels = j->levels_path ? &j->levels : NULL;
    int status = make_outputs(j);
    if (status) return status;
    cli_stage(run, "make");
    txm_status result = texsyn_erosion_make(&j->desc, &run->env, &j->erosion);
    cli_stage(run, "draw");
    if (result == TXM_OK)
        result = texsyn_erosion_draw(j->erosion, (float)j->level, levels, &j->image, &run->env, j->out);
    if (result == TXM_OK && j->cracks)
        result = texsyn_erosion_mask(j->erosion, (float)j->level, levels, &run->env, j->cracks_out);
    if (result == TXM_OK && j->intact)
        result = texsyn_erosion_intact(&j->desc, &run->env, j->intact_out);
    if (result != TXM_OK) return check_result(run, result, j->weathered);
    cli_figure(run, "width", j->image.width);
    cli_figure(run, "height", j->image.height);
    cli_figure(run, "channels", j->image.channels);
    cli_figure(run, "share", (double)texsyn_erosion_share(j->erosion));
    cli_figure(run, "level", j->level);
    return CLI_DONE;
}

static int write_outputs(erode_job *j) {
    cli *run = &j->run;
    const char *const names[3] = {run->output, j->cracks, j->intact};
    const txm_image *const pictures[3] = {&j->out, &j->cracks_out, &j->intact_out};
    cli_file files[3] = {{0}};
    unsigned char *bytes[3] = {NULL, NULL, NULL};
    size_t total = 0;
    int count = 0;
    int status = CLI_DONE;
    cli_stage(run, "encode");
    memset(files, 0, sizeof files);
    for (int i = 0; i < 3 && !status; i++) {
        if (!names[i]) continue;
        files[count].name = names[i];
        status = encode_picture(run, names[i], pictures[i], &bytes[i], &files[count].size);
        files[count].bytes = bytes[i];
        total += files[count++].size;
    }
    cli_figure(run, "file_bytes", (double)total);
    if (!status) status = cli_finish_files(run, files, count);
    for (int i = 0; i < 3; i++) free(bytes[i]);
    return status;
}

static int run_erode(int argc, char **argv) {
    erode_job j = {0};
    int status;
    const cli_option options[] = {
        {CLI_INPUT, "--weathered", "EXEMPLAR", "a picture of cracked stone, at least 32 x 32",
         &j.weathered, 0, 0},
        {CLI_TEXT, "--level", "L", "how far, 0 (not at all) to 1", &j.level_text, 0, 0},
        {CLI_INPUT, "--levels", "FILE", "multiply the level by the gray of this picture",
         &j.levels_path, 0, 0},
        {CLI_TEXT, "--share", "S", "the share of cracks at level 1, 0.001 to 0.5; default 0.1",
         &j.share_text, 0, 0},
        {CLI_INPUT, "--mask", "M", "take cracks only from where this picture of EXEMPLAR's size is white",
         &j.mask_path, 0, 0},
        {CLI_OUTPUT, "--cracks", "FILE", "also write what is eroded, in white", &j.cracks, 0, 0},
        {CLI_OUTPUT, "--intact", "FILE", "also write where EXEMPLAR is intact, in white", &j.intact, 0,
         0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(&j.run, &erode_manual, options, argc, argv, &status)) return status;
    status = check_options(&j);
    if (status) return status;
    status = read_all(&j);
    if (!status) status = erode(&j);
    if (!status) status = write_outputs(&j);
    if (!status && !j.run.quiet)
        printf("%s: %d x %d pixels, %.4g %% eroded at the most, %.1f s\n", j.run.output, j.image.width,
               j.image.height, 100 * j.level * (double)texsyn_erosion_share(j.erosion),
               cli_seconds(&j.run));
    texsyn_erosion_free(j.erosion);
    image_free(&j.image);
    image_free(&j.levels);
    image_free(&j.desc.weathered);
    image_free(&j.desc.mask);
    image_free(&j.out);
    image_free(&j.cracks_out);
    image_free(&j.intact_out);
    return status;
}

const command erode_command = {&erode_manual, run_erode};
