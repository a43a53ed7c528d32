/* fill.c - texkit fill: a region of a picture replaced by texture that continues its surroundings
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "files/image_io.h"
#include "texsyn.h"

#include <errno.h>
#include <stdio.h>

static const cli_manual fill_manual = {
    "fill",
    "IMAGE --mask M -o OUT [options]",
    "replace a region by texture that continues its surroundings",
    "What is white in M is replaced: the texture round it is learned and synthesised with the\n"
    "surroundings fixed, so that no seam shows; no other pixel changes. For irregular texture:\n"
    "grass, bark, sand, litter. Lines and shapes that end at the region are not continued; that\n"
    "is what 'texkit inpaint' is for. The region may have any shape and several parts. OUT ends "
    "in\n"
    ".png, .jpg, .tif, .webp, .tga or .bmp and has the channels of IMAGE; .png and .tif keep 16 bits.\n"
    "--source S learns only where S is white, of what lies near the region.\n"
    "--model fills with a texture of 'texkit learn', whose exemplar had the channels of IMAGE;\n"
    "--relight gives it the mean colour and the contrast of the picture.\n"
    "Of --stats: 'filled' pixels.\n",
    "  texkit fill meadow.jpg --mask stone.png -o meadow-only.png\n"
    "  texkit fill bark.png --mask label.png --model bark.txs --seed 2 -o bark-clean.png\n",
    1,
    "picture",
    0,
    "take a smaller picture", NULL};

typedef struct fill_job {
    cli run;
    const char *mask, *source, *model;
    texsyn_fill_desc desc;
    texsyn_model *loaded;
    txm_image out;
} fill_job;

static int load_model(fill_job *j) {
    size_t size;
    unsigned char *bytes = file_read(j->model, &size);
    if (!bytes)
        return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", j->model, strerror(errno));
    const txm_status result = texsyn_load(bytes, size, &j->run.env, &j->loaded);
    free(bytes);
    if (result != TXM_OK) return check_result(&j->run, result, j->model);
    j->desc.model = j->loaded;
    if (texsyn_channels(j->loaded) == j->desc.image.channels) return CLI_DONE;
    return cli_fail(&j->run, CLI_FAILED,
                    "the model '%s' has %d channels, '%s' has %d; learn it from such a picture",
                    j->model, texsyn_channels(j->loaded), j->run.inputs[0], j->desc.image.channels);
}

static int read_all(fill_job *j) {
    static const mask_role hole = {"the mask", "is filled", TXM_MASK_REPLACES, 0};
    static const mask_role source = {"the source mask", "is learned from", TXM_MASK_ALLOWS, 0};
    texsyn_fill_desc *d = &j->desc;
    int status = read_picture(&j->run, j->run.inputs[0], 0, TXM_U16, &d->image);
    const int w = d->image.width, h = d->image.height;
    if (!status) status = read_mask(&j->run, &hole, j->mask, w, h, j->run.inputs[0], &d->mask);
    if (!status) status = read_mask(&j->run, &source, j->source, w, h, j->run.inputs[0], &d->source);
    if (!status && j->model) status = load_model(j);
    if (!status)
        status =
            check_picture_fits(&j->run, j->run.output, d->image.width, d->image.height, &d->image);
    if (!status)
        status = new_picture(&j->run, d->image.width, d->image.height, d->image.channels,
                             d->image.sample, &j->out);
    return status;
}

/* How many pixels were replaced. */
static double count_filled(const txm_image *mask) {
    unsigned char *bytes = (unsigned char *)new_array((size_t)mask->width, (size_t)mask->height);
    const double count = bytes ? (double)txm_mask_read(mask, TXM_MASK_REPLACES, bytes) : 0;
    free(bytes);
    return count;
}

static int run_job(fill_job *j, int argc, char **argv) {
    cli *run = &j->run;
    int status;
    const cli_option options[] = {
        {CLI_INPUT, "--mask", "M", "white where the picture is to be filled", &j->mask, 0, 0},
        {CLI_INPUT, "--source", "S", "learn only where this picture is white", &j->source, 0, 0},
        {CLI_INPUT, "--model", "MODEL.txs", "fill with this texture instead of learning one",
         &j->model, 0, 0},
        {CLI_FLAG, "--relight", NULL, "give the model of --model the light of the picture",
         &j->desc.relight, 0, 0},
        {CLI_INT, "--quality", "N", "fewer or more statistics and sweeps, -2 to 2; default 0",
         &j->desc.quality, -2, 2},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(run, &fill_manual, options, argc, argv, &status)) return status;
    if (j->desc.relight && !j->model)
        return cli_fail(run, CLI_USAGE,
                        "--relight without --model: what is learned here has the "
                        "light of the picture");
    if (!j->mask)
        return cli_fail(run, CLI_USAGE, "no mask given; add --mask M, white where to fill");
    status = check_picture_path(run, run->output, 0, 0, 0);
    if (status) return status;
    cli_stage(run, "read");
    status = read_all(j);
    if (status) return status;

    cli_stage(run, "fill");
    j->desc.seed = run->seed;
    const double filled = count_filled(&j->desc.mask);
    status = check_result(run, texsyn_fill(&j->desc, &run->env, j->out), run->inputs[0]);
    if (status) return status;
    cli_figure(run, "width", j->out.width);
    cli_figure(run, "height", j->out.height);
    cli_figure(run, "channels", j->out.channels);
    cli_figure(run, "filled", filled);
    status = finish_with_picture(run, &j->out);
    if (!status && !run->quiet)
        printf("%s: %.0f pixels filled, %.1f s\n", run->output, filled, cli_seconds(run));
    return status;
}

static int run_fill(int argc, char **argv) {
    fill_job j = {0};
    const int status = run_job(&j, argc, argv);
    image_free(&j.desc.image);
    image_free(&j.desc.mask);
    image_free(&j.desc.source);
    image_free(&j.out);
    texsyn_model_free(j.loaded);
    return status;
}

const command fill_command = {&fill_manual, run_fill};
