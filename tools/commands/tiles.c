/* tiles.c - texkit tiles: a photograph in, a tile set out
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: open_memstream */
#include "tiles.h"
#include "files/image_io.h"
#include "straighten.h"

enum {
    PREVIEW_TILES = 8,     /* along a side of the preview; fewer, but at least 2, ... */
    PREVIEW_PIXELS = 2048, /* ... so that it has no more pixels than this            */
    MAX_PHOTOS = TEXTILES_MAX_EXEMPLARS
};

static const char *const kind_names[] = {"wang", "corner", "triangle", "frame", NULL};
static const char *const packing_names[] = {"packed", "torus", "slices", NULL};
static const char *const repair_names[] = {"poisson", "none", NULL};

static const cli_manual tiles_manual = {
    "tiles", "EXEMPLAR -o DIR --kind KIND [options]",
    "cut a set of tiles that join invisibly out of a picture",
    "KIND is wang (squares with colors on their edges), corner (squares with colors on\n"
    "their corners), triangle (equilateral triangles with directed colors on their edges)\n"
    "or frame (squares of a few classes with fixed edges). DIR, which is made if it is\n"
    "not there, receives atlas.png, tiles.json (see docs/tiles.md) and preview.png. The\n"
    "edges of a tile are unchanged pixels of EXEMPLAR on both sides of the joint. A side of\n"
    "EXEMPLAR should be at least three times that of a tile.\n"
    "Squares are also written as tiles.tsx for Tiled (with Wang colors) and as tiles.tres for\n"
    "Godot 4 (with a terrain set).\n"
    "Maps of the same material (normals, roughness) are cut in register with --maps:\n"
    "atlas-2.png holds the first of them, and so on. The alpha of a map says how much of its colors\n"
    "shows, unless --data names it. Uneven light of EXEMPLAR and of --more and --edges, not that of\n"
    "maps, is evened out, with a warning, if it would show; see --even.\n",
    "  texkit tiles gravel.jpg -o gravel-tiles --kind wang\n"
    "  texkit tiles bark.png -o bark --kind frame --classes '0,0,0,0;0,1,0,0' --variants 4\n",
    1, "exemplar", 1, "make smaller tiles", NULL};

/* ---- the files of a set ------------------------------------------------------------------ */

static void name_atlas(int map, char name[24]) {
    snprintf(name, 24, map ? "atlas-%d.png" : "atlas.png", map + 1);
}

/* The documents of a set; triangles have the first only. */
enum { DOCUMENTS = 3 };
static const char *const document_names[DOCUMENTS] = {"tiles.json", "tiles.tsx", "tiles.tres"};
static int document_count(textiles_kind kind) {
    return kind == TEXTILES_TRIANGLE ? 1 : DOCUMENTS;
}

/* Announce all that will be written for an exemplar with the maps of that list. */
static int announce_set(cli *run, textiles_kind kind, const char *maps) {
    int status = cli_writes_inside(run, "preview.png"), count = 1;
    for (int d = 0; d < document_count(kind) && !status; d++)
        status = cli_writes_inside(run, document_names[d]);
    char map[MAX_PATH];
    for (const char *at = maps; at; count++) cli_take_name(&at, ",", map);
    for (int m = 0; m < count && m < TEXTILES_MAX_MAPS && !status; m++) {
        char name[24];
        name_atlas(m, name);
        status = cli_writes_inside(run, name);
    }
    return status;
}

/* ---- tiles.json ------------------------------------------------------------------------- */

static void print_ints(FILE *to, const char *name, const int *values, int count) {
    fprintf(to, "\"%s\": [", name);
    for (int i = 0; i < count; i++) fprintf(to, i ? ",%d" : "%d", values[i]);
    fprintf(to, "]");
}

/* One tile; x, y: the top left pixel of its square, without the gutter. */
static void print_tile(FILE *to, const textiles_set *set, const textiles_layout *layout, int index) {
    textiles_tile tile;
    int x, y, step;
    float uv[4][2];
    const int is_triangle = layout->kind == TEXTILES_TRIANGLE, corners = is_triangle ? 3 : 4;
    textiles_tile_at(set, index, &tile);
    textiles_place(layout, index, &x, &y, &step, uv);
    if (step < 0) {
        x -= layout->size;
        y -= layout->size;
    }
    fprintf(to, "    {\"x\": %d, \"y\": %d, ", x, y);
    print_ints(to, layout->kind == TEXTILES_CORNER ? "corners" : "edges", tile.edges, corners);
    if (is_triangle) {
        fprintf(to, ", ");
        print_ints(to, "directions", tile.directions, 3);
        fprintf(to, ", \"step\": %d", step);
    }
    fprintf(to, ", \"variant\": %d, \"uv\": [", tile.variant);
    for (int k = 0; k < corners; k++)
        fprintf(to, "%s[%.9g,%.9g]", k ? "," : "", (double)uv[k][0], (double)uv[k][1]);
    fprintf(to, "]}");
}

