/* tree_looks.c - the pictures of 'texkit tree': bark from tiles, leaves
   SPDX-License-Identifier: MIT OR Unlicense */
#include "tree.h"
#include "files/image_io.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>

enum { DRAWN_LEAVES = 256, MAX_TILES = 64 };

static int encode(tree_job *j, const txm_image *image, const char *kind, int s, picture *p) {
    const char *why;
    image_job job = {0};
    job.env = &j->run.env;
    if (!image_encode(&job, ".png", image, &p->png, &p->size, &why))
        return cli_fail(&j->run, CLI_FAILED, "cannot write '%s': %s", j->run.output, why);
    p->width = image->width;
    if (s == 0) snprintf(p->name, sizeof p->name, "%s", kind);
    else snprintf(p->name, sizeof p->name, "%s-%d", kind, s + 1);
    return CLI_DONE;
}

/* So many square pictures in one block, for free(); NULL after a message. */
static unsigned char *new_tiles(tree_job *j, txm_image *tiles, int count, int side, int channels) {
    const size_t size = (size_t)side * (size_t)side * (size_t)channels;
    unsigned char *block = (unsigned char *)new_array((size_t)count, size);
    if (!block) fail_memory(&j->run);
    for (int i = 0; i < count && block; i++) {
        memset(&tiles[i], 0, sizeof tiles[i]);
        tiles[i].pixels = block + (size_t)i * size;
        tiles[i].width = tiles[i].height = side;
        tiles[i].channels = channels;
    }
    return block;
}

/* ---- tiles of the user -------------------------------------------------------------------- */

typedef struct tile_list {
    int x[MAX_TILES], y[MAX_TILES], count, size;
} tile_list;

/* All tiles with the edges of the first. 0 with *why if the set is not one for bark. */
static int list_tiles(const cJSON *json, const txm_image *atlas, tile_list *t, const char **why) {
    const cJSON *kind = cJSON_GetObjectItemCaseSensitive(json, "kind");
    const cJSON *tiles = cJSON_GetObjectItemCaseSensitive(json, "tiles"), *tile;
    int first[4] = {0, 0, 0, 0};
    t->count = 0;
    if (!cJSON_IsString(kind) || strcmp(kind->valuestring, "frame") != 0)
        return *why = "not a set of framed tiles; make one with 'texkit tiles --kind frame'", 0;
    *why = "a field is missing or out of range; make the set again, with --packing packed";
    if (!json_int(json, "size", 16, 1024, &t->size)) return 0;
    cJSON_ArrayForEach(tile, tiles) {
        const cJSON *list = cJSON_GetObjectItemCaseSensitive(tile, "edges");
        int x, y, edges[4];
        if (!json_int(tile, "x", 0, atlas->width - t->size, &x) ||
            !json_int(tile, "y", 0, atlas->height - t->size, &y))
            return 0;
        for (int k = 0; k < 4; k++)
            if (!json_int(cJSON_GetArrayItem(list, k), NULL, 0, 255, &edges[k])) return 0;
        if (t->count == 0) memcpy(first, edges, sizeof first);
        if (memcmp(first, edges, sizeof first) != 0 || t->count == MAX_TILES) continue;
        t->x[t->count] = x;
        t->y[t->count++] = y;
    }
    if (t->count == 0) return 0;
    if (first[0] != first[2] || first[1] != first[3])
        return *why = "the first tile does not continue across its own edges; make the set without --classes", 0;
    return 1;
}

/* A square of the atlas, reduced by averaging; colours count as much as they show. */
static void reduce_tile(const txm_image *atlas, int x0, int y0, int size, const txm_image *out) {
    const int channels = out->channels, colors = txm_image_colours(out);
    const double step = (double)size / out->width;
    for (int y = 0; y < out->height; y++) {
        unsigned char *to = (unsigned char *)txm_image_row(out, y);
        for (int x = 0; x < out->width; x++) {
            double sum[4] = {0, 0, 0, 0}, weights = 0, shown = 0;
            const double left = x * step, right = left + step, top = y * step, bottom = top + step;
            for (int v = (int)top; v < size && v < bottom; v++) {
                const double high = (v + 1 < bottom ? v + 1 : bottom) - (v > top ? v : top);
                const unsigned char *row =
                    (const unsigned char *)txm_image_row_const(atlas, y0 + v);
                for (int u = (int)left; u < size && u < right; u++) {
                    const double wide = (u + 1 < right ? u + 1 : right) - (u > left ? u : left);
                    const unsigned char *texel = row + (x0 + u) * channels;
                    const double alpha = colors < channels ? texel[colors] / 255.0 : 1;
                    for (int c = 0; c < colors; c++) sum[c] += alpha * (high * wide * texel[c]);
                    shown += alpha * (high * wide);
                    weights += high * wide;
                }
            }
            for (int c = 0; c < colors; c++)
                *to++ = (unsigned char)(shown > 0 ? sum[c] / shown + 0.5 : 0);
            if (colors < channels) *to++ = (unsigned char)(255 * shown / weights + 0.5);
        }
    }
}

