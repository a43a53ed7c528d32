/* segment.c - texkit segment: the textures of a picture as a map of labels
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "files/image_io.h"
#include "texsyn.h"

#include <stdio.h>

static const cli_manual segment_manual = {
    "segment", "IMAGE -o LABELS [options]", "divide a picture into its textures",
    "Finds the textures of a picture by itself, and which pixels belong to each. LABELS ends in\n"
    ".png       indexed: each pixel holds its label, 0 for the texture with the largest area, 1\n"
    "           for the next, ... The palette shows the mean colours of the textures;\n"
    ".tga, .bmp  gray: the label is the gray value, as in .png with --gray.\n"
    "Pixels that do not take part, by --mask or because they are transparent, have label 255.\n"
    "With --transition, specks and thin parts have label 254; else they join what is around\n"
    "them. The picture has at least 16 x 16 pixels; a large one is worked at about 700 x 700.\n"
    "'areas' of --stats are the pixels of each label, the first eight.\n",
    "  texkit segment hillside.jpg -o hillside-labels.png --stats hillside.json\n"
    "  texkit segment hillside.jpg -o three.png --segments 3 --mask no-sky.png\n",
    1, "picture", 0, "take a smaller picture", NULL};

enum { COLOURS = 256 };

/* Pixels of each label, and its mean colour in 8 bits. No two labels have the same colour. */
static void describe_labels(const txm_image *image, const txm_image *labels, int areas[COLOURS],
                            unsigned char palette[COLOURS][3]) {
    static double sum[COLOURS][3];
    memset(sum, 0, sizeof sum);
    for (int y = 0; y < image->height; y++) {
        const unsigned char *row = (const unsigned char *)txm_image_row_const(labels, y);
        for (int x = 0; x < image->width; x++) {
            areas[row[x]]++;
            for (int c = 0; c < 3; c++)
                sum[row[x]][c] += (double)txm_image_get(image, x, y, image->channels < 3 ? 0 : c);
        }
    }
    memset(palette, 0, 3 * COLOURS);
    for (int l = 0; l < (int)TEXSYN_TRANSITION; l++) {
        for (int c = 0; c < 3 && areas[l]; c++)
            palette[l][c] = (unsigned char)(sum[l][c] / areas[l] * 255 + 0.5);
        for (int k = 0; k < l && areas[l]; k++) {
            if (memcmp(palette[k], palette[l], 3) != 0) continue;
            palette[l][2] = (unsigned char)(palette[l][2] ^ 1 << (l & 7));
            k = -1; /* again with the new colour */
        }
    }
    memset(palette[TEXSYN_TRANSITION], 255, 3); /* white; and black for what does not take part */
}

static int write_labels(cli *run, const txm_image *labels, int is_indexed,
                        const unsigned char palette[COLOURS][3]) {
    unsigned char *bytes = NULL;
    image_job job = {0};
    const char *why;
    size_t size = 0;
    if (!is_indexed) return finish_with_picture(run, labels);
    cli_stage(run, "encode");
    job.env = &run->env;
    if (!image_encode_indexed(&job, labels, palette, &bytes, &size, &why)) {
        if (job.is_cancelled) return check_result(run, TXM_CANCELLED, run->output);
        return cli_fail(run, CLI_FAILED, "cannot write '%s': %s", run->output, why);
    }
    cli_figure(run, "file_bytes", (double)size);
    const int status = cli_finish(run, bytes, size);
    free(bytes);
    return status;
}

static int run_segment(int argc, char **argv) {
    cli run;
    texsyn_segment_desc desc = {0};
    static const mask_role role = {"the mask", "takes part", TXM_MASK_ALLOWS, 0};
    const char *mask_path = NULL;
    txm_image labels = {0};
    int is_gray = 0, count = 0, status;
    const cli_option options[] = {
        {CLI_INT, "--segments", "K", "how many textures, 1 to 16; default: as many as are found",
         &desc.segments, 1, TEXSYN_MAX_SEGMENTS},
        {CLI_INPUT, "--mask", "M", "only where this picture of the same size is white", &mask_path,
         0, 0},
        {CLI_FLAG, "--transition", NULL, "label 254 for specks and thin parts", &desc.transition, 0,
         0},
        {CLI_FLAG, "--gray", NULL, "a gray PNG instead of an indexed one", &is_gray, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    char extension[8];

    if (cli_begin(&run, &segment_manual, options, argc, argv, &status)) return status;
    file_extension(run.output, extension);
    if (!strcmp(extension, ".jpg") || !strcmp(extension, ".jpeg"))
        return cli_fail(&run, CLI_USAGE, "cannot write '%s': JPEG changes labels; use .png",
                        run.output);
    if ((status = check_picture_path(&run, run.output, 0, 0, 1)) != CLI_DONE) return status;

    cli_stage(&run, "read");
    status = read_picture(&run, run.inputs[0], 0, TXM_U16, &desc.image);
    if (!status)
        status = read_mask(&run, &role, mask_path, desc.image.width, desc.image.height, run.inputs[0],
                           &desc.mask);
    if (!status)
        status = new_picture(&run, desc.image.width, desc.image.height, 1, TXM_U8, &labels);
    if (!status) {
        cli_stage(&run, "segment");
        desc.seed = run.seed;
        status = check_result(&run, texsyn_segment(&desc, &run.env, labels, &count), run.inputs[0]);
    }
    if (!status) {
        int areas[COLOURS] = {0};
        unsigned char palette[COLOURS][3];
        describe_labels(&desc.image, &labels, areas, palette);
        cli_figure(&run, "width", labels.width);
        cli_figure(&run, "height", labels.height);
        cli_figure(&run, "segments", count);
        cli_figures(&run, "areas", areas, count < CLI_MAX_LIST ? count : CLI_MAX_LIST);
        cli_figure(&run, "transition", areas[TEXSYN_TRANSITION]);
        cli_figure(&run, "not_counted", areas[TEXSYN_NO_LABEL]);
        const int is_indexed = !strcmp(extension, ".png") && !is_gray;
        status = write_labels(&run, &labels, is_indexed, (const unsigned char(*)[3])palette);
    }
    if (!status && !run.quiet)
        printf("%s: %d %s, %.1f s\n", run.output, count, count == 1 ? "texture" : "textures",
               cli_seconds(&run));
    image_free(&labels);
    image_free(&desc.image);
    image_free(&desc.mask);
    return status;
}

const command segment_command = {&segment_manual, run_segment};
