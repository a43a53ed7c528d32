/* composite.c - texkit composite: pictures of several materials, laid out as in an example
   SPDX-License-Identifier: MIT OR Unlicense */
#include "files/image_io.h"
#include "label_picture.h"
#include "texsyn.h"

#include <errno.h>
#include <stdio.h>

enum { MAX_SIDE = 1 << 24 };

static const cli_manual composite_manual = {
    "composite",
    "EXEMPLAR|MODEL.txc -o OUT --size WxH [options]",
    "make a picture of several textures, laid out as in an exemplar",
    "EXEMPLAR is a picture of two to 16 materials, at least 32 x 32 pixels; --labels tells which "
    "is\n"
    "where; without it that is found, as by 'texkit segment --transition'. Learned are the "
    "layout,\n"
    "the texture of each label and what happens where two of them meet. Or the input is what "
    "--save\n"
    "wrote before (the file's content decides, not its name).\n"
    "OUT ends in .png, .jpg, .tif, .webp, .tga or .bmp; it has the channels of EXEMPLAR, and .png\n"
    "and .tif keep 16 bits.\n"
    "A picture of labels is gray, indexed or in colour and has one colour for each label, at most\n"
    "  16, each on 256 pixels or more. Gray values that are all below 16 are labels 0 to 15; "
    "other\n"
    "  colours are numbered from dark to bright, by red, then green, then blue. Where it is\n"
    "  transparent nothing is learned.\n"
    "--layout is a drawn picture of labels with the colours of --labels; without --size the "
    "result\n"
    "  has its size. For a saved composite without --labels it has to show every label.\n",
    "  texkit composite slope.jpg --labels parts.png -o slope2.png --size 1024x768 --save "
    "slope.txc\n"
    "  texkit composite slope.jpg --segments 3 -o more.png --size 1024x768 --map more-labels.png\n"
    "  texkit composite slope.txc -o drawn.png --layout drawing.png\n",
    1,
    "exemplar or model",
    0,
    "take a smaller size", NULL};

typedef struct composite_job {
    cli run;
    const char *labels_path, *layout_path, *field_name, *save_path, *map_path, *like_path;
    int extent[2], quality, segments;
    label_colours colours;
    texsyn_composite_learn_desc learn;
    texsyn_composite_desc desc;
    texsyn_composite *composite;
    txm_sample sample; /* of the output */
    unsigned char *bytes;
    size_t size; /* of the composite, saved */
    txm_image out, map;
} composite_job;

static int check_options(composite_job *j) {
    static const char *const fields[] = {"auto", "none", "rows", "columns", NULL};
    cli *run = &j->run;
    char extension[8];
    int status = CLI_DONE;
    if (!j->extent[0] && !j->layout_path)
        return cli_fail(run, CLI_USAGE,
                        "no size given; add --size WxH, such as --size 512x512, or a --layout");
    if (j->extent[0] && j->extent[0] > TEXSYN_MAX_PIXELS / j->extent[1])
        return cli_fail(run, CLI_USAGE, "--size %dx%d: at most %d pixels in all", j->extent[0],
                        j->extent[1], TEXSYN_MAX_PIXELS);
    if (j->segments && j->labels_path)
        return cli_fail(run, CLI_USAGE,
                        "--segments: --labels says how many there are; leave one out");
    if (j->field_name) {
        const int field = find_name(run, "--field", j->field_name, fields);
        if (field < 0) return CLI_USAGE;
        j->learn.field = (texsyn_field)field;
    }
    if (j->save_path) {
        file_extension(j->save_path, extension);
        if (strcmp(extension, ".txc") != 0)
            return cli_fail(run, CLI_USAGE, "cannot write '%s': end the composite's name in .txc",
                            j->save_path);
    }
    status = check_picture_path(run, run->output, j->extent[0], j->extent[1], 0);
    if (!status && j->map_path)
        status = check_picture_path(run, j->map_path, j->extent[0], j->extent[1], 0);
    return status;
}

/* ---- the composite ------------------------------------------------------------------------- */

static int save(composite_job *j) {
    cli *run = &j->run;
    txm_status result = texsyn_composite_save(j->composite, &run->env, NULL, 0, &j->size);
    if (result == TXM_OK && !(j->bytes = (unsigned char *)malloc(j->size)))
        result = TXM_OUT_OF_MEMORY;
    if (result == TXM_OK)
        result = texsyn_composite_save(j->composite, &run->env, j->bytes, j->size, &j->size);
    return check_result(run, result, run->inputs[0]);
}

/* The labels of the exemplar, found. What is thin is not learned. */
static int find_labels(composite_job *j) {
    cli *run = &j->run;
    txm_image *labels = &j->learn.labels;
    texsyn_segment_desc desc = {0};
    int count = 0;
    desc.image = j->learn.example;
    desc.segments = j->segments;
    desc.transition = 1;
    desc.seed = run->seed;
    cli_stage(run, "segment");
    int status = new_picture(run, desc.image.width, desc.image.height, 1, TXM_U8, labels);
    if (!status)
        status =
            check_result(run, texsyn_segment(&desc, &run->env, *labels, &count), run->inputs[0]);
    uint8_t *p = (uint8_t *)labels->pixels;
    const size_t pixels = (size_t)desc.image.width * (size_t)desc.image.height;
    for (size_t i = 0; i < pixels && !status; i++)
        if (p[i] >= count) p[i] = NO_LABEL;
    if (!status) plain_labels(count, &j->colours);
    return status;
}

