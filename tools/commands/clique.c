/* clique.c - texkit learn and texkit synth: a model of a texture, and new texture from it
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "files/image_io.h"
#include "texsyn.h"

#include <errno.h>
#include <stdio.h>

enum { MAX_SIDE = 1 << 24 };

/* ---- texkit learn ------------------------------------------------------------------------ */

static void model_figures(cli *run, const texsyn_model *model, size_t bytes) {
    cli_figure(run, "model_bytes", (double)bytes);
    int per_level[CLI_MAX_LIST] = {0}; /* full resolution first */
    texsyn_clique clique;
    for (int i = 0; texsyn_clique_at(model, i, &clique, NULL, 0) > 0; i++)
        per_level[clique.level]++;
    cli_figure(run, "clique_types", texsyn_clique_count(model));
    cli_figures(run, "clique_types_per_level", per_level, texsyn_level_count(model));
    cli_figure(run, "levels", texsyn_level_count(model));
    cli_figure(run, "bands", texsyn_band_count(model));
}

/* Even the light of the exemplar, if it needs it or the user says so. */
static int even_example(cli *run, int even, texsyn_learn_desc *d) {
    int used;
    const int status = even_picture(run, run->inputs[0], even, d->mask.pixels ? &d->mask : NULL,
                                    &d->example, &used);
    cli_figure(run, "even", used);
    return status;
}

static const cli_manual learn_manual = {
    "learn", "EXEMPLAR -o MODEL.txs [options]", "learn a small model of a texture from a picture",
    "EXEMPLAR is a PNG, JPEG, TIFF, WebP, BMP, TGA or PNM picture of the texture, at least\n"
    "16 x 16 pixels, gray, RGB or RGBA (gray with alpha is read as RGBA). About 256 x 256\n"
    "pixels that show the largest element a few dozen times are enough. The model holds\n"
    "statistics, no pixels; 'texkit synth' makes new texture from it. If the light falls off to\n"
    "a side or the corners are dark, it is evened out first, and a warning says so; see --even.\n",
    "  texkit learn gravel.jpg -o gravel.txs\n"
    "  texkit learn photo.png --mask grass-area.png -o grass.txs\n",
    1, "exemplar", 0, "take a smaller exemplar", ".txs"};

