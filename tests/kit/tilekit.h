/* tilekit.h - what the tests of tile sets share: exemplars, sets made of them, sets read back
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h, textiles.h and testkit.h. Most tests look at a few sets that are made once, in
   make_common. With TEXTILES_TEST_SHOW in the environment they print how well each set joins.  */
#ifndef TILEKIT_H
#define TILEKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "textiles.h"

#include "images.h"
#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

static inline void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.12g is not %.12g within %g", a, b, tolerance);
}

static inline void assert_between(double x, double low, double high) {
    if (!(x >= low && x <= high)) fail_msg("%.9g is not between %g and %g", x, low, high);
}

static inline void *need(size_t bytes) {
    void *p = calloc(1, bytes);
    if (!p) abort();
    return p;
}

static inline txm_image new_image(int width, int height, int channels, txm_sample sample) {
    const size_t n = (size_t)width * (size_t)height * (size_t)channels;
    return view(need(n * txm_sample_bytes(sample)), width, height, channels, sample);
}

/* ---- exemplars ---------------------------------------------------------------------------- */

/* Round blobs: random values seen through a disk, stretched. */
static inline int draw_blobs(int x, int y, int c) {
    int sum = 0, n = 0;
    for (int v = -3; v <= 3; v++) {
        for (int u = -3; u <= 3; u++) {
            const int weight = 12 - u * u - v * v;
            if (weight <= 0) continue;
            sum += weight * at_random(x + u, y + v, c);
            n += weight;
        }
    }
    return 128 + (sum / n - 128) * 3 + (at_random(x, y, c + 7) - 128) / 16;
}

/* Pebbles: the distance to the nearest of one random point per lattice square. */
static inline int draw_cells(int x, int y, int c) {
    const int spacing = 9;
    int best = 1 << 30, tone = 0;
    for (int j = y / spacing - 1; j <= y / spacing + 1; j++) {
        for (int i = x / spacing - 1; i <= x / spacing + 1; i++) {
            const int dx = i * spacing + at_random(i, j, 0) * spacing / 256 - x;
            const int dy = j * spacing + at_random(i, j, 1) * spacing / 256 - y;
            if (dx * dx + dy * dy < best) {
                best = dx * dx + dy * dy;
                tone = at_random(i, j, 2 + c);
            }
        }
    }
    return 200 - 3 * best + tone / 6 + at_random(x, y, 20 + c) / 16;
}

/* Stripes that bend. */
static inline int draw_stripes(int x, int y, int c) {
    const int bend = draw_blobs(x / 4, y / 4, 3) / 40, phase = (y + bend) % 10;
    return 60 + 25 * (phase < 5 ? phase : 10 - phase) + 10 * c + at_random(x, y, 9 + c) / 10;
}

typedef int drawing(int x, int y, int c);
static drawing *const drawings[] = {draw_blobs, draw_cells, draw_stripes};
enum { BLOBS, CELLS, STRIPES };

/* U8 picture of a drawing, shifted */
static inline txm_image draw(int which, int width, int height, int channels, int shift) {
    const txm_image im = new_image(width, height, channels, TXM_U8);
    uint8_t *to = (uint8_t *)im.pixels;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            for (int c = 0; c < channels; c++)
                *to++ = (uint8_t)txm_clampi(drawings[which](x + shift, y + 64, c), 0, 255);
        }
    }
    return im;
}

/* what the second and third map show where the first shows p */
static inline uint8_t second_map(const uint8_t *p, int c) {
    return (uint8_t)(c < 3 ? 255 - p[(c + 1) % 3] : 128 + p[0] / 2);
}
static inline float third_map(const uint8_t *p) {
    return (float)(p[0] * 3 + p[1] * 7 - p[2]) * 0.25f;
}

/* Three maps in register: RGB, RGBA and one float. */
static inline void draw_maps(int which, int width, int height, int shift, txm_image maps[3]) {
    maps[0] = draw(which, width, height, 3, shift);
    maps[1] = new_image(width, height, 4, TXM_U8);
    maps[2] = new_image(width, height, 1, TXM_F32);
    const uint8_t *p = (const uint8_t *)maps[0].pixels;
    for (int i = 0; i < width * height; i++, p += 3) {
        for (int c = 0; c < 4; c++) ((uint8_t *)maps[1].pixels)[4 * i + c] = second_map(p, c);
        ((float *)maps[2].pixels)[i] = third_map(p);
    }
}

