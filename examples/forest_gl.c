/* forest_gl.c - a forest in the wind, drawn by the graphics card
   SPDX-License-Identifier: MIT OR Unlicense

   forest_gl [--species NAME|FILE,...] [--count N] [--seed N] [--pieces N] [--bare]
             [--bark DIR|SHEET.png] [--leaf PICTURE.png]
             [--time T] [--wind SPEED] [--level MAX] [--half METRES] [--wire]
             [--orbit AZIMUTH,ELEVATION,DISTANCE] [--at X,Y,Z] [--size WxH] [--shaders DIR]
             [--headless OUT.png [--frames N] [--smooth N]]

   What a game does with treepieces.h and shaders/treepieces.glsl. All arrays of the forest go to the
   graphics card once, its bones once a frame. A frame is one instanced draw for each type of piece, one
   for all leaf clouds, one for ground and sky, and one more if the view has turned, which renders the
   clouds' impostors anew: never more than 10, however many trees there are.

   In the window: drag to turn, wheel to come nearer, right button to move, w shows the levels of
   tessellation, l the leaves, space stops the time, Esc quits. --headless needs neither window nor
   graphics card; OUT with %d or %03d in it takes --frames pictures, 25 a second.

   --bark    a set of framed tiles made by 'texkit tiles --kind frame', or a sheet of treepieces_bark
   --leaf    a picture with transparency, for all species
   --level, --half   tessellation at the eye, and the distance over which it halves
   --orbit   degrees about the middle of the forest, and metres from there; --at: another middle
   --smooth  samples across and down a pixel                                                     */
#define _XOPEN_SOURCE 600 /* clock_gettime */
#define TREEPIECES_IMPLEMENTATION
#define TREEPIECES_STATIC
#include "treepieces.h"

#define GL_GLEXT_PROTOTYPES
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/gl.h>
#include <GL/glext.h>
#ifdef FOREST_WINDOW /* SDL 2 is there */
#include <SDL2/SDL.h>
#endif
#include <cjson/cJSON.h>
#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifndef FOREST_SHADERS
#define FOREST_SHADERS "/usr/local/share/texkit/shaders"
#endif

enum {
    MAX_SPECIES = 16,
    BARK_TILES = 24,   /* drawn if there are none                                               */
    BARK_SIDE = 64,    /* pixels of a tile                                                      */
    LEAF_SIDE = 512,   /* pixels of a leaf picture                                              */
    CLOUDS = 8,        /* different leaf clouds a species                                       */
    CLOUD_SIDE = 256,  /* pixels of an impostor                                                 */
    MAX_CELLS = 1200000 /* of the light's texture                                                */
};

typedef struct options {
    const char *species, *bark, *leaf, *shaders, *headless;
    int count, pieces, is_bare, is_wire, width, height, frames, smooth;
    uint64_t seed;
    double time;
    float wind, level, half;
    float orbit[3]; /* degrees, degrees, metres; distance 0: as far as shows it all             */
    float at[3];
    int has_at;
} options;

/* What all shaders know of a frame: frame_block in forest.glsl. */
typedef struct frame_data {
    float view_projection[16]; /* column by column                                              */
    float eye[4], right[4], up[4], forward[4], sun[4], box_low[4], box_scale[4], lod[4];
} frame_data;

/* A type of piece as treepieces.glsl wants it. */
typedef struct kind_data {
    float building[3][4], rotation[3][4];
    uint32_t first, stride, quads, leaves;
} kind_data;

typedef struct card_data {
    float center[4], right[4], up[4], normal[4];
} card_data;

enum { BONES, RECORDS, KINDS, QUADS, LOOKS, CLUSTERS, CARDS, BUFFERS }; /* bindings                */
enum { BARK, LEAVES, IMPOSTORS, DEPTHS, LIGHT, CARD_DEPTHS, TEXTURES }; /* the same                */
enum { PIECES, WIRE, CARD, CLOUD, LAND, PROGRAMS };

typedef struct forest_gl {
    options o;
    txm_env env;
    char failed[400]; /* what went wrong; empty: nothing so far                                 */

    /* the forest */
    treepieces_species species[MAX_SPECIES];
    int species_count;
    treepieces_kit *kit;
    treepieces_forest *forest;
    float *bones, *sway;
    double now;
    txm_image sheets[MAX_SPECIES], leaves[MAX_SPECIES];
    float low[3], high[3]; /* the box around it                                                 */

    /* the view */
    frame_data frame;
    float near_plane, far_plane;
    float seen_from[3]; /* direction that the impostors are for                                 */
    int has_impostors;

    /* OpenGL */
    GLuint programs[PROGRAMS], buffers[BUFFERS], textures[TEXTURES];
    GLuint block, vertices, indices, array, card_frame;
    int first_index[TREEPIECES_MAX_TYPES], card_count, draws;
    EGLDisplay display;
} forest_gl;

static int fail(forest_gl *f, const char *format, ...) {
    va_list list;
    va_start(list, format);
    vsnprintf(f->failed, sizeof f->failed, format, list);
    va_end(list);
    return 0;
}

static int check(forest_gl *f, txm_status status) {
    return status == TXM_OK ? 1 : fail(f, "%s", f->env.message);
}

/* count things of so many bytes, zeroed, or NULL with the failure noted */
static void *need(forest_gl *f, size_t count, size_t bytes) {
    void *memory = calloc(count ? count : 1, bytes);
    if (!memory) fail(f, "no memory");
    return memory;
}

static txm_image image_of(void *pixels, int width, int height, int channels) {
    const txm_image image = {pixels, width, height, channels, TXM_U8, 0};
    return image;
}

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* ---- the forest --------------------------------------------------------------------------- */

/* The whole file with a 0 at its end, for free(); NULL if it cannot be read. */
static char *read_text(const char *path) {
    FILE *file = fopen(path, "rb");
    size_t size = 0, capacity = 1 << 14;
    char *text = NULL;
    while (file) {
        char *more = (char *)realloc(text, capacity);
        if (!more) break;
        text = more;
        size += fread(text + size, 1, capacity - 1 - size, file);
        if (size < capacity - 1) break;
        capacity *= 2;
    }
    if (text) text[size] = 0;
    if (file) fclose(file);
    return text;
}

static int read_species(forest_gl *f) {
    char name[256];
    for (const char *at = f->o.species; *at; at += *at == ',') {
        const size_t length = strcspn(at, ",");
        if (f->species_count == MAX_SPECIES || length >= sizeof name)
            return fail(f, "more than %d species, or a name that is too long", MAX_SPECIES);
        memcpy(name, at, length);
        name[length] = 0;
        at += length;
        treepieces_species *species = &f->species[f->species_count++];
        char *text = strpbrk(name, "./") ? read_text(name) : NULL;
        const txm_status status = text
            ? treepieces_species_parse(text, strlen(text), &f->env, species)
            : treepieces_preset(name, &f->env, species);
        free(text);
        if (!check(f, status)) return 0;
        if (f->o.is_bare) species->leaf_count = 0;
    }
    return f->species_count ? 1 : fail(f, "no species");
}

