#ifndef TEXTILES_SET_H
#define TEXTILES_SET_H

#include "config.h"

/* ---- private types ---------------------------------------------------------------------- */

/* One map of all tiles: tile by tile side x side texels. */
typedef struct txt_map {
    int channels;
    int has_alpha;   /* the last of 2 or 4 channels is alpha: the map is no data */
    txm_sample sample;
    size_t texel;    /* bytes of one texel                                     */
    uint8_t *pixels; /* count * side * side * texel bytes; aligned for sample  */
} txt_map;

struct textiles_set {
    txm_arena arena; /* holds the set itself and all it points to                                 */
    textiles_kind kind;
    int size, side; /* pixels a side; texels stored a row: size, of triangles size + 1           */
    int colors, variants, reduced;
    int symbols;    /* digits of a code: colors, of triangles 2 colors                           */
    int complete;   /* every code has a tile (triangles: every acyclic one)                       */
    int count, map_count;
    textiles_tile *tiles;
    int32_t *lookup; /* by code: tile of variant 0 * 4 + rotation, or -1; see txt_code            */
    txt_map maps[TEXTILES_MAX_MAPS];
    int32_t *source; /* count * side * side texel numbers in the sheet, or NULL if imported       */
    struct {         /* exemplars as the texel numbers count them, one after the other            */
        int32_t first;
        int width, height; /* texels; of triangles rows are sqrt(3) / 2 pixels apart              */
    } sheets[TEXTILES_MAX_EXEMPLARS];
    int exemplar_count;
};

/* Colours as digits of one number: squares 4 digits edges[0] first, triangles 3 symbols
   2 color + (direction < 0). The number of codes is txt_code_count. */
static int txt_symbol(const textiles_set *s, const int edges[4], const int directions[3], int k) {
    return s->kind == TEXTILES_TRIANGLE ? 2 * edges[k] + (directions[k] < 0) : edges[k];
}

static int txt_code(const textiles_set *s, const int edges[4], const int directions[3]) {
    const int digits = s->kind == TEXTILES_TRIANGLE ? 3 : 4;
    int code = 0;
    for (int k = 0; k < digits; k++) {
        if (edges[k] < 0 || edges[k] >= s->colors) return -1;
        code = code * s->symbols + txt_symbol(s, edges, directions, k);
    }
    return code;
}

static int txt_code_count(const textiles_set *s) {
    const int n = s->symbols;
    return s->kind == TEXTILES_TRIANGLE ? n * n * n : n * n * n * n;
}

/* texel (x, y) of a tile, inside its side x side square */
static uint8_t *txt_texel(const textiles_set *s, int map, int tile, int x, int y) {
    const size_t side = (size_t)s->side;
    return s->maps[map].pixels +
           (((size_t)tile * side + (size_t)y) * side + (size_t)x) * s->maps[map].texel;
}

/* the exemplar of which a sheet holds the texel of this number */
static int txt_sheet_of(const textiles_set *s, int32_t texel) {
    int e = 0;
    while (e + 1 < s->exemplar_count && texel >= s->sheets[e + 1].first) e++;
    return e;
}

/* sample i of a row, as it is stored: not scaled to 0..1 */
static double txt_stored(txm_sample sample, const void *row, size_t i) {
    if (sample == TXM_F32) return (double)((const float *)row)[i];
    if (sample == TXM_U16) return ((const uint16_t *)row)[i];
    return ((const uint8_t *)row)[i];
}

static txm_status txt_cancelled(txm_env *env) {
    return txm_fail(env, TXM_CANCELLED, "cancelled");
}

/* ---- which tiles a set has ---------------------------------------------------------------- */