/* ---- making ------------------------------------------------------------------------------- */

static inline textiles_desc desc_of(textiles_kind kind, const textiles_exemplar *exemplars, int count,
                                    int size) {
    textiles_desc d;
    memset(&d, 0, sizeof d);
    d.kind = kind;
    d.exemplars = exemplars;
    d.exemplar_count = count;
    d.size = size;
    return d;
}

static inline textiles_set *make_with(const textiles_desc *desc,
                               void (*parallel)(void *, int, void (*)(void *, int), void *)) {
    tk_progress progress = {0};
    txm_env env = tk_env(NULL, &progress);
    textiles_set *set = NULL;
    env.parallel_for = parallel;
    const txm_status status = textiles_make(desc, &env, &set);
    if (status != TXM_OK) fail_msg("make: %d, %s", status, env.message);
    assert_non_null(set);
    assert_int_equal(progress.errors, 0);
    assert_true(progress.calls > 3 && progress.last == 1.0f);
    return set;
}

static inline textiles_set *make(const textiles_desc *desc) {
    return make_with(desc, tk_parallel_threads);
}

/* A set read back: all pixels and where they come from. */
typedef struct readback {
    const textiles_set *set;
    textiles_kind kind;
    int size, side, count, colors, variants, maps;
    int types; /* bit m: map m is of floats; bit m + 8: of 16 bits */
    int channels[TEXTILES_MAX_MAPS];
    size_t texel[TEXTILES_MAX_MAPS];
    uint8_t *bytes[TEXTILES_MAX_MAPS]; /* as textiles_draw_tile gives them, tile by tile */
    textiles_tile *tiles;
    signed char *sheet; /* the exemplar, or -1 */
    float (*from)[2];
} readback;

static inline int is_inside(const readback *b, int x, int y) {
    return b->kind != TEXTILES_TRIANGLE || x + y <= b->size;
}

static inline size_t place_of(const readback *b, int t, int x, int y) {
    return ((size_t)t * (size_t)b->side + (size_t)y) * (size_t)b->side + (size_t)x;
}

static inline readback read_back(const textiles_set *set, int types) {
    readback b;
    memset(&b, 0, sizeof b);
    b.set = set;
    b.kind = textiles_kind_of(set);
    b.size = textiles_size(set);
    b.side = b.size + (b.kind == TEXTILES_TRIANGLE);
    b.count = textiles_count(set);
    b.colors = textiles_colors(set);
    b.variants = textiles_variants(set);
    b.maps = textiles_map_count(set);
    b.types = types;
    const size_t n = (size_t)b.count * (size_t)b.side * (size_t)b.side;
    b.tiles = (textiles_tile *)need((size_t)b.count * sizeof *b.tiles);
    b.sheet = (signed char *)need(n);
    b.from = (float(*)[2])need(n * sizeof *b.from);
    for (int m = 0; m < b.maps; m++) {
        const txm_sample sample = types >> m & 1         ? TXM_F32
                                  : types >> (m + 8) & 1 ? TXM_U16
                                                         : TXM_U8;
        b.channels[m] = textiles_channels(set, m);
        b.texel[m] = (size_t)b.channels[m] * txm_sample_bytes(sample);
        b.bytes[m] = (uint8_t *)need(n * b.texel[m]);
        for (int t = 0; t < b.count; t++) {
            txm_env env = {0};
            const txm_image out = view(b.bytes[m] + place_of(&b, t, 0, 0) * b.texel[m], b.side,
                                       b.side, b.channels[m], sample);
            const txm_status status = textiles_draw_tile(set, t, 0, m, &env, out);
            if (status != TXM_OK) fail_msg("draw_tile: %d, %s", status, env.message);
        }
    }
    for (int t = 0; t < b.count; t++) {
        assert_int_equal(textiles_tile_at(set, t, &b.tiles[t]), 1);
        for (int y = 0; y < b.side; y++) {
            for (int x = 0; x < b.side; x++) {
                const size_t p = place_of(&b, t, x, y);
                b.from[p][0] = b.from[p][1] = -1;
                b.sheet[p] = (signed char)textiles_source(set, t, x, y, b.from[p]);
            }
        }
    }
    return b;
}