/* Give the exemplar the light of another picture before it is learned. */
static int relight(composite_job *j) {
    cli *run = &j->run;
    texsyn_relight_desc desc = {0};
    if (!j->like_path) return CLI_DONE;
    cli_stage(run, "relight");
    int status = read_picture(run, j->like_path, 0, TXM_U16, &desc.like);
    desc.image = j->learn.example;
    if (!status)
        status =
            check_result(run, texsyn_relight(&desc, &run->env, j->learn.example), run->inputs[0]);
    image_free(&desc.like);
    return status;
}

static int learn(composite_job *j) {
    cli *run = &j->run;
    texsyn_composite_learn_desc *d = &j->learn;
    int status = check_picture_fits(run, run->output, j->extent[0], j->extent[1], &d->example);
    if (!status) status = relight(j);
    if (status) return status;
    status =
        j->labels_path ? read_labels(run, j->labels_path, &j->colours, &d->labels) : find_labels(j);
    if (!status && j->labels_path)
        status = check_extent(run, "the picture of labels", j->labels_path, &d->labels,
                              d->example.width, d->example.height, run->inputs[0]);
    if (status) return status;
    cli_stage(run, "learn");
    d->seed = run->seed;
    j->sample = d->example.sample;
    status = check_result(run, texsyn_composite_learn(d, &run->env, &j->composite), run->inputs[0]);
    return status ? status : save(j);
}

/* The input as a composite: loaded if it is one, else learned from the picture. */
static int get_composite(composite_job *j) {
    cli *run = &j->run;
    const char *path = run->inputs[0];
    char extension[8];
    size_t size;
    int status = CLI_DONE;
    cli_stage(run, "read");
    unsigned char *bytes = file_read(path, &size);
    if (!bytes) return cli_fail(run, CLI_FAILED, "cannot read '%s': %s", path, strerror(errno));
    file_extension(path, extension);
    const txm_status result = texsyn_composite_load(bytes, size, &run->env, &j->composite);
    if (result == TXM_OK && j->like_path)
        status = cli_fail(run, CLI_FAILED,
                          "--like changes an exemplar before it is learned; '%s' is "
                          "learned already: use 'texkit relight' on the result",
                          path);
    else if (result == TXM_OK) status = save(j);
    else if (!strcmp(extension, ".txc") && !image_is_known(bytes, size))
        status = check_result(run, result, path);
    else status = decode_picture(run, path, bytes, size, 0, TXM_U16, &j->learn.example);
    free(bytes);
    if (!status && !j->composite) status = learn(j);
    return status;
}

/* The colours of the labels of a composite that was loaded: as in --labels, if given. */
static int get_colours(composite_job *j) {
    const int count = texsyn_composite_label_count(j->composite);
    txm_image unused = {0};
    int status = CLI_DONE;
    if (j->colours.count) return CLI_DONE;
    if (j->labels_path) {
        status = read_labels(&j->run, j->labels_path, &j->colours, &unused);
        image_free(&unused);
        if (!status && j->colours.count != count)
            status = cli_fail(&j->run, CLI_FAILED, "'%s' has %d labels; '%s' has %d",
                              j->labels_path, j->colours.count, j->run.inputs[0], count);
    } else if (!j->layout_path) plain_labels(count, &j->colours);
    return status;
}

/* ---- the picture ---------------------------------------------------------------------------- */

static int read_layout(composite_job *j) {
    cli *run = &j->run;
    const int count = texsyn_composite_label_count(j->composite), is_known = j->colours.count;
    if (!j->layout_path) return CLI_DONE;
    int status = read_labels(run, j->layout_path, &j->colours, &j->desc.layout);
    if (status) return status;
    const txm_image *layout = &j->desc.layout;
    if (!is_known && j->colours.count != count)
        return cli_fail(run, CLI_FAILED,
                        "'%s' has %d labels; '%s' has %d: add its --labels, or draw "
                        "all of them",
                        j->layout_path, j->colours.count, run->inputs[0], count);
    if (memchr(layout->pixels, NO_LABEL, (size_t)layout->width * (size_t)layout->height))
        return cli_fail(run, CLI_FAILED, "'%s': transparent pixels are no label; paint them",
                        j->layout_path);
    if (!j->extent[0]) {
        j->extent[0] = layout->width;
        j->extent[1] = layout->height;
    }
    return check_extent(run, "the layout", j->layout_path, layout, j->extent[0], j->extent[1],
                        "--size");
}