/* Move on to a time: in steps that the sway's springs can follow. */
static int blow(forest_gl *f, double time) {
    const treepieces_wind wind = {0.4f, f->o.wind, 0.7f, 7};
    const double from = f->now;
    const int steps = txm_clampi((int)((time - from) * 30 + 0.999), 1, 300);
    for (int i = 1; i <= steps; i++)
        if (!check(f, treepieces_sway(f->forest, &wind, from + (time - from) * i / steps,
                                      (time - from) / steps, NULL, &f->env, f->sway, f->bones)))
            return 0;
    f->now = time;
    return 1;
}

static void include(forest_gl *f, const float p[3], float radius) {
    for (int k = 0; k < 3; k++) {
        f->low[k] = txm_minf(f->low[k], p[k] - radius);
        f->high[k] = txm_maxf(f->high[k], p[k] + radius);
    }
}

/* a + along * (length of the node's piece) in the world */
static void axis_point(const forest_gl *f, uint32_t node, float along, float p[3]) {
    const float *b = f->bones + (size_t)TREEPIECES_BONE * node;
    for (int k = 0; k < 3; k++) p[k] = b[4 * k + 3] + along * b[4 * k + 1];
}

static int grow(forest_gl *f) {
    treepieces_forest_desc desc = {0};
    if (!check(f, treepieces_kit_make(NULL, 0, &f->env, &f->kit))) return 0;
    const treepieces_place alone = {{0, 0, 0}, 0, 0, 0, f->o.seed};
    desc.kit = f->kit;
    desc.species = f->species;
    desc.species_count = f->species_count;
    desc.tree_count = f->o.count;
    desc.places = f->o.count == 1 ? &alone : NULL;
    desc.max_pieces = f->o.pieces;
    desc.seed = f->o.seed;
    if (!check(f, treepieces_forest_make(&desc, &f->env, &f->forest))) return 0;
    f->bones = (float *)need(f, f->forest->node_count, TREEPIECES_BONE * sizeof(float));
    f->sway = (float *)need(f, f->forest->node_count, 4 * sizeof(float));
    if (!f->bones || !f->sway) return 0;
    f->now = f->o.time - 10; /* for the sway to settle */
    if (!blow(f, f->o.time)) return 0;
    for (int k = 0; k < 3; k++) {
        f->low[k] = k == 1 ? 0 : 1e9f;
        f->high[k] = -1e9f;
    }
    for (uint32_t i = 0; i < f->forest->node_count; i++) {
        float p[3];
        axis_point(f, i, 1, p);
        include(f, p, 0.1f);
    }
    for (uint32_t i = 0; i < f->forest->cluster_count; i++) {
        const treepieces_cluster *c = &f->forest->clusters[i];
        float p[3];
        axis_point(f, c->node, c->along, p);
        include(f, p, c->radius);
    }
    return 1;
}

/* ---- pictures ------------------------------------------------------------------------------ */

static int new_image(forest_gl *f, txm_image *image, int width, int height, int channels) {
    void *pixels = need(f, (size_t)width * (size_t)height, (size_t)channels);
    *image = image_of(pixels, width, height, channels);
    return pixels != NULL;
}

static int read_picture(forest_gl *f, const char *path, int channels, txm_image *image) {
    int width, height, had;
    stbi_uc *pixels = stbi_load(path, &width, &height, &had, channels);
    if (!pixels) return fail(f, "cannot read '%s': %s", path, stbi_failure_reason());
    *image = image_of(pixels, width, height, channels);
    return 1;
}

static int number_of(const cJSON *json, const char *name) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsNumber(item) ? item->valueint : -1;
}

/* Tiles of a set that have the edges of the first, as views into its atlas. */
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

static int lay_sheet(forest_gl *f, const txm_image *tiles, int count, txm_image *sheet) {
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
    char *text = read_text(path);
    cJSON *json = text ? cJSON_Parse(text) : NULL;
    snprintf(path, sizeof path, "%s/atlas.png", folder);
    int good = json ? read_picture(f, path, 3, &atlas)
                    : fail(f, "'%s' is no set of tiles of 'texkit tiles'", folder);
    if (good) {
        const int count = list_tiles(json, &atlas, tiles);
        good = count ? lay_sheet(f, tiles, count, sheet)
                     : fail(f, "'%s' holds no tiles that fit into its atlas", folder);
    }
    stbi_image_free(atlas.pixels);
    cJSON_Delete(json);
    free(text);
    return good;
}

static int draw_tiles(forest_gl *f, const treepieces_species *species, txm_image *sheet) {
    uint8_t *block = (uint8_t *)need(f, BARK_TILES, 3 * BARK_SIDE * BARK_SIDE);
    txm_image tiles[BARK_TILES];
    if (!block) return 0;
    for (int i = 0; i < BARK_TILES; i++)
        tiles[i] = image_of(block + 3 * BARK_SIDE * BARK_SIDE * i, BARK_SIDE, BARK_SIDE, 3);
    const int good =
        check(f, treepieces_draw_bark(species, f->o.seed, &f->env, tiles, BARK_TILES)) &&
        lay_sheet(f, tiles, BARK_TILES, sheet);
    free(block);
    return good;
}

/* A sheet of bark and a leaf picture for each species. */
static int make_pictures(forest_gl *f) {
    const size_t length = f->o.bark ? strlen(f->o.bark) : 0;
    const int is_sheet = length > 4 && strcmp(f->o.bark + length - 4, ".png") == 0;
    for (int s = 0; s < f->species_count; s++) {
        txm_image *sheet = &f->sheets[s], *leaf = &f->leaves[s];
        int good;
        if (!f->o.bark) good = draw_tiles(f, &f->species[s], sheet);
        else if (is_sheet) good = read_picture(f, f->o.bark, 3, sheet);
        else good = read_tiles(f, f->o.bark, sheet);
        if (!good) return 0;
        if (sheet->width % TREEPIECES_SHEET || sheet->height != sheet->width * TREEPIECES_OWN)
            return fail(f, "'%s' is no sheet of bark: it must be 5 times as high as wide", f->o.bark);
        if (f->o.leaf) good = read_picture(f, f->o.leaf, 4, leaf);
        else good = new_image(f, leaf, LEAF_SIDE, LEAF_SIDE, 4) &&
                    check(f, treepieces_draw_leaves(&f->species[s], f->o.seed, &f->env, *leaf));
        if (!good) return 0;
    }
    return 1;
}

/* ---- light through the crowns -------------------------------------------------------------- */

/* How much wood and leaves there are, in the cells of a grid: how much light is lost on a way of one
   metre. */
typedef struct cells {
    int n[3];
    size_t count;
    float size, low[3];
    float *loss, *above; /* above: the sum of all losses on the way to the light */
} cells;

static float *cell_at(const cells *c, int x, int y, int z) {
    return c->loss + (((size_t)z * (size_t)c->n[1] + (size_t)y) * (size_t)c->n[0] + (size_t)x);
}