/* The tiles of --tiles, at most `side` pixels a side, in *block for free(). */
static int read_tiles(tree_job *j, int side, txm_image *tiles, int *count, unsigned char **block) {
    char path[MAX_PATH];
    const char *why = "";
    txm_image atlas;
    tile_list list;
    cJSON *json;
    int status = read_tiles_json(&j->run, j->tiles, &json);
    if (status) return status;
    if (snprintf(path, sizeof path, "%s/atlas.png", j->tiles) >= (int)sizeof path)
        status = cli_fail(&j->run, CLI_USAGE, "'%s': the path is too long", j->tiles);
    if (!status) status = read_picture(&j->run, path, 0, TXM_U8, &atlas);
    if (status) {
        cJSON_Delete(json);
        return status;
    }
    if (!list_tiles(json, &atlas, &list, &why)) {
        status = cli_fail(&j->run, CLI_FAILED, "'%s/tiles.json': %s", j->tiles, why);
    } else {
        *count = list.count;
        const int size = list.size < side ? list.size & ~1 : side; /* must be even */
        *block = new_tiles(j, tiles, list.count, size, atlas.channels);
        if (!*block) status = CLI_FAILED;
        for (int i = 0; i < list.count && *block; i++)
            reduce_tile(&atlas, list.x[i], list.y[i], list.size, &tiles[i]);
    }
    image_free(&atlas);
    cJSON_Delete(json);
    return status;
}

/* Draw tiles, in *block for free(). */
static int draw_tiles(tree_job *j, const treepieces_species *species, int side, txm_image *tiles,
                      unsigned char **block) {
    *block = new_tiles(j, tiles, BARK_TILES, side, 3);
    if (!*block) return CLI_FAILED;
    return check_result(
        &j->run, treepieces_draw_bark(species, j->run.seed, &j->run.env, tiles, BARK_TILES),
        species->name);
}

/* ---- the sheet's normal map ------------------------------------------------------------------ */

/* How high the bark is in 2 x 2 texels of a sheet, 0..1: as bright as it is. The columns repeat, a layer
   ends at its first and last row. */
static double height_at(const txm_image *sheet, int x, int y, int layer) {
    const int size = sheet->width, half = size / 2, row = txm_clampi(y, layer * half, (layer + 1) * half - 1);
    const int column = (x + half) % half;
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        const unsigned char *row_of = (const unsigned char *)txm_image_row_const(sheet, 2 * row + k / 2);
        const unsigned char *texel = row_of + (2 * column + k % 2) * sheet->channels;
        for (int c = 0; c < txm_image_colours(sheet); c++)
            sum += texel[c] / (4 * 255.0 * txm_image_colours(sheet));
    }
    return sum;
}

/* Half as wide and high as the sheet; x to the right, y up in the picture, as glTF has it. */
static int make_relief(tree_job *j, int s, const txm_image *sheet) {
    const int width = sheet->width / 2, height = sheet->height / 2;
    const double depth = 0.12 * width / TREEPIECES_SHEET; /* ours: of a tile, in texels */
    txm_image out = {0};
    int status = new_picture(&j->run, width, height, 3, TXM_U8, &out);
    for (int y = 0; y < height && !status; y++) {
        unsigned char *to = (unsigned char *)txm_image_row(&out, y);
        for (int x = 0; x < width; x++) {
            const int layer = y / width;
            double n[3], length = 1;
            n[0] = 0.5 * depth * (height_at(sheet, x - 1, y, layer) - height_at(sheet, x + 1, y, layer));
            n[1] = 0.5 * depth * (height_at(sheet, x, y + 1, layer) - height_at(sheet, x, y - 1, layer));
            n[2] = 1;
            length = sqrt(n[0] * n[0] + n[1] * n[1] + 1);
            for (int c = 0; c < 3; c++) *to++ = (unsigned char)(127.5 + 127.5 * n[c] / length + 0.5);
        }
    }
    if (!status) status = encode(j, &out, "relief", s, &j->relief[s]);
    free(out.pixels);
    return status;
}

