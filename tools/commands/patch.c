/* patch.c - texkit patch: a photograph and its maps in, more of the same out
   SPDX-License-Identifier: MIT OR Unlicense

   Read, follow strokes if there are any, synthesise (a job, or a window of the endless plane),
   draw, write: run_job at the end tells the story.                                             */
#include "command.h"
#include "files/image_io.h"
#include "texedges.h"

#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>

enum {
    MAX_NAMES = TEXPATCH_MAX_MAPS > TEXPATCH_MAX_EXEMPLARS ? TEXPATCH_MAX_MAPS
                                                           : TEXPATCH_MAX_EXEMPLARS,
    MAX_LEVELS = 28,         /* no picture has more coarser ones */
    MAX_COORDINATE = 1 << 20 /* of a stroke's points, pixels     */
};

static const int64_t MAX_PLACE = (int64_t)1 << 40; /* of a window, pixels */

static const cli_manual patch_manual = {
    "patch", "EXEMPLAR -o OUT --size WxH [options]",
    "make new texture out of pieces of a picture, in register for all maps",
    "For textures with a structure that has to go on: bricks, weaves, cobbles, planks, stones.\n"
    "EXEMPLAR is a picture of 32 x 32 pixels or more; a lattice in it is found and kept. OUT\n"
    "ends in .png, .tga, .bmp or .jpg and has the channels of EXEMPLAR, as .png its 16 bits too.\n"
    "--maps M1,M2 are pictures in register with EXEMPLAR. Each is made in register with OUT\n"
    "  and named by what its name has and EXEMPLAR's has not: bricks-normal.png becomes\n"
    "  OUT-normal.png. Options count maps from 0, which is EXEMPLAR.\n"
    "--exemplars E2,E3 are more pictures of the same material, of any size. Their maps go\n"
    "  behind semicolons: --maps 'M1,M2;E2-M1,E2-M2;E3-M1,E3-M2'.\n"
    "--guide and --target say what goes where: each pixel of OUT comes from where the guide\n"
    "  of EXEMPLAR looks as the target does there.\n"
    "--control STROKES is a JSON file of lines that become edges of the texture:\n"
    "  {\"levels\": 4, \"smooth\": 0, \"least\": 0, \"background\": -1, \"disturb\": 1,\n"
    "   \"strokes\": [{\"layer\": 0, \"closed\": false, \"width\": 8,\n"
    "     \"points\": [[20,20], [200,90]]}]}\n"
    "  Only points must be given, the rest is what you see here by default. 'texkit edges'\n"
    "  shows the layers of the same levels, smooth and least; 0 is the darkest. A closed stroke\n"
    "  is filled with its layer, an open one is as wide as width says. background is the layer\n"
    "  elsewhere, -1 leaves it free; disturb, 0 to 4, is how much of the unrest of EXEMPLAR's\n"
    "  edges the strokes take on.\n"
    "--window X,Y,W,H is a part of a plane without end; all windows show the same plane.\n"
    "--lod K writes K coarser levels, each half as wide: OUT-1.png, OUT-2.png ...\n"
    "--sources FILE.pfm says where each pixel comes from, in three floats: x and y in the\n"
    "  exemplar; and 8 times the exemplar's number (EXEMPLAR is 0), plus 4 if it is mirrored,\n"
    "  plus its quarter turns counter-clockwise, or -1 if the pixel was kept.\n"
    "'continuous' of --stats is the share of neighbours in OUT that are so in EXEMPLAR.\n",
    "  texkit patch bricks.jpg -o wall.png --size 2048x1024 --tileable --lod 4\n"
    "  texkit patch bricks.png -o wall.png --size 512x512 --normal 1 --data 2 \\\n"
    "      --maps bricks-normal.png,bricks-height.png --weights 1,0,0.3\n",
    1, "exemplar", 0, "take a smaller size"};

/* Names out of a list; they lie in storage. */
typedef struct names {
    char *storage;
    const char *at[MAX_NAMES];
    int count;
} names;

typedef struct patch_job {
    cli run;
    char extension[8];

    /* options as they were given */
    const char *map_list, *weights, *normals, *labels, *data, *more, *masks, *guides, *target;
    const char *target_mask, *guide_weight, *kept_list, *keep, *novelty, *lattice, *window;
    const char *sources, *control;
    int extent[2], passes, directx, tileable, tileable_x, tileable_y, lod;

    texpatch_desc desc; /* of the library, filled in as options are read and files are */
    texpatch_exemplar exemplars[TEXPATCH_MAX_EXEMPLARS];
    texpatch_map maps[TEXPATCH_MAX_MAPS];
    names exemplar_names, map_names[TEXPATCH_MAX_EXEMPLARS];
    txm_image pictures[TEXPATCH_MAX_EXEMPLARS][TEXPATCH_MAX_MAPS], kept[TEXPATCH_MAX_MAPS];
    int64_t window_x, window_y;

    /* the result */
    char (*paths)[MAX_PATH]; /* map 0 and its levels, map 1 and its levels, ... */
    int path_count;
    txm_image out[TEXPATCH_MAX_MAPS];
    texpatch_source *from; /* of all pixels; NULL: nobody asks */
} patch_job;

/* ---- lists ------------------------------------------------------------------------------- */