/* A ball that lets exp(-loss) of the light through its middle. */
static void add_ball(cells *c, const float p[3], float radius, float loss) {
    const float reach = txm_maxf(radius, 0.75f * c->size);
    int from[3], to[3];
    loss *= radius * radius / (reach * reach);
    for (int k = 0; k < 3; k++) {
        from[k] = txm_clampi((int)((p[k] - reach - c->low[k]) / c->size), 0, c->n[k] - 1);
        to[k] = txm_clampi((int)((p[k] + reach - c->low[k]) / c->size), 0, c->n[k] - 1);
    }
    for (int z = from[2]; z <= to[2]; z++) {
        for (int y = from[1]; y <= to[1]; y++) {
            for (int x = from[0]; x <= to[0]; x++) {
                const float d[3] = {c->low[0] + ((float)x + 0.5f) * c->size - p[0],
                                    c->low[1] + ((float)y + 0.5f) * c->size - p[1],
                                    c->low[2] + ((float)z + 0.5f) * c->size - p[2]};
                const float square = dot(d, d) / (reach * reach);
                if (square < 1) *cell_at(c, x, y, z) += 0.75f * loss / reach * (1 - square);
            }
        }
    }
}

/* Sums from the top down along a direction, layer by layer, each read between its cells: shadows
   soften with distance. */
static void sum_along(cells *c, const float to_light[3]) {
    const float step = c->size / to_light[1];
    const float dx = to_light[0] / to_light[1], dz = to_light[2] / to_light[1];
    const size_t line = (size_t)c->n[0], slice = line * (size_t)c->n[1];
    for (int y = c->n[1] - 1; y >= 0; y--) {
        for (int z = 0; z < c->n[2]; z++) {
            for (int x = 0; x < c->n[0]; x++) {
                const float u = (float)x + dx, v = (float)z + dz;
                const int i = (int)floorf(u), j = (int)floorf(v);
                float sum = 0;
                for (int k = 0; k < 4 && y + 1 < c->n[1]; k++) {
                    const int a = i + (k & 1), b = j + (k >> 1);
                    const float wa = k & 1 ? u - (float)i : 1 - (u - (float)i);
                    const float wb = k >> 1 ? v - (float)j : 1 - (v - (float)j);
                    if (a < 0 || b < 0 || a >= c->n[0] || b >= c->n[2]) continue;
                    const size_t up = (size_t)b * slice + (size_t)(y + 1) * line + (size_t)a;
                    sum += wa * wb * (c->above[up] + 0.5f * step * c->loss[up]);
                }
                const size_t here = (size_t)z * slice + (size_t)y * line + (size_t)x;
                c->above[here] = sum + 0.5f * step * c->loss[here];
            }
        }
    }
}

/* A grid over the forest and its shadows. */
static int open_cells(forest_gl *f, cells *c) {
    float volume = 1, size[3];
    for (int k = 0; k < 3; k++) {
        /* shadows fall to the side that the sun is not on */
        const float shadow = f->high[1] * f->frame.sun[k] / f->frame.sun[1], rim = k == 1 ? 0 : 1;
        c->low[k] = f->low[k] - rim * txm_maxf(shadow, 1);
        size[k] = f->high[k] + rim * txm_maxf(-shadow, 1) - c->low[k];
        volume *= size[k];
    }
    c->size = txm_maxf(cbrtf(volume / MAX_CELLS), 0.05f);
    c->count = 1;
    for (int k = 0; k < 3; k++) {
        c->n[k] = txm_clampi((int)(size[k] / c->size) + 1, 1, 1024);
        c->count *= (size_t)c->n[k];
    }
    c->loss = (float *)need(f, c->count, sizeof *c->loss);
    c->above = (float *)need(f, c->count, sizeof *c->above);
    return c->loss && c->above;
}

static void add_trees(const forest_gl *f, cells *c) {
    float p[3];
    for (uint32_t i = 0; i < f->forest->cluster_count; i++) {
        const treepieces_cluster *cluster = &f->forest->clusters[i];
        axis_point(f, cluster->node, cluster->along, p);
        add_ball(c, p, 0.9f * cluster->radius, 0.9f);
    }
    for (uint32_t i = 0; i < f->forest->node_count; i++) {
        const treepieces_node *n = &f->forest->nodes[i];
        const int balls = txm_clampi((int)(n->length / txm_maxf(c->size, n->radius)), 1, 16);
        /* together as much shade as a rod gives, and within it, so that its surface has light */
        const float loss = 2 * txm_minf(1, n->length / ((float)balls * 2 * n->radius));
        for (int k = 0; k < balls; k++) {
            axis_point(f, i, ((float)k + 0.5f) / (float)balls, p);
            add_ball(c, p, txm_minf(0.8f * n->radius, 2 * c->size), loss);
        }
    }
}

static void upload_light(forest_gl *f, const cells *c, const uint8_t *bytes) {
    static const float open[4] = {1, 1, 1, 1}; /* outside of the grid */
    glActiveTexture(GL_TEXTURE0 + LIGHT);
    glBindTexture(GL_TEXTURE_3D, f->textures[LIGHT]);
    glTexImage3D(GL_TEXTURE_3D, 0, GL_RG8, c->n[0], c->n[1], c->n[2], 0, GL_RG, GL_UNSIGNED_BYTE,
                 bytes);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_BORDER);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_BORDER);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_R, GL_CLAMP_TO_BORDER);
    glTexParameterfv(GL_TEXTURE_3D, GL_TEXTURE_BORDER_COLOR, open);
    for (int k = 0; k < 3; k++) {
        f->frame.box_low[k] = c->low[k];
        f->frame.box_scale[k] = 1 / ((float)c->n[k] * c->size);
    }
    f->frame.box_low[3] = c->size;
}

/* Light from the sun and from five directions of the sky, for the forest as it stands now. The wind
   moves shadows too little to do it again. */
static int make_light(forest_gl *f) {
    static const float sky[5][3] = {{0, 1, 0}, {0.7f, 0.7f, 0}, {-0.7f, 0.7f, 0}, {0, 0.7f, 0.7f},
                                    {0, 0.7f, -0.7f}};
    cells c = {{0, 0, 0}, 0, 0, {0, 0, 0}, NULL, NULL};
    const int is_open = open_cells(f, &c);
    float *from_sky = is_open ? (float *)need(f, c.count, sizeof *from_sky) : NULL;
    uint8_t *bytes = from_sky ? (uint8_t *)need(f, c.count, 2) : NULL;
    if (bytes) {
        add_trees(f, &c);
        for (int d = 0; d < 5; d++) {
            sum_along(&c, sky[d]);
            for (size_t i = 0; i < c.count; i++) from_sky[i] += 51 * expf(-c.above[i]);
        }
        sum_along(&c, f->frame.sun);
        for (size_t i = 0; i < c.count; i++) {
            bytes[2 * i] = (uint8_t)(255 * expf(-c.above[i]) + 0.5f);
            bytes[2 * i + 1] = (uint8_t)(from_sky[i] + 0.5f);
        }
        upload_light(f, &c, bytes);
    }
    free(c.loss);
    free(c.above);
    free(from_sky);
    free(bytes);
    return !f->failed[0];
}

