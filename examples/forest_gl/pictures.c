/* pictures.c - a sheet of bark and a leaf picture for each species
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

#include <cjson/cJSON.h>
#include <stb/stb_image.h>
#include <stdio.h>

static int number_of(const cJSON *json, const char *name) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsNumber(item) ? item->valueint : -1;
}

/* The tiles of a set whose edges are those of the first, as views into its atlas. */
static int list_tiles(const cJSON *json, const txm_image *atlas, txm_image tiles[BARK_TILES]) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(json, "tiles"), *tile, *first = NULL;
    const int size = number_of(json, "size") & ~1;
    int count = 0;
    cJSON_ArrayForEach(tile, list) {
        const cJSON *edges = cJSON_GetObjectItemCaseSensitive(tile, "edges");
        const int x = number_of(tile, "x"), y = number_of(tile, "y");
        if (!first) first = edges;
        if (size < 4 || x < 0 || y < 0 || x + size > atlas->width || y + size > atlas->height)
            return 0;
        if (!edges || !cJSON_Compare(edges, first, 1) || count == BARK_TILES) continue;
        tiles[count] = *atlas;
        tiles[count].pixels = (uint8_t *)atlas->pixels +
                              3 * ((size_t)y * (size_t)atlas->width + (size_t)x);
        tiles[count].stride = 3 * (ptrdiff_t)atlas->width;
        tiles[count].width = tiles[count].height = size;
        count++;
    }
    return count;
}

static int make_sheet(forest_gl *f, const txm_image *tiles, int count, txm_image *sheet) {
    treepieces_bark_desc desc = {0};
    desc.tiles = tiles;
    desc.tile_count = count;
    desc.seed = f->o.seed;
    const int side = TREEPIECES_SHEET * tiles[0].width;
    return new_image(f, sheet, side, side * treepieces_bark_layers(&desc), 3) &&
           check(f, treepieces_bark(&desc, &f->env, *sheet));
}

static int read_tiles(forest_gl *f, const char *folder, txm_image *sheet) {
    char path[1024];
    txm_image atlas = {0}, tiles[BARK_TILES];
    snprintf(path, sizeof path, "%s/tiles.json", folder);
    char *text = read_file(path);
    cJSON *json = text ? cJSON_Parse(text) : NULL;
    snprintf(path, sizeof path, "%s/atlas.png", folder);
    int good = json ? read_picture(f, path, 3, &atlas)
                    : fail(f, "'%s' is not a set of tiles of 'texkit tiles'", folder);
    if (good) {
        const int count = list_tiles(json, &atlas, tiles);
        good = count ? make_sheet(f, tiles, count, sheet)
                     : fail(f, "'%s' has no tiles that lie inside its atlas", folder);
    }
    stbi_image_free(atlas.pixels);
    cJSON_Delete(json);
    free(text);
    return good;
}

static int draw_bark(forest_gl *f, const treepieces_species *species, txm_image *sheet) {
    uint8_t *block = (uint8_t *)allocate(f, BARK_TILES, 3 * BARK_SIDE * BARK_SIDE);
    txm_image tiles[BARK_TILES];
    if (!block) return 0;
    for (int i = 0; i < BARK_TILES; i++)
        tiles[i] = image_of(block + 3 * BARK_SIDE * BARK_SIDE * i, BARK_SIDE, BARK_SIDE, 3);
    const int good =
        check(f, treepieces_draw_bark(species, f->o.seed, &f->env, tiles, BARK_TILES)) &&
        make_sheet(f, tiles, BARK_TILES, sheet);
    free(block);
    return good;
}

/* A sheet of bark and a leaf picture for each species. */
int make_pictures(forest_gl *f) {
    const size_t length = f->o.bark ? strlen(f->o.bark) : 0;
    const int is_sheet = length > 4 && strcmp(f->o.bark + length - 4, ".png") == 0;
    for (int s = 0; s < f->species_count; s++) {
        txm_image *sheet = &f->sheets[s], *leaf = &f->leaves[s];
        int good;
        if (!f->o.bark) good = draw_bark(f, &f->species[s], sheet);
        else if (is_sheet) good = read_picture(f, f->o.bark, 3, sheet);
        else good = read_tiles(f, f->o.bark, sheet);
        if (!good) return 0;
        if (sheet->width % TREEPIECES_SHEET || sheet->height != sheet->width * TREEPIECES_OWN)
            return fail(f, "'%s' is not a sheet of bark: it must be 5 times as high as wide", f->o.bark);
        if (f->o.leaf) good = read_picture(f, f->o.leaf, 4, leaf);
        else good = new_image(f, leaf, LEAF_SIDE, LEAF_SIDE, 4) &&
                    check(f, treepieces_draw_leaves(&f->species[s], f->o.seed, &f->env, *leaf));
        if (!good) return 0;
    }
    return 1;
}