/* Take a list apart at its separators; most names, none empty. */
static int patch_split(patch_job *j, const char *option, const char *list, char separator, int most,
                       names *n) {
    const size_t size = strlen(list) + 1;
    n->storage = (char *)malloc(size);
    if (!n->storage) return fail_memory(&j->run);
    memcpy(n->storage, list, size);
    for (char *c = n->storage; c; n->count++) {
        if (n->count == most)
            return cli_fail(&j->run, CLI_USAGE, "%s '%s': at most %d", option, list, most);
        n->at[n->count] = c;
        c = strchr(c, separator);
        if (c) *c++ = 0;
        if (n->at[n->count][0] == 0)
            return cli_fail(&j->run, CLI_USAGE, "%s '%s': a name is empty", option, list);
    }
    return CLI_DONE;
}

/* "1,3": mark these maps. */
static int mark_maps(patch_job *j, const char *option, const char *list, int mark,
                     int marks[TEXPATCH_MAX_MAPS]) {
    double numbers[TEXPATCH_MAX_MAPS];
    if (!list) return CLI_DONE;
    const int last = j->desc.map_count - 1;
    const int n = parse_numbers(&j->run, option, list, TEXPATCH_MAX_MAPS, 0, last, numbers);
    if (!n) return CLI_USAGE;
    for (int i = 0; i < n; i++) {
        const int m = (int)numbers[i];
        if ((double)m != numbers[i])
            return cli_fail(&j->run, CLI_USAGE, "%s '%s': give whole numbers, 0 for '%s', 1 for "
                            "the first of --maps", option, list, j->run.inputs[0]);
        marks[m] = mark;
    }
    return CLI_DONE;
}

/* ---- what goes together ------------------------------------------------------------------- */

/* The maps of all exemplars, and how each is treated. */
static int parse_maps(patch_job *j) {
    names groups = {0};
    double weights[TEXPATCH_MAX_MAPS] = {1};
    int normals[TEXPATCH_MAX_MAPS] = {0}, labels[TEXPATCH_MAX_MAPS] = {0};
    int data[TEXPATCH_MAX_MAPS] = {0};
    texpatch_desc *d = &j->desc;
    int status = CLI_DONE;
    j->exemplar_names.at[0] = j->run.inputs[0];
    j->exemplar_names.count = 1;
    if (j->more) {
        names more = {0};
        status = patch_split(j, "--exemplars", j->more, ',', TEXPATCH_MAX_EXEMPLARS - 1, &more);
        j->exemplar_names.storage = more.storage;
        for (int e = 0; e < more.count; e++)
            j->exemplar_names.at[j->exemplar_names.count++] = more.at[e];
    }
    d->exemplar_count = j->exemplar_names.count;
    d->map_count = 1;
    if (!status && j->map_list) {
        status = patch_split(j, "--maps", j->map_list, ';', TEXPATCH_MAX_EXEMPLARS, &groups);
        for (int e = 0; e < groups.count && !status; e++)
            status = patch_split(j, "--maps", groups.at[e], ',', TEXPATCH_MAX_MAPS - 1,
                                 &j->map_names[e]);
        d->map_count += j->map_names[0].count;
        if (!status && groups.count != d->exemplar_count)
            status = cli_fail(&j->run, CLI_USAGE, "--maps has maps of %d exemplars, there are %d; "
                              "separate theirs by ';'", groups.count, d->exemplar_count);
        for (int e = 1; e < groups.count && !status; e++) {
            if (j->map_names[e].count != j->map_names[0].count)
                status = cli_fail(&j->run, CLI_USAGE, "--maps has %d maps of '%s', but %d of '%s'; "
                                  "give all of each", j->map_names[0].count, j->run.inputs[0],
                                  j->map_names[e].count, j->exemplar_names.at[e]);
        }
    }
    free(groups.storage);
    if (status) return status;
    if (j->weights) {
        weights[0] = 0;
        if (!parse_numbers(&j->run, "--weights", j->weights, d->map_count, 0, 16, weights))
            return CLI_USAGE;
    }
    status = mark_maps(j, "--normal", j->normals, j->directx ? 2 : 1, normals);
    if (!status) status = mark_maps(j, "--label", j->labels, 1, labels);
    if (!status) status = mark_maps(j, "--data", j->data, 1, data);
    if (status) return status;
    double sum = 0;
    for (int m = 0; m < d->map_count; m++) {
        if ((normals[m] != 0) + labels[m] + data[m] > 1)
            return cli_fail(&j->run, CLI_USAGE, "map %d: choose one of --normal, --label and "
                            "--data", m);
        j->maps[m].weight = (float)weights[m];
        j->maps[m].is_normal = normals[m];
        j->maps[m].is_label = labels[m];
        j->maps[m].is_data = data[m];
        sum += weights[m];
    }
    if (!(sum > 0))
        return cli_fail(&j->run, CLI_USAGE, "--weights '%s': one at least must be above 0",
                        j->weights);
    if (j->directx && !j->normals)
        return cli_fail(&j->run, CLI_USAGE, "--directx goes with --normal");
    d->maps = j->maps;
    d->exemplars = j->exemplars;
    return CLI_DONE;
}

/* A whole number of the window, with a comma behind it or as the last. */
static int parse_place(const char **text, int64_t low, int64_t high, char behind, int64_t *value) {
    const char *c = *text + (**text == '-');
    char *end;
    if (*c < '0' || *c > '9') return 0;
    errno = 0;
    const long long v = strtoll(*text, &end, 10);
    if (errno || *end != behind || v < low || v > high) return 0;
    *text = end + (behind != 0);
    *value = v;
    return 1;
}