/* ---- shaders -------------------------------------------------------------------------------- */

/* Text of a shader file: where --shaders says, else beside the source or where it was installed. */
static char *read_shader(forest_gl *f, const char *name, const char *program) {
    char path[1024];
    const char *slash = strrchr(program, '/');
    const int length = slash ? (int)(slash - program) : 1;
    for (int i = 0; i < 3; i++) {
        if (f->o.shaders) snprintf(path, sizeof path, "%s/%s", f->o.shaders, name);
        else if (i == 0)
            snprintf(path, sizeof path, "%.*s/../../shaders/%s", length, slash ? program : ".", name);
        else if (i == 1) snprintf(path, sizeof path, "shaders/%s", name);
        else snprintf(path, sizeof path, "%s/%s", FOREST_SHADERS, name);
        char *text = read_text(path);
        if (text) return text;
    }
    fail(f, "cannot find shaders/%s; --shaders says where it is", name);
    return NULL;
}

static int add_stage(forest_gl *f, GLuint program, GLenum type, const char *stage,
                     const char *defines, const char *library, const char *body) {
    char head[256];
    snprintf(head, sizeof head, "#version 430 core\n#define %s\n%s", stage, defines);
    const char *parts[3] = {head, library, body};
    GLint good = 0;
    const GLuint shader = glCreateShader(type);
    glShaderSource(shader, 3, parts, NULL);
    glCompileShader(shader);
    glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
    if (!good) {
        char log[300] = "";
        glGetShaderInfoLog(shader, sizeof log, NULL, log);
        fail(f, "%s: %s", stage, log);
    }
    glAttachShader(program, shader);
    glDeleteShader(shader); /* once the program is */
    return good;
}

/* count names of what the last stage before the fragments puts out is to be recorded; 0: none */
static GLuint make_program(forest_gl *f, int number, const char *library, const char *body,
                           const char *defines, const char *const *recorded, int count) {
    static const struct {
        int program;
        GLenum type;
        const char *name;
    } stages[] = {
        {PIECES, GL_VERTEX_SHADER, "PIECE_VERTEX"},
        {PIECES, GL_TESS_CONTROL_SHADER, "PIECE_CONTROL"},
        {PIECES, GL_TESS_EVALUATION_SHADER, "PIECE_EVALUATION"},
        {PIECES, GL_FRAGMENT_SHADER, "PIECE_FRAGMENT"},
        {WIRE, GL_VERTEX_SHADER, "PIECE_VERTEX"},
        {WIRE, GL_TESS_CONTROL_SHADER, "PIECE_CONTROL"},
        {WIRE, GL_TESS_EVALUATION_SHADER, "PIECE_EVALUATION"},
        {WIRE, GL_GEOMETRY_SHADER, "PIECE_WIRE"},
        {WIRE, GL_FRAGMENT_SHADER, "PIECE_FRAGMENT\n#define WIRE"},
        {CARD, GL_VERTEX_SHADER, "CARD_VERTEX"},
        {CARD, GL_GEOMETRY_SHADER, "CARD_GEOMETRY"},
        {CARD, GL_FRAGMENT_SHADER, "CARD_FRAGMENT"},
        {CLOUD, GL_VERTEX_SHADER, "CLOUD_VERTEX"},
        {CLOUD, GL_FRAGMENT_SHADER, "CLOUD_FRAGMENT"},
        {LAND, GL_VERTEX_SHADER, "LAND_VERTEX"},
        {LAND, GL_FRAGMENT_SHADER, "LAND_FRAGMENT"},
    };
    const GLuint program = glCreateProgram();
    GLint good = 1;
    for (size_t i = 0; i < sizeof stages / sizeof stages[0] && good; i++)
        if (stages[i].program == number)
            good = add_stage(f, program, stages[i].type, stages[i].name, defines, library, body);
    if (count) glTransformFeedbackVaryings(program, count, recorded, GL_INTERLEAVED_ATTRIBS);
    if (good) {
        glLinkProgram(program);
        glGetProgramiv(program, GL_LINK_STATUS, &good);
        if (!good) {
            char log[300] = "";
            glGetProgramInfoLog(program, sizeof log, NULL, log);
            fail(f, "program %d: %s", number, log);
        }
    }
    return good ? program : 0;
}

static int make_programs(forest_gl *f, const char *path) {
    char *library = read_shader(f, "treepieces.glsl", path);
    char *body = library ? read_shader(f, "forest.glsl", path) : NULL;
    for (int i = 0; i < PROGRAMS && body && !f->failed[0]; i++)
        f->programs[i] = make_program(f, i, library, body, "", NULL, 0);
    free(library);
    free(body);
    return !f->failed[0];
}

/* ---- buffers and textures ------------------------------------------------------------------- */

/* OpenGL takes offsets into buffers as pointers. */
static void *at_offset(size_t bytes) {
    return (void *)bytes; /* NOLINT(performance-no-int-to-ptr) */
}

static void fill_buffer(forest_gl *f, int binding, const void *data, size_t bytes) {
    glBindBuffer(GL_SHADER_STORAGE_BUFFER, f->buffers[binding]);
    glBufferData(GL_SHADER_STORAGE_BUFFER, (GLsizeiptr)(bytes ? bytes : 16), bytes ? data : NULL,
                 binding == BONES ? GL_STREAM_DRAW : GL_STATIC_DRAW);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, (GLuint)binding, f->buffers[binding]);
}

