/* edges.c - texkit edges: the boundaries of the gray layers of a picture
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: open_memstream */
#include "command.h"
#include "files/image_io.h"
#include "texedges.h"

#include <stdio.h>

static const cli_manual edges_manual = {
    "edges", "EXEMPLAR -o OUT [options]",
    "find the boundaries between the gray layers of a picture",
    "The grays of EXEMPLAR are divided into layers of about equal area; layer 0 is the\n"
    "darkest. The strokes of 'texkit patch --control' refer to these layers. OUT ends in\n"
    ".png, .jpg, .tif, .webp, .tga or .bmp  the boundaries of every layer on its own side, one\n"
    "       pixel wide, darker for darker layers;\n"
    ".svg   one path for each layer, filled with its gray: the layers as shapes;\n"
    ".json  {\"width\", \"height\", \"levels\", \"thresholds\": [...],\n"
    "        \"lines\": [{\"layer\": 0, \"hole\": false, \"points\": [[x,y], ...]}, ...]}\n"
    "Lines are closed and run between pixels, with their layer on the right; [0,0] is the top\n"
    "left corner of the picture. Points are where a line turns. A hole is a line around\n"
    "something that is not in the layer. A threshold, 0 to 1, is the lowest gray of the next\n"
    "layer. 'length' of --stats is that of all lines in pixels; each edge counts twice, once\n"
    "on each side.\n",
    "  texkit edges bricks.jpg -o bricks-edges.png --levels 3 --smooth 1.5 --least 40\n"
    "  texkit edges bricks.jpg -o bricks.svg --layers bricks-layers.png\n",
    1, "exemplar", 0, "take a smaller picture", NULL};

typedef struct options {
    const char *smooth, *thresholds, *over, *layers;
    int layer; /* -1: all */
} options;

enum { OVER_BLACK, OVER_PICTURE, OVER_LAYERS };

/* ---- lines as text ----------------------------------------------------------------------- */

/* Point i of a line; i may run past its end. */
static txm_vec2 point_of(const texedges_set *e, const texedges_polyline *line, size_t i) {
    return e->points[line->first + i % line->count];
}

static int sign_of(float x) {
    return (x > 0) - (x < 0);
}

/* Does the line turn at its point i? Every step is along an axis. */
static int turns_at(const texedges_set *e, const texedges_polyline *line, size_t i) {
    const txm_vec2 p = point_of(e, line, i + line->count - 1), q = point_of(e, line, i);
    const txm_vec2 r = point_of(e, line, i + 1);
    return sign_of(q.x - p.x) != sign_of(r.x - q.x) || sign_of(q.y - p.y) != sign_of(r.y - q.y);
}

static void print_json(FILE *to, const texedges_set *e, int layer) {
    const char *between = "";
    fprintf(to, "{\n  \"width\": %d,\n  \"height\": %d,\n  \"levels\": %d,\n  \"thresholds\": [",
            e->width, e->height, e->levels);
    for (int k = 0; k + 1 < e->levels; k++)
        fprintf(to, "%s%.9g", k ? ", " : "", (double)e->thresholds[k]);
    fprintf(to, "],\n  \"lines\": [");
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
        const char *comma = "";
        if (layer >= 0 && line->layer != layer) continue;
        fprintf(to, "%s\n    {\"layer\": %d, \"hole\": %s, \"points\": [", between, line->layer,
                line->is_hole ? "true" : "false");
        for (size_t k = 0; k < line->count; k++) {
            if (!turns_at(e, line, k)) continue;
            const txm_vec2 p = point_of(e, line, k);
            fprintf(to, "%s[%.9g,%.9g]", comma, (double)p.x, (double)p.y);
            comma = ",";
        }
        fprintf(to, "]}");
        between = ",";
    }
    fprintf(to, "\n  ]\n}\n");
}

static void print_svg(FILE *to, const texedges_set *e, int layer) {
    fprintf(to, "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
            "viewBox=\"0 0 %d %d\" fill-rule=\"evenodd\" shape-rendering=\"crispEdges\">\n",
            e->width, e->height, e->width, e->height);
    for (int k = 0; k < e->levels; k++) {
        const int gray = (255 * k + (e->levels - 1) / 2) / (e->levels - 1); /* as texedges_layers */
        if (layer >= 0 && k != layer) continue;
        fprintf(to, "<path id=\"layer-%d\" fill=\"#%02x%02x%02x\" d=\"", k, (unsigned)gray,
                (unsigned)gray, (unsigned)gray);
        for (size_t i = 0; i < e->line_count; i++) {
            const texedges_polyline *line = &e->lines[i];
            char move = 'M';
            if (line->layer != k) continue;
            for (size_t n = 0; n < line->count; n++) {
                if (!turns_at(e, line, n)) continue;
                const txm_vec2 p = point_of(e, line, n);
                fprintf(to, "%c%.9g %.9g", move, (double)p.x, (double)p.y);
                move = 'L';
            }
            fprintf(to, "Z\n");
        }
        fprintf(to, "\"/>\n");
    }
    fprintf(to, "</svg>\n");
}