static int parse_window(patch_job *j) {
    const char *at = j->window;
    int64_t w, h;
    if (!parse_place(&at, -MAX_PLACE, MAX_PLACE, ',', &j->window_x) ||
        !parse_place(&at, -MAX_PLACE, MAX_PLACE, ',', &j->window_y) ||
        !parse_place(&at, 1, TEXPATCH_MAX_PIXELS, ',', &w) ||
        !parse_place(&at, 1, TEXPATCH_MAX_PIXELS, 0, &h))
        return cli_fail(&j->run, CLI_USAGE,
                        "--window '%s': give X,Y,W,H in pixels, X and Y within -2^40 to 2^40",
                        j->window);
    j->extent[0] = (int)w;
    j->extent[1] = (int)h;
    return CLI_DONE;
}

/* What the endless plane has not. */
static int check_window(patch_job *j) {
    const struct {
        const char *name;
        int is_given;
    } others[] = {{"--size", j->extent[0]},      {"--tileable", j->tileable},
                  {"--tileable-x", j->tileable_x}, {"--tileable-y", j->tileable_y},
                  {"--target", j->target != NULL}, {"--keep", j->kept_list != NULL},
                  {"--control", j->control != NULL}};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        if (others[i].is_given)
            return cli_fail(&j->run, CLI_USAGE, "%s does not go with --window", others[i].name);
    }
    return parse_window(j);
}

static int parse_lattice(patch_job *j) {
    double v[4];
    if (!j->lattice || !strcmp(j->lattice, "auto")) return CLI_DONE;
    if (!strcmp(j->lattice, "none")) {
        j->desc.lattice = -1;
        return CLI_DONE;
    }
    if (j->lattice[0] != '-' && (j->lattice[0] < '0' || j->lattice[0] > '9'))
        return cli_fail(&j->run, CLI_USAGE, "--lattice '%s': choose auto, none, or AX,AY,BX,BY",
                        j->lattice);
    const int n = parse_numbers(&j->run, "--lattice", j->lattice, 4, -TEXPATCH_MAX_SIDE,
                                TEXPATCH_MAX_SIDE, v);
    if (!n) return CLI_USAGE;
    if (n < 4 || fabs(v[0] * v[3] - v[1] * v[2]) < 16)
        return cli_fail(&j->run, CLI_USAGE, "--lattice '%s': give two steps, AX,AY,BX,BY, that "
                        "span 16 pixels or more", j->lattice);
    j->desc.lattice = 1;
    for (int k = 0; k < 4; k++) j->desc.lattice_vectors[k] = (float)v[k];
    return CLI_DONE;
}

/* Refuse, before any work, what does not go together. */
static int patch_check_options(patch_job *j) {
    cli *run = &j->run;
    texpatch_desc *d = &j->desc;
    int status = j->window ? check_window(j) : CLI_DONE;
    if (status) return status;
    const int w = j->extent[0], h = j->extent[1];
    if (w == 0)
        return cli_fail(run, CLI_USAGE, "no size given; add --size WxH, such as --size 512x512");
    if (w > TEXPATCH_MAX_PIXELS / h)
        return cli_fail(run, CLI_USAGE, "%s %dx%d: at most %d pixels in all",
                        j->window ? "--window" : "--size", w, h, TEXPATCH_MAX_PIXELS);
    if (d->turns == 3) return cli_fail(run, CLI_USAGE, "--turns '3': choose 1, 2 or 4");
    if (!j->guides != !j->target)
        return cli_fail(run, CLI_USAGE, "--guide and --target go together; give both");
    if (j->control && j->guides)
        return cli_fail(run, CLI_USAGE, "--control makes its own guides; leave out --guide");
    if (j->target_mask && !j->target)
        return cli_fail(run, CLI_USAGE, "--target-mask goes with --target");
    if (j->guide_weight && !j->target && !j->control)
        return cli_fail(run, CLI_USAGE, "--guide-weight goes with --target or --control");
    if (!j->kept_list != !j->keep)
        return cli_fail(run, CLI_USAGE, "--keep and --keep-mask go together; give both");
    int coarser = 0;
    for (int side = w > h ? w : h; side > 1; side = (side + 1) / 2) coarser++;
    if (j->lod > coarser)
        return cli_fail(run, CLI_USAGE, "--lod %d: %d x %d pixels have %d coarser levels", j->lod,
                        w, h, coarser);
    if (j->sources) {
        char extension[8];
        file_extension(j->sources, extension);
        if (strcmp(extension, ".pfm") != 0)
            return cli_fail(run, CLI_USAGE, "cannot write '%s': end the name of --sources in .pfm",
                            j->sources);
    }
    d->passes = j->passes < 0 ? 0 : j->passes == 0 ? -1 : j->passes;
    d->tileable = (j->tileable || j->tileable_x ? TEXPATCH_TILE_X : 0) |
                  (j->tileable || j->tileable_y ? TEXPATCH_TILE_Y : 0);
    d->width = w;
    d->height = h;
    d->seed = run->seed;
    double novelty = 0, weight = 0;
    status = parse_number(run, "--novelty", j->novelty, 0, 1, &novelty);
    if (!status) status = parse_number(run, "--guide-weight", j->guide_weight, 0, 16, &weight);
    d->novelty = (float)novelty;
    d->guide_weight = (float)weight;
    if (!status && j->guide_weight && d->guide_weight <= 0)
        return cli_fail(run, CLI_USAGE, "--guide-weight 0: leave out --target or --control "
                        "instead");
    if (!status) status = parse_lattice(j);
    if (!status) status = parse_maps(j);
    return status;
}