/* The pieces themselves: their vertices, quads and building transforms, and all records. */
static int upload_pieces(forest_gl *f) {
    const int types = f->forest->type_count;
    kind_data kinds[TREEPIECES_MAX_TYPES];
    size_t vertices = 0, quads = 0, words = 0;
    memset(kinds, 0, sizeof kinds);
    for (int t = 0; t < types; t++) {
        const treepieces_piece *p = treepieces_kit_piece(f->kit, t);
        vertices += (size_t)p->vertex_count;
        quads += (size_t)p->quad_count;
        words += (size_t)f->forest->batches[t].count * f->forest->batches[t].stride;
    }
    treepieces_vertex *all = (treepieces_vertex *)need(f, vertices, sizeof *all);
    uint16_t *corners = (uint16_t *)need(f, quads, 4 * sizeof *corners);
    uint32_t *looks = (uint32_t *)need(f, quads, sizeof *looks);
    uint32_t *records = (uint32_t *)need(f, words, sizeof *records);
    if (all && corners && looks && records) {
        vertices = quads = words = 0;
        for (int t = 0; t < types; t++) {
            const treepieces_piece *p = treepieces_kit_piece(f->kit, t);
            const treepieces_batch *b = &f->forest->batches[t];
            const size_t size = (size_t)b->count * b->stride;
            for (int k = 0; k < p->leaf_count; k++) {
                memcpy(kinds[t].building[k], p->building[k].translation, 3 * sizeof(float));
                kinds[t].building[k][3] = p->building[k].scale;
                memcpy(kinds[t].rotation[k], p->building[k].rotation, 4 * sizeof(float));
            }
            kinds[t].first = (uint32_t)words;
            kinds[t].stride = b->stride;
            kinds[t].quads = (uint32_t)quads;
            kinds[t].leaves = (uint32_t)p->leaf_count;
            f->first_index[t] = (int)(4 * quads);
            for (int q = 0; q < p->quad_count; q++, quads++) {
                for (int k = 0; k < 4; k++)
                    corners[4 * quads + (size_t)k] = (uint16_t)(vertices + p->quads[q].corners[k]);
                looks[quads] = p->quads[q].tile_class + 256u * p->quads[q].band;
            }
            memcpy(all + vertices, p->vertices, (size_t)p->vertex_count * sizeof *all);
            vertices += (size_t)p->vertex_count;
            if (size) memcpy(records + words, b->words, size * sizeof *records);
            words += size;
        }
        glBindBuffer(GL_ARRAY_BUFFER, f->vertices);
        glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(vertices * sizeof *all), all, GL_STATIC_DRAW);
        glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, f->indices);
        glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(4 * quads * sizeof *corners), corners,
                     GL_STATIC_DRAW);
        const GLsizei size = (GLsizei)sizeof *all;
        glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, size, NULL);
        glVertexAttribIPointer(1, 1, GL_INT, size, at_offset(offsetof(treepieces_vertex, rim)));
        glVertexAttribPointer(2, 3, GL_FLOAT, GL_FALSE, size,
                              at_offset(offsetof(treepieces_vertex, normal)));
        glVertexAttribPointer(3, 4, GL_FLOAT, GL_FALSE, size,
                              at_offset(offsetof(treepieces_vertex, weights)));
        for (GLuint i = 0; i < 4; i++) glEnableVertexAttribArray(i);
        fill_buffer(f, KINDS, kinds, sizeof kinds);
        fill_buffer(f, QUADS, looks, quads * sizeof *looks);
        fill_buffer(f, RECORDS, records, words * sizeof *records);
    }
    free(all);
    free(corners);
    free(looks);
    free(records);
    return !f->failed[0];
}

/* What belongs to nodes and clusters, and the cards of the leaf clouds. */
static int upload_trees(forest_gl *f) {
    const treepieces_forest *forest = f->forest;
    uint32_t *looks = (uint32_t *)need(f, forest->node_count, sizeof *looks);
    card_data *cards = (card_data *)need(f, (size_t)f->species_count * CLOUDS * 256, sizeof *cards);
    treepieces_card made[256];
    if (looks && cards) {
        for (int t = 0; t < forest->tree_count; t++) {
            const treepieces_tree *tree = &forest->trees[t];
            const uint32_t look = (uint32_t)tree->species |
                                  ((uint32_t)txm_hash(tree->seed + (uint64_t)t) & 0xffffffu) << 8;
            for (uint32_t i = 0; i < tree->node_count; i++) looks[tree->first_node + i] = look;
        }
        for (int i = 0; i < f->species_count * CLOUDS; i++) {
            const int s = i / CLOUDS;
            const int count = treepieces_cloud(&f->species[s], (uint32_t)(i % CLOUDS), made);
            for (int k = 0; k < count; k++) {
                card_data *card = &cards[f->card_count++];
                memcpy(card->center, made[k].center, sizeof made[k].center);
                memcpy(card->right, made[k].right, sizeof made[k].right);
                memcpy(card->up, made[k].up, sizeof made[k].up);
                memcpy(card->normal, made[k].normal, sizeof made[k].normal);
                card->center[3] = (float)i;
                card->right[3] = (float)s;
            }
        }
        fill_buffer(f, LOOKS, looks, forest->node_count * sizeof *looks);
        fill_buffer(f, CARDS, cards, (size_t)f->card_count * sizeof *cards);
        fill_buffer(f, CLUSTERS, forest->clusters, forest->cluster_count * sizeof *forest->clusters);
    }
    free(looks);
    free(cards);
    return !f->failed[0];
}

static void upload_bones(forest_gl *f) {
    fill_buffer(f, BONES, f->bones, f->forest->node_count * TREEPIECES_BONE * sizeof(float));
}

/* An array texture of layers of one size. */
static void make_array(forest_gl *f, int number, GLenum format, int width, int height, int layers,
                       GLenum filter) {
    const int is_depth = format == GL_DEPTH_COMPONENT24;
    glActiveTexture(GL_TEXTURE0 + (GLenum)number);
    glBindTexture(GL_TEXTURE_2D_ARRAY, f->textures[number]);
    glTexImage3D(GL_TEXTURE_2D_ARRAY, 0, (GLint)format, width, height, layers, 0,
                 is_depth ? GL_DEPTH_COMPONENT : format == GL_R32F ? GL_RED : GL_RGBA,
                 is_depth ? GL_UNSIGNED_INT : format == GL_R32F ? GL_FLOAT : GL_UNSIGNED_BYTE, NULL);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, (GLint)filter);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER,
                    filter == GL_NEAREST ? GL_NEAREST : GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_S,
                    number == BARK ? GL_REPEAT : GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
}

static int upload_pictures(forest_gl *f) {
    const int n = f->species_count, side = f->sheets[0].width;
    const int width = f->leaves[0].width, height = f->leaves[0].height;
    make_array(f, BARK, GL_SRGB8_ALPHA8, side, side, n * TREEPIECES_OWN, GL_LINEAR_MIPMAP_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAX_LEVEL, 6);
    for (int s = 0; s < n; s++)
        glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, s * TREEPIECES_OWN, side, side, TREEPIECES_OWN,
                        GL_RGB, GL_UNSIGNED_BYTE, f->sheets[s].pixels);
    glGenerateMipmap(GL_TEXTURE_2D_ARRAY);
    make_array(f, LEAVES, GL_RGBA8, width, height, n, GL_NEAREST);
    for (int s = 0; s < n; s++)
        glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, s, width, height, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                        f->leaves[s].pixels);

    /* impostors and what they are rendered with */
    const GLenum both[2] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    make_array(f, IMPOSTORS, GL_RGBA8, CLOUD_SIDE, CLOUD_SIDE, n * CLOUDS, GL_LINEAR_MIPMAP_LINEAR);
    make_array(f, DEPTHS, GL_R32F, CLOUD_SIDE, CLOUD_SIDE, n * CLOUDS, GL_NEAREST);
    make_array(f, CARD_DEPTHS, GL_DEPTH_COMPONENT24, CLOUD_SIDE, CLOUD_SIDE, n * CLOUDS, GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, f->card_frame);
    glFramebufferTexture(GL_FRAMEBUFFER, both[0], f->textures[IMPOSTORS], 0);
    glFramebufferTexture(GL_FRAMEBUFFER, both[1], f->textures[DEPTHS], 0);
    glFramebufferTexture(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, f->textures[CARD_DEPTHS], 0);
    glDrawBuffers(2, both);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        return fail(f, "this OpenGL cannot render into array textures");
    return 1;
}