static void print_document(FILE *to, const textiles_set *set, const textiles_layout *layout,
                         int map_count) {
    const int count = textiles_count(set);
    fprintf(to, "{\n  \"kind\": \"%s\",\n  \"size\": %d,\n  \"colors\": %d,\n  \"variants\": %d,\n",
             kind_names[layout->kind], layout->size, textiles_colors(set), textiles_variants(set));
    fprintf(to, "  \"atlas\": {\"width\": %d, \"height\": %d, \"packing\": \"%s\", \"gutter\": %d, ",
             layout->width, layout->height, packing_names[layout->packing], layout->gutter);
    fprintf(to, "\"columns\": %d, \"pitch\": [%d,%d], \"files\": [\"atlas.png\"", layout->columns,
             layout->pitch_x, layout->pitch_y);
    for (int m = 1; m < map_count; m++) fprintf(to, ", \"atlas-%d.png\"", m + 1);
    fprintf(to, "]},\n  \"tiles\": [\n");
    for (int i = 0; i < count; i++) {
        print_tile(to, set, layout, i);
        fprintf(to, i + 1 < count ? ",\n" : "\n");
    }
    fprintf(to, "  ]\n}\n");
}

/* Document d of the set in memory; *text is for free(). */
static int make_document(cli *run, const textiles_set *set, const textiles_layout *layout, int d,
                         char **text, size_t *size) {
    FILE *to = open_memstream(text, size);
    if (to && d == 0) print_document(to, set, layout, textiles_map_count(set));
    else if (to && d == 1) print_tiled(to, set, layout);
    else if (to) print_godot(to, set, layout);
    return !to || ferror(to) | fclose(to) ? fail_memory(run) : CLI_DONE;
}

/* ---- pictures --------------------------------------------------------------------------- */

/* A part of the plane that the set covers; without a plane, tiles in scan-line order. */
static txm_status draw_preview(cli *run, const textiles_set *set, const textiles_layout *layout,
                               const txm_image *atlas, const txm_image *out) {
    textiles_plane plane;
    const int size = layout->size, columns = out->width / size, rows = out->height / size;
    if (textiles_plane_make(set, (uint32_t)run->seed, &run->env, &plane) == TXM_OK)
        return textiles_draw_plane(&plane, layout, atlas, 0, 0, 1, &run->env, *out);
    int tiles[PREVIEW_TILES * PREVIEW_TILES];
    txm_status status = textiles_scanline(set, columns, rows, run->seed, &run->env, tiles);
    if (status == TXM_BAD_ARGUMENT) /* frames whose classes do not all fit: put them side by side */
        for (int i = 0; i < columns * rows; i++) tiles[i] = i % textiles_count(set);
    else if (status != TXM_OK) return status;
    const size_t texel = (size_t)out->channels * txm_sample_bytes(out->sample);
    const size_t row = (size_t)out->width * texel;
    for (int i = 0; i < columns * rows; i++) {
        int px, py, step;
        textiles_place(layout, tiles[i], &px, &py, &step, NULL);
        for (int y = 0; y < size; y++)
            memcpy((char *)out->pixels + (size_t)(i / columns * size + y) * row +
                       (size_t)(i % columns * size) * texel,
                   (const char *)txm_image_row_const(atlas, py + y) + (size_t)px * texel,
                   (size_t)size * texel);
    }
    return TXM_OK;
}