static int run_learn(int argc, char **argv) {
    cli run;
    texsyn_learn_desc desc = {0};
    static const mask_role role = {"the mask", "is learned from", TXM_MASK_ALLOWS, 0};
    const char *mask_path = NULL;
    int even = EVEN_AUTO;
    const cli_option options[] = {
        {CLI_INT, "--max-distance", "D", "longest pair in pixels, 2 to 60; default 40",
         &desc.max_distance, 2, 60},
        {CLI_INT, "--types", "N", "clique types added per level, 1 to 60; default 24, gray 36",
         &desc.max_types, 1, 60},
        {CLI_INT, "--levels", "N", "pyramid levels, 1 to 6; default: chosen by the size",
         &desc.levels, 1, 6},
        {CLI_INPUT, "--mask", "M", "learn only where this picture of the same size is white",
         &mask_path, 0, 0},
        {CLI_INT, "--even", "R", EVEN_HELP, &even, 0, EVEN_MOST},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    char extension[8];
    texsyn_model *model = NULL;
    unsigned char *bytes = NULL;
    size_t size = 0;
    int status;

    if (cli_begin(&run, &learn_manual, options, argc, argv, &status)) return status;
    file_extension(run.output, extension);
    if (strcmp(extension, ".txs") != 0)
        return cli_fail(&run, CLI_USAGE, "cannot write '%s': end the model's name in .txs",
                        run.output);
    status = check_even(&run, even);
    if (status) return status;

    cli_stage(&run, "read");
    status = read_picture(&run, run.inputs[0], 0, TXM_U16, &desc.example);
    if (!status && desc.example.sample == TXM_U16)
        cli_warn(&run, "'%s' has 16 bits a sample; a model does not keep that: add --deep to 'texkit synth' "
                 "for textures of 16 bits", run.inputs[0]);
    if (!status)
        status = read_mask(&run, &role, mask_path, desc.example.width, desc.example.height,
                           run.inputs[0], &desc.mask);
    if (!status) status = even_example(&run, even, &desc);
    if (status) goto done;

    cli_stage(&run, "learn");
    desc.seed = run.seed;
    txm_status result = texsyn_learn(&desc, &run.env, &model);
    if (result == TXM_OK) result = texsyn_save(model, &run.env, NULL, 0, &size);
    if (result == TXM_OK && !(bytes = (unsigned char *)malloc(size))) result = TXM_OUT_OF_MEMORY;
    if (result == TXM_OK) result = texsyn_save(model, &run.env, bytes, size, &size);
    if (result != TXM_OK) {
        status = check_result(&run, result, run.inputs[0]);
        goto done;
    }

    model_figures(&run, model, size);
    status = cli_finish(&run, bytes, size);
    if (!status && !run.quiet)
        printf("%s: %d clique types on %d levels, %zu bytes, %.1f s\n", run.output,
               texsyn_clique_count(model), texsyn_level_count(model), size, cli_seconds(&run));
done:
    free(bytes);
    texsyn_model_free(model);
    image_free(&desc.example);
    image_free(&desc.mask);
    return status;
}

/* ---- texkit synth ------------------------------------------------------------------------ */

static const cli_manual synth_manual = {
    "synth", "EXEMPLAR|MODEL.txs -o OUT --size WxH [options]",
    "make new texture from a model or a picture",
    "The input is a model of 'texkit learn' or a picture, from which a model is learned\n"
    "first (the file's content decides, not its name). OUT ends in .png, .jpg, .tif,\n"
    ".webp, .tga or .bmp; it has the channels of the exemplar and, in .png and .tif, the 16 bits of\n"
    "a picture. BMP and WebP store gray as RGB; JPEG has no alpha. A higher --quality makes more\n"
    "sweeps over the picture: its statistics get closer to the\n"
    "exemplar's, and it takes longer. Uneven light of a picture is evened out before it is\n"
    "learned, as by 'texkit learn'.\n",
    "  texkit synth gravel.txs -o gravel-large.png --size 2048x1024\n"
    "  texkit synth gravel.jpg -o tile.png --size 512x512 --tileable --seed 7\n",
    1, "exemplar or model", 0, "take a smaller size", NULL};

/* The input as a model: loaded if it is one, else learned from the picture, whose samples it then has. */
static int get_model(cli *run, int even, texsyn_model **model, txm_sample *sample) {
    const char *path = run->inputs[0];
    texsyn_learn_desc learn = {0};
    char extension[8];
    size_t size;
    txm_status result;
    int status = CLI_DONE;

    cli_stage(run, "read");
    unsigned char *bytes = file_read(path, &size);
    if (!bytes) return cli_fail(run, CLI_FAILED, "cannot read '%s': %s", path, strerror(errno));
    file_extension(path, extension);
    result = texsyn_load(bytes, size, &run->env, model);
    if (result == TXM_OK) {
        model_figures(run, *model, size);
        if (even != EVEN_AUTO)
            status = cli_fail(run, CLI_USAGE, "--even goes with a picture, and '%s' is a model; give "
                              "it to 'texkit learn'", path);
    } else if (!strcmp(extension, ".txs") && !image_is_known(bytes, size)) {
        status = check_result(run, result, path);
    } else if ((status = decode_picture(run, path, bytes, size, 0, TXM_U16, &learn.example))) {
        /* said already */
    } else if (!(status = check_picture_path(run, run->output, 0, 0, learn.example.channels))) {
        *sample = learn.example.sample;
        status = even_example(run, even, &learn);
        cli_stage(run, "learn");
        learn.seed = run->seed;
        if (!status) result = texsyn_learn(&learn, &run->env, model);
        if (!status && result == TXM_OK) result = texsyn_save(*model, &run->env, NULL, 0, &size);
        if (!status && result == TXM_OK) model_figures(run, *model, size);
        else if (!status) status = check_result(run, result, path);
    }
    image_free(&learn.example);
    free(bytes);
    return status;
}

static int run_synth(int argc, char **argv) {
    cli run;
    int extent[2] = {0, 0}, tileable = 0, quality = 0, is_deep = 0, even = EVEN_AUTO, status;
    const cli_option options[] = {
        {CLI_EXTENT, "--size", "WxH", "width and height of the result in pixels", extent, 1,
         MAX_SIDE},
        {CLI_FLAG, "--tileable", NULL, "the result continues across its own borders", &tileable, 0,
         0},
        {CLI_INT, "--quality", "N", "fewer or more sweeps, -2 (fast) to 2 (best); default 0",
         &quality, -2, 2},
        {CLI_FLAG, "--deep", NULL, "16 bits a sample; a picture of 16 bits gives them by itself", &is_deep,
         0, 0},
        {CLI_INT, "--even", "R", EVEN_HELP, &even, 0, EVEN_MOST},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    texsyn_model *model = NULL;
    txm_sample sample = TXM_U8;
    txm_image out = {0};

    if (cli_begin(&run, &synth_manual, options, argc, argv, &status)) return status;
    if (extent[0] == 0)
        return cli_fail(&run, CLI_USAGE, "no size given; add --size WxH, such as --size 512x512");
    if (extent[0] > TEXSYN_MAX_PIXELS / extent[1])
        return cli_fail(&run, CLI_USAGE, "--size %dx%d: at most %d pixels in all", extent[0],
                        extent[1], TEXSYN_MAX_PIXELS);
    status = check_even(&run, even);
    if (!status) status = check_picture_path(&run, run.output, extent[0], extent[1], 0);
    if (!status) status = get_model(&run, even, &model, &sample);
    if (!status)
        status = check_picture_path(&run, run.output, extent[0], extent[1], texsyn_channels(model));
    if (!status)
        status = new_picture(&run, extent[0], extent[1], texsyn_channels(model),
                             is_deep ? TXM_U16 : sample, &out);
    if (!status) status = check_picture_fits(&run, run.output, extent[0], extent[1], &out);
    if (status) goto done;

    cli_stage(&run, "synthesise");
    texsyn_synth_desc desc = {model, out.width, out.height, tileable, quality, run.seed};
    const txm_status result = texsyn_synthesize(&desc, &run.env, out);
    if (result != TXM_OK) {
        status = check_result(&run, result, run.inputs[0]);
        goto done;
    }

    cli_figure(&run, "width", out.width);
    cli_figure(&run, "height", out.height);
    cli_figure(&run, "channels", out.channels);
    status = finish_with_picture(&run, &out);
    if (!status && !run.quiet)
        printf("%s: %d x %d pixels, %.1f s\n", run.output, out.width, out.height,
               cli_seconds(&run));
done:
    image_free(&out);
    texsyn_model_free(model);
    return status;
}

const command learn_command = {&learn_manual, run_learn};
const command synth_command = {&synth_manual, run_synth};