static void make_objects(forest_gl *f) {
    const float to_sun[3] = {0.53f, 0.62f, 0.58f}, length = sqrtf(dot(to_sun, to_sun));
    for (int k = 0; k < 3; k++) f->frame.sun[k] = to_sun[k] / length;
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glGenBuffers(BUFFERS, f->buffers);
    glGenBuffers(1, &f->block);
    glGenBuffers(1, &f->vertices);
    glGenBuffers(1, &f->indices);
    glGenTextures(TEXTURES, f->textures);
    glGenFramebuffers(1, &f->card_frame);
    glGenVertexArrays(1, &f->array);
    glBindVertexArray(f->array);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, f->block);
}

/* Everything that OpenGL needs; program: argv[0]. */
static int prepare(forest_gl *f, const char *program) {
    make_objects(f);
    return make_programs(f, program) && upload_pieces(f) && upload_trees(f) && upload_pictures(f) &&
           make_light(f);
}

/* ---- a frame --------------------------------------------------------------------------------- */

static const float degree = 0.0174532925f, half_view = 19; /* degrees up and down */

/* Where --orbit and --at leave it open: as far from the middle as shows it all. */
static void choose_view(forest_gl *f) {
    const float tall = f->high[1] - f->low[1], tan_up = tanf(half_view * degree);
    const float wide = 0.5f * (f->high[0] - f->low[0] + f->high[2] - f->low[2]);
    const float tan_right = tan_up * (float)f->o.width / (float)f->o.height;
    for (int k = 0; k < 3 && !f->o.has_at; k++) f->o.at[k] = 0.5f * (f->low[k] + f->high[k]);
    if (f->o.orbit[2] > 0) return;
    f->o.orbit[2] = 0.53f * txm_maxf(tall / tan_up, wide / tan_right) + 0.2f * wide;
}

/* Look at the forest from --orbit. */
static void aim(forest_gl *f, int width, int height) {
    frame_data *d = &f->frame;
    const float a = f->o.orbit[0] * degree, e = f->o.orbit[1] * degree, distance = f->o.orbit[2];
    const float tan_up = tanf(half_view * degree), tan_right = tan_up * (float)width / (float)height;
    const float wide = 0.5f * (f->high[0] - f->low[0] + f->high[2] - f->low[2]);
    const float *middle = f->o.at;
    const float back[3] = {cosf(e) * sinf(a), sinf(e), cosf(e) * cosf(a)};
    const float right[3] = {cosf(a), 0, -sinf(a)};
    const float up[3] = {-sinf(e) * sinf(a), cosf(e), -sinf(e) * cosf(a)};
    for (int k = 0; k < 3; k++) {
        d->eye[k] = middle[k] + distance * back[k];
        d->right[k] = right[k];
        d->up[k] = up[k];
        d->forward[k] = -back[k];
    }
    d->eye[1] = txm_maxf(d->eye[1], 0.1f);
    d->right[3] = tan_right;
    d->up[3] = tan_up;
    d->forward[3] = CLOUDS;
    d->box_scale[3] = 0.18f / (distance + wide + 30);
    d->lod[0] = f->o.level;
    d->lod[1] = f->o.half;
    d->lod[2] = 0.6f;
    d->lod[3] = (float)f->sheets[0].width;
    f->near_plane = txm_clampf(0.02f * distance, 0.05f, 1);
    f->far_plane = distance + 4 * (wide + f->high[1]) + 500;
    const float n = f->near_plane, far = f->far_plane;
    const float z[2] = {-(far + n) / (far - n), -2 * far * n / (far - n)};
    for (int column = 0; column < 4; column++) {
        /* the column of the view: right, up and back in its rows */
        const float v[3] = {column < 3 ? right[column] : -dot(right, d->eye),
                            column < 3 ? up[column] : -dot(up, d->eye),
                            column < 3 ? back[column] : -dot(back, d->eye)};
        float *m = d->view_projection + 4 * column;
        m[0] = v[0] / tan_right;
        m[1] = v[1] / tan_up;
        m[2] = z[0] * v[2] + (column == 3 ? z[1] : 0);
        m[3] = -v[2];
    }
    glBindBuffer(GL_UNIFORM_BUFFER, f->block);
    glBufferData(GL_UNIFORM_BUFFER, sizeof *d, d, GL_STREAM_DRAW);
}

static void draw_strips(forest_gl *f, int program, int count) {
    glUseProgram(f->programs[program]);
    glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, count);
    f->draws++;
}

/* The leaf clouds as seen along the view, if it has turned. */
static void draw_impostors(forest_gl *f) {
    static const float clear[4] = {0, 0, 0, 0}, nothing[4] = {-2, 0, 0, 0}, away = 1;
    const float turned = 1 - dot(f->seen_from, f->frame.forward);
    if (!f->card_count || (f->has_impostors && turned < 1e-6f)) return;
    glBindFramebuffer(GL_FRAMEBUFFER, f->card_frame);
    glViewport(0, 0, CLOUD_SIDE, CLOUD_SIDE);
    glEnable(GL_DEPTH_TEST);
    glClearBufferfv(GL_COLOR, 0, clear);
    glClearBufferfv(GL_COLOR, 1, nothing);
    glClearBufferfv(GL_DEPTH, 0, &away);
    draw_strips(f, CARD, f->card_count);
    glActiveTexture(GL_TEXTURE0 + IMPOSTORS);
    glGenerateMipmap(GL_TEXTURE_2D_ARRAY);
    memcpy(f->seen_from, f->frame.forward, sizeof f->seen_from);
    f->has_impostors = 1;
}

static void draw_pieces(forest_gl *f, GLuint program) {
    const GLint kind = glGetUniformLocation(program, "kind");
    glUseProgram(program);
    glPatchParameteri(GL_PATCH_VERTICES, 4);
    for (int t = 0; t < f->forest->type_count; t++) {
        const treepieces_batch *b = &f->forest->batches[t];
        const size_t first = (size_t)f->first_index[t];
        if (!b->count) continue;
        glUniform1i(kind, t);
        glDrawElementsInstanced(GL_PATCHES, 4 * b->quad_count, GL_UNSIGNED_SHORT,
                                at_offset(first * sizeof(uint16_t)), (GLsizei)b->count);
        f->draws++;
    }
}

/* The whole picture into a frame buffer of that size. */
static void draw_frame(forest_gl *f, GLuint target, int width, int height) {
    f->draws = 0;
    aim(f, width, height);
    draw_impostors(f);
    glBindFramebuffer(GL_FRAMEBUFFER, target);
    glViewport(0, 0, width, height);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LEQUAL);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glEnable(GL_CULL_FACE);
    draw_pieces(f, f->programs[f->o.is_wire ? WIRE : PIECES]);
    glDisable(GL_CULL_FACE);
    if (f->forest->cluster_count && !f->o.is_bare)
        draw_strips(f, CLOUD, (int)f->forest->cluster_count);
    glUseProgram(f->programs[LAND]); /* last: most of it is covered by then */
    glDrawArrays(GL_TRIANGLES, 0, 3);
    f->draws++;
}