static inline void free_readback(readback *b) {
    for (int m = 0; m < b->maps; m++) free(b->bytes[m]);
    free(b->tiles);
    free(b->sheet);
    free(b->from);
}

static const uint8_t *pixel(const readback *b, int m, size_t place) {
    return b->bytes[m] + place * b->texel[m];
}

static inline double sample_of(const readback *b, int m, size_t place, int c) {
    const void *p = pixel(b, m, place);
    if (b->types >> m & 1) return (double)((const float *)p)[c];
    if (b->types >> (m + 8) & 1) return ((const uint16_t *)p)[c];
    return ((const uint8_t *)p)[c];
}

static inline int same_source(const readback *b, size_t p, size_t q) {
    return b->sheet[p] == b->sheet[q] && memcmp(b->from[p], b->from[q], sizeof b->from[p]) == 0;
}

static inline int same_bytes(const readback *b, size_t p, size_t q) {
    for (int m = 0; m < b->maps; m++) {
        if (memcmp(pixel(b, m, p), pixel(b, m, q), b->texel[m]) != 0) return 0;
    }
    return 1;
}

/* Does q show the pixel of the exemplar at (dx, dy) from the one that p shows? */
static inline int is_next(const readback *b, size_t p, size_t q, int dx, int dy) {
    return b->sheet[p] >= 0 && b->sheet[p] == b->sheet[q] &&
           b->from[q][0] == b->from[p][0] + (float)dx && b->from[q][1] == b->from[p][1] + (float)dy;
}

/* One number for a set: pixels and, of a made one, sources. */
static inline uint64_t hash_of(const readback *b) {
    uint64_t h = 0;
    for (int t = 0; t < b->count; t++) {
        h = tk_hash(h, b->tiles[t].edges, sizeof b->tiles[t].edges);
        for (int y = 0; y < b->side; y++) {
            for (int x = 0; x < b->side; x++) {
                const size_t p = place_of(b, t, x, y);
                if (!is_inside(b, x, y)) continue;
                for (int m = 0; m < b->maps; m++) h = tk_hash(h, pixel(b, m, p), b->texel[m]);
                h = tk_hash(h, &b->sheet[p], 1);
                h = tk_hash(h, b->from[p], sizeof b->from[p]);
            }
        }
    }
    return h;
}

static inline uint64_t hash_and_free(textiles_set *set, int types) {
    readback b = read_back(set, types);
    const uint64_t h = hash_of(&b);
    free_readback(&b);
    textiles_set_free(set);
    return h;
}

/* texel number a of row r of side k; rows count from the joint (triangles: 0 is the edge itself) */
static inline size_t side_place(const readback *b, int t, int k, int a, int r) {
    const int n = b->size;
    int x, y;
    if (b->kind == TEXTILES_TRIANGLE) {
        x = k == 0 ? r : k == 1 ? a : n - a - r;
        y = k == 0 ? a : k == 1 ? n - a - r : r;
    } else {
        x = k == 1 ? n - 1 - r : k == 3 ? r : a;
        y = k == 0 ? r : k == 2 ? n - 1 - r : a;
    }
    return place_of(b, t, x, y);
}

/* what a side of a square matches by: its colour, of corner tiles those of both its ends */
static inline int side_key(const readback *b, int t, int k) {
    static const int ends[4][2] = {{0, 1}, {1, 2}, {3, 2}, {0, 3}};
    const int *e = b->tiles[t].edges;
    return b->kind == TEXTILES_CORNER ? e[ends[k][0]] * TEXTILES_MAX_COLORS + e[ends[k][1]] : e[k];
}

/* first tile whose side k matches by key; -1: none */
static inline int tile_with(const readback *b, int k, int key) {
    for (int t = 0; t < b->count; t++) {
        if (side_key(b, t, k) == key) return t;
    }
    return -1;
}

enum { KEYS = TEXTILES_MAX_COLORS * TEXTILES_MAX_COLORS };

/* ---- the sets that most tests look at ------------------------------------------------------ */

enum { SIZE = 40, EXEMPLAR = 100, KINDS = 4 };

static const int common_classes[][4] = {
    {0, 0, 0, 0}, {2, 1, 0, 1}, {0, 1, 2, 2}, {1, 2, 0, 0}, {2, 2, 1, 0}};