/* The checks of a description that made and imported sets have in common. */
static txm_status txt_check_kind(const textiles_desc *d, txm_env *env) {
    const int low = d->kind == TEXTILES_FRAME ? 1 : 2;
    const int least = d->kind == TEXTILES_TRIANGLE ? TEXTILES_MIN_TRIANGLE : TEXTILES_MIN_SIZE;
    if ((int)d->kind < TEXTILES_WANG || (int)d->kind > TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT, "kind is none of textiles_kind");
    if (d->size && (d->size < least || d->size > TEXTILES_MAX_SIZE))
        return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "size must be # to # pixels, or 0 for 128",
                                (uint64_t)least, TEXTILES_MAX_SIZE);
    if (d->colors && (d->colors < low || d->colors > TEXTILES_MAX_COLORS))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "colors must be 2 to 4 (of a frame set 1 to 4), or 0 for 2");
    if (d->variants < 0 || d->variants > TEXTILES_MAX_VARIANTS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "variants must be 1 to 16, or 0 for 1");
    if (d->reduced && d->kind != TEXTILES_WANG && d->kind != TEXTILES_TRIANGLE)
        return txm_fail(env, TXM_BAD_ARGUMENT, "only wang and triangle sets can be reduced");
    if ((d->classes || d->class_count) && d->kind != TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT, "classes are for frame sets; leave them NULL and 0");
    if (!d->classes != !d->class_count || d->class_count < 0 ||
        d->class_count > TEXTILES_MAX_CLASSES)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "give classes together with class_count, 1 to 64, or neither");
    const int colors = d->colors ? d->colors : 2;
    for (int k = 0; k < d->class_count; k++) {
        for (int i = 0; i < 4; i++) {
            if (d->classes[k][i] < 0 || d->classes[k][i] >= colors)
                return txm_fail(env, TXM_BAD_ARGUMENT, "classes: a color is not below colors");
        }
        for (int j = 0; j < k; j++) {
            if (memcmp(d->classes[j], d->classes[k], sizeof d->classes[k]) == 0)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "classes: two are the same; raise variants instead");
        }
    }
    return TXM_OK;
}

/* Append the variants of a tile; enter it in the table under its code and, of a triangle, under
   those of its rotations. With tiles NULL it only counts. */
static void txt_add_tile(textiles_set *s, const int edges[4], const int directions[3]) {
    const int rotations = s->kind == TEXTILES_TRIANGLE ? 3 : 1;
    if (s->tiles) {
        for (int v = 0; v < s->variants; v++) {
            textiles_tile *t = &s->tiles[s->count + v];
            for (int k = 0; k < 4; k++) t->edges[k] = edges[k];
            for (int k = 0; k < 3; k++) t->directions[k] = directions[k];
            t->variant = v;
        }
        for (int r = rotations - 1; r >= 0; r--) { /* side k here is side k + r of the tile */
            int e[4] = {edges[0], edges[1], edges[2], edges[3]}, d[3] = {0, 0, 0};
            for (int k = 0; k < 3 && rotations == 3; k++) {
                e[k] = edges[(k + r) % 3];
                d[k] = directions[(k + r) % 3];
            }
            s->lookup[txt_code(s, e, d)] = s->count * 4 + r;
        }
    }
    s->count += s->variants;
}

/* All triples of directed edges up to rotation, ((2 C)^3 + 4 C) / 3 of them; in a reduced set
   without those whose edges all have the same direction, 2 C^3. Each is listed under its smallest
   code. */
static void txt_list_triangles(textiles_set *s) {
    const int n = s->symbols;
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            for (int c = 0; c < n; c++) {
                const int code = (a * n + b) * n + c;
                if ((b * n + c) * n + a < code || (c * n + a) * n + b < code) continue;
                const int sum = (a & 1) + (b & 1) + (c & 1);
                if (s->reduced && (sum == 0 || sum == 3)) continue;
                const int edges[4] = {a / 2, b / 2, c / 2, 0};
                const int directions[3] = {a & 1 ? -1 : 1, b & 1 ? -1 : 1, c & 1 ? -1 : 1};
                txt_add_tile(s, edges, directions);
            }
        }
    }
}

/* Count the tiles (tiles NULL) or list them. */
static void txt_list_tiles(textiles_set *s, const textiles_desc *d) {
    const int c = s->colors, none[3] = {0, 0, 0};
    s->count = 0;
    if (s->kind == TEXTILES_TRIANGLE) {
        txt_list_triangles(s);
    } else if (s->kind == TEXTILES_FRAME) {
        for (int k = 0; k < (d->classes ? d->class_count : c); k++) {
            const int plain[4] = {0, k, 0, k};
            txt_add_tile(s, d->classes ? d->classes[k] : plain, none);
        }
    } else if (s->reduced) {
        /* (north, west) -> (east, south) is one to one for each of the two tiles, so that all
           colours are as frequent, and both tiles differ in both */
        for (int i = 0; i < 2 * c * c; i++) {
            const int north = i / (2 * c), west = i / 2 % c, j = i & 1;
            const int edges[4] = {north, (north + west + j) % c, (north + j) % c, west};
            txt_add_tile(s, edges, none);
        }
    } else {
        for (int i = 0; i < c * c * c * c; i++) {
            const int edges[4] = {i / (c * c * c), i / (c * c) % c, i / c % c, i % c};
            txt_add_tile(s, edges, none);
        }
    }
}

/* A set with its tiles listed and memory for their texels. Of maps only channels and sample are
   read, and what is alpha follows from the description. */