/* Make atlases, preview and tiles.json, with those samples in the maps, in memory, then write all of them into the folder. */
static int write_set(cli *run, const textiles_set *set, const textiles_layout *layout,
                     const txm_sample *samples) {
    const int maps = textiles_map_count(set);
    txm_image atlas[TEXTILES_MAX_MAPS], preview = {0};
    cli_file files[TEXTILES_MAX_MAPS + 1 + DOCUMENTS] = {{0}};
    char names[TEXTILES_MAX_MAPS + 1][24];
    unsigned char *bytes[TEXTILES_MAX_MAPS + 1] = {NULL};
    char *texts[DOCUMENTS] = {NULL};
    int status = CLI_DONE, count = 0, side = PREVIEW_TILES;
    memset(atlas, 0, sizeof atlas);

    cli_stage(run, "draw");
    for (int m = 0; m < maps && !status; m++) {
        status = new_picture(run, layout->width, layout->height, textiles_channels(set, m),
                             samples[m], &atlas[m]);
        if (status) break;
        status = check_result(run, textiles_draw_atlas(set, layout, m, &run->env, atlas[m]),
                              run->inputs[0]);
    }
    while (side > 2 && side * layout->size > PREVIEW_PIXELS) side--;
    if (!status)
        status = new_picture(run, side * layout->size, side * layout->size, atlas[0].channels,
                             samples[0], &preview);
    if (!status)
        status = check_result(run, draw_preview(run, set, layout, &atlas[0], &preview),
                              run->inputs[0]);

    cli_stage(run, "encode");
    for (int m = 0; m <= maps && !status; m++) { /* the preview comes last */
        size_t size;
        name_atlas(m, names[m]);
        files[count].name = m < maps ? names[m] : "preview.png";
        status = encode_picture(run, files[count].name, m < maps ? &atlas[m] : &preview, &bytes[m],
                                &size);
        files[count].bytes = bytes[m];
        files[count++].size = size;
    }
    for (int d = 0; d < document_count(layout->kind) && !status; d++) {
        size_t size = 0;
        status = make_document(run, set, layout, d, &texts[d], &size);
        files[count].name = document_names[d];
        files[count].bytes = texts[d];
        files[count++].size = size;
    }
    if (!status) status = cli_finish_folder(run, files, count);
    for (int d = 0; d < DOCUMENTS; d++) free(texts[d]);
    for (int m = 0; m <= maps; m++) free(bytes[m]);
    for (int m = 0; m < maps; m++) free(atlas[m].pixels);
    free(preview.pixels);
    return status;
}

/* ---- the command ------------------------------------------------------------------------- */

/* Parse classes such as "0,0,0,0;0,1,0,0". Returns how many, or 0 if the list is malformed. */
static int parse_classes(const char *list, int classes[TEXTILES_MAX_CLASSES][4]) {
    int count = 0;
    for (const char *c = list;; c++) {
        if (count == TEXTILES_MAX_CLASSES) return 0;
        for (int k = 0; k < 4; k++) {
            if (*c < '0' || *c > '9') return 0;
            classes[count][k] = *c++ - '0';
            if (k < 3 && *c++ != ',') return 0;
        }
        count++;
        if (*c == 0) return count;
        if (*c != ';') return 0;
    }
}

/* The photographs of a run: exemplars[0] is EXEMPLAR with its maps. */
typedef struct photos {
    textiles_exemplar exemplars[MAX_PHOTOS];
    txm_image images[MAX_PHOTOS][TEXTILES_MAX_MAPS];
    int count;
} photos;

/* Call `take` for each name of a list. */
static int read_list(cli *run, const char *list, const char *option, int most, photos *p,
                     int (*take)(cli *run, photos *p, const char *path)) {
    char path[MAX_PATH];
    for (int n = 0; list; n++) {
        if (n == most) return cli_fail(run, CLI_USAGE, "%s: at most %d pictures", option, most);
        cli_take_name(&list, ",", path);
        const int status = take(run, p, path);
        if (status) return status;
    }
    return CLI_DONE;
}

static int take_map(cli *run, photos *p, const char *path) {
    textiles_exemplar *x = &p->exemplars[0];
    txm_image *image = &p->images[0][x->map_count];
    const int status = read_picture(run, path, 0, TXM_U16, image);
    if (status) return status;
    x->map_count++;
    if (image->width == p->images[0][0].width && image->height == p->images[0][0].height)
        return CLI_DONE;
    return cli_fail(run, CLI_FAILED, "the map '%s' is %d x %d; make it %d x %d like '%s'", path,
                    image->width, image->height, p->images[0][0].width, p->images[0][0].height,
                    run->inputs[0]);
}

static int take_photo(cli *run, photos *p, const char *path) {
    const int status = read_picture(run, path, p->images[0][0].channels, TXM_U16,
                                    &p->images[p->count][0]);
    if (status) return status;
    p->exemplars[p->count].maps = p->images[p->count];
    p->exemplars[p->count].map_count = 1;
    p->count++;
    return CLI_DONE;
}