/* ---- the outputs' names ------------------------------------------------------------------- */

static int is_separator(char c) {
    return c == '-' || c == '_' || c == '.' || c == ' ';
}

/* The length of a file's name without its extension; *name is behind the last slash. */
static size_t stem_of(const char *path, const char **name) {
    const char *slash = strrchr(path, '/'), *dot;
    *name = slash ? slash + 1 : path;
    dot = strrchr(*name, '.');
    return dot && dot > *name ? (size_t)(dot - *name) : strlen(*name);
}

/* What tells a map from its exemplar: "normal" of bricks_normal.png beside bricks.png or
   bricks_albedo.png. The whole stem if that leaves nothing. */
static size_t own_name(const char *path, const char *exemplar, const char **name) {
    const char *other;
    const size_t n = stem_of(path, name), m = stem_of(exemplar, &other);
    size_t same = 0, cut = 0;
    while (same < n && same < m && (*name)[same] == other[same]) {
        same++;
        if (is_separator(other[same - 1])) cut = same;
    }
    if (same == m && same < n && is_separator((*name)[same])) cut = same + 1;
    if (cut >= n) cut = 0;
    *name += cut;
    return n - cut;
}

/* OUT-normal-2.png: level 2 of a map. */
static int name_output(patch_job *j, int map, int level, char path[MAX_PATH]) {
    const size_t n = strlen(j->run.output) - strlen(j->extension);
    const char *name = "";
    size_t length = 0;
    char number[16] = "";
    if (level) snprintf(number, sizeof number, "-%d", level);
    if (map) length = own_name(j->map_names[0].at[map - 1], j->run.inputs[0], &name);
    const int size = snprintf(path, MAX_PATH, "%.*s%s%.*s%s%s", (int)n, j->run.output,
                              map ? "-" : "", (int)length, name, number, j->run.output + n);
    if (size < MAX_PATH) return CLI_DONE;
    return cli_fail(&j->run, CLI_USAGE, "'%s': the path is too long", j->run.output);
}

/* All paths that will be written. */
static int patch_name_outputs(patch_job *j) {
    const int levels = 1 + j->lod, count = j->desc.map_count * levels;
    int status = CLI_DONE;
    file_extension(j->run.output, j->extension);
    j->paths = (char(*)[MAX_PATH])calloc((size_t)count + 1, MAX_PATH);
    if (!j->paths) return fail_memory(&j->run);
    for (int i = 0; i < count && !status; i++) {
        status = name_output(j, i / levels, i % levels, j->paths[i]);
        if (!status && i > 0) status = cli_writes(&j->run, j->paths[i]); /* the first is -o */
    }
    j->path_count = count;
    if (!status && j->sources) {
        if (strlen(j->sources) >= MAX_PATH)
            return cli_fail(&j->run, CLI_USAGE, "'%s': the path is too long", j->sources);
        memcpy(j->paths[j->path_count++], j->sources, strlen(j->sources) + 1);
    }
    if (!status)
        status = check_picture_path(&j->run, j->run.output, j->desc.width, j->desc.height, 0);
    return status;
}

/* ---- reading ------------------------------------------------------------------------------- */

/* 8 bits as 16. */
static int widen(patch_job *j, txm_image *image) {
    txm_image wide;
    const int status =
        new_picture(&j->run, image->width, image->height, image->channels, TXM_U16, &wide);
    const size_t count = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    const uint8_t *from = (const uint8_t *)image->pixels;
    for (size_t i = 0; i < count && !status; i++) {
        ((uint16_t *)wide.pixels)[i] = (uint16_t)(from[i] * 257);
    }
    image_free(image);
    *image = wide;
    return status;
}

/* Read a picture with so many channels of that sample type. */
static int read_as(patch_job *j, const char *path, int channels, txm_sample sample,
                   txm_image *image) {
    const int status = read_picture(&j->run, path, channels, sample, image);
    return !status && image->sample != sample ? widen(j, image) : status;
}

static int check_extent(patch_job *j, const char *what, const char *path, const txm_image *image,
                        int width, int height, const char *like) {
    if (image->width == width && image->height == height) return CLI_DONE;
    return cli_fail(&j->run, CLI_FAILED, "%s '%s' is %d x %d; make it %d x %d as %s", what, path,
                    image->width, image->height, width, height, like);
}

/* Exemplar e and its maps; all exemplars have the channels and the depths of the first. */
static int read_exemplar(patch_job *j, int e) {
    texpatch_exemplar *x = &j->exemplars[e];
    const char *path = j->exemplar_names.at[e];
    int status = CLI_DONE;
    x->maps = j->pictures[e];
    for (int m = 0; m < j->desc.map_count && !status; m++) {
        const txm_image *first = &j->pictures[0][m];
        txm_image *image = &j->pictures[e][m];
        const char *name = m ? j->map_names[e].at[m - 1] : path;
        if (e) status = read_as(j, name, first->channels, first->sample, image);
        else status = read_picture(&j->run, name, 0, TXM_U16, image);
        if (!status && m)
            status = check_extent(j, "the map", name, image, x->maps[0].width, x->maps[0].height,
                                  path);
    }
    return status;
}