static txm_status txt_set_make(const textiles_desc *d, const txt_map *maps, int map_count,
                               int with_source, txm_env *env, textiles_set **out) {
    textiles_set head;
    memset(&head, 0, sizeof head);
    txm_arena_init(&head.arena, env);
    head.kind = d->kind;
    head.size = d->size ? d->size : 128;
    head.side = head.size + (d->kind == TEXTILES_TRIANGLE);
    head.colors = d->colors ? d->colors : 2;
    head.variants = d->variants ? d->variants : 1;
    head.reduced = d->reduced != 0;
    head.complete = d->kind == TEXTILES_TRIANGLE || (d->kind != TEXTILES_FRAME && !d->reduced);
    head.symbols = head.colors * (d->kind == TEXTILES_TRIANGLE ? 2 : 1);
    head.map_count = map_count;
    txt_list_tiles(&head, d);

    const size_t texels = (size_t)head.side * (size_t)head.side;
    if ((size_t)head.count > TEXTILES_MAX_PIXELS / texels)
        return txm_fail(env, TXM_TOO_LARGE,
                        "the set has more than TEXTILES_MAX_PIXELS pixels; fewer or smaller tiles");
    const size_t all = (size_t)head.count * texels, codes = (size_t)txt_code_count(&head);
    head.tiles =
        (textiles_tile *)txm_arena_alloc(&head.arena, (size_t)head.count, sizeof(textiles_tile));
    head.lookup = (int32_t *)txm_arena_alloc(&head.arena, codes, sizeof(int32_t));
    for (int m = 0; m < map_count; m++) {
        head.maps[m] = maps[m];
        head.maps[m].has_alpha = maps[m].channels % 2 == 0 && !(d->data_maps >> m & 1);
        head.maps[m].texel = (size_t)maps[m].channels * txm_sample_bytes(maps[m].sample);
        head.maps[m].pixels = (uint8_t *)txm_arena_zero(&head.arena, all, head.maps[m].texel);
    }
    if (with_source)
        head.source = (int32_t *)txm_arena_alloc(&head.arena, all, sizeof(int32_t));
    textiles_set *s = (textiles_set *)txm_arena_alloc(&head.arena, 1, sizeof *s);
    if (head.arena.failed) {
        txm_arena_free(&head.arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the tile set");
    }
    for (size_t i = 0; i < codes; i++) head.lookup[i] = -1;
    txt_list_tiles(&head, d);
    *s = head;
    *out = s;
    return TXM_OK;
}

/* May square u lie east of t, or (down) south of it? */
static int txt_joins(const textiles_set *s, int t, int u, int down) {
    const int *a = s->tiles[t].edges, *b = s->tiles[u].edges;
    if (s->kind == TEXTILES_CORNER)
        return down ? a[3] == b[0] && a[2] == b[1] : a[1] == b[0] && a[2] == b[3];
    return down ? a[2] == b[0] : a[1] == b[3];
}

/* Are all samples finite? Of a triangle's square only the triangle counts. */
static int txt_tile_is_finite(const txm_image *im, textiles_kind kind) {
    for (int y = 0; y < im->height; y++) {
        txm_image row = *im;
        row.pixels = txm_image_row(im, y);
        row.height = 1;
        if (kind == TEXTILES_TRIANGLE) row.width = im->width - y;
        if (!txm_image_is_finite(&row)) return 0;
    }
    return 1;
}

/* Replace the hidden colours of all tiles of imported squares by those of visible neighbours. */
static txm_status txt_bleed_tiles(const textiles_set *s, txm_env *env) {
    txm_status status = TXM_OK;
    for (int i = 0; i < s->count && s->kind != TEXTILES_TRIANGLE; i++) {
        for (int m = 0; m < s->map_count && status == TXM_OK; m++) {
            const txm_image tile = {txt_texel(s, m, i, 0, 0), s->side, s->side,
                                    s->maps[m].channels, s->maps[m].sample, 0};
            if (s->maps[m].has_alpha) status = txm_image_bleed(&tile, 0, env);
        }
    }
    return status;
}

/* ---- public: sets ------------------------------------------------------------------------- */

TEXTILES_API void textiles_set_free(textiles_set *set) {
    if (!set) return;
    txm_arena arena = set->arena; /* the set lies in a block of its own */
    txm_arena_free(&arena);
}

TEXTILES_API txm_status textiles_import(const textiles_desc *desc, const txm_image *tiles,
                                        int tile_count, int map_count, txm_env *env,
                                        textiles_set **out) {
    txt_map maps[TEXTILES_MAX_MAPS];
    textiles_set *s = NULL;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc || !tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "desc or tiles is NULL");
    if (map_count < 1 || map_count > TEXTILES_MAX_MAPS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map_count must be 1 to 8");
    if (tile_count < 1) return txm_fail(env, TXM_BAD_ARGUMENT, "tile_count must be 1 or more");
    txm_status status = txt_check_kind(desc, env);
    if (status != TXM_OK) return status;

    const int side = (desc->size ? desc->size : 128) + (desc->kind == TEXTILES_TRIANGLE);
    memset(maps, 0, sizeof maps);
    for (int m = 0; m < map_count; m++) {
        maps[m].channels = tiles[m].channels ? tiles[m].channels : 1;
        maps[m].sample = tiles[m].sample;
    }
    for (int i = 0; i < tile_count; i++) {
        for (int m = 0; m < map_count; m++) {
            const txm_image *im = &tiles[(size_t)i * (size_t)map_count + (size_t)m];
            status = txm_image_check(im, "tiles", TEXTILES_MAX_PIXELS, env);
            if (status != TXM_OK) return status;
            if (im->width != side || im->height != side || im->sample != maps[m].sample ||
                txm_image_resolve(*im).channels != maps[m].channels)
                return txm_fail(env, TXM_BAD_ARGUMENT,
                                "tiles: all must have the size of the set and the same channels");
            if (!txt_tile_is_finite(im, desc->kind))
                return txm_fail(env, TXM_BAD_ARGUMENT, "tiles: a sample is not finite");
        }
    }
    status = txt_set_make(desc, maps, map_count, 0, env, &s);
    if (status != TXM_OK) return status;
    if (s->count != tile_count) {
        textiles_set_free(s);
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "tile_count is not the number of tiles that such a set has");
    }
    for (int i = 0; i < tile_count; i++) {
        for (int m = 0; m < map_count; m++) {
            const txm_image *im = &tiles[(size_t)i * (size_t)map_count + (size_t)m];
            for (int y = 0; y < side; y++)
                memcpy(txt_texel(s, m, i, 0, y), txm_image_row_const(im, y),
                       (size_t)side * s->maps[m].texel);
        }
    }
    status = txt_bleed_tiles(s, env);
    if (status != TXM_OK) textiles_set_free(s);
    else *out = s;
    return status;
}