/* The file of exemplar e, for messages; names: what is left of --edges and --more. */
static const char *name_photo(const cli *run, int e, const char *names[2], char path[MAX_PATH]) {
    const char **list = names[0] ? &names[0] : &names[1];
    if (e == 0) return run->inputs[0];
    cli_take_name(list, ",", path);
    return path;
}

/* If one photograph has 16 bits a sample, all have. */
static int same_depth(cli *run, photos *p) {
    int is_deep = 0, status = CLI_DONE;
    for (int i = 0; i < p->count; i++) is_deep |= p->images[i][0].sample == TXM_U16;
    for (int i = 0; i < p->count && is_deep && !status; i++)
        status = widen_picture(run, &p->images[i][0]);
    return status;
}

/* Even the light of all photographs, but not of the maps. names: --edges and --more, for warnings. */
static int even_photos(cli *run, photos *p, int even, const char *names[2]) {
    int status = CLI_DONE, used;
    char path[MAX_PATH];
    for (int e = 0; e < p->count && !status; e++) {
        const char *name = name_photo(run, e, names, path);
        status = even_picture(run, name, even, NULL, &p->images[e][0], &used);
        if (e == 0) cli_figure(run, "even", used);
    }
    return status;
}

/* Every exemplar with its maps, from straight in front; data: bit m is set for maps that are data. */
static int straighten_photos(cli *run, photos *p, unsigned data, const char *names[2]) {
    static const texpatch_map quantity = {0, 0, 0, 1};
    int status = CLI_DONE;
    char path[MAX_PATH];
    for (int e = 0; e < p->count && !status; e++) {
        straight_picture pictures[TEXTILES_MAX_MAPS];
        const char *name = name_photo(run, e, names, path);
        double agreement;
        for (int m = 0; m < p->exemplars[e].map_count; m++) {
            pictures[m].image = &p->images[e][m];
            pictures[m].map = data >> m & 1 ? &quantity : NULL;
        }
        status = straighten(run, name, pictures, p->exemplars[e].map_count, NULL, 0, 0, &agreement);
    }
    return status;
}

static void free_photos(photos *p) {
    for (int e = 0; e < p->count; e++) {
        for (int m = 0; m < p->exemplars[e].map_count; m++) image_free(&p->images[e][m]);
    }
}

/* Refuse, before any work, options that do not go together. */
static int check_options(cli *run, const textiles_desc *d, textiles_packing packing, int gutter,
                         int has_edges) {
    const int is_frame = d->kind == TEXTILES_FRAME, size = d->size ? d->size : 128;
    const int colors = d->colors ? d->colors : 2;
    if (d->kind == TEXTILES_TRIANGLE && size < TEXTILES_MIN_TRIANGLE)
        return cli_fail(run, CLI_USAGE, "--size %d: of triangles at least %d", size,
                        TEXTILES_MIN_TRIANGLE);
    if (d->colors == 1 && !is_frame)
        return cli_fail(run, CLI_USAGE, "--colors 1 is for frame sets; give 2 to 4");
    if (d->class_count && !is_frame)
        return cli_fail(run, CLI_USAGE, "--classes goes with --kind frame only");
    for (int k = 0; k < d->class_count; k++) {
        for (int i = 0; i < k; i++) {
            if (!memcmp(d->classes[i], d->classes[k], sizeof d->classes[k]))
                return cli_fail(run, CLI_USAGE, "--classes: class %d is the same as class %d; "
                                "use --variants instead", k, i);
        }
        for (int i = 0; i < 4; i++) {
            if (d->classes[k][i] >= colors)
                return cli_fail(run, CLI_USAGE, "--classes: color %d of class %d; with --colors %d "
                                "they are 0 to %d", d->classes[k][i], k, colors, colors - 1);
        }
    }
    if (d->reduced && d->kind != TEXTILES_WANG && d->kind != TEXTILES_TRIANGLE)
        return cli_fail(run, CLI_USAGE, "--reduced goes with --kind wang or triangle only");
    if (has_edges && d->kind == TEXTILES_CORNER)
        return cli_fail(run, CLI_USAGE, "--edges does not go with --kind corner, whose edges have no "
                        "colors");
    if (gutter > size / 2)
        return cli_fail(run, CLI_USAGE, "--gutter %d: at most half a tile, %d", gutter, size / 2);
    if (packing != TEXTILES_TORUS) return CLI_DONE;
    if (d->reduced || is_frame || d->kind == TEXTILES_TRIANGLE ||
        (d->kind == TEXTILES_CORNER && colors > 3))
        return cli_fail(run, CLI_USAGE, "--packing torus is for whole wang sets, and corner sets of "
                        "2 or 3 colors; take packed");
    if (gutter > 0) return cli_fail(run, CLI_USAGE, "--packing torus has no gutter; leave it out");
    return CLI_DONE;
}