/* ---- without a window ------------------------------------------------------------------------ */

static int open_headless(forest_gl *f) {
    typedef EGLDisplay (*get_display)(EGLenum, void *, const EGLint *);
    const EGLint profile[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 3,
                              EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                              EGL_NONE};
    /* a cast between a function's and another function's type */
    const get_display get = (get_display)eglGetProcAddress("eglGetPlatformDisplayEXT");
    f->display = get ? get(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL) : EGL_NO_DISPLAY;
    if (f->display == EGL_NO_DISPLAY || !eglInitialize(f->display, NULL, NULL) ||
        !eglBindAPI(EGL_OPENGL_API))
        return fail(f, "no EGL that works without a window; Mesa's package is libegl-mesa0");
    const EGLContext context =
        eglCreateContext(f->display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, profile);
    if (context == EGL_NO_CONTEXT ||
        !eglMakeCurrent(f->display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
        return fail(f, "no OpenGL 4.3");
    return 1;
}

/* A frame buffer to render into. */
static GLuint make_target(int width, int height) {
    GLuint frame, color, depth;
    glGenFramebuffers(1, &frame);
    glBindFramebuffer(GL_FRAMEBUFFER, frame);
    glGenRenderbuffers(1, &color);
    glBindRenderbuffer(GL_RENDERBUFFER, color);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color);
    glGenRenderbuffers(1, &depth);
    glBindRenderbuffer(GL_RENDERBUFFER, depth);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth);
    return frame;
}

/* The name of picture `number`: %d or %0Nd in the pattern is replaced. 0: it has another %. */
static int name_picture(const char *pattern, int number, char *path, size_t capacity) {
    const char *percent = strchr(pattern, '%');
    size_t digits = 0;
    if (!percent) return (size_t)snprintf(path, capacity, "%s", pattern) < capacity;
    const char *at = percent + 1;
    if (*at == '0') digits = (size_t)(*++at - '0');
    if (digits > 9 || (digits && *++at != 'd') || *at != 'd' || strchr(at, '%')) return 0;
    return (size_t)snprintf(path, capacity, "%.*s%0*d%s", (int)(percent - pattern), pattern,
                            (int)digits, number, at + 1) < capacity;
}

/* Means of smooth x smooth pixels, with the first row on top. */
static void reduce(const uint8_t *rgba, int width, int height, int smooth, uint8_t *rgb) {
    const int samples = smooth * smooth;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < 3 * width; x++) {
            int sum = samples / 2;
            for (int i = 0; i < samples; i++) {
                const int row = (height - 1 - y) * smooth + i / smooth;
                const int column = x / 3 * smooth + i % smooth;
                sum += rgba[4 * ((size_t)row * (size_t)(width * smooth) + (size_t)column) +
                            (size_t)(x % 3)];
            }
            rgb[(size_t)y * 3 * (size_t)width + (size_t)x] = (uint8_t)(sum / samples);
        }
    }
}

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int render_pictures(forest_gl *f) {
    const int width = f->o.width * f->o.smooth, height = f->o.height * f->o.smooth;
    uint8_t *pixels = (uint8_t *)need(f, (size_t)width * (size_t)height, 4);
    uint8_t *rgb = (uint8_t *)need(f, (size_t)f->o.width * (size_t)f->o.height, 3);
    const GLuint target = make_target(width, height);
    const double start = seconds();
    for (int i = 0; i < f->o.frames && pixels && rgb && !f->failed[0]; i++) {
        char path[1024];
        if (i > 0 && !blow(f, f->o.time + i / 25.0)) break;
        upload_bones(f);
        draw_frame(f, target, width, height);
        glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
        reduce(pixels, f->o.width, f->o.height, f->o.smooth, rgb);
        if (!name_picture(f->o.headless, i, path, sizeof path) ||
            !stbi_write_png(path, f->o.width, f->o.height, 3, rgb, 3 * f->o.width))
            fail(f, "cannot write '%s'", f->o.headless);
        else if (i == 0)
            printf("trees %d\npieces %u\nclouds %u\ndraws %d\n", f->forest->tree_count,
                   f->forest->node_count, f->forest->cluster_count, f->draws);
    }
    if (!f->failed[0]) printf("seconds %.3f\n", (seconds() - start) / f->o.frames);
    free(pixels);
    free(rgb);
    if (!f->failed[0] && glGetError() != GL_NO_ERROR) fail(f, "OpenGL reports an error");
    return !f->failed[0];
}

/* ---- the window ------------------------------------------------------------------------------- */

#ifdef FOREST_WINDOW
/* 0: the window is to be closed */
static int handle(forest_gl *f, const SDL_Event *e, int *is_still) {
    float *orbit = f->o.orbit;
    if (e->type == SDL_QUIT) return 0;
    if (e->type == SDL_MOUSEWHEEL) orbit[2] *= powf(0.9f, (float)e->wheel.y);
    if (e->type == SDL_MOUSEMOTION && (e->motion.state & SDL_BUTTON_LMASK)) {
        orbit[0] -= 0.3f * (float)e->motion.xrel;
        orbit[1] = txm_clampf(orbit[1] + 0.3f * (float)e->motion.yrel, -5, 89);
    } else if (e->type == SDL_MOUSEMOTION && (e->motion.state & SDL_BUTTON_RMASK)) {
        const float step = 0.0015f * orbit[2];
        for (int k = 0; k < 3; k++)
            f->o.at[k] += step * (f->frame.up[k] * (float)e->motion.yrel -
                                  f->frame.right[k] * (float)e->motion.xrel);
    } else if (e->type == SDL_KEYDOWN) {
        const SDL_Keycode key = e->key.keysym.sym;
        if (key == SDLK_ESCAPE) return 0;
        if (key == SDLK_w) f->o.is_wire = !f->o.is_wire;
        if (key == SDLK_l) f->o.is_bare = !f->o.is_bare;
        if (key == SDLK_SPACE) *is_still = !*is_still;
    }
    return 1;
}

