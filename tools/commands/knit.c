/* knit.c - texkit knit: joins two pictures along a border of any shape
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "files/image_io.h"
#include "texsyn.h"

#include <stdio.h>

static const cli_manual knit_manual = {
    "knit", "A B --layout L -o OUT [options]", "join two textures along a border, without a seam",
    "OUT is A where L is black and B where it is white (gray times alpha of at least half). L has the\n"
    "size of A; B is reflected where it ends. Between pictures of the same texture the zone of the\n"
    "border is made anew. Between different ones the border is first displaced as their grain\n"
    "suggests. An example of the border says what happens there. Everywhere else OUT has the samples\n"
    "of A or B. OUT ends in .png, .jpg, .tif, .webp, .tga or .bmp; it has the channels of A and B,\n"
    "and .png and .tif keep 16 bits.\n",
    "  texkit knit rock.png grass.png --layout slope.png -o hill.png\n"
    "  texkit knit a.png b.png --layout l.png --border ab.png --border-layout ab-l.png -o c.png\n",
    2, "two pictures", 0, "take smaller pictures", NULL};

enum { LONGEST_ZONE = 64, ROUGHEST = 32 };

typedef struct knit_job {
    cli run;
    const char *layout, *border, *border_layout, *roughness, *likeness;
    int relight;
    texsyn_knit_desc desc;
    txm_image out;
} knit_job;

/* Read A and B with the same channels and depth. */
static int read_pair(knit_job *j) {
    texsyn_knit_desc *d = &j->desc;
    cli *run = &j->run;
    int status = read_picture(run, run->inputs[0], 0, TXM_U16, &d->a);
    if (!status) status = read_picture(run, run->inputs[1], 0, TXM_U16, &d->b);
    if (status || (d->a.channels == d->b.channels && d->a.sample == d->b.sample)) return status;
    const int channels = d->a.channels > d->b.channels ? d->a.channels : d->b.channels;
    image_free(&d->a);
    image_free(&d->b);
    status = read_picture(run, run->inputs[0], channels, TXM_U16, &d->a);
    if (!status) status = read_picture(run, run->inputs[1], channels, TXM_U16, &d->b);
    if (status || d->a.sample == d->b.sample) return status;
    status = widen_picture(run, &d->a);
    return status ? status : widen_picture(run, &d->b);
}

static int read_all(knit_job *j) {
    static const mask_role layout = {"the layout", "is B", TXM_MASK_DIVIDES, 0};
    texsyn_knit_desc *d = &j->desc;
    cli *run = &j->run;
    cli_stage(run, "read");
    int status = read_pair(j);
    if (!status) status = check_picture_fits(run, run->output, d->a.width, d->a.height, &d->a);
    if (!status)
        status = read_mask(run, &layout, j->layout, d->a.width, d->a.height, run->inputs[0], &d->layout);
    if (status || !j->border) return status;
    status = read_picture(run, j->border, d->a.channels, TXM_U16, &d->border);
    if (status) return status;
    return read_mask(run, &layout, j->border_layout, d->border.width, d->border.height, j->border,
                     &d->border_layout);
}

/* Give B the light of A. */
static int relight_b(knit_job *j) {
    texsyn_relight_desc relight = {0};
    cli_stage(&j->run, "relight");
    relight.image = j->desc.b;
    relight.like = j->desc.a;
    return check_result(&j->run, texsyn_relight(&relight, &j->run.env, j->desc.b),
                        j->run.inputs[1]);
}

static int knit(knit_job *j) {
    const txm_image *a = &j->desc.a;
    cli *run = &j->run;
    int status = new_picture(run, a->width, a->height, a->channels, a->sample, &j->out);
    if (!status && j->relight) status = relight_b(j);
    if (status) return status;
    cli_stage(run, "knit");
    const txm_status result = texsyn_knit(&j->desc, &run->env, j->out);
    if (result != TXM_OK) return check_result(run, result, run->inputs[0]);
    cli_figure(run, "width", a->width);
    cli_figure(run, "height", a->height);
    cli_figure(run, "channels", a->channels);
    status = finish_with_picture(run, &j->out);
    if (!status && !run->quiet)
        printf("%s: %d x %d pixels, %.1f s\n", run->output, a->width, a->height, cli_seconds(run));
    return status;
}

/* The options that are more than a number. An exit status. */
static int read_options(knit_job *j) {
    static const char *const names[] = {"auto", "same", "different", NULL};
    cli *run = &j->run;
    double roughness = 0;
    if (!j->layout)
        return cli_fail(run, CLI_USAGE, "no layout given; add --layout L, white where B goes");
    if (!j->border != !j->border_layout)
        return cli_fail(run, CLI_USAGE, "--border and --border-layout go together; give both");
    const int status = parse_number(run, "--roughness", j->roughness, 0, ROUGHEST, &roughness);
    if (status) return status;
    if (j->roughness) j->desc.roughness = roughness > 0 ? (float)roughness : -1.0f;
    if (j->likeness) {
        const int found = find_name(run, "--textures", j->likeness, names);
        if (found < 0) return CLI_USAGE;
        j->desc.likeness = (texsyn_likeness)found;
    }
    return check_picture_path(run, run->output, 0, 0, 0);
}

static int run_knit(int argc, char **argv) {
    knit_job j = {0};
    int status;
    const cli_option options[] = {
        {CLI_INPUT, "--layout", "L", "a picture of A's size: white where B goes", &j.layout, 0, 0},
        {CLI_INT, "--zone", "N",
         "pixels made anew on either side, 1 to 64; default 6, 3 if one texture",
         &j.desc.zone, 1, LONGEST_ZONE},
        {CLI_TEXT, "--roughness", "R",
         "pixels that the border moves, 0 (as drawn) to 32; default: as the grain is",
         &j.roughness, 0, 0},
        {CLI_TEXT, "--textures", "HOW", "auto, same or different; default auto", &j.likeness, 0, 0},
        {CLI_INPUT, "--border", "E", "a picture in which the two textures meet", &j.border, 0, 0},
        {CLI_INPUT, "--border-layout", "M", "its layout", &j.border_layout, 0, 0},
        {CLI_FLAG, "--relight", NULL, "give B the light of A first", &j.relight, 0, 0},
        {CLI_INT, "--quality", "N",
         "fewer or more clique types and sweeps, -2 (fast) to 2 (best); default 0", &j.desc.quality,
         -2, 2},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(&j.run, &knit_manual, options, argc, argv, &status)) return status;
    status = read_options(&j);
    if (status) return status;
    j.desc.seed = j.run.seed;
    status = read_all(&j);
    if (!status) status = knit(&j);
    image_free(&j.desc.a);
    image_free(&j.desc.b);
    image_free(&j.desc.layout);
    image_free(&j.desc.border);
    image_free(&j.desc.border_layout);
    image_free(&j.out);
    return status;
}

const command knit_command = {&knit_manual, run_knit};
