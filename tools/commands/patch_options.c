/* patch_options.c - the options of 'texkit patch', parsed and checked
   SPDX-License-Identifier: MIT OR Unlicense */
#include "patch.h"
#include "files/image_io.h"

#include <errno.h>

/* of a window, pixels */
static const int64_t MAX_PLACE = (int64_t)1 << 40;

/* ---- lists ------------------------------------------------------------------------------- */

/* The names up to the end of the list or, if that is a separator, to a semicolon. */
static int split(patch_job *j, const char *option, const char **list, const char *separators, int most,
                 names *n) {
    const char *all = *list;
    char name[MAX_PATH], *to = (char *)malloc(strlen(all) + 1);
    n->storage = to;
    if (!to) return fail_memory(&j->run);
    do {
        if (n->count == most)
            return cli_fail(&j->run, CLI_USAGE, "%s '%s': at most %d", option, all, most);
        if (!cli_take_name(list, separators, name))
            return cli_fail(&j->run, CLI_USAGE, "%s '%s': a name is empty", option, all);
        n->at[n->count++] = to;
        memcpy(to, name, strlen(name) + 1);
        to += strlen(name) + 1;
    } while (*list && (*list)[-1] != ';');
    return CLI_DONE;
}

int patch_split(patch_job *j, const char *option, const char *list, int most, names *n) {
    return split(j, option, &list, ",", most, n);
}

/* ---- options ------------------------------------------------------------------------------ */

/* The maps of all exemplars, and how each is treated. */
static int parse_maps(patch_job *j) {
    double weights[TEXPATCH_MAX_MAPS] = {1};
    int normals[TEXPATCH_MAX_MAPS] = {0}, labels[TEXPATCH_MAX_MAPS] = {0};
    int data[TEXPATCH_MAX_MAPS] = {0};
    texpatch_desc *d = &j->desc;
    int status = CLI_DONE;
    j->exemplar_names.at[0] = j->run.inputs[0];
    j->exemplar_names.count = 1;
    if (j->more) {
        names more = {0};
        status = patch_split(j, "--exemplars", j->more, TEXPATCH_MAX_EXEMPLARS - 1, &more);
        j->exemplar_names.storage = more.storage;
        for (int e = 0; e < more.count; e++)
            j->exemplar_names.at[j->exemplar_names.count++] = more.at[e];
    }
    d->exemplar_count = j->exemplar_names.count;
    d->map_count = 1;
    if (!status && j->map_list) {
        int groups = 0;
        for (const char *at = j->map_list; at && !status; groups++)
            status = groups < TEXPATCH_MAX_EXEMPLARS
                         ? split(j, "--maps", &at, ",;", TEXPATCH_MAX_MAPS - 1, &j->map_names[groups])
                         : cli_fail(&j->run, CLI_USAGE, "--maps '%s': at most %d", j->map_list, groups);
        d->map_count += j->map_names[0].count;
        if (!status && groups != d->exemplar_count)
            status = cli_fail(&j->run, CLI_USAGE, "--maps has maps of %d exemplars, there are %d; "
                              "separate theirs by ';'", groups, d->exemplar_count);
        for (int e = 1; e < groups && !status; e++) {
            if (j->map_names[e].count != j->map_names[0].count)
                status = cli_fail(&j->run, CLI_USAGE, "--maps has %d maps of '%s', but %d of '%s'; "
                                  "give all of each", j->map_names[0].count, j->run.inputs[0],
                                  j->map_names[e].count, j->exemplar_names.at[e]);
        }
    }
    if (status) return status;
    if (j->weights) {
        weights[0] = 0;
        if (!parse_numbers(&j->run, "--weights", j->weights, d->map_count, 0, 16, weights))
            return CLI_USAGE;
    }
    const int last = d->map_count - 1;
    status = mark_maps(&j->run, "--normal", j->normals, 0, last, j->directx ? 2 : 1, normals);
    if (!status) status = mark_maps(&j->run, "--label", j->labels, 0, last, 1, labels);
    if (!status) status = mark_maps(&j->run, "--data", j->data, 0, last, 1, data);
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
        return cli_fail(&j->run, CLI_USAGE, "--weights '%s': at least one must be above 0",
                        j->weights);
    if (j->directx && !j->normals)
        return cli_fail(&j->run, CLI_USAGE, "--directx goes with --normal");
    d->maps = j->maps;
    d->exemplars = j->exemplars;
    return CLI_DONE;
}

/* A whole number of the window, followed by a comma or by the end. */
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

/* Refuse options that the endless plane does not have. */
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

int patch_check_options(patch_job *j) {
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
    while (txm_level_side(w > h ? w : h, coarser) > 1) coarser++;
    if (j->lod > coarser)
        return cli_fail(run, CLI_USAGE, "--lod %d: %d x %d pixels have %d coarser levels", j->lod,
                        w, h, coarser);
    if (j->cutout && !j->lod)
        return cli_fail(run, CLI_USAGE, "--cutout goes with --lod, whose levels it is for");
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
    if (!status) status = check_even(run, j->even);
    /* guides tell places of the exemplar apart, perhaps by their light; kept pixels keep theirs */
    if (j->even == EVEN_AUTO && (j->guides || j->control || j->kept_list)) j->even = 0;
    if (!status) status = parse_lattice(j);
    if (!status) status = parse_maps(j);
    return status;
}