/* ---- the sheet ----------------------------------------------------------------------------- */

static int make_bark(tree_job *j, int s, const float color[3]) {
    txm_image tiles[MAX_TILES], sheet = {0};
    treepieces_bark_desc desc = {0};
    treepieces_species species = j->species[s];
    unsigned char *block = NULL;
    const int side = j->sheet / (2 * TREEPIECES_SHEET) * 2;
    int status;
    memset(tiles, 0, sizeof tiles);
    memcpy(species.bark_color, color, sizeof species.bark_color);
    desc.tiles = tiles;
    desc.tile_count = BARK_TILES;
    desc.seed = j->run.seed;
    if (j->tiles) status = read_tiles(j, side, tiles, &desc.tile_count, &block);
    else status = draw_tiles(j, &species, side, tiles, &block);
    if (!status) {
        const int width = TREEPIECES_SHEET * tiles[0].width;
        status = new_picture(&j->run, width, width * treepieces_bark_layers(&desc),
                             tiles[0].channels, TXM_U8, &sheet);
    }
    if (!status)
        status = check_result(&j->run, treepieces_bark(&desc, &j->run.env, sheet),
                              j->tiles ? j->tiles : species.name);
    if (!status) status = encode(j, &sheet, "bark", s, &j->bark[s]);
    if (!status && tree_is_glb(j)) status = make_relief(j, s, &sheet);
    free(block);
    free(sheet.pixels);
    return status;
}

static int make_leaves(tree_job *j, int s) {
    txm_image image = {0};
    int status;
    if (j->species[s].leaf_count == 0) return CLI_DONE;
    if (j->leaf) {
        status = read_picture(&j->run, j->leaf, 4, TXM_U8, &image);
        /* other programs' filters must not show what the picture hides */
        if (!status)
            status = check_result(&j->run, txm_image_bleed(&image, 0, &j->run.env), j->leaf);
    } else {
        status = new_picture(&j->run, DRAWN_LEAVES, DRAWN_LEAVES, 4, TXM_U8, &image);
        if (!status)
            status = check_result(
                &j->run, treepieces_draw_leaves(&j->species[s], j->run.seed, &j->run.env, image),
                j->species[s].name);
    }
    if (!status) status = encode(j, &image, "leaves", s, &j->leaves[s]);
    free(image.pixels);
    return status;
}

/* ---- all species ----------------------------------------------------------------------------- */

/* The brightest bark of all species in each channel; instances darken it to their own color. */
static void brightest_bark(const tree_job *j, float color[3]) {
    memcpy(color, j->species[0].bark_color, 3 * sizeof(float));
    for (int s = 1; s < j->species_count; s++)
        for (int k = 0; k < 3; k++)
            if (j->species[s].bark_color[k] > color[k]) color[k] = j->species[s].bark_color[k];
}

int tree_has_one_bark(const tree_job *j) {
    return j->tiles || (tree_is_glb(j) && !j->variants);
}

int tree_has_bark(const tree_job *j, int s) {
    return s == 0 || !tree_has_one_bark(j);
}

static void set_material(const tree_job *j, const picture *p, int is_cut_out, mesh_material *m) {
    m->name = p->name;
    m->is_cut_out = is_cut_out;
    m->repeats = !is_cut_out;
    m->texture = name_in(p->path);
    if (!tree_is_glb(j)) return;
    m->png = p->png;
    m->png_size = p->size;
}

int tree_dress(tree_job *j, float tint[3]) {
    int status = CLI_DONE;
    brightest_bark(j, tint);
    if (tree_is_bare(j)) return CLI_DONE;
    for (int s = 0; s < j->species_count && !status; s++) {
        if (tree_has_bark(j, s))
            status = make_bark(j, s, tree_has_one_bark(j) ? tint : j->species[s].bark_color);
        if (!status) status = make_leaves(j, s);
        set_material(j, &j->bark[s], 0, &j->bark_materials[s]);
        j->bark_materials[s].relief = j->relief[s].png;
        j->bark_materials[s].relief_size = j->relief[s].size;
        set_material(j, &j->leaves[s], 1, &j->leaf_materials[s]);
    }
    return status;
}