/* A list of masks or guides, one for each exemplar. */
static int read_for_exemplars(patch_job *j, const char *option, const char *list, int channels) {
    names n = {0};
    int status = patch_split(j, option, list, ',', TEXPATCH_MAX_EXEMPLARS, &n);
    if (!status && n.count != j->desc.exemplar_count)
        status = cli_fail(&j->run, CLI_USAGE, "%s '%s': give %d, one for each exemplar", option,
                          list, j->desc.exemplar_count);
    for (int e = 0; e < n.count && !status; e++) {
        texpatch_exemplar *x = &j->exemplars[e];
        txm_image *image = channels ? &x->mask : &x->guide;
        const int as_first = channels ? channels : j->exemplars[0].guide.channels; /* 0: as it is */
        status = read_as(j, n.at[e], as_first, TXM_U8, image);
        if (!status)
            status = check_extent(j, channels ? "the mask" : "the guide", n.at[e], image,
                                  x->maps[0].width, x->maps[0].height, j->exemplar_names.at[e]);
    }
    free(n.storage);
    return status;
}

static int read_sized(patch_job *j, const char *what, const char *path, int channels,
                      txm_sample sample, txm_image *image) {
    const int status = read_as(j, path, channels, sample, image);
    if (status) return status;
    return check_extent(j, what, path, image, j->desc.width, j->desc.height, "--size says");
}

static int read_kept(patch_job *j) {
    names n = {0};
    texpatch_desc *d = &j->desc;
    int status = patch_split(j, "--keep", j->kept_list, ',', TEXPATCH_MAX_MAPS, &n);
    if (!status && n.count != d->map_count)
        status = cli_fail(&j->run, CLI_USAGE, "--keep '%s': give %d, one for each map",
                          j->kept_list, d->map_count);
    for (int m = 0; m < n.count && !status; m++)
        status = read_sized(j, "the picture", n.at[m], j->pictures[0][m].channels,
                            j->pictures[0][m].sample, &j->kept[m]);
    free(n.storage);
    if (!status) status = read_sized(j, "the mask", j->keep, 1, TXM_U8, &d->keep);
    d->kept = j->kept;
    return status;
}

/* All pictures; then it is known what OUT has to hold. */
static int patch_read_all(patch_job *j) {
    texpatch_desc *d = &j->desc;
    int status = CLI_DONE;
    for (int e = 0; e < d->exemplar_count && !status; e++) status = read_exemplar(j, e);
    for (int m = 0; m < d->map_count && !status; m++) {
        const txm_image *image = &j->pictures[0][m];
        const char *path = j->paths[m * (1 + j->lod)];
        status = check_picture_path(&j->run, path, d->width, d->height, image->channels);
        if (!status && image->sample == TXM_U16 && strcmp(j->extension, ".png") != 0)
            status = cli_fail(&j->run, CLI_USAGE, "cannot write '%s': of these formats only PNG "
                              "takes 16 bits a sample; use .png", path);
    }
    if (!status && j->masks) status = read_for_exemplars(j, "--mask", j->masks, 1);
    if (!status && j->guides) status = read_for_exemplars(j, "--guide", j->guides, 0);
    if (!status && j->target)
        status = read_sized(j, "the target", j->target, j->exemplars[0].guide.channels, TXM_U8,
                            &d->guide);
    if (!status && j->target_mask)
        status = read_sized(j, "the mask", j->target_mask, 1, TXM_U8, &d->guide_mask);
    if (!status && j->keep) status = read_kept(j);
    return status;
}

/* ---- strokes ------------------------------------------------------------------------------- */

/* A file of strokes: what to find in the exemplar, and what to draw. */
typedef struct strokes {
    texedges_desc find;
    texedges_control control;
    texedges_stroke *list;
    txm_vec2 *points;
    char why[120]; /* what is wrong with the file */
} strokes;

static int is_in(const cJSON *item, double low, double high) {
    return cJSON_IsNumber(item) && item->valuedouble >= low && item->valuedouble <= high;
}

/* A number low..high of that name; *value stays if there is none. */
static int get_number(strokes *s, const cJSON *from, const char *name, double low, double high,
                      int is_whole, double *value) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(from, name);
    if (!item) return 1;
    const int fits = is_in(item, low, high);
    if (fits && (!is_whole || (double)(int)item->valuedouble == item->valuedouble)) {
        *value = item->valuedouble;
        return 1;
    }
    snprintf(s->why, sizeof s->why, "\"%s\" is to be a %snumber from %g to %g", name,
             is_whole ? "whole " : "", low, high);
    return 0;
}

/* Has the object only fields of these names? A misspelt one would do nothing, and nobody knew. */
static int knows_fields(strokes *s, const cJSON *object, const char *const *fields) {
    const cJSON *item;
    cJSON_ArrayForEach(item, object) {
        int k = 0;
        while (fields[k] && strcmp(fields[k], item->string) != 0) k++;
        if (fields[k]) continue;
        snprintf(s->why, sizeof s->why, "unknown field \"%.40s\"", item->string);
        return 0;
    }
    return 1;
}