TEXTILES_API textiles_kind textiles_kind_of(const textiles_set *set) {
    return set->kind;
}
TEXTILES_API int textiles_count(const textiles_set *set) {
    return set->count;
}
TEXTILES_API int textiles_size(const textiles_set *set) {
    return set->size;
}
TEXTILES_API int textiles_colors(const textiles_set *set) {
    return set->colors;
}
TEXTILES_API int textiles_variants(const textiles_set *set) {
    return set->variants;
}
TEXTILES_API int textiles_map_count(const textiles_set *set) {
    return set->map_count;
}
TEXTILES_API int textiles_channels(const textiles_set *set, int map) {
    return map >= 0 && map < set->map_count ? set->maps[map].channels : 0;
}

TEXTILES_API int textiles_tile_at(const textiles_set *set, int index, textiles_tile *tile) {
    if (index < 0 || index >= set->count) return 0;
    *tile = set->tiles[index];
    return 1;
}

TEXTILES_API int textiles_find(const textiles_set *set, const int edges[4], const int directions[3],
                               int *rotation) {
    if (!edges || (set->kind == TEXTILES_TRIANGLE && !directions)) return -1;
    const int code = txt_code(set, edges, directions);
    if (code < 0 || set->lookup[code] < 0) return -1;
    if (rotation) *rotation = set->lookup[code] & 3;
    return set->lookup[code] / 4;
}

TEXTILES_API int textiles_source(const textiles_set *set, int tile, int x, int y, float from[2]) {
    if (!set->source || tile < 0 || tile >= set->count || x < 0 || y < 0 || x >= set->side ||
        y >= set->side)
        return -1;
    const size_t side = (size_t)set->side;
    const int32_t t = set->source[((size_t)tile * side + (size_t)y) * side + (size_t)x];
    if (t < 0) return -1;
    const int e = txt_sheet_of(set, t), at = t - set->sheets[e].first, width = set->sheets[e].width;
    const int row = at / width, column = at % width;
    if (set->kind == TEXTILES_TRIANGLE) {
        from[0] = (float)column + (row & 1 ? 0.5f : 0.0f);
        from[1] = txm_float(row * 0.86602540378443864676);
    } else {
        from[0] = (float)column;
        from[1] = (float)row;
    }
    return e;
}

#endif /* TEXTILES_SET_H */