/* The maps of --data as bits; 0 after a message. */
static int parse_data(cli *run, const char *data, unsigned *maps) {
    double number[TEXTILES_MAX_MAPS];
    const int count =
        parse_numbers(run, "--data", data, TEXTILES_MAX_MAPS, 0, TEXTILES_MAX_MAPS - 1, number);
    for (int i = 0; i < count; i++) {
        if (number[i] != (int)number[i]) {
            cli_fail(run, CLI_USAGE, "--data '%s': give numbers of maps; EXEMPLAR is 0", data);
            return 0;
        }
        *maps |= 1u << (int)number[i];
    }
    return count;
}

static void set_figures(cli *run, const textiles_set *set, const textiles_layout *layout,
                        const textiles_joints *joints) {
    cli_figure(run, "tiles", textiles_count(set));
    cli_figure(run, "atlas_width", layout->width);
    cli_figure(run, "atlas_height", layout->height);
    cli_figure(run, "joint_pairs", joints->pairs);
    cli_figure(run, "joint_mean", joints->mean);
    cli_figure(run, "joint_worst", joints->worst);
}

static int run_tiles(int argc, char **argv) {
    cli run;
    textiles_desc desc = {0};
    const char *kind = NULL, *packing = "packed", *repair = "poisson", *classes = NULL;
    const char *maps = NULL, *more = NULL, *edges = NULL, *data = NULL;
    int even = EVEN_AUTO, gutter = -1, straight = 0, status, list[TEXTILES_MAX_CLASSES][4], edge_exemplars[TEXTILES_MAX_COLORS];
    const cli_option options[] = {
        {CLI_TEXT, "--kind", "KIND", "wang, corner, triangle or frame", &kind, 0, 0},
        {CLI_INT, "--colors", "C", "colors of the edges or corners, 2 to 4 (frame: 1 to 4); default 2",
         &desc.colors, 1, TEXTILES_MAX_COLORS},
        {CLI_INT, "--variants", "V", "tiles with the same colors, 1 to 16; default 1",
         &desc.variants, 1, TEXTILES_MAX_VARIANTS},
        {CLI_INT, "--size", "S", "side of a tile in pixels, 8 (triangle: 32) to 1024; default 128", &desc.size,
         TEXTILES_MIN_SIZE, TEXTILES_MAX_SIZE},
        {CLI_FLAG, "--reduced", NULL,
         "fewer tiles: wang 2 C^2, for scan-line tiling; triangle 2 C^3, for meshes", &desc.reduced, 0,
         0},
        {CLI_TEXT, "--classes", "LIST", "frame: edge colors n,e,s,w of each class, separated by ';'",
         &classes, 0, 0},
        {CLI_INPUTS, "--maps", "M1,M2,...", "more maps of the exemplar, cut in register", &maps, 0, 0},
        {CLI_TEXT, "--data", "I,J,...",
         "these maps hold quantities, not colors; --maps count from 1", &data, 0, 0},
        {CLI_INPUTS, "--more", "E2,E3,...", "more exemplars of the same texture", &more, 0, 0},
        {CLI_INPUTS, "--edges", "P0,P1,...", "pictures to cut the edges from, one for each color",
         &edges, 0, 0},
        {CLI_INT, "--even", "R", EVEN_HELP, &even, 0, EVEN_MOST},
        {CLI_FLAG, "--straighten", NULL,
         "make all exemplars straight first, as 'texkit straighten' does", &straight, 0, 0},
        {CLI_TEXT, "--packing", "HOW", "packed (with gutters), torus (Wei's layout) or slices",
         &packing, 0, 0},
        {CLI_INT, "--gutter", "G", "pixels around each tile, 2^n for n mip levels; default 8",
         &gutter, 0, TEXTILES_MAX_SIZE / 2},
        {CLI_TEXT, "--repair", "HOW", "smooth the seams inside tiles: poisson (default) or none",
         &repair, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    photos p;
    txm_sample samples[TEXTILES_MAX_MAPS];
    textiles_set *set = NULL;
    textiles_layout layout;
    textiles_joints joints;
    memset(&p, 0, sizeof p);

    if (cli_begin(&run, &tiles_manual, options, argc, argv, &status)) return status;
    if (!kind)
        return cli_fail(&run, CLI_USAGE, "no kind given; add --kind wang, corner, triangle or frame");
    const int kind_index = find_name(&run, "--kind", kind, kind_names);
    const int packing_index = kind_index < 0 ? -1 : find_name(&run, "--packing", packing, packing_names);
    const int repair_index = packing_index < 0 ? -1 : find_name(&run, "--repair", repair, repair_names);
    if (repair_index < 0) return CLI_USAGE;
    desc.kind = (textiles_kind)kind_index;
    desc.repair = repair_index ? TEXTILES_REPAIR_NONE : TEXTILES_REPAIR_POISSON;
    desc.seed = run.seed;
    if (classes && !(desc.class_count = parse_classes(classes, list)))
        return cli_fail(&run, CLI_USAGE,
                        "--classes '%s': give four colors for each class, such as '0,0,0,0;0,1,0,0'",
                        classes);
    if (classes) desc.classes = (const int(*)[4])list;
    status = check_options(&run, &desc, (textiles_packing)packing_index, gutter, edges != NULL);
    if (!status) status = check_even(&run, even);
    if (status) return status;
    if (maps && (more || edges))
        return cli_fail(&run, CLI_USAGE, "--maps goes with one exemplar, without --more and --edges");
    if (data && !parse_data(&run, data, &desc.data_maps)) return CLI_USAGE;
    status = announce_set(&run, desc.kind, maps);
    if (status) return status;

    cli_stage(&run, "read");
    status = read_picture(&run, run.inputs[0], 0, TXM_U16, &p.images[0][0]);
    if (!status) {
        p.exemplars[0].maps = p.images[0];
        p.exemplars[0].map_count = p.count = 1;
        if (maps) status = read_list(&run, maps, "--maps", TEXTILES_MAX_MAPS - 1, &p, take_map);
    }
    const int colors = desc.colors ? desc.colors : 2;
    if (!status && edges) {
        status = read_list(&run, edges, "--edges", colors, &p, take_photo);
        if (!status && p.count != 1 + colors)
            status = cli_fail(&run, CLI_USAGE, "--edges: give %d pictures, one for each color", colors);
        for (int c = 0; c < colors; c++) edge_exemplars[c] = 1 + c;
        desc.edge_exemplars = edge_exemplars;
    }
    if (!status && more)
        status = read_list(&run, more, "--more", MAX_PHOTOS - p.count, &p, take_photo);
    if (!status && straight) {
        cli_stage(&run, "straighten");
        status = straighten_photos(&run, &p, desc.data_maps, (const char *[2]){edges, more});
    }
    if (!status) status = same_depth(&run, &p);
    if (!status) status = even_photos(&run, &p, even, (const char *[2]){edges, more});
    if (status) goto done;

    cli_stage(&run, "cut");
    desc.exemplars = p.exemplars;
    desc.exemplar_count = p.count;
    txm_status result = textiles_make(&desc, &run.env, &set);
    if (result == TXM_OK)
        result = textiles_layout_make(set, (textiles_packing)packing_index, gutter, &run.env, &layout);
    if (result == TXM_OK) {
        cli_stage(&run, "measure");
        result = textiles_measure(set, 0, &run.env, &joints);
    }
    if (result != TXM_OK) {
        status = check_result(&run, result, run.inputs[0]);
        goto done;
    }
    set_figures(&run, set, &layout, &joints);
    for (int m = 0; m < p.exemplars[0].map_count; m++) samples[m] = p.images[0][m].sample;
    status = write_set(&run, set, &layout, samples);
    if (!status && !run.quiet)
        printf("%s: %d tiles, atlas %d x %d, steps at joints %.3f of those inside (worst pair %.3f), "
               "%.1f s\n", run.output, textiles_count(set), layout.width, layout.height, joints.mean,
               joints.worst, cli_seconds(&run));
done:
    textiles_set_free(set);
    free_photos(&p);
    return status;
}

const command tiles_command = {&tiles_manual, run_tiles};