static txm_image common_maps[3];
static textiles_exemplar common_exemplar;
static textiles_set *common_sets[KINDS][2]; /* unrepaired, repaired */
static readback common[KINDS][2];

static inline textiles_desc common_desc(int kind) {
    textiles_desc d = desc_of((textiles_kind)kind, &common_exemplar, 1, SIZE);
    d.seed = 5;
    d.data_maps = 1 << 1; /* four quantities, none of them alpha */
    if (kind == TEXTILES_FRAME) {
        d.colors = 3;
        d.classes = common_classes;
        d.class_count = 5;
        d.variants = 3;
    }
    return d;
}

static inline void make_common_sets(int last) {
    draw_maps(BLOBS, EXEMPLAR, EXEMPLAR, 64, common_maps);
    common_exemplar.maps = common_maps;
    common_exemplar.map_count = 3;
    for (int k = 0; k < KINDS; k++) {
        textiles_desc d = common_desc(k);
        for (int r = 0; r <= last; r++) {
            d.repair = r ? TEXTILES_REPAIR_DEFAULT : TEXTILES_REPAIR_NONE;
            common_sets[k][r] = make(&d);
            common[k][r] = read_back(common_sets[k][r], 4);
        }
    }
}
static inline int make_common(void **state) {
    (void)state;
    make_common_sets(1);
    return 0;
}
/* Without repair, which takes longest: common[k][1] remains empty. */
static inline int make_common_unrepaired(void **state) {
    (void)state;
    make_common_sets(0);
    return 0;
}

static inline int free_common(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        for (int r = 0; r < 2; r++) {
            free_readback(&common[k][r]);
            textiles_set_free(common_sets[k][r]);
        }
    }
    for (int m = 0; m < 3; m++) free(common_maps[m].pixels);
    return 0;
}

/* ---- importing ------------------------------------------------------------------------------ */

/* Import count tiles of one map, each cut by cut() out of a picture. */
typedef void cut_tile(int tile, int side, const txm_image *from, txm_image *to);

static inline textiles_set *import_cut(const textiles_desc *d, int count, const txm_image *from,
                                       cut_tile *cut) {
    const int side = d->size + (d->kind == TEXTILES_TRIANGLE);
    txm_image *tiles = (txm_image *)need((size_t)count * sizeof *tiles);
    textiles_set *set = NULL;
    txm_env env = {0};
    for (int t = 0; t < count; t++) {
        tiles[t] = new_image(side, side, from->channels, from->sample);
        cut(t, side, from, &tiles[t]);
    }
    const txm_status status = textiles_import(d, tiles, count, 1, &env, &set);
    if (status != TXM_OK) fail_msg("import: %d, %s", status, env.message);
    for (int t = 0; t < count; t++) free(tiles[t].pixels);
    free(tiles);
    return set;
}

static inline void cut_gray(int tile, int side, const txm_image *from, txm_image *to) {
    (void)tile;
    (void)from;
    memset(to->pixels, 70, (size_t)side * (size_t)side);
}

/* ---- measuring ------------------------------------------------------------------------------ */

static inline double step_of(const readback *b, int m, size_t p, size_t q) {
    double sum = 0;
    for (int c = 0; c < b->channels[m]; c++)
        sum += fabs(sample_of(b, m, p, c) - sample_of(b, m, q, c));
    return sum;
}

typedef struct tally {
    double sum;
    int count;
} tally;

static inline double mean_of(tally t) {
    return t.sum / t.count;
}

/* rows from side k of a triangle: 0 on it */
static inline int row_from(const readback *b, int k, int x, int y) {
    return k == 0 ? x : k == 1 ? b->size - x - y : y;
}

static inline textiles_joints measure(const textiles_set *set, int map) {
    textiles_joints j;
    txm_env env = {0};
    memset(&j, 0xff, sizeof j);
    const txm_status status = textiles_measure(set, map, &env, &j);
    if (status != TXM_OK) fail_msg("measure: %d, %s", status, env.message);
    if (getenv("TEXTILES_TEST_SHOW"))
        printf("# kind %d, %d tiles of %d, map %d: mean %.3f, worst %.3f, least %.3f, %d pairs\n",
               (int)textiles_kind_of(set), textiles_count(set), textiles_size(set), map, j.mean,
               j.worst, j.least, j.pairs);
    return j;
}

#endif /* TILEKIT_H */