/* One stroke; its points go behind those of the ones before. */
static int parse_stroke(strokes *s, const cJSON *json, texedges_stroke *to, txm_vec2 *points) {
    static const char *const fields[] = {"layer", "closed", "width", "points", NULL};
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(json, "points"), *point;
    const cJSON *closed = cJSON_GetObjectItemCaseSensitive(json, "closed");
    double layer = 0, width = 0;
    if (!cJSON_IsObject(json)) {
        snprintf(s->why, sizeof s->why, "it is to be an object");
        return 0;
    }
    if (!knows_fields(s, json, fields) ||
        !get_number(s, json, "layer", 0, s->find.levels - 1, 1, &layer) ||
        !get_number(s, json, "width", 2, 256, 0, &width))
        return 0;
    if (closed && !cJSON_IsBool(closed)) {
        snprintf(s->why, sizeof s->why, "\"closed\" is to be true or false");
        return 0;
    }
    to->is_closed = cJSON_IsTrue(closed);
    to->layer = (int)layer;
    to->width = (float)width;
    to->points = points;
    cJSON_ArrayForEach(point, list) {
        const cJSON *x = cJSON_GetArrayItem(point, 0), *y = cJSON_GetArrayItem(point, 1);
        if (!cJSON_IsArray(point) || cJSON_GetArraySize(point) != 2 ||
            !is_in(x, -MAX_COORDINATE, MAX_COORDINATE) ||
            !is_in(y, -MAX_COORDINATE, MAX_COORDINATE)) {
            snprintf(s->why, sizeof s->why, "point %d is to be [x,y] within -%d to %d", to->count,
                     MAX_COORDINATE, MAX_COORDINATE);
            return 0;
        }
        points[to->count].x = (float)x->valuedouble;
        points[to->count++].y = (float)y->valuedouble;
    }
    int moves = 0; /* strokes that stay where they begin have no way */
    for (int i = 1; i < to->count; i++)
        moves |= points[i].x < points[0].x || points[i].x > points[0].x ||
                 points[i].y < points[0].y || points[i].y > points[0].y;
    if (cJSON_IsArray(list) && to->count >= 2 + to->is_closed && moves) return 1;
    snprintf(s->why, sizeof s->why,
             "\"points\" is to be a list of %d or more [x,y], not all the same", 2 + to->is_closed);
    return 0;
}

static int parse_strokes(strokes *s, const cJSON *json) {
    static const char *const fields[] = {"levels",     "smooth",  "least",  "background",
                                         "disturb",    "strokes", NULL};
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(json, "strokes"), *item;
    double levels = 4, smooth = 0, least = 0, background = -1, disturb = 1;
    size_t count = 0, points = 0;
    if (!cJSON_IsObject(json) || !cJSON_IsArray(list)) {
        snprintf(s->why, sizeof s->why, "not a list of strokes; see 'texkit patch --help'");
        return 0;
    }
    if (!knows_fields(s, json, fields) ||
        !get_number(s, json, "levels", 2, TEXEDGES_MAX_LEVELS, 1, &levels) ||
        !get_number(s, json, "smooth", 0, 16, 0, &smooth) ||
        !get_number(s, json, "least", 0, 1 << 30, 1, &least) ||
        !get_number(s, json, "background", -1, levels - 1, 1, &background) ||
        !get_number(s, json, "disturb", 0, 4, 0, &disturb))
        return 0;
    s->find.levels = (int)levels;
    s->find.smooth = (float)smooth;
    s->find.least = (int)least;
    s->control.background = (int)background;
    s->control.disturb = disturb > 0 ? (float)disturb : -1; /* the library's 0 is its default */
    cJSON_ArrayForEach(item, list) {
        count++;
        points += (size_t)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(item, "points"));
    }
    s->list = (texedges_stroke *)calloc(count + 1, sizeof *s->list);
    s->points = (txm_vec2 *)calloc(points + 1, sizeof *s->points);
    if (!s->list || !s->points) {
        snprintf(s->why, sizeof s->why, "out of memory");
        return 0;
    }
    s->control.strokes = s->list;
    points = 0;
    cJSON_ArrayForEach(item, list) {
        texedges_stroke *stroke = &s->list[s->control.stroke_count];
        if (!parse_stroke(s, item, stroke, s->points + points)) {
            char why[sizeof s->why];
            memcpy(why, s->why, sizeof why);
            snprintf(s->why, sizeof s->why, "stroke %d: %.95s", s->control.stroke_count, why);
            return 0;
        }
        points += (size_t)stroke->count;
        s->control.stroke_count++;
    }
    return 1;
}

static int read_strokes(patch_job *j, strokes *s) {
    size_t size;
    unsigned char *bytes = file_read(j->control, &size);
    if (!bytes)
        return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", j->control, strerror(errno));
    cJSON *json = cJSON_ParseWithLength((const char *)bytes, size);
    free(bytes);
    snprintf(s->why, sizeof s->why, "not a JSON file");
    const int ok = json && parse_strokes(s, json);
    cJSON_Delete(json);
    if (ok) return CLI_DONE;
    return cli_fail(&j->run, CLI_FAILED, "'%s': %s", j->control, s->why);
}

