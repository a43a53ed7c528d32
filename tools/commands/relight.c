/* relight.c - texkit relight: gives a picture the light of another one
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "files/image_io.h"
#include "texsyn.h"

#include <stdio.h>

static const cli_manual relight_manual = {
    "relight", "IMAGE --like TARGET -o OUT [options]",
    "give a picture the light of another one",
    "Corrects exposure, contrast, gamma, saturation and the colour of the light, so that materials\n"
    "of IMAGE look as in TARGET, which may have any size and show them in other shares. Grays stay\n"
    "exactly gray. OUT ends in .png, .jpg, .tif, .webp, .tga or .bmp; it has the channels of IMAGE,\n"
    "and .png and .tif keep 16 bits. In masks white counts, gray times alpha of at least half.\n"
    "'gain' of --stats is by how\n"
    "much the saturation changes, 'cast' what the colour of the light adds to it.\n",
    "  texkit relight forest.jpg --like slope.jpg -o overcast.png\n"
    "  texkit relight a.png --like b.png --mask a-stone.png --like-mask b-stone.png -o c.png\n",
    1, "picture", 0, "take smaller pictures", NULL};

typedef struct relight_job {
    cli run;
    const char *like, *mask, *like_mask, *strength;
    texsyn_relight_desc desc;
    double amount;
    txm_image out;
} relight_job;

static int read_all(relight_job *j) {
    static const mask_role role = {"the mask", "is compared", TXM_MASK_ALLOWS, 0};
    texsyn_relight_desc *d = &j->desc;
    cli *run = &j->run;
    cli_stage(run, "read");
    int status = read_picture(run, run->inputs[0], 0, TXM_U16, &d->image);
    if (!status)
        status = check_picture_fits(run, run->output, d->image.width, d->image.height, &d->image);
    if (!status) status = read_picture(run, j->like, 0, TXM_U16, &d->like);
    if (!status)
        status = read_mask(run, &role, j->mask, d->image.width, d->image.height, run->inputs[0],
                           &d->mask);
    if (!status)
        status = read_mask(run, &role, j->like_mask, d->like.width, d->like.height, j->like,
                           &d->like_mask);
    return status;
}

static int relight(relight_job *j) {
    const txm_image *im = &j->desc.image;
    cli *run = &j->run;
    texsyn_light light;
    int status = new_picture(run, im->width, im->height, im->channels, im->sample, &j->out);
    if (status) return status;
    cli_stage(run, "learn");
    txm_status result = texsyn_light_learn(&j->desc, &run->env, &light);
    cli_stage(run, "apply");
    if (result == TXM_OK)
        result = texsyn_light_apply(&light, (float)j->amount, im, &run->env, j->out);
    if (result != TXM_OK) return check_result(run, result, run->inputs[0]);
    cli_figure(run, "width", im->width);
    cli_figure(run, "height", im->height);
    cli_figure(run, "channels", im->channels);
    cli_figure(run, "gain", sqrt((double)light.gain[0] * (double)light.gain[0] +
                                 (double)light.gain[1] * (double)light.gain[1]));
    cli_figure(run, "cast", sqrt((double)light.cast[0] * (double)light.cast[0] +
                                 (double)light.cast[1] * (double)light.cast[1]));
    status = finish_with_picture(run, &j->out);
    if (!status && !run->quiet)
        printf("%s: %d x %d pixels in the light of %s, %.1f s\n", run->output, im->width, im->height,
               j->like, cli_seconds(run));
    return status;
}

static int run_relight(int argc, char **argv) {
    relight_job j = {0};
    int status;
    const cli_option options[] = {
        {CLI_INPUT, "--like", "TARGET", "a picture in the light that is wanted", &j.like, 0, 0},
        {CLI_INPUT, "--mask", "M", "compare only where this picture of IMAGE's size is white", &j.mask,
         0, 0},
        {CLI_INPUT, "--like-mask", "M", "the same for TARGET", &j.like_mask, 0, 0},
        {CLI_TEXT, "--strength", "S", "how much of the change is made, 0 to 1; default 1", &j.strength,
         0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(&j.run, &relight_manual, options, argc, argv, &status)) return status;
    if (!j.like)
        return cli_fail(&j.run, CLI_USAGE, "no light given; add --like TARGET, a picture in it");
    j.amount = 1;
    status = parse_number(&j.run, "--strength", j.strength, 0, 1, &j.amount);
    if (!status) status = check_picture_path(&j.run, j.run.output, 0, 0, 0);
    if (status) return status;
    status = read_all(&j);
    if (!status) status = relight(&j);
    image_free(&j.desc.image);
    image_free(&j.desc.mask);
    image_free(&j.desc.like);
    image_free(&j.desc.like_mask);
    image_free(&j.out);
    return status;
}

const command relight_command = {&relight_manual, run_relight};