static int synthesise(composite_job *j) {
    cli *run = &j->run;
    const int channels = texsyn_channels(texsyn_composite_model(j->composite, 0));
    txm_image labels = {0};
    j->desc.composite = j->composite;
    j->desc.width = j->extent[0];
    j->desc.height = j->extent[1];
    j->desc.quality = j->quality;
    j->desc.seed = run->seed;
    int status = check_picture_path(run, run->output, j->extent[0], j->extent[1], channels);
    if (!status)
        status = new_picture(run, j->extent[0], j->extent[1], channels, j->sample, &j->out);
    if (!status) status = new_picture(run, j->extent[0], j->extent[1], 1, TXM_U8, &labels);
    if (status) return status;
    cli_stage(run, "layout");
    txm_status result = texsyn_composite_layout(&j->desc, &run->env, labels);
    cli_stage(run, "synthesise");
    if (result == TXM_OK && !j->desc.layout.pixels) j->desc.layout = labels;
    if (result == TXM_OK) result = texsyn_composite_synthesize(&j->desc, &run->env, j->out);
    status = check_result(run, result, run->inputs[0]);
    if (!status && j->map_path) status = draw_labels(run, &j->desc.layout, &j->colours, &j->map);
    if (j->desc.layout.pixels != labels.pixels) image_free(&labels);
    return status;
}

static void add_figures(composite_job *j) {
    const int labels = texsyn_composite_label_count(j->composite);
    int types = 0;
    for (int k = 0; k < labels; k++)
        types += texsyn_clique_count(texsyn_composite_model(j->composite, k));
    cli_figure(&j->run, "width", j->out.width);
    cli_figure(&j->run, "height", j->out.height);
    cli_figure(&j->run, "channels", j->out.channels);
    cli_figure(&j->run, "labels", labels);
    cli_figure(&j->run, "clique_types", types);
    cli_figure(&j->run, "levels", texsyn_level_count(texsyn_composite_model(j->composite, 0)));
    cli_figure(&j->run, "model_bytes", (double)j->size);
}

static int write_outputs(composite_job *j) {
    cli *run = &j->run;
    cli_file files[3] = {{0}, {0}, {0}};
    unsigned char *picture = NULL, *map = NULL;
    int count = 1;
    cli_stage(run, "encode");
    files[0].name = run->output;
    int status = encode_picture(run, run->output, &j->out, &picture, &files[0].size);
    files[0].bytes = picture;
    cli_figure(run, "file_bytes", (double)files[0].size);
    if (!status && j->map_path) {
        files[count].name = j->map_path;
        status = encode_picture(run, j->map_path, &j->map, &map, &files[count].size);
        files[count++].bytes = map;
    }
    if (j->save_path) {
        files[count].name = j->save_path;
        files[count].bytes = j->bytes;
        files[count++].size = j->size;
    }
    if (!status) status = cli_finish_files(run, files, count);
    free(picture);
    free(map);
    return status;
}

static int run_composite(int argc, char **argv) {
    composite_job j = {0};
    int status;
    const cli_option options[] = {
        {CLI_EXTENT, "--size", "WxH", "width and height of the result in pixels", j.extent, 1,
         MAX_SIDE},
        {CLI_INPUT, "--labels", "L", "a picture of labels of the exemplar's size; default: found",
         &j.labels_path, 0, 0},
        {CLI_INPUT, "--like", "TARGET", "give the exemplar the light of this picture first",
         &j.like_path, 0, 0},
        {CLI_INT, "--segments", "K", "without --labels: how many textures, 1 to 16; default: found",
         &j.segments, 1, TEXSYN_MAX_SEGMENTS},
        {CLI_INPUT, "--layout", "DRAWN", "a picture of labels for the result; default: synthesised",
         &j.layout_path, 0, 0},
        {CLI_TEXT, "--field", "NAME",
         "do labels keep to rows (a sky above) or to columns? auto, none, "
         "rows, columns",
         &j.field_name, 0, 0},
        {CLI_INT, "--types", "N", "clique types added per label and level, 1 to 64; default 10",
         &j.learn.max_types, 1, 64},
        {CLI_INT, "--quality", "N", "fewer or more sweeps, -2 (fast) to 2 (best); default 0",
         &j.quality, -2, 2},
        {CLI_OUTPUT, "--save", "MODEL.txc", "also save what was learned", &j.save_path, 0, 0},
        {CLI_OUTPUT, "--map", "FILE",
         "also write the labels of the result, in the colours of --labels", &j.map_path, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(&j.run, &composite_manual, options, argc, argv, &status)) return status;
    status = check_options(&j);
    if (!status) status = get_composite(&j);
    if (!status) status = get_colours(&j);
    if (!status) status = read_layout(&j);
    if (!status) status = synthesise(&j);
    if (!status) {
        add_figures(&j);
        status = write_outputs(&j);
    }
    if (!status && !j.run.quiet)
        printf("%s: %d x %d pixels, %d labels, %.1f s\n", j.run.output, j.out.width, j.out.height,
               texsyn_composite_label_count(j.composite), cli_seconds(&j.run));
    free(j.bytes);
    texsyn_composite_free(j.composite);
    image_free(&j.learn.example);
    image_free(&j.learn.labels);
    image_free(&j.desc.layout);
    image_free(&j.out);
    image_free(&j.map);
    return status;
}

const command composite_command = {&composite_manual, run_composite};