/* Layers of the exemplars as their guides, the disturbed strokes as the guide of the output. */
static int follow_strokes(patch_job *j, strokes *s) {
    texpatch_desc *d = &j->desc;
    texedges_set *edges = NULL, *disturbed = NULL;
    texedges_control control = s->control;
    int status = CLI_DONE;
    s->find.image = j->pictures[0][0];
    status = check_result(&j->run, texedges_find(&s->find, &j->run.env, &edges), j->run.inputs[0]);
    for (int e = 0; e < d->exemplar_count && !status; e++) {
        const txm_image *image = &j->pictures[e][0];
        txm_image *layers = &j->exemplars[e].guide;
        s->find.image = *image;
        status = new_picture(&j->run, image->width, image->height, 1, TXM_U8, layers);
        if (!status)
            status = check_result(&j->run, texedges_layers(&s->find, edges, &j->run.env, layers),
                                  j->exemplar_names.at[e]);
    }
    control.edges = edges;
    control.seed = j->run.seed;
    if (!status) status = new_picture(&j->run, d->width, d->height, 1, TXM_U8, &d->guide);
    if (!status) status = new_picture(&j->run, d->width, d->height, 1, TXM_U8, &d->guide_mask);
    if (!status)
        status = check_result(&j->run, texedges_disturb(&control, d->width, d->height, &j->run.env,
                                                        &disturbed), j->control);
    if (!status)
        status = check_result(&j->run, texedges_guide(&control, disturbed, &j->run.env,
                                                      &d->guide, &d->guide_mask), j->control);
    texedges_set_free(edges);
    texedges_set_free(disturbed);
    return status;
}

static int patch_take_strokes(patch_job *j) {
    strokes s;
    memset(&s, 0, sizeof s);
    int status = read_strokes(j, &s);
    if (!status) {
        cli_stage(&j->run, "strokes");
        cli_figure(&j->run, "stroke_count", s.control.stroke_count);
        status = follow_strokes(j, &s);
    }
    free(s.list);
    free(s.points);
    return status;
}

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

/* ---- where pixels come from ---------------------------------------------------------------- */