/* The text, for free(); NULL if memory ran out. */
static char *lines_as_text(const texedges_set *e, int layer, int is_svg, size_t *size) {
    char *text = NULL;
    FILE *to = open_memstream(&text, size);
    if (!to) return NULL;
    if (is_svg) print_svg(to, e, layer);
    else print_json(to, e, layer);
    if (!(ferror(to) | fclose(to))) return text;
    free(text);
    return NULL;
}

/* ---- lines as a picture ------------------------------------------------------------------ */

/* Lines over black, over the picture (in RGB) or over its layers (gray). */
static int draw_lines(cli *run, const texedges_set *e, int layer, int over,
                      const txm_image *image, const txm_image *layers, txm_image *out) {
    const int status = new_picture(run, e->width, e->height, 3, TXM_U8, out);
    if (status) return status;
    const txm_image *under = over == OVER_PICTURE ? image : layers;
    if (under->sample != TXM_U8 && over == OVER_PICTURE)
        cli_warn(run, "'%s' has 16 bits a sample; lines are drawn over 8 of them", run->inputs[0]);
    for (int y = 0; y < e->height && over != OVER_BLACK; y++) {
        for (int x = 0; x < e->width; x++) {
            for (int k = 0; k < 3; k++)
                txm_image_set(out, x, y, k,
                              txm_image_get(under, x, y, under->channels < 3 ? 0 : k));
        }
    }
    const txm_status result = texedges_draw(e, layer, &run->env, out);
    return check_result(run, result, run->inputs[0]);
}

/* ---- the command ------------------------------------------------------------------------- */

static int is_text(const char *extension) {
    return !strcmp(extension, ".svg") || !strcmp(extension, ".json");
}

/* Refuse, before any work, options that do not go together. */
static int check_options(cli *run, const options *o, texedges_desc *d, int *over,
                         float thresholds[TEXEDGES_MAX_LEVELS]) {
    static const char *const overs[] = {"black", "picture", "layers", NULL};
    char extension[8];
    double numbers[TEXEDGES_MAX_LEVELS];
    int status = CLI_DONE;
    file_extension(run->output, extension);
    if (!is_text(extension)) status = check_picture_path(run, run->output, 0, 0, 3);
    if (!status && o->layers) status = check_picture_path(run, o->layers, 0, 0, 1);
    if (status) return status;
    if (o->smooth) {
        if (!parse_numbers(run, "--smooth", o->smooth, 1, 0, 16, numbers)) return CLI_USAGE;
        d->smooth = (float)numbers[0];
    }
    if (o->thresholds) {
        const int n = parse_numbers(run, "--thresholds", o->thresholds, TEXEDGES_MAX_LEVELS - 1, 0,
                                    1, numbers);
        if (!n) return CLI_USAGE;
        for (int k = 0; k < n; k++) {
            thresholds[k] = (float)numbers[k];
            if (k && !(thresholds[k] > thresholds[k - 1]))
                return cli_fail(run, CLI_USAGE, "--thresholds '%s': each must be above the one "
                                "before", o->thresholds);
        }
        if (d->levels && d->levels != n + 1)
            return cli_fail(run, CLI_USAGE, "--levels %d has %d thresholds, --thresholds has %d",
                            d->levels, d->levels - 1, n);
        d->levels = n + 1;
        d->thresholds = thresholds;
    }
    const int levels = d->levels ? d->levels : 4;
    if (o->layer >= levels)
        return cli_fail(run, CLI_USAGE, "--layer %d: there are %d, 0 to %d", o->layer, levels,
                        levels - 1);
    *over = find_name(run, "--over", o->over, overs);
    if (*over < 0) return CLI_USAGE;
    if (*over != OVER_BLACK && is_text(extension))
        return cli_fail(run, CLI_USAGE, "--over is for pictures; '%s' holds only lines",
                        run->output);
    return CLI_DONE;
}