static void run_window(forest_gl *f, const char *program) {
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MAJOR_VERSION, 4);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_MINOR_VERSION, 3);
    SDL_GL_SetAttribute(SDL_GL_CONTEXT_PROFILE_MASK, SDL_GL_CONTEXT_PROFILE_CORE);
    SDL_GL_SetAttribute(SDL_GL_DEPTH_SIZE, 24);
    SDL_GL_SetAttribute(SDL_GL_MULTISAMPLEBUFFERS, 1);
    SDL_GL_SetAttribute(SDL_GL_MULTISAMPLESAMPLES, 4);
    SDL_Window *window = NULL;
    SDL_GLContext context = NULL;
    if (SDL_Init(SDL_INIT_VIDEO) != 0 ||
        !(window = SDL_CreateWindow("forest_gl", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                                    f->o.width, f->o.height,
                                    SDL_WINDOW_OPENGL | SDL_WINDOW_RESIZABLE)) ||
        !(context = SDL_GL_CreateContext(window)))
        fail(f, "%s", SDL_GetError());
    else prepare(f, program);
    if (!f->failed[0]) SDL_GL_SetSwapInterval(1);
    Uint64 before = SDL_GetPerformanceCounter();
    int is_open = !f->failed[0], is_still = 0, shown = 0;
    while (is_open && !f->failed[0]) {
        SDL_Event e;
        int width, height;
        while (is_open && SDL_PollEvent(&e)) is_open = handle(f, &e, &is_still);
        const Uint64 now = SDL_GetPerformanceCounter();
        const double step = (double)(now - before) / (double)SDL_GetPerformanceFrequency();
        before = now;
        if (!is_still && !blow(f, f->now + (step < 0.2 ? step : 0.2))) break;
        upload_bones(f);
        SDL_GL_GetDrawableSize(window, &width, &height);
        draw_frame(f, 0, width, height);
        SDL_GL_SwapWindow(window);
        if (++shown % 16 == 0) {
            char title[120];
            snprintf(title, sizeof title, "forest_gl: %d trees, %u pieces, %d draw calls, %.1f ms",
                     f->forest->tree_count, f->forest->node_count, f->draws, 1e3 * step);
            SDL_SetWindowTitle(window, title);
        }
    }
    if (context) SDL_GL_DeleteContext(context);
    if (window) SDL_DestroyWindow(window);
    SDL_Quit();
}
#endif

/* ---- main -------------------------------------------------------------------------------------- */

/* up to `count` numbers parted by `separator`; returns how many there are, 0 if there is anything else */
static int read_numbers(const char *text, char separator, float *numbers, int count) {
    int n = 0;
    for (; n < count; n++) {
        char *end;
        numbers[n] = strtof(text, &end);
        if (end == text || !(fabsf(numbers[n]) <= 1e9f)) return 0;
        text = end + (*end == separator);
        if (*end == 0) return n + 1;
        if (*end != separator) return 0;
    }
    return 0;
}

/* One option and its value; returns how many words it took, 0: it is wrong. */
static int read_option(options *o, const char *name, const char *value) {
    float v[3] = {0, 0, 0};
    if (strcmp(name, "--bare") == 0) return o->is_bare = 1;
    if (strcmp(name, "--wire") == 0) return o->is_wire = 1;
    if (!value) return 0;
    if (strcmp(name, "--species") == 0) o->species = value;
    else if (strcmp(name, "--bark") == 0) o->bark = value;
    else if (strcmp(name, "--leaf") == 0) o->leaf = value;
    else if (strcmp(name, "--shaders") == 0) o->shaders = value;
    else if (strcmp(name, "--headless") == 0) o->headless = value;
    else if (strcmp(name, "--seed") == 0) o->seed = strtoull(value, NULL, 10);
    else if (strcmp(name, "--orbit") == 0) {
        if (read_numbers(value, ',', o->orbit, 3) < 2) return 0;
    } else if (strcmp(name, "--at") == 0) {
        o->has_at = 1;
        if (read_numbers(value, ',', o->at, 3) != 3) return 0;
    } else if (strcmp(name, "--size") == 0) {
        if (read_numbers(value, 'x', v, 2) != 2) return 0;
        o->width = (int)v[0];
        o->height = (int)v[1];
    } else {
        if (read_numbers(value, ',', v, 1) != 1) return 0;
        if (strcmp(name, "--count") == 0) o->count = (int)v[0];
        else if (strcmp(name, "--pieces") == 0) o->pieces = (int)v[0];
        else if (strcmp(name, "--frames") == 0) o->frames = (int)v[0];
        else if (strcmp(name, "--smooth") == 0) o->smooth = (int)v[0];
        else if (strcmp(name, "--time") == 0) o->time = (double)v[0];
        else if (strcmp(name, "--wind") == 0) o->wind = v[0];
        else if (strcmp(name, "--level") == 0) o->level = v[0];
        else if (strcmp(name, "--half") == 0) o->half = v[0];
        else return 0;
    }
    return 2;
}

static options defaults(void) {
    options o;
    memset(&o, 0, sizeof o);
    o.species = "oak";
    o.count = o.frames = 1;
    o.seed = 1;
    o.smooth = 2;
    o.width = 960;
    o.height = 720;
    o.wind = 4;
    o.level = 6;
    o.half = 12;
    o.orbit[1] = 5;
    return o;
}

static int is_sound(const options *o) {
    return o->count >= 1 && o->count <= 1000000 && o->frames >= 1 && o->frames <= 100000 &&
           o->width >= 16 && o->width <= 8192 && o->height >= 16 && o->height <= 8192 &&
           o->smooth >= 1 && o->smooth <= 4 && o->level >= 1 && o->level <= 64 && o->half > 0 &&
           (o->frames == 1 || !o->headless || strchr(o->headless, '%'));
}

static void close_forest(forest_gl *f) {
    for (int s = 0; s < MAX_SPECIES; s++) {
        free(f->sheets[s].pixels);
        free(f->leaves[s].pixels);
    }
    free(f->bones);
    free(f->sway);
    treepieces_forest_free(f->forest);
    treepieces_kit_free(f->kit);
    if (f->display != EGL_NO_DISPLAY) eglTerminate(f->display);
}

int main(int argc, char **argv) {
    static forest_gl f;
    int step = 1;
    f.o = defaults();
    for (int i = 1; i < argc && step; i += step)
        step = read_option(&f.o, argv[i], i + 1 < argc ? argv[i + 1] : NULL);
    if (!step || !is_sound(&f.o)) {
        fprintf(stderr,
                "usage: forest_gl [--species NAME|FILE,...] [--count N] [--seed N] [--pieces N]\n"
                "  [--bare] [--bark DIR|SHEET.png] [--leaf PNG] [--time T] [--wind SPEED]\n"
                "  [--level MAX] [--half METRES] [--wire] [--orbit AZIMUTH,ELEVATION,DISTANCE]\n"
                "  [--at X,Y,Z] [--size WxH] [--shaders DIR]\n"
                "  [--headless OUT.png [--frames N, with %%d in OUT] [--smooth N]]\n");
        return 2;
    }
    if (read_species(&f) && grow(&f) && make_pictures(&f)) {
        choose_view(&f);
        if (f.o.headless) {
            if (open_headless(&f) && prepare(&f, argv[0])) render_pictures(&f);
        } else {
#ifdef FOREST_WINDOW
            run_window(&f, argv[0]);
#else
            fail(&f, "built without a window; --headless OUT.png draws a picture");
#endif
        }
    }
    if (f.failed[0]) fprintf(stderr, "forest_gl: %s\n", f.failed);
    close_forest(&f);
    return f.failed[0] != 0;
}