/* Does q follow p in the exemplar as it does in the output, one step to the right or down? */
static int goes_on(const texpatch_source *p, const texpatch_source *q, int is_down) {
    /* what becomes of a step to the right by so many quarter turns back; y points down */
    static const int turned[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    if (p->exemplar < 0 || p->exemplar != q->exemplar || p->turn != q->turn) return 0;
    const int *step = turned[(p->turn + is_down) & 3];
    const float dx = q->x - p->x - (float)(p->turn >= 4 ? -step[0] : step[0]);
    const float dy = q->y - p->y - (float)step[1];
    return dx > -0.25f && dx < 0.25f && dy > -0.25f && dy < 0.25f;
}

/* The share of neighbours that are neighbours in the exemplar. */
static double measure_continuous(const patch_job *j) {
    const size_t w = (size_t)j->desc.width, h = (size_t)j->desc.height;
    double pairs = 0, good = 0;
    for (size_t y = 0; y < h; y++) {
        for (size_t x = 0; x < w; x++) {
            const texpatch_source *p = &j->from[y * w + x];
            if (x + 1 < w) good += goes_on(p, p + 1, 0);
            if (y + 1 < h) good += goes_on(p, p + w, 1);
            pairs += (x + 1 < w) + (y + 1 < h);
        }
    }
    return pairs > 0 ? good / pairs : 1;
}

/* A PFM: floats with the low byte first, rows from bottom to top. */
static unsigned char *encode_sources(const patch_job *j, size_t *size) {
    const size_t w = (size_t)j->desc.width, h = (size_t)j->desc.height;
    char head[48];
    size_t bytes;
    const int n = snprintf(head, sizeof head, "PF\n%zu %zu\n-1.0\n", w, h);
    if (!txm_mul(w, h, 12, &bytes) || !txm_add(bytes, (size_t)n, size)) return NULL;
    unsigned char *file = (unsigned char *)malloc(*size), *to = file;
    if (!file) return NULL;
    memcpy(to, head, (size_t)n);
    to += n;
    for (size_t y = h; y-- > 0;) {
        for (size_t x = 0; x < w; x++) {
            const texpatch_source *p = &j->from[y * w + x];
            const float values[3] = {p->x, p->y,
                                     p->exemplar < 0 ? -1 : (float)(8 * p->exemplar + p->turn)};
            for (int k = 0; k < 3; k++) {
                uint32_t bits;
                memcpy(&bits, &values[k], sizeof bits);
                for (int b = 0; b < 4; b++) *to++ = (unsigned char)(bits >> (8 * b) & 255);
            }
        }
    }
    return file;
}

/* ---- writing ------------------------------------------------------------------------------- */

static int encode(patch_job *j, const txm_image *image, int index, cli_file *file,
                  unsigned char **bytes) {
    file->name = j->paths[index];
    const int status = encode_picture(&j->run, file->name, image, bytes, &file->size);
    file->bytes = *bytes;
    return status;
}

/* A map and its coarser levels; the finer one is given up as soon as the next is made. */
static int encode_levels(patch_job *j, int map, cli_file *files, unsigned char **bytes) {
    const int first = map * (1 + j->lod);
    txm_image *image = &j->out[map];
    int status = encode(j, image, first, &files[first], &bytes[first]);
    for (int level = 1; level <= j->lod && !status; level++) {
        const int i = first + level;
        txm_image half;
        status = new_picture(&j->run, (image->width + 1) / 2, (image->height + 1) / 2,
                             image->channels, image->sample, &half);
        if (!status)
            status = check_result(&j->run, texpatch_half(image, &j->maps[map], &j->run.env, &half),
                                  j->run.inputs[0]);
        free(image->pixels);
        *image = half;
        if (!status) status = encode(j, image, i, &files[i], &bytes[i]);
    }
    return status;
}

static int patch_write_outputs(patch_job *j) {
    const size_t count = (size_t)j->path_count;
    cli_file *files = (cli_file *)calloc(count, sizeof *files);
    unsigned char **bytes = (unsigned char **)calloc(count, sizeof *bytes);
    double sum = 0;
    int status = files && bytes ? CLI_DONE : fail_memory(&j->run);
    cli_stage(&j->run, "encode");
    for (int m = 0; m < j->desc.map_count && !status; m++)
        status = encode_levels(j, m, files, bytes);
    if (!status && j->sources) {
        cli_file *last = &files[count - 1];
        last->name = j->sources;
        last->bytes = bytes[count - 1] = encode_sources(j, &last->size);
        if (!last->bytes) status = fail_memory(&j->run);
    }
    for (size_t i = 0; i < count && !status; i++) sum += (double)files[i].size;
    cli_figure(&j->run, "files", (double)count);
    cli_figure(&j->run, "file_bytes", sum);
    if (!status) status = cli_finish_files(&j->run, files, (int)count);
    for (size_t i = 0; i < count && bytes; i++) free(bytes[i]);
    free(bytes);
    free(files);
    return status;
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
        {CLI_FLAG, "--tileable-x", NULL, "only from the right one to the left one", &j->tileable_x,
         0, 0},
        {CLI_FLAG, "--tileable-y", NULL, "only from the lower one to the upper one", &j->tileable_y,
         0, 0},
        {CLI_GROUPS, "--maps", "M1,M2,...", "pictures in register with EXEMPLAR, made in register",
         &j->map_list, 0, 0},
        {CLI_TEXT, "--weights", "W0,W1,...",
         "how much EXEMPLAR and the maps count in matching, 0 to 16; default 1,0", &j->weights, 0,
         0},
        {CLI_TEXT, "--normal", "I,J,...", "these maps are normal maps", &j->normals, 0, 0},
        {CLI_FLAG, "--directx", NULL, "y of normals points down; default: up, as in OpenGL",
         &j->directx, 0, 0},
        {CLI_TEXT, "--label", "I,J,...", "these maps hold names, which are not to be mixed",
         &j->labels, 0, 0},
        {CLI_TEXT, "--data", "I,J,...", "these maps hold amounts (height, roughness), not colors",
         &j->data, 0, 0},
        {CLI_INPUTS, "--exemplars", "E2,...", "more exemplars, up to 8 in all", &j->more, 0, 0},
        {CLI_INPUTS, "--mask", "M", "use EXEMPLAR only where this picture is not black; one for each",
         &j->masks, 0, 0},
        {CLI_INT, "--patch", "N",
         "side of the first patches in pixels; default: what suits EXEMPLAR", &d->patch, 8,
         TEXPATCH_MAX_SIDE},
        {CLI_INT, "--passes", "P", "of optimisation, 1 to 16; 0 = none; default 3, at full size 2",
         &j->passes, 0, 16},
        {CLI_TEXT, "--lattice", "HOW", "auto (default), none, or its two steps: AX,AY,BX,BY",
         &j->lattice, 0, 0},
        {CLI_INT, "--turns", "N", "pieces may be turned: 2 = by half turns, 4 = by quarter turns",
         &d->turns, 1, 4},
        {CLI_FLAG, "--mirror", NULL, "pieces may be mirrored", &d->mirror, 0, 0},
        {CLI_TEXT, "--novelty", "V", "0 to 1: avoid long pieces that are as in EXEMPLAR; default 0",
         &j->novelty, 0, 0},
        {CLI_INPUTS, "--guide", "G", "a picture in register with EXEMPLAR; one for each exemplar",
         &j->guides, 0, 0},
        {CLI_INPUT, "--target", "T", "what the guide should look like in OUT", &j->target, 0, 0},
        {CLI_INPUT, "--target-mask", "M", "where this picture is black, the target says nothing",
         &j->target_mask, 0, 0},
        {CLI_TEXT, "--guide-weight", "V", "against a map of weight 1; above 0, up to 16; default 2",
         &j->guide_weight, 0, 0},
        {CLI_INPUT, "--control", "STROKES", "lines that become edges of the texture", &j->control, 0,
         0},
        {CLI_INPUTS, "--keep", "K0,K1,...",
         "pictures of OUT's size, for each map, to be kept in part", &j->kept_list, 0, 0},
        {CLI_INPUT, "--keep-mask", "M", "they are kept where this picture is not black", &j->keep, 0,
         0},
        {CLI_INT, "--lod", "K", "coarser levels to write, each half as wide", &j->lod, 0,
         MAX_LEVELS},
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
    if (!status && run->stats) cli_figure(run, "continuous", measure_continuous(j));
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
    const int status = run_job(j, argc, argv);
    free_job(j);
    return status;
}

const command patch_command = {&patch_manual, run_patch};
