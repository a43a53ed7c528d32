/* tiles_engines.c - a set of square tiles for Tiled (.tsx) and for Godot 4 (.tres)
   SPDX-License-Identifier: MIT OR Unlicense

   Both have what a Wang set is: Tiled "Wang colors", Godot "terrains", on edges or on corners. The
   two axes share the numbers of colors, as neighbours are only ever compared along one of them. */
#include "tiles.h"

static const char *const rgb[TEXTILES_MAX_COLORS] = {"e6550d", "3182bd", "31a354", "756bb1"};

/* column and row of a tile's cell */
static void cell_of(const textiles_layout *l, int tile, int *column, int *row) {
    int x, y, step;
    textiles_place(l, tile, &x, &y, &step, NULL);
    *column = (x - l->gutter) / l->pitch_x;
    *row = (y - l->gutter) / l->pitch_y;
}

void print_tiled(FILE *to, const textiles_set *set, const textiles_layout *l) {
    const int is_corner = l->kind == TEXTILES_CORNER, rows = l->height / l->pitch_y;
    fprintf(to, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
            "<tileset version=\"1.8\" tiledversion=\"1.8.2\" name=\"tiles\" tilewidth=\"%d\" "
            "tileheight=\"%d\" spacing=\"%d\" margin=\"%d\" tilecount=\"%d\" columns=\"%d\">\n"
            " <image source=\"atlas.png\" width=\"%d\" height=\"%d\"/>\n"
            " <wangsets>\n"
            "  <wangset name=\"%s\" type=\"%s\" tile=\"-1\">\n",
            l->size, l->size, l->pitch_x - l->size, l->gutter, l->columns * rows, l->columns, l->width,
            l->height, is_corner ? "corners" : "edges", is_corner ? "corner" : "edge");
    for (int c = 0; c < textiles_colors(set); c++)
        fprintf(to, "   <wangcolor name=\"color %d\" color=\"#%s\" tile=\"-1\" probability=\"1\"/>\n", c,
                rgb[c]);
    for (int i = 0; i < textiles_count(set); i++) {
        textiles_tile tile;
        int column, row, id[8] = {0}; /* from the top edge on, clockwise; 0: none */
        textiles_tile_at(set, i, &tile);
        cell_of(l, i, &column, &row);
        for (int k = 0; k < 4; k++) id[is_corner ? (2 * k + 7) % 8 : 2 * k] = tile.edges[k] + 1;
        fprintf(to, "   <wangtile tileid=\"%d\" wangid=\"%d,%d,%d,%d,%d,%d,%d,%d\"/>\n",
                row * l->columns + column, id[0], id[1], id[2], id[3], id[4], id[5], id[6], id[7]);
    }
    fprintf(to, "  </wangset>\n </wangsets>\n</tileset>\n");
}

/* The color that a tile shows most, the lower one of two: Godot paints with it. */
static int main_color(const textiles_tile *tile) {
    int count[TEXTILES_MAX_COLORS] = {0}, best = 0;
    for (int k = 0; k < 4; k++) count[tile->edges[k]]++;
    for (int c = 1; c < TEXTILES_MAX_COLORS; c++) {
        if (count[c] > count[best]) best = c;
    }
    return best;
}

static void print_godot_tile(FILE *to, const textiles_set *set, const textiles_layout *l, int index) {
    static const char *const sides[4] = {"top_side", "right_side", "bottom_side", "left_side"};
    static const char *const corners[4] = {"top_left_corner", "top_right_corner",
                                           "bottom_right_corner", "bottom_left_corner"};
    textiles_tile tile;
    int column, row;
    textiles_tile_at(set, index, &tile);
    cell_of(l, index, &column, &row);
    fprintf(to, "%d:%d/0 = 0\n%d:%d/0/terrain_set = 0\n%d:%d/0/terrain = %d\n", column, row, column, row,
            column, row, main_color(&tile));
    for (int k = 0; k < 4; k++)
        fprintf(to, "%d:%d/0/terrains_peering_bit/%s = %d\n", column, row,
                l->kind == TEXTILES_CORNER ? corners[k] : sides[k], tile.edges[k]);
}

void print_godot(FILE *to, const textiles_set *set, const textiles_layout *l) {
    enum { MATCH_CORNERS = 1, MATCH_SIDES = 2 };
    fprintf(to, "[gd_resource type=\"TileSet\" load_steps=3 format=3]\n\n"
            "[ext_resource type=\"Texture2D\" path=\"atlas.png\" id=\"1\"]\n\n"
            "[sub_resource type=\"TileSetAtlasSource\" id=\"2\"]\n"
            "texture = ExtResource(\"1\")\nmargins = Vector2i(%d, %d)\nseparation = Vector2i(%d, %d)\n"
            "texture_region_size = Vector2i(%d, %d)\n", l->gutter, l->gutter, l->pitch_x - l->size,
            l->pitch_y - l->size, l->size, l->size);
    for (int i = 0; i < textiles_count(set); i++) print_godot_tile(to, set, l, i);
    fprintf(to, "\n[resource]\ntile_size = Vector2i(%d, %d)\nterrain_set_0/mode = %d\n", l->size,
            l->size, l->kind == TEXTILES_CORNER ? (int)MATCH_CORNERS : (int)MATCH_SIDES);
    for (int c = 0; c < textiles_colors(set); c++) {
        unsigned int red, green, blue;
        sscanf(rgb[c], "%2x%2x%2x", &red, &green, &blue);
        fprintf(to, "terrain_set_0/terrain_%d/name = \"color %d\"\nterrain_set_0/terrain_%d/color = "
                "Color(%.4f, %.4f, %.4f, 1)\n", c, c, c, red / 255.0, green / 255.0, blue / 255.0);
    }
    fprintf(to, "sources/0 = SubResource(\"2\")\n");
}