/* Figures for --stats; returns the number of lines in OUT. */
static size_t set_figures(cli *run, const texedges_set *e, int layer) {
    int per_layer[TEXEDGES_MAX_LEVELS] = {0};
    size_t count = 0;
    double length = 0;
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
        if (layer >= 0 && line->layer != layer) continue;
        per_layer[line->layer]++;
        count++;
        length += (double)line->count; /* a point at each pixel corner */
    }
    cli_figure(run, "width", e->width);
    cli_figure(run, "height", e->height);
    cli_figure(run, "levels", e->levels);
    cli_figure(run, "lines", (double)count);
    cli_figure(run, "length", length);
    if (e->levels <= CLI_MAX_LIST) cli_figures(run, "lines_per_layer", per_layer, e->levels);
    return count;
}

static int write_outputs(cli *run, const options *o, const texedges_set *e, int over,
                         const txm_image *image, const txm_image *layers) {
    cli_file files[2] = {{0}, {0}};
    unsigned char *bytes[2] = {NULL, NULL};
    char extension[8];
    txm_image out = {0};
    int status = CLI_DONE;
    cli_stage(run, "encode");
    file_extension(run->output, extension);
    files[0].name = run->output;
    files[1].name = o->layers;
    if (is_text(extension)) {
        bytes[0] = (unsigned char *)lines_as_text(e, o->layer, !strcmp(extension, ".svg"),
                                                  &files[0].size);
        if (!bytes[0]) status = fail_memory(run);
    } else {
        status = draw_lines(run, e, o->layer, over, image, layers, &out);
        if (!status) status = encode_picture(run, run->output, &out, &bytes[0], &files[0].size);
    }
    if (!status && o->layers)
        status = encode_picture(run, o->layers, layers, &bytes[1], &files[1].size);
    for (int i = 0; i < 2; i++) files[i].bytes = bytes[i];
    cli_figure(run, "file_bytes", (double)(files[0].size + files[1].size));
    if (!status) status = cli_finish_files(run, files, o->layers ? 2 : 1);
    for (int i = 0; i < 2; i++) free(bytes[i]);
    free(out.pixels);
    return status;
}

static int run_edges(int argc, char **argv) {
    cli run;
    options o = {NULL, NULL, "black", NULL, -1};
    texedges_desc desc = {0};
    texedges_set *edges = NULL;
    txm_image layers = {0};
    float thresholds[TEXEDGES_MAX_LEVELS];
    int over = 0, status;
    const cli_option table[] = {
        {CLI_INT, "--levels", "N", "layers, 2 to 16; default 4", &desc.levels, 2,
         TEXEDGES_MAX_LEVELS},
        {CLI_TEXT, "--thresholds", "T1,...", "gray levels, 0 to 1, where layers 1, 2, ... begin",
         &o.thresholds, 0, 0},
        {CLI_TEXT, "--smooth", "R", "radius of a blur beforehand, in pixels, 0 to 16; default 0",
         &o.smooth, 0, 0},
        {CLI_INT, "--least", "N", "leave out regions with a shorter boundary, in pixels; default 0",
         &desc.least, 0, 1 << 30},
        {CLI_INT, "--layer", "K", "only the lines of this layer", &o.layer, 0,
         TEXEDGES_MAX_LEVELS - 1},
        {CLI_TEXT, "--over", "WHAT", "draw over black (default), the picture or its layers",
         &o.over, 0, 0},
        {CLI_OUTPUT, "--layers", "FILE", "also write a picture of the layers, in grays", &o.layers, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };

    if (cli_begin(&run, &edges_manual, table, argc, argv, &status)) return status;
    status = check_options(&run, &o, &desc, &over, thresholds);
    if (status) return status;
    cli_stage(&run, "read");
    status = read_picture(&run, run.inputs[0], 0, TXM_U16, &desc.image);
    if (status) return status;

    cli_stage(&run, "find");
    txm_status result = texedges_find(&desc, &run.env, &edges);
    if (result == TXM_OK && (o.layers || over == OVER_LAYERS)) {
        cli_stage(&run, "layers");
        status = new_picture(&run, desc.image.width, desc.image.height, 1, TXM_U8, &layers);
        if (!status) result = texedges_layers(&desc, edges, &run.env, &layers);
    }
    if (!status) status = check_result(&run, result, run.inputs[0]);
    if (!status) {
        const size_t count = set_figures(&run, edges, o.layer);
        status = write_outputs(&run, &o, edges, over, &desc.image, &layers);
        if (!status && !run.quiet)
            printf("%s: %lu lines of %d layers, %.1f s\n", run.output, (unsigned long)count,
                   edges->levels, cli_seconds(&run));
    }
    texedges_set_free(edges);
    free(layers.pixels);
    image_free(&desc.image);
    return status;
}

const command edges_command = {&edges_manual, run_edges};
