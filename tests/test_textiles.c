/* test_textiles.c - tile sets: making, importing, looking into them, measuring their joints
   SPDX-License-Identifier: MIT OR Unlicense

   cc -std=c99 -I. -Itests tests/test_textiles.c -lcmocka -lpthread -lm

   Most tests look at a few sets that are made once, in make_common. With TEXTILES_TEST_SHOW in the
   environment they print how well each set joins.                                            */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define TEXTILES_MAX_PIXELS (1 << 22) /* so that too large ones are near */
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"

#include "testkit.h"

/* ---- helpers ---------------------------------------------------------------------------- */

static void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.12g is not %.12g within %g", a, b, tolerance);
}

static void assert_between(double x, double low, double high) {
    if (!(x >= low && x <= high)) fail_msg("%.9g is not between %g and %g", x, low, high);
}

static void *need(size_t bytes) {
    void *p = malloc(bytes);
    if (!p) abort();
    return p;
}

static txm_image view(void *pixels, int width, int height, int channels, txm_sample sample) {
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    return im;
}

static txm_image new_image(int width, int height, int channels, txm_sample sample) {
    const size_t n = (size_t)width * (size_t)height * (size_t)channels;
    return view(need(n * txm_sample_bytes(sample)), width, height, channels, sample);
}

/* ---- exemplars ---------------------------------------------------------------------------- */

static int at_random(int x, int y, int which) {
    const uint64_t place = (uint64_t)(uint32_t)x << 32 | (uint32_t)y;
    return (int)(txm_hash(place + 0x9e3779b97f4a7c15u * (uint64_t)(uint32_t)(which + 1)) >> 56);
}

/* Round blobs: random values seen through a disk, stretched. */
static int draw_blobs(int x, int y, int c) {
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
static int draw_cells(int x, int y, int c) {
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
static int draw_stripes(int x, int y, int c) {
    const int bend = draw_blobs(x / 4, y / 4, 3) / 40, phase = (y + bend) % 10;
    return 60 + 25 * (phase < 5 ? phase : 10 - phase) + 10 * c + at_random(x, y, 9 + c) / 10;
}

typedef int drawing(int x, int y, int c);
static drawing *const drawings[] = {draw_blobs, draw_cells, draw_stripes};
enum { BLOBS, CELLS, STRIPES };

/* U8 picture of a drawing, from that place of it on */
static txm_image draw(int which, int width, int height, int channels, int shift) {
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
static uint8_t second_map(const uint8_t *p, int c) {
    return (uint8_t)(c < 3 ? 255 - p[(c + 1) % 3] : 128 + p[0] / 2);
}
static float third_map(const uint8_t *p) {
    return (float)(p[0] * 3 + p[1] * 7 - p[2]) * 0.25f;
}

/* Three maps in register: RGB, RGBA and one float. */
static void draw_maps(int which, int width, int height, int shift, txm_image maps[3]) {
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

static textiles_desc desc_of(textiles_kind kind, const textiles_exemplar *exemplars, int count,
                             int size) {
    textiles_desc d;
    memset(&d, 0, sizeof d);
    d.kind = kind;
    d.exemplars = exemplars;
    d.exemplar_count = count;
    d.size = size;
    return d;
}

static textiles_set *make_with(const textiles_desc *desc,
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

static textiles_set *make(const textiles_desc *desc) {
    return make_with(desc, tk_parallel_threads);
}

/* A set read out: all pixels and where they come from. */
typedef struct book {
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
} book;

static int is_inside(const book *b, int x, int y) {
    return b->kind != TEXTILES_TRIANGLE || x + y <= b->size;
}

static size_t place_of(const book *b, int t, int x, int y) {
    return ((size_t)t * (size_t)b->side + (size_t)y) * (size_t)b->side + (size_t)x;
}

static book open_book(const textiles_set *set, int types) {
    book b;
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

static void close_book(book *b) {
    for (int m = 0; m < b->maps; m++) free(b->bytes[m]);
    free(b->tiles);
    free(b->sheet);
    free(b->from);
}

static const uint8_t *pixel(const book *b, int m, size_t place) {
    return b->bytes[m] + place * b->texel[m];
}

static double sample_of(const book *b, int m, size_t place, int c) {
    const void *p = pixel(b, m, place);
    if (b->types >> m & 1) return (double)((const float *)p)[c];
    if (b->types >> (m + 8) & 1) return ((const uint16_t *)p)[c];
    return ((const uint8_t *)p)[c];
}

static int same_source(const book *b, size_t p, size_t q) {
    return b->sheet[p] == b->sheet[q] && memcmp(b->from[p], b->from[q], sizeof b->from[p]) == 0;
}

static int same_bytes(const book *b, size_t p, size_t q) {
    for (int m = 0; m < b->maps; m++) {
        if (memcmp(pixel(b, m, p), pixel(b, m, q), b->texel[m]) != 0) return 0;
    }
    return 1;
}

/* is q's source the exemplar's pixel (dx, dy) from p's? */
static int is_next(const book *b, size_t p, size_t q, int dx, int dy) {
    return b->sheet[p] >= 0 && b->sheet[p] == b->sheet[q] &&
           b->from[q][0] == b->from[p][0] + (float)dx && b->from[q][1] == b->from[p][1] + (float)dy;
}

/* One number for a set: pixels and, of a made one, sources. */
static uint64_t hash_of(const book *b) {
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

static uint64_t hash_and_free(textiles_set *set, int types) {
    book b = open_book(set, types);
    const uint64_t h = hash_of(&b);
    close_book(&b);
    textiles_free(set);
    return h;
}

/* texel number a of row r of side k; rows count from the joint (triangles: 0 is the edge itself) */
static size_t side_place(const book *b, int t, int k, int a, int r) {
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
static int side_key(const book *b, int t, int k) {
    static const int ends[4][2] = {{0, 1}, {1, 2}, {3, 2}, {0, 3}};
    const int *e = b->tiles[t].edges;
    return b->kind == TEXTILES_CORNER ? e[ends[k][0]] * TEXTILES_MAX_COLORS + e[ends[k][1]] : e[k];
}

/* first tile whose side k matches by key; -1: none */
static int tile_with(const book *b, int k, int key) {
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
static book common[KINDS][2];

static textiles_desc common_desc(int kind) {
    textiles_desc d = desc_of((textiles_kind)kind, &common_exemplar, 1, SIZE);
    d.seed = 5;
    if (kind == TEXTILES_FRAME) {
        d.colors = 3;
        d.classes = common_classes;
        d.class_count = 5;
        d.variants = 3;
    }
    return d;
}

static int make_common(void **state) {
    (void)state;
    draw_maps(BLOBS, EXEMPLAR, EXEMPLAR, 64, common_maps);
    common_exemplar.maps = common_maps;
    common_exemplar.map_count = 3;
    for (int k = 0; k < KINDS; k++) {
        textiles_desc d = common_desc(k);
        for (int r = 0; r < 2; r++) {
            d.repair = r ? TEXTILES_REPAIR_DEFAULT : TEXTILES_REPAIR_NONE;
            common_sets[k][r] = make(&d);
            common[k][r] = open_book(common_sets[k][r], 4);
        }
    }
    return 0;
}

static int free_common(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        for (int r = 0; r < 2; r++) {
            close_book(&common[k][r]);
            textiles_free(common_sets[k][r]);
        }
    }
    for (int m = 0; m < 3; m++) free(common_maps[m].pixels);
    return 0;
}

/* ---- checks that every set must pass -------------------------------------------------------- */

/* Every texel has a source inside its exemplar. sizes: width and height of each. */
static void check_sources(const book *b, const int (*sizes)[2]) {
    for (int t = 0; t < b->count; t++) {
        for (int y = 0; y < b->side; y++) {
            for (int x = 0; x < b->side; x++) {
                const size_t p = place_of(b, t, x, y);
                const int e = b->sheet[p];
                if (!is_inside(b, x, y)) {
                    assert_int_equal(e, -1);
                    continue;
                }
                if (e < 0) fail_msg("tile %d: no source for (%d, %d)", t, x, y);
                const double u = (double)b->from[p][0], v = (double)b->from[p][1];
                if (!(u >= 0 && v >= 0 && u <= sizes[e][0] - 1 && v <= sizes[e][1] - 1))
                    fail_msg("tile %d: (%d, %d) comes from (%g, %g)", t, x, y, u, v);
                if (b->kind != TEXTILES_TRIANGLE) assert_true(u == floor(u) && v == floor(v));
            }
        }
    }
}

/* The first two rows at a side are the same in all tiles with its colour. */
static void check_square_borders(const book *b) {
    for (int k = 0; k < 4; k++) {
        for (int t = 0; t < b->count; t++) {
            const int first = tile_with(b, k, side_key(b, t, k));
            for (int i = 0; i < 2 * b->size; i++) {
                const size_t p = side_place(b, t, k, i / 2, i % 2);
                const size_t q = side_place(b, first, k, i / 2, i % 2);
                if (!same_source(b, p, q))
                    fail_msg("tiles %d, %d, side %d: sources differ at %d, row %d", first, t, k,
                             i / 2, i % 2);
                if (!same_bytes(b, p, q))
                    fail_msg("tiles %d, %d, side %d: bytes differ at %d, row %d", first, t, k, i / 2,
                             i % 2);
            }
        }
    }
}

/* The exemplar goes on across the joints and along them, but for a place per cut and row. */
static void check_square_joints(const book *b, int segments) {
    const int n = b->size, zone = n / 4 < 12 ? n / 4 : 12;
    int joints = 0;
    for (int axis = 0; axis < 2; axis++) { /* 0: south over north, 1: east beside west */
        for (int key = 0; key < KEYS; key++) {
            const int k[2] = {axis ? 1 : 2, axis ? 3 : 0};
            const int t[2] = {tile_with(b, k[0], key), tile_with(b, k[1], key)};
            if (t[0] < 0 || t[1] < 0) continue;
            joints++;
            size_t line[4], last[4] = {0, 0, 0, 0};
            int breaks[3] = {0, 0, 0}, along[4] = {0, 0, 0, 0};
            for (int a = 0; a < n; a++) {
                for (int l = 0; l < 4; l++)
                    line[l] = side_place(b, t[l / 2], k[l / 2], a, l < 2 ? 1 - l : l - 2);
                for (int l = 0; l < 3; l++) {
                    if (is_next(b, line[l], line[l + 1], axis, !axis)) continue;
                    breaks[l]++;
                    if (segments == 1 && a >= zone && a < n - zone)
                        fail_msg("key %d, axis %d: a break across at %d", key, axis, a);
                }
                for (int l = 0; l < 4 && a; l++)
                    along[l] += !is_next(b, last[l], line[l], !axis, axis);
                memcpy(last, line, sizeof last);
            }
            for (int l = 0; l < 3; l++) assert_true(breaks[l] <= segments + 1);
            for (int l = 0; l < 4; l++) assert_true(along[l] <= segments + 1);
        }
    }
    assert_true(joints > 0);
}

/* Around a vertex four tiles show one piece of exemplar, always the same for its colour. */
static void check_square_corners(const book *b) {
    const int n = b->size;
    for (int color = 0; color < b->colors; color++) {
        size_t vertex = (size_t)-1;
        for (int t = 0; t < b->count; t++) {
            for (int c = 0; c < 4; c++) { /* nw, ne, se, sw */
                if (b->kind == TEXTILES_CORNER && b->tiles[t].edges[c] != color) continue;
                const int right = c == 1 || c == 2, low = c >= 2;
                if (vertex == (size_t)-1 && c == 0) vertex = place_of(b, t, 0, 0);
                if (vertex == (size_t)-1) continue; /* the first tile is 0 0 0 0; of others below */
                for (int i = 0; i < 4; i++) {
                    const int dx = right ? -1 - i % 2 : i % 2, dy = low ? -1 - i / 2 : i / 2;
                    const size_t p = place_of(b, t, (n + dx) % n, (n + dy) % n);
                    if (!is_next(b, vertex, p, dx, dy))
                        fail_msg("tile %d, corner %d: not what other tiles show there", t, c);
                }
            }
        }
        assert_true(vertex != (size_t)-1);
    }
}

/* Edges of different colours show different places. */
static void check_edges_differ(const book *b) {
    const int triangle = b->kind == TEXTILES_TRIANGLE;
    for (int k = 0; k < (triangle ? 3 : 4); k++) {
        for (int one = 0; one < KEYS; one++) {
            for (int two = 0; two < one; two++) {
                const int s = tile_with(b, k, one), t = tile_with(b, k, two);
                int same = 0;
                if (s < 0 || t < 0) continue;
                if (triangle && b->tiles[s].directions[k] != b->tiles[t].directions[k]) continue;
                for (int a = 12; a < b->size - 12; a++)
                    same += same_source(b, side_place(b, s, k, a, 0), side_place(b, t, k, a, 0));
                assert_true(b->size <= 24 || same * 8 <= b->size - 24);
            }
        }
    }
}

/* Edge texels are the same whichever side and tile they are seen from, vertices everywhere; the rows
   beside an edge are the same in all tiles that see it from the same side. */
static void check_triangle_borders(const book *b) {
    const int n = b->size;
    int first[TEXTILES_MAX_COLORS][2][2]; /* color, direction -> tile, side */
    memset(first, -1, sizeof first);
    for (int t = 0; t < b->count; t++) {
        for (int k = 0; k < 3; k++) {
            const int color = b->tiles[t].edges[k], with = b->tiles[t].directions[k] > 0;
            if (first[color][with][0] < 0) {
                first[color][with][0] = t;
                first[color][with][1] = k;
            }
            for (int end = 0; end < 2; end++) {
                const size_t p = side_place(b, t, k, end * n, 0), q = place_of(b, 0, 0, 0);
                assert_true(same_source(b, p, q) && same_bytes(b, p, q));
            }
            for (int d = 0; d < 2; d++) {
                const int s = first[color][d][0], j = first[color][d][1];
                if (s < 0) continue;
                for (int a = 0; a <= n; a++) {
                    const size_t p = side_place(b, t, k, a, 0);
                    const size_t q = side_place(b, s, j, d == with ? a : n - a, 0);
                    if (!same_source(b, p, q) || !same_bytes(b, p, q))
                        fail_msg("tile %d side %d, tile %d side %d: texel %d differs", t, k, s, j, a);
                }
                for (int a = 8; a <= n - 8 - 2 && d == with; a++) {
                    for (int r = 1; r <= 2; r++) {
                        const size_t p = side_place(b, t, k, a, r), q = side_place(b, s, j, a, r);
                        if (!same_source(b, p, q) || !same_bytes(b, p, q))
                            fail_msg("tiles %d, %d: row %d differs at %d", t, s, r, a);
                    }
                }
            }
        }
    }
}

/* The rows on both sides of an edge lie in the exemplar on both sides of what the edge shows. */
static void check_triangle_joints(const book *b, int segments) {
    const int n = b->size;
    int joints = 0;
    for (int color = 0; color < b->colors; color++) {
        int at[2][2] = {{-1, -1}, {-1, -1}}, breaks = 0, places = 0;
        for (int t = 0; t < b->count; t++) {
            for (int k = 0; k < 3; k++) {
                if (b->tiles[t].edges[k] != color) continue;
                at[b->tiles[t].directions[k] > 0][0] = t;
                at[b->tiles[t].directions[k] > 0][1] = k;
            }
        }
        if (at[0][0] < 0 || at[1][0] < 0) continue;
        joints++;
        for (int a = 8; a < n - 8; a++) {
            const size_t p = side_place(b, at[1][0], at[1][1], a, 0);
            const size_t q = side_place(b, at[1][0], at[1][1], a + 1, 0);
            const size_t side[2] = {side_place(b, at[1][0], at[1][1], a, 1),
                                    side_place(b, at[0][0], at[0][1], n - a - 1, 1)};
            const double ex = (double)b->from[q][0] - (double)b->from[p][0];
            const double ey = (double)b->from[q][1] - (double)b->from[p][1];
            double turn[2];
            int fine = b->sheet[p] == b->sheet[q] && fabs(ex * ex + ey * ey - 1) < 1e-3;
            for (int i = 0; i < 2; i++) {
                const double x = (double)b->from[side[i]][0] - (double)b->from[p][0];
                const double y = (double)b->from[side[i]][1] - (double)b->from[p][1];
                turn[i] = ex * y - ey * x; /* sin of the angle from the edge: 60 degrees */
                fine = fine && b->sheet[side[i]] == b->sheet[p] && fabs(x * x + y * y - 1) < 1e-3 &&
                       fabs(ex * x + ey * y - 0.5) < 1e-3;
            }
            fine = fine && turn[0] * turn[1] < 0;
            breaks += !fine;
            places++;
        }
        if (segments == 1) assert_int_equal(breaks, 0);
        assert_true(breaks <= 6 * (segments - 1));
        assert_true(places > n / 3);
    }
    assert_true(joints > 0);
}

static void check_set(const book *b, int segments) {
    if (b->kind == TEXTILES_TRIANGLE) {
        check_triangle_borders(b);
        check_triangle_joints(b, segments);
    } else {
        check_square_borders(b);
        check_square_joints(b, segments);
        check_square_corners(b);
    }
}

/* ---- measuring by another route -------------------------------------------------------------- */

static double step_of(const book *b, int m, size_t p, size_t q) {
    double sum = 0;
    for (int c = 0; c < b->channels[m]; c++)
        sum += fabs(sample_of(b, m, p, c) - sample_of(b, m, q, c));
    return sum;
}

typedef struct tally {
    double sum;
    int count;
} tally;

static double mean_of(tally t) {
    return t.sum / t.count;
}

/* rows from side k of a triangle: 0 on it */
static int row_from(const book *b, int k, int x, int y) {
    return k == 0 ? x : k == 1 ? b->size - x - y : y;
}

/* all pairs of neighbours inside a tile: those across the joint that it has on side k, and all that
   count as usual there */
static void tally_tile(const book *b, int m, int t, int k, tally *joint, tally *all) {
    static const int dx[3] = {1, 0, 1}, dy[3] = {0, 1, -1};
    const int triangle = b->kind == TEXTILES_TRIANGLE;
    for (int y = 0; y < b->side; y++) {
        for (int x = 0; x < b->side; x++) {
            for (int d = 0; d < 3; d++) {
                const int u = x + dx[d], v = y + dy[d];
                if (triangle ? 0 : d != (k & 1 ? 0 : 1)) continue;
                if (u >= b->side || v >= b->side || v < 0) continue;
                if (!is_inside(b, x, y) || !is_inside(b, u, v)) continue;
                const double step = step_of(b, m, place_of(b, t, x, y), place_of(b, t, u, v));
                all->sum += step;
                all->count++;
                if (triangle && row_from(b, k, x, y) + row_from(b, k, u, v) == 1) {
                    joint->sum += step;
                    joint->count++;
                }
            }
        }
    }
}

static textiles_joints measure_again(const book *b, int m) {
    textiles_joints j = {0, 0, 1e300, 0, 0};
    const int triangle = b->kind == TEXTILES_TRIANGLE, sides = triangle ? 3 : 4;
    tally(*joint)[4] = (tally(*)[4])need((size_t)b->count * sizeof *joint);
    tally(*all)[4] = (tally(*)[4])need((size_t)b->count * sizeof *all);
    double steps = 0, usual = 0;
    memset(joint, 0, (size_t)b->count * sizeof *joint);
    memset(all, 0, (size_t)b->count * sizeof *all);
    for (int t = 0; t < b->count; t++) {
        for (int k = 0; k < sides; k++) tally_tile(b, m, t, k, &joint[t][k], &all[t][k]);
    }
    for (int s = 0; s < b->count; s++) {
        for (int t = 0; t < b->count; t++) {
            for (int k = 0; k < 3; k++) {
                for (int l = 0; l < sides; l++) {
                    tally step = {0, 0};
                    if (triangle) {
                        if (b->tiles[s].edges[k] != b->tiles[t].edges[l] ||
                            b->tiles[s].directions[k] + b->tiles[t].directions[l] != 0)
                            continue;
                        step.sum = joint[s][k].sum + joint[t][l].sum;
                        step.count = joint[s][k].count + joint[t][l].count;
                    } else { /* east to west, south to north */
                        if (k == 0 || l != (k + 2) % 4 || side_key(b, s, k) != side_key(b, t, l))
                            continue;
                        for (int a = 0; a < b->size; a++)
                            step.sum += step_of(b, m, side_place(b, s, k, a, 0),
                                                side_place(b, t, l, a, 0));
                        step.count = b->size;
                    }
                    const double inside = (mean_of(all[s][k]) + mean_of(all[t][l])) / 2;
                    const double ratio = mean_of(step) / inside;
                    j.mean += ratio;
                    j.worst = fmax(j.worst, ratio);
                    j.least = fmin(j.least, ratio);
                    steps += mean_of(step);
                    usual += inside;
                    j.pairs++;
                }
            }
        }
    }
    free(joint);
    free(all);
    j.mean /= j.pairs;
    j.overall = steps / usual;
    return j;
}

static textiles_joints measure(const textiles_set *set, int map) {
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

static void check_measure(const book *b, int m) {
    const textiles_joints j = measure(b->set, m), again = measure_again(b, m);
    assert_int_equal(j.pairs, again.pairs);
    assert_near(j.mean, again.mean, 1e-9 * again.mean);
    assert_near(j.worst, again.worst, 1e-9 * again.worst);
    assert_near(j.least, again.least, 1e-9 * again.least);
    assert_near(j.overall, again.overall, 1e-9 * again.overall);
}

/* ---- importing ------------------------------------------------------------------------------ */

/* Import count tiles of one map, each cut by cut() out of a picture. */
typedef void cut_tile(int tile, int side, const txm_image *from, txm_image *to);

static textiles_set *import_cut(const textiles_desc *d, int count, const txm_image *from,
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

static void copy_from(const txm_image *from, int x, int y, txm_image *to) {
    const size_t pixel = (size_t)from->channels * txm_sample_bytes(from->sample);
    for (int j = 0; j < to->height; j++) {
        for (int i = 0; i < to->width; i++)
            memcpy((char *)txm_image_row(to, j) + (size_t)i * pixel,
                   (const char *)txm_image_row_const(from, (y + j) % from->height) +
                       (size_t)((x + i) % from->width) * pixel, pixel);
    }
}

static void cut_anywhere(int tile, int side, const txm_image *from, txm_image *to) {
    copy_from(from, at_random(tile, side, 50) * (from->width - side) / 256,
              at_random(tile, side, 51) * (from->height - side) / 256, to);
}

static void cut_the_same(int tile, int side, const txm_image *from, txm_image *to) {
    (void)tile;
    (void)side;
    copy_from(from, 0, 0, to);
}

static void cut_flat(int tile, int side, const txm_image *from, txm_image *to) {
    (void)from;
    memset(to->pixels, tile ? 90 : 70, (size_t)side * (size_t)side);
}

static void cut_gray(int tile, int side, const txm_image *from, txm_image *to) {
    (void)tile;
    (void)from;
    memset(to->pixels, 70, (size_t)side * (size_t)side);
}

/* ---- tests: listing ------------------------------------------------------------------------- */

static textiles_set *import_plain(textiles_kind kind, int colors, int variants, int reduced,
                                  int count) {
    uint8_t one = 0;
    const txm_image from = view(&one, 1, 1, 1, TXM_U8);
    textiles_desc d = desc_of(kind, NULL, 0, 32);
    d.colors = colors;
    d.variants = variants;
    d.reduced = reduced;
    return import_cut(&d, count, &from, cut_gray);
}

static void check_find(const textiles_set *set, const int edges[4], const int directions[3],
                       int tile, int rotation) {
    int r = -7;
    assert_int_equal(textiles_find(set, edges, directions, &r), tile);
    assert_int_equal(r, tile < 0 ? -7 : rotation);
    assert_int_equal(textiles_find(set, edges, directions, NULL), tile);
}

/* Tiles of equal colours follow each other, variants in order; find gives the first. */
static void check_variants(const textiles_set *set, int variants) {
    for (int t = 0; t < textiles_count(set); t++) {
        textiles_tile tile, first;
        assert_int_equal(textiles_tile_at(set, t, &tile), 1);
        assert_int_equal(textiles_tile_at(set, t - t % variants, &first), 1);
        assert_int_equal(tile.variant, t % variants);
        assert_memory_equal(tile.edges, first.edges, sizeof tile.edges);
        assert_memory_equal(tile.directions, first.directions, sizeof tile.directions);
        check_find(set, tile.edges, tile.directions, t - t % variants, 0);
    }
}

static void test_list_squares(void **state) {
    (void)state;
    for (int colors = 2; colors <= 4; colors++) {
        for (int variants = 1; variants <= 3; variants += 2) {
            const int c4 = colors * colors * colors * colors;
            const textiles_kind kind = variants == 1 ? TEXTILES_WANG : TEXTILES_CORNER;
            textiles_set *set = import_plain(kind, colors, variants, 0, c4 * variants);
            assert_int_equal(textiles_kind_of(set), kind);
            assert_int_equal(textiles_count(set), c4 * variants);
            assert_int_equal(textiles_size(set), 32);
            assert_int_equal(textiles_colors(set), colors);
            assert_int_equal(textiles_variants(set), variants);
            assert_int_equal(textiles_map_count(set), 1);
            assert_int_equal(textiles_channels(set, 0), 1);
            assert_int_equal(textiles_channels(set, 1), 0);
            assert_int_equal(textiles_channels(set, -1), 0);
            check_variants(set, variants);
            for (int i = 0; i < c4; i++) { /* the colours read as digits */
                const int e[4] = {i / colors / colors / colors, i / colors / colors % colors,
                                  i / colors % colors, i % colors};
                check_find(set, e, NULL, i * variants, 0);
            }
            textiles_free(set);
        }
    }
}

static void test_list_reduced_wang(void **state) {
    (void)state;
    for (int colors = 2; colors <= 4; colors++) {
        const int variants = colors - 1, count = 2 * colors * colors * variants;
        textiles_set *set = import_plain(TEXTILES_WANG, colors, variants, 1, count);
        int pairs[TEXTILES_MAX_COLORS][TEXTILES_MAX_COLORS] = {{0}};
        assert_int_equal(textiles_count(set), count);
        check_variants(set, variants);
        for (int t = 0; t < count; t += variants) {
            textiles_tile a;
            textiles_tile_at(set, t, &a);
            pairs[a.edges[0]][a.edges[3]]++;
        }
        for (int n = 0; n < colors; n++) {
            int found = 0;
            for (int w = 0; w < colors; w++) assert_int_equal(pairs[n][w], 2);
            for (int i = 0; i < colors * colors * colors; i++) {
                const int e[4] = {n, i / colors / colors, i / colors % colors, i % colors};
                found += textiles_find(set, e, NULL, NULL) >= 0;
            }
            assert_int_equal(found, 2 * colors); /* all others are not there */
        }
        textiles_free(set);
    }
}

static void test_list_triangles(void **state) {
    (void)state;
    for (int colors = 2; colors <= 4; colors++) {
        for (int reduced = 0; reduced < 2; reduced++) {
            const int variants = 1 + (colors == 2), s = 2 * colors;
            const int count = (reduced ? 2 * colors * colors * colors : (s * s * s + 4 * colors) / 3);
            textiles_set *set =
                import_plain(TEXTILES_TRIANGLE, colors, variants, reduced, count * variants);
            int seen = 0;
            check_variants(set, variants);
            for (int i = 0; i < s * s * s; i++) {
                const int symbol[3] = {i / s / s, i / s % s, i % s};
                int e[4] = {0, 0, 0, 0}, d[3], r = -1, sum = 0;
                for (int k = 0; k < 3; k++) {
                    e[k] = symbol[k] / 2;
                    d[k] = symbol[k] % 2 ? -1 : 1;
                    sum += d[k];
                }
                const int t = textiles_find(set, e, d, &r);
                if (reduced && abs(sum) == 3) {
                    assert_int_equal(t, -1);
                    continue;
                }
                assert_true(t >= 0 && t < count * variants && t % variants == 0);
                assert_true(r >= 0 && r < 3);
                textiles_tile tile;
                assert_int_equal(textiles_tile_at(set, t, &tile), 1);
                for (int k = 0; k < 3; k++) {
                    assert_int_equal(tile.edges[(k + r) % 3], e[k]);
                    assert_int_equal(tile.directions[(k + r) % 3], d[k]);
                }
                seen++;
            }
            /* all, or all but a quarter: those that run one way round */
            assert_int_equal(seen, reduced ? s * s * s * 3 / 4 : s * s * s);
            textiles_free(set);
        }
    }
}

static void test_list_frames(void **state) {
    (void)state;
    for (int colors = 1; colors <= 4; colors++) {
        textiles_set *set = import_plain(TEXTILES_FRAME, colors, 2, 0, colors * 2);
        check_variants(set, 2);
        for (int k = 0; k < colors; k++) {
            const int e[4] = {0, k, 0, k}, other[4] = {k, 0, 0, 0};
            check_find(set, e, NULL, 2 * k, 0);
            check_find(set, other, NULL, k ? -1 : 0, 0);
        }
        textiles_free(set);
    }
    const book *b = &common[TEXTILES_FRAME][0];
    assert_int_equal(b->count, 15);
    check_variants(b->set, 3);
    for (int k = 0; k < 5; k++) check_find(b->set, common_classes[k], NULL, 3 * k, 0);
}

static void test_find_refuses(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const textiles_set *set = common_sets[k][0];
        int good[4] = {0, 0, 0, 0}, d[3] = {1, 1, 1};
        textiles_tile tile, before;
        memset(&tile, 0x33, sizeof tile);
        before = tile;
        assert_true(textiles_find(set, good, d, NULL) >= 0);
        for (int i = 0; i < (k == TEXTILES_TRIANGLE ? 3 : 4); i++) {
            static const int bad[] = {-1, 4, 3, INT_MAX, INT_MIN / 2, 1 << 30};
            for (size_t j = 0; j < sizeof bad / sizeof *bad; j++) {
                int e[4] = {0, 0, 0, 0};
                e[i] = bad[j];
                check_find(set, e, d, -1, 0);
            }
        }
        assert_int_equal(textiles_find(set, NULL, d, NULL), -1);
        assert_int_equal(textiles_find(set, good, NULL, NULL), k == TEXTILES_TRIANGLE ? -1 : 0);
        assert_int_equal(textiles_tile_at(set, -1, &tile), 0);
        assert_int_equal(textiles_tile_at(set, textiles_count(set), &tile), 0);
        assert_int_equal(textiles_tile_at(set, INT_MIN, &tile), 0);
        assert_memory_equal(&tile, &before, sizeof tile);

        float from[2] = {0, 0};
        const int side = common[k][0].side, bad[][3] = {
            {-1, 0, 0}, {textiles_count(set), 0, 0}, {0, -1, 0}, {0, 0, -1}, {0, side, 0},
            {0, 0, side}, {INT_MAX, INT_MAX, INT_MAX}, {INT_MIN, INT_MIN, INT_MIN}};
        for (size_t j = 0; j < sizeof bad / sizeof *bad; j++)
            assert_int_equal(textiles_source(set, bad[j][0], bad[j][1], bad[j][2], from), -1);
        assert_int_equal(textiles_source(set, 0, 0, 0, from), 0);
    }
}

/* ---- tests: what a set shows ------------------------------------------------------------------ */

static void test_borders(void **state) {
    (void)state;
    const int sizes[][2] = {{EXEMPLAR, EXEMPLAR}};
    for (int k = 0; k < KINDS; k++) {
        for (int r = 0; r < 2; r++) {
            check_sources(&common[k][r], sizes);
            check_set(&common[k][r], 1);
            check_edges_differ(&common[k][r]);
        }
    }
}

/* share of the texels away from the border that differ between two tiles, by source */
static double share_different(const book *b, const book *o, int s, int t) {
    int count = 0, different = 0;
    for (int y = 0; y < b->side; y++) {
        for (int x = 0; x < b->side; x++) {
            if (!is_inside(b, x + 8, y + 8) || x < 8 || y < 8 || x >= b->size - 8 || y >= b->size - 8)
                continue;
            const size_t p = place_of(b, s, x, y), q = place_of(o, t, x, y);
            different += b->sheet[p] != o->sheet[q] ||
                         memcmp(b->from[p], o->from[q], sizeof b->from[p]) != 0;
            count++;
        }
    }
    return (double)different / count;
}

static void test_insides_differ(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const book *b = &common[k][0];
        double sum = 0;
        int pairs = 0;
        for (int t = 1; t < b->count; t++) {
            for (int s = 0; s < t; s++) {
                const double share = share_different(b, b, s, t);
                sum += share;
                pairs++;
                if (b->variants > 1 && s / b->variants == t / b->variants && share < 0.5)
                    fail_msg("kind %d: variants %d, %d differ in %g only", k, s, t, share);
            }
        }
        assert_between(sum / pairs, 0.8, 1);
    }
}

static void test_seeds_differ(void **state) {
    (void)state;
    static const uint64_t seeds[] = {6, 0x100000005u}; /* all 64 bits count */
    for (int i = 0; i < 3; i++) {
        const int k = i ? TEXTILES_FRAME : TEXTILES_TRIANGLE;
        const book *b = &common[k][0]; /* of seed 5 */
        textiles_desc d = common_desc(k);
        d.repair = TEXTILES_REPAIR_NONE;
        d.seed = seeds[i / 2];
        textiles_set *set = make(&d);
        book other = open_book(set, 4);
        double share = 0;
        int edge = 0;
        for (int t = 0; t < b->count; t++) {
            share += share_different(b, &other, t, t) / b->count;
            for (int a = 0; a < SIZE; a++) {
                const size_t p = side_place(b, t, 0, a, 0);
                edge += memcmp(b->from[p], other.from[p], sizeof b->from[p]) != 0;
            }
        }
        assert_between(share, 0.8, 1);
        assert_true(edge * 2 > b->count * SIZE);
        close_book(&other);
        textiles_free(set);
    }
}

/* Is p's pixel of a map that of the exemplar at its source? Squares. */
static int shows_source(const book *b, const textiles_exemplar *exemplars, int m, size_t p) {
    const txm_image *im = &exemplars[b->sheet[p]].maps[m];
    const char *row = (const char *)txm_image_row_const(im, (int)b->from[p][1]);
    return memcmp(pixel(b, m, p), row + (size_t)b->from[p][0] * b->texel[m], b->texel[m]) == 0;
}

static void check_pixels(const book *b, const textiles_exemplar *exemplars) {
    for (int m = 0; m < b->maps; m++) {
        for (int t = 0; t < b->count; t++) {
            for (int i = 0; i < b->side * b->side; i++) {
                if (!shows_source(b, exemplars, m, place_of(b, t, i % b->side, i / b->side)))
                    fail_msg("map %d, tile %d: (%d, %d) is not its source", m, t, i % b->side,
                             i / b->side);
            }
        }
    }
}

static void test_pixels_are_the_exemplars(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        if (k != TEXTILES_TRIANGLE) check_pixels(&common[k][0], &common_exemplar);
    }
}

/* Repair changes pixels near cuts, none at the border, and makes the cuts smoother. Pieces may also
   meet where both show the same: there it changes little. */
static void test_repair(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const book *b = &common[k][0], *r = &common[k][1];
        const int triangle = k == TEXTILES_TRIANGLE;
        double steps[2][3] = {{0}};
        int changed = 0, cuts = 0;
        tally change[2] = {{0, 0}, {0, 0}}; /* far from cuts, near them */
        for (int t = 0; t < b->count; t++) {
            for (int y = 0; y < b->side; y++) {
                for (int x = 0; x < b->side; x++) {
                    const size_t p = place_of(b, t, x, y);
                    if (!is_inside(b, x, y)) continue;
                    assert_true(b->sheet[p] == r->sheet[p]);
                    assert_memory_equal(b->from[p], r->from[p], sizeof b->from[p]);
                    int edge = b->size;
                    for (int s = 0; s < 3 && triangle; s++) {
                        const int row = row_from(b, s, x, y);
                        edge = row < edge ? row : edge;
                    }
                    if (!triangle) {
                        const int across = x < b->size - 1 - x ? x : b->size - 1 - x;
                        const int down = y < b->size - 1 - y ? y : b->size - 1 - y;
                        edge = across < down ? across : down;
                    }
                    int near = 0; /* do sources break within reach? */
                    for (int v = y - 7; v <= y + 6; v++) {
                        for (int u = x - 7; u <= x + 6; u++) {
                            if (u < 0 || v < 0 || u + 1 >= b->side || v + 1 >= b->side ||
                                !is_inside(b, u, v) || near)
                                continue;
                            const size_t q = place_of(b, t, u, v);
                            const size_t o[2] = {q + 1, q + (size_t)b->side};
                            for (int i = 0; i < 2; i++) {
                                if (!triangle) near |= !is_next(b, q, o[i], !i, i);
                                else near |= 1; /* turned pieces: not looked at */
                            }
                        }
                    }
                    int same = 1;
                    for (int m = 0; m < b->maps; m++)
                        same = same && memcmp(pixel(b, m, p), pixel(r, m, p), b->texel[m]) == 0;
                    changed += !same;
                    if (!same && edge < (triangle ? 1 : 2)) fail_msg("a border pixel was repaired");
                    if (edge >= 2)
                        change[near].sum += fabs(sample_of(b, 2, p, 0) - sample_of(r, 2, p, 0));
                    change[near].count += edge >= 2;
                    if (triangle || edge < 3 || is_next(b, p, p + 1, 1, 0)) continue;
                    cuts++;
                    for (int m = 0; m < 3; m++) {
                        steps[0][m] += step_of(b, m, p, p + 1);
                        steps[1][m] += step_of(r, m, p, p + 1);
                    }
                }
            }
        }
        assert_true(changed > 20);
        if (triangle) continue;
        assert_true(cuts > 20);
        assert_true(change[0].count > 100 && change[1].count > 100);
        assert_true(mean_of(change[0]) * 8 < mean_of(change[1]));
        for (int m = 0; m < 3; m++) assert_true(steps[1][m] < steps[0][m]);
    }
}

/* Maps stay in register: what is a function of the first map still is. */
static void test_register(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        const book *b = &common[k][0];
        int values = 0;
        assert_int_equal(b->maps, 3);
        assert_true(b->channels[0] == 3 && b->channels[1] == 4 && b->channels[2] == 1);
        for (int t = 0; t < b->count; t++) {
            for (int y = 0; y < b->side; y++) {
                for (int x = 0; x < b->side; x++) {
                    const size_t p = place_of(b, t, x, y);
                    if (!is_inside(b, x, y)) continue;
                    const uint8_t *rgb = pixel(b, 0, p), *two = pixel(b, 1, p);
                    const double third = sample_of(b, 2, p, 0);
                    values |= 1 << rgb[0] / 32;
                    if (k != TEXTILES_TRIANGLE) {
                        for (int c = 0; c < 4; c++)
                            assert_int_equal(two[c], second_map(rgb, c));
                        assert_true(third == (double)third_map(rgb));
                    } else { /* resampling is linear but for rounding and clamping */
                        for (int c = 0; c < 4; c++) assert_near(two[c], second_map(rgb, c), 1.01);
                        int clamped = 0;
                        for (int c = 0; c < 3; c++) clamped |= rgb[c] == 0 || rgb[c] == 255;
                        if (!clamped) assert_near(third, (double)third_map(rgb), 0.25 * 11 * 0.51);
                    }
                }
            }
        }
        assert_true((values & (values - 1)) != 0);
    }
}

/* Triangles of a smooth exemplar: a texel has the exemplar's value at the place it comes from. */
static double smooth(double x, double y, int c) {
    return 0.5 + 0.2 * sin(0.19 * x + 0.11 * y + c) + 0.2 * cos(0.13 * x - 0.17 * y + 2 * c);
}

static void test_triangle_values(void **state) {
    (void)state;
    const int n = 96, sizes[][2] = {{96, 96}};
    txm_image maps[3] = {new_image(n, n, 3, TXM_F32), new_image(n, n, 2, TXM_U8),
                         new_image(n, n, 1, TXM_U16)};
    for (int i = 0; i < n * n; i++) {
        ((uint16_t *)maps[2].pixels)[i] = (uint16_t)(65535 * smooth(i % n, i / n, 5) + 0.5);
        for (int c = 0; c < 3; c++)
            ((float *)maps[0].pixels)[3 * i + c] = (float)smooth(i % n, i / n, c);
        for (int c = 0; c < 2; c++)
            ((uint8_t *)maps[1].pixels)[2 * i + c] =
                (uint8_t)(255 * smooth(i % n, i / n, c + 3) + 0.5);
    }
    const textiles_exemplar exemplar = {maps, 3};
    textiles_desc d = desc_of(TEXTILES_TRIANGLE, &exemplar, 1, 33);
    d.reduced = 1;
    d.repair = TEXTILES_REPAIR_NONE;
    textiles_set *set = make(&d);
    book b = open_book(set, 1 | 4 << 8);
    check_sources(&b, sizes);
    check_set(&b, 1);
    int turned = 0, inner = 0;
    for (int t = 0; t < b.count; t++) {
        for (int y = 0; y < b.side; y++) {
            for (int x = 0; x + y < b.side; x++) {
                const size_t p = place_of(&b, t, x, y);
                const double u = (double)b.from[p][0], v = (double)b.from[p][1];
                if (u < 3 || v < 3 || u > n - 4 || v > n - 4) continue;
                for (int c = 0; c < 3; c++)
                    assert_near(sample_of(&b, 0, p, c), smooth(u, v, c), 2e-4);
                for (int c = 0; c < 2; c++)
                    assert_near(sample_of(&b, 1, p, c), 255 * smooth(u, v, c + 3), 1.5);
                assert_near(sample_of(&b, 2, p, 0), 65535 * smooth(u, v, 5), 2e-4 * 65535);
                inner++;
                turned += x + y < b.side - 1 &&
                          fabs((double)(b.from[p + 1][0] - b.from[p][0]) - 1) > 0.1;
            }
        }
    }
    assert_true(inner > b.count * 300 && turned > b.count * 20);
    close_book(&b);
    textiles_free(set);
    for (int m = 0; m < 3; m++) free(maps[m].pixels);
}

/* ---- tests: exemplars of many sorts ------------------------------------------------------------ */

/* 8 bits made 16: the same tiles. (Those of triangles are resampled, to 16 bits.) */
static void test_sixteen_bits(void **state) {
    (void)state;
    enum { N = 96 };
    txm_image maps[2] = {draw(BLOBS, N, N, 3, 64), new_image(N, N, 3, TXM_U16)};
    for (int i = 0; i < N * N * 3; i++)
        ((uint16_t *)maps[1].pixels)[i] = (uint16_t)(257 * ((const uint8_t *)maps[0].pixels)[i]);
    for (int k = 0; k < KINDS; k++) {
        if (k == TEXTILES_TRIANGLE) continue;
        for (int repair = 1; repair <= 2; repair++) {
            textiles_joints joints[2];
            book b[2];
            textiles_set *sets[2];
            for (int i = 0; i < 2; i++) {
                const textiles_exemplar exemplar = {&maps[i], 1};
                textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, 34);
                d.repair = (textiles_repair)repair;
                d.reduced = k == TEXTILES_WANG;
                sets[i] = make(&d);
                b[i] = open_book(sets[i], i << 8);
                joints[i] = measure(sets[i], 0);
            }
            for (size_t p = 0; p < place_of(b, b->count, 0, 0); p++) {
                assert_true(b[0].sheet[p] == b[1].sheet[p]);
                assert_memory_equal(b[0].from[p], b[1].from[p], sizeof b[0].from[p]);
                for (int c = 0; c < 3; c++)
                    assert_near(sample_of(&b[1], 0, p, c) / 257, sample_of(&b[0], 0, p, c),
                                repair == TEXTILES_REPAIR_NONE ? 0 : 0.51);
            }
            assert_int_equal(joints[0].pairs, joints[1].pairs);
            assert_near(joints[0].mean, joints[1].mean, repair == TEXTILES_REPAIR_NONE ? 1e-9 : 0.01);
            for (int i = 0; i < 2; i++) {
                close_book(&b[i]);
                textiles_free(sets[i]);
            }
        }
    }
    for (int i = 0; i < 2; i++) free(maps[i].pixels);
}

/* Three exemplars; edges of a colour show the one they are told to. */
static void test_several_exemplars(void **state) {
    (void)state;
    txm_image maps[3];
    textiles_exemplar exemplars[3];
    const int sizes[3][2] = {{96, 80}, {72, 100}, {90, 90}};
    for (int e = 0; e < 3; e++) {
        maps[e] = draw(BLOBS, sizes[e][0], sizes[e][1], 3, 64 + 300 * e);
        exemplars[e].maps = &maps[e];
        exemplars[e].map_count = 1;
    }
    for (int k = 0; k < KINDS; k++) {
        for (int told = 0; told < 2; told++) {
            const int wishes[] = {2, 0, 1};
            textiles_desc d = desc_of((textiles_kind)k, exemplars, 3, 36);
            d.reduced = k == TEXTILES_TRIANGLE || k == TEXTILES_WANG;
            d.repair = TEXTILES_REPAIR_NONE;
            if (k == TEXTILES_FRAME) d.colors = 3, d.variants = 3;
            if (told) d.edge_exemplars = wishes;
            if (told == (k == TEXTILES_CORNER)) continue; /* of these refused, see test_bad_kinds */
            textiles_set *set = make(&d);
            book b = open_book(set, 0);
            int used[3] = {0, 0, 0};
            check_sources(&b, sizes);
            check_set(&b, 1);
            if (k != TEXTILES_TRIANGLE) check_pixels(&b, exemplars);
            for (int t = 0; t < b.count; t++) {
                for (int i = 0; i < b.side * b.side; i++) {
                    if (is_inside(&b, i % b.side, i / b.side))
                        used[(int)b.sheet[place_of(&b, t, i % b.side, i / b.side)]]++;
                }
                for (int s = 0; s < (k == TEXTILES_TRIANGLE ? 3 : 4) && told; s++) {
                    for (int a = 9; a < 27; a++) {
                        const size_t p = side_place(&b, t, s, a, 0);
                        assert_int_equal(b.sheet[p], wishes[b.tiles[t].edges[s]]);
                    }
                }
            }
            if (!used[0] || !used[1] || !used[2])
                fail_msg("kind %d: %d, %d, %d pixels of the exemplars", k, used[0], used[1], used[2]);
            close_book(&b);
            textiles_free(set);
        }
    }
    for (int e = 0; e < 3; e++) free(maps[e].pixels);
}

/* One set with everything checked; segments: of which its edges may be made. */
static void try_size(textiles_kind kind, int width, int height, int channels, int size, int colors,
                     int segments) {
    const int sizes[][2] = {{width, height}};
    txm_image map = draw(CELLS, width, height, channels, 80);
    const textiles_exemplar exemplar = {&map, 1};
    textiles_desc d = desc_of(kind, &exemplar, 1, size);
    d.colors = colors;
    d.reduced = kind == TEXTILES_TRIANGLE || kind == TEXTILES_WANG;
    d.repair = TEXTILES_REPAIR_NONE;
    textiles_set *set = make(&d);
    book b = open_book(set, 0);
    assert_int_equal(b.size, size ? size : 128);
    check_sources(&b, sizes);
    check_set(&b, segments);
    if (kind != TEXTILES_TRIANGLE) check_pixels(&b, &exemplar);
    if (getenv("TEXTILES_TEST_SHOW")) measure(set, 0);
    close_book(&b);
    textiles_free(set);
    free(map.pixels);
}

static void test_sizes(void **state) {
    (void)state;
    try_size(TEXTILES_WANG, 64, 64, 1, 32, 4, 1);
    try_size(TEXTILES_WANG, 100, 64, 4, 33, 2, 1);
    try_size(TEXTILES_CORNER, 64, 64, 1, 32, 3, 1);
    try_size(TEXTILES_TRIANGLE, 64, 70, 2, 32, 2, 1);
    try_size(TEXTILES_FRAME, 64, 128, 3, 33, 4, 1);
    try_size(TEXTILES_FRAME, 65, 67, 2, 32, 1, 1);
}

static void test_small_exemplars(void **state) {
    (void)state;
    try_size(TEXTILES_FRAME, 64, 64, 3, 0, 2, 6);
    try_size(TEXTILES_FRAME, 90, 64, 1, 0, 2, 6);
    try_size(TEXTILES_FRAME, 400, 64, 1, 0, 1, 6);
    try_size(TEXTILES_FRAME, 64, 400, 1, 100, 1, 6);
    try_size(TEXTILES_CORNER, 90, 64, 1, 50, 2, 4);
    try_size(TEXTILES_TRIANGLE, 70, 64, 1, 60, 2, 4);
}

/* Tiles much larger than the exemplar: made or refused, but never from beyond its borders. */
static void test_tiny_exemplars(void **state) {
    (void)state;
    static const int cases[][4] = {{TEXTILES_FRAME, 64, 64, 160},
                                   {TEXTILES_FRAME, 100, 64, 230},
                                   {TEXTILES_FRAME, 64, 64, 1024}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const int *c = cases[i], sizes[][2] = {{c[1], c[2]}};
        txm_image map = draw(BLOBS, c[1], c[2], 1, 80);
        const textiles_exemplar exemplar = {&map, 1};
        textiles_desc d = desc_of((textiles_kind)c[0], &exemplar, 1, c[3]);
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        textiles_set *set = NULL;
        d.colors = 1;
        d.repair = TEXTILES_REPAIR_NONE;
        const txm_status status = textiles_make(&d, &env, &set);
        if (status != TXM_OK) {
            assert_int_equal(status, TXM_TOO_SMALL);
            assert_true(!set && env.message[0]);
        } else {
            book b = open_book(set, 0);
            check_sources(&b, sizes);
            check_pixels(&b, &exemplar);
            close_book(&b);
            textiles_free(set);
        }
        assert_int_equal(tk_leaks(&memory), 0);
        free(map.pixels);
    }
}

/* An exemplar of one colour: so are the tiles. Floats of any size too. */
static void test_constant(void **state) {
    (void)state;
    static uint8_t gray[64 * 64 * 3];
    static float floats[64 * 64];
    static const float values[] = {0.0f, -7.5f, 3e38f};
    memset(gray, 77, sizeof gray);
    for (int k = 0; k < KINDS; k++) {
        for (int i = 0; i < 2; i++) {
            const txm_image map = i ? view(floats, 64, 64, 1, TXM_F32) : view(gray, 64, 64, 3, TXM_U8);
            const textiles_exemplar exemplar = {&map, 1};
            const double value = i ? (double)values[k % 3] : 77;
            for (int p = 0; p < 64 * 64; p++) floats[p] = values[k % 3];
            textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, 32);
            d.reduced = k == TEXTILES_WANG || k == TEXTILES_TRIANGLE;
            textiles_set *set = make(&d);
            book b = open_book(set, i);
            for (int t = 0; t < b.count; t++) {
                for (int p = 0; p < b.side * b.side; p++) {
                    if (!is_inside(&b, p % b.side, p / b.side)) continue;
                    assert_near(sample_of(&b, 0, place_of(&b, t, p % b.side, p / b.side), 0), value,
                                fabs(value) * 1e-6);
                }
            }
            if (k != TEXTILES_TRIANGLE || !i) {
                const textiles_joints j = measure(set, 0);
                assert_true(j.mean == 1 && j.worst == 1 && j.least == 1 && j.overall == 1);
            }
            close_book(&b);
            textiles_free(set);
        }
    }
}

/* Rows far apart, and upside down in memory: the same set. */
static void test_strides(void **state) {
    (void)state;
    enum { W = 70, H = 66, ROW = 80 };
    static float apart[H * ROW];
    static float packed[H * W];
    for (int i = 0; i < H * ROW; i++) apart[i] = (float)NAN; /* what lies between is not looked at */
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++)
            packed[y * W + x] = apart[(H - 1 - y) * ROW + x] = (float)draw_cells(x + 64, y + 64, 0);
    }
    txm_image maps[2] = {view(packed, W, H, 0, TXM_F32),
                         view(apart + (H - 1) * ROW, W, H, 1, TXM_F32)};
    maps[1].stride = -(ptrdiff_t)(ROW * sizeof(float));
    for (int k = 2; k < KINDS; k++) {
        uint64_t hash[2];
        for (int i = 0; i < 2; i++) {
            const textiles_exemplar exemplar = {&maps[i], 1};
            textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, 32);
            d.reduced = k == TEXTILES_TRIANGLE;
            textiles_set *set = make(&d);
            assert_int_equal(textiles_channels(set, 0), 1);
            hash[i] = hash_and_free(set, 1);
        }
        assert_true(hash[0] == hash[1]);
    }
}

/* ---- tests: measuring --------------------------------------------------------------------------- */

static void test_measure_agrees(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        for (int m = 0; m < 3; m++) {
            check_measure(&common[k][1], m);
            if (k > 1) check_measure(&common[k][0], m);
        }
    }
}

static void check_guarantee(const textiles_set *set) {
    const textiles_joints j = measure(set, 0);
    assert_between(j.mean, 0.9, 1.1);
    assert_between(j.worst, j.mean, 1.35);
    assert_between(j.overall, 0.9, 1.1);
    assert_between(j.least, 0.6, j.mean);
}

/* The promise of the header: joints are as rough as the texture is elsewhere. */
static void test_guarantee(void **state) {
    (void)state;
    for (int k = 0; k < KINDS; k++) {
        if (k != TEXTILES_TRIANGLE) check_guarantee(common_sets[k][1]);
    }
    for (int k = 0; k < KINDS; k++) { /* of triangles, large ones keep it */
        const int triangle = k == TEXTILES_TRIANGLE, n = triangle ? 192 : 144;
        txm_image map = draw(k == TEXTILES_WANG ? STRIPES : CELLS, n, n, triangle ? 1 : 3, 64);
        const textiles_exemplar exemplar = {&map, 1};
        textiles_desc d = desc_of((textiles_kind)k, &exemplar, 1, n / 3);
        d.reduced = k == TEXTILES_WANG || triangle;
        textiles_set *set = make(&d);
        check_guarantee(set);
        textiles_free(set);
        free(map.pixels);
    }
}

/* Tiles that do not match are told apart. */
static void test_measure_controls(void **state) {
    (void)state;
    static const int counts[KINDS] = {16, 16, 24, 2};
    const txm_image periodic = draw(BLOBS, SIZE, SIZE, 3, 64);
    for (int k = 0; k < KINDS; k++) {
        textiles_desc d = desc_of((textiles_kind)k, NULL, 0, SIZE);
        textiles_joints j, good = measure(common_sets[k][1], 0);

        textiles_set *set = import_cut(&d, counts[k], &common_maps[0], cut_anywhere);
        book b = open_book(set, 0);
        if (k != TEXTILES_TRIANGLE) check_measure(&b, 0);
        j = measure(set, 0);
        if (!(j.mean > 1.5 && j.mean > 1.4 * good.mean && j.worst > 1.8))
            fail_msg("kind %d: tiles cut anywhere seem to match: mean %.3f, worst %.3f; of a made set "
                     "%.3f, %.3f", k, j.mean, j.worst, good.mean, good.worst);
        close_book(&b);
        textiles_free(set);

        /* one tile for all, whose sides belong together but for the step from last to first */
        set = import_cut(&d, counts[k], &periodic, cut_the_same);
        b = open_book(set, 0);
        if (k != TEXTILES_TRIANGLE) check_measure(&b, 0);
        close_book(&b);
        textiles_free(set);

        const txm_image none = view(NULL, 0, 0, 1, TXM_U8);
        set = import_cut(&d, counts[k], &none, cut_gray);
        j = measure(set, 0);
        assert_true(j.mean == 1 && j.worst == 1 && j.least == 1 && j.overall == 1 && j.pairs > 0);
        textiles_free(set);
        if (k == TEXTILES_TRIANGLE) continue;
        set = import_cut(&d, counts[k], &none, cut_flat);
        j = measure(set, 0);
        assert_true(j.worst > 1e6 && j.least == 1);
        textiles_free(set);
    }
    free(periodic.pixels);
}

static void test_measure_refuses(void **state) {
    (void)state;
    const textiles_set *set = common_sets[TEXTILES_TRIANGLE][0];
    for (int i = 0; i < 6; i++) {
        tk_memory memory = {0};
        memory.fail_at = i == 5;
        txm_env env = tk_env(&memory, NULL);
        textiles_joints j, before;
        memset(&j, 0x5c, sizeof j);
        before = j;
        const txm_status status =
            textiles_measure(i == 0 ? NULL : set, i == 2 ? -1 : i == 3 ? 3 : i == 4 ? INT_MAX : 0, &env,
                             i == 1 ? NULL : &j);
        assert_int_equal(status, i == 5 ? TXM_OUT_OF_MEMORY : TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_memory_equal(&j, &before, sizeof j);
        assert_int_equal(tk_leaks(&memory), 0);
    }
    textiles_joints j;
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    assert_int_equal(textiles_measure(set, 2, &env, &j), TXM_OK);
    assert_int_equal(tk_leaks(&memory), 0);
    assert_int_equal(textiles_measure(set, 2, NULL, &j), TXM_OK);
}

/* ---- tests: the same bytes ----------------------------------------------------------------------- */

static void test_same_bytes(void **state) {
    (void)state;
    for (int k = 1; k < KINDS; k++) { /* the common ones were made on threads */
        textiles_desc d = common_desc(k);
        d.repair = TEXTILES_REPAIR_POISSON;
        const uint64_t hash = hash_of(&common[k][1]);
        assert_true(hash != hash_of(&common[k][0]));
        if (k != TEXTILES_TRIANGLE) assert_true(hash_and_free(make_with(&d, NULL), 4) == hash);
        if (k != TEXTILES_CORNER)
            assert_true(hash_and_free(make_with(&d, tk_parallel_reverse), 4) == hash);
    }
}

/* ---- tests: bad input ------------------------------------------------------------------------------ */

static void refuses(const textiles_desc *desc, txm_status expected, const char *what) {
    tk_memory memory = {0};
    tk_progress progress = {0};
    txm_env env = tk_env(&memory, &progress);
    textiles_set *set = (textiles_set *)&memory;
    const txm_status status = textiles_make(desc, &env, &set);
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    if (set) fail_msg("%s: *out is not NULL", what);
    if (!env.message[0]) fail_msg("%s: no message", what);
    assert_int_equal(tk_leaks(&memory), 0);
    set = (textiles_set *)&memory;
    assert_int_equal(textiles_make(desc, NULL, &set), expected);
    assert_null(set);
}

#define REFUSES(field, value, expected)             \
    do {                                            \
        textiles_desc d = good;                     \
        d.field = value;                            \
        refuses(&d, expected, #field " = " #value); \
    } while (0)

/* the same of the first exemplar, or its first map */
#define REFUSES_EXEMPLAR(e, field, value, expected)                   \
    do {                                                              \
        const textiles_exemplar keep = exemplars[e];                  \
        exemplars[e].field = value;                                   \
        refuses(&good, expected, "exemplar: " #field " = " #value);   \
        exemplars[e] = keep;                                          \
    } while (0)
#define REFUSES_MAP(m, field, value, expected)                \
    do {                                                      \
        const txm_image keep = maps[m];                       \
        maps[m].field = value;                                \
        refuses(&good, expected, "map: " #field " = " #value); \
        maps[m] = keep;                                       \
    } while (0)

static void test_bad_arguments(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64 * 4];
    static float floats[64 * 64];
    txm_image maps[4] = {view(pixels, 64, 64, 3, TXM_U8), view(floats, 64, 64, 1, TXM_F32),
                         view(pixels, 64, 64, 3, TXM_U8), view(floats, 64, 64, 1, TXM_F32)};
    textiles_exemplar exemplars[2] = {{maps, 2}, {maps + 2, 2}};
    textiles_desc good = desc_of(TEXTILES_WANG, exemplars, 2, 32);
    good.repair = TEXTILES_REPAIR_NONE;
    txm_env env = {0};
    assert_int_equal(textiles_make(&good, &env, NULL), TXM_BAD_ARGUMENT);
    assert_true(env.message[0] != 0);
    refuses(NULL, TXM_BAD_ARGUMENT, "desc NULL");

    REFUSES(kind, (textiles_kind)4, TXM_BAD_ARGUMENT);
    REFUSES(kind, (textiles_kind)-1, TXM_BAD_ARGUMENT);
    REFUSES(exemplars, NULL, TXM_BAD_ARGUMENT);
    REFUSES(exemplar_count, 0, TXM_BAD_ARGUMENT);
    REFUSES(exemplar_count, -1, TXM_BAD_ARGUMENT);
    REFUSES(exemplar_count, 9, TXM_BAD_ARGUMENT);
    REFUSES(size, 31, TXM_BAD_ARGUMENT);
    REFUSES(size, 1, TXM_BAD_ARGUMENT);
    REFUSES(size, -32, TXM_BAD_ARGUMENT);
    REFUSES(size, 1025, TXM_BAD_ARGUMENT);
    REFUSES(size, INT_MAX, TXM_BAD_ARGUMENT);
    REFUSES(colors, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 5, TXM_BAD_ARGUMENT);
    REFUSES(colors, -2, TXM_BAD_ARGUMENT);
    REFUSES(variants, 17, TXM_BAD_ARGUMENT);
    REFUSES(variants, -1, TXM_BAD_ARGUMENT);
    REFUSES(repair, (textiles_repair)3, TXM_BAD_ARGUMENT);
    REFUSES(repair, (textiles_repair)-1, TXM_BAD_ARGUMENT);
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT);
    REFUSES(class_count, 2, TXM_BAD_ARGUMENT);
    {
        static const int wishes[][4] = {{0, 2}, {-1, 0}, {0, INT_MAX}};
        for (int i = 0; i < 3; i++) REFUSES(edge_exemplars, wishes[i], TXM_BAD_ARGUMENT);
    }

    /* exemplars and maps that do not go together */
    REFUSES_EXEMPLAR(0, maps, NULL, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(1, maps, NULL, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, 0, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, -1, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, 9, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(0, map_count, 1, TXM_BAD_ARGUMENT);
    REFUSES_EXEMPLAR(1, map_count, 1, TXM_BAD_ARGUMENT);
    for (int m = 0; m < 4; m++) {
        REFUSES_MAP(m, pixels, NULL, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, width, 0, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, height, -64, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, width, INT_MAX, TXM_TOO_LARGE);
        REFUSES_MAP(m, height, TEXTILES_MAX_PIXELS / 64 + 1, TXM_TOO_LARGE);
        REFUSES_MAP(m, channels, -1, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, channels, 5, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, sample, (txm_sample)3, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, stride, 5, TXM_BAD_ARGUMENT);
        REFUSES_MAP(m, stride, PTRDIFF_MAX, TXM_TOO_LARGE);
    }
    REFUSES_MAP(1, width, 63, TXM_BAD_ARGUMENT);
    REFUSES_MAP(1, height, 63, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, height, 63, TXM_BAD_ARGUMENT);
    REFUSES_MAP(0, channels, 1, TXM_BAD_ARGUMENT); /* the second exemplar has 3 */
    REFUSES_MAP(2, channels, 4, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, channels, 2, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, sample, TXM_U8, TXM_BAD_ARGUMENT);
    REFUSES_MAP(3, sample, TXM_U16, TXM_BAD_ARGUMENT);
    REFUSES_MAP(1, pixels, (char *)floats + 2, TXM_BAD_ARGUMENT);

    static const float bad[] = {(float)NAN, (float)INFINITY, -(float)INFINITY};
    static const int places[] = {0, 63, 64, 2000, 4095};
    for (size_t i = 0; i < 3; i++) {
        for (size_t p = 0; p < sizeof places / sizeof *places; p++) {
            floats[places[p]] = bad[i];
            refuses(&good, TXM_BAD_ARGUMENT, "a sample that is not finite");
            floats[places[p]] = 0;
        }
    }

    /* sizes of the exemplars */
    for (int e = 0; e < 2; e++) {
        for (int low = 0; low < 2; low++) {
            txm_image keep[2] = {maps[2 * e], maps[2 * e + 1]};
            for (int m = 0; m < 2; m++) {
                if (low) maps[2 * e + m].height = 63;
                else maps[2 * e + m].width = 63;
            }
            refuses(&good, TXM_TOO_SMALL, "an exemplar of 63 pixels a side");
            for (int m = 0; m < 2; m++) maps[2 * e + m] = keep[m];
        }
    }
    for (int m = 0; m < 4; m++) {
        maps[m] = view(pixels, 64, TEXTILES_MAX_PIXELS / 2 / 64 + 1, 1, TXM_U8);
    }
    refuses(&good, TXM_TOO_LARGE, "two exemplars, too large together");

    /* and of the set */
    for (int m = 0; m < 4; m++) maps[m] = view(pixels, 64, 64, 1, TXM_U8);
    good.exemplar_count = 1;
    REFUSES(size, 1024, TXM_TOO_LARGE);
    good.variants = 16;
    REFUSES(size, 160, TXM_TOO_LARGE); /* one of them would do */
}

static void test_bad_kinds(void **state) {
    (void)state;
    static uint8_t pixels[64 * 64];
    static int many[65][4];
    const int wishes[4] = {0, 0, 0, 0};
    const txm_image map = view(pixels, 64, 64, 1, TXM_U8);
    const textiles_exemplar exemplar = {&map, 1};
    textiles_desc good = desc_of(TEXTILES_CORNER, &exemplar, 1, 32);
    REFUSES(reduced, 1, TXM_BAD_ARGUMENT);
    REFUSES(edge_exemplars, wishes, TXM_BAD_ARGUMENT);
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT);
    REFUSES(colors, 1, TXM_BAD_ARGUMENT);
    good.kind = TEXTILES_TRIANGLE;
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT);
    REFUSES(class_count, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 5, TXM_BAD_ARGUMENT);

    good.kind = TEXTILES_FRAME;
    REFUSES(reduced, 1, TXM_BAD_ARGUMENT);
    REFUSES(colors, 5, TXM_BAD_ARGUMENT);
    REFUSES(colors, -1, TXM_BAD_ARGUMENT);
    REFUSES(classes, common_classes, TXM_BAD_ARGUMENT); /* without class_count */
    REFUSES(class_count, 1, TXM_BAD_ARGUMENT);          /* without classes     */
    good.classes = common_classes;
    good.class_count = 5;
    REFUSES(colors, 2, TXM_BAD_ARGUMENT); /* they need three */
    good.colors = 4;
    for (int i = 0; i < 64; i++) {
        many[i][0] = i / 16;
        many[i][1] = i / 4 % 4;
        many[i][3] = i % 4;
    }
    many[64][2] = 1;
    good.classes = (const int(*)[4])many;
    good.class_count = 64;
    REFUSES(class_count, 65, TXM_BAD_ARGUMENT);
    REFUSES(class_count, -1, TXM_BAD_ARGUMENT);
    REFUSES(class_count, INT_MAX, TXM_BAD_ARGUMENT);
    for (int i = 0; i < 64; i += 63) {
        for (int k = 0; k < 4; k++) {
            const int keep = many[i][k];
            many[i][k] = 4;
            refuses(&good, TXM_BAD_ARGUMENT, "a class with a color too high");
            many[i][k] = -1;
            refuses(&good, TXM_BAD_ARGUMENT, "a class with a negative color");
            many[i][k] = keep;
        }
    }
    memcpy(many[63], many[7], sizeof many[7]);
    refuses(&good, TXM_BAD_ARGUMENT, "two equal classes");
}

/* ---- tests: importing ------------------------------------------------------------------------------- */

static void test_import_round_trip(void **state) {
    (void)state;
    static const int counts[KINDS] = {16, 32, 24, 3};
    for (int k = 0; k < KINDS; k++) {
        const int n = 35, side = n + (k == TEXTILES_TRIANGLE), count = counts[k];
        const size_t texels = (size_t)side * (size_t)side, row = (size_t)side * 2 + 3;
        uint8_t *bytes = (uint8_t *)need((size_t)count * texels * 3);
        uint16_t *words = (uint16_t *)need((size_t)count * texels * sizeof *words);
        float *floats = (float *)need((size_t)count * row * (size_t)side * sizeof *floats);
        txm_image *tiles = (txm_image *)need((size_t)count * 3 * sizeof *tiles);
        txm_rng rng = txm_rng_make(9, (uint64_t)k);
        for (size_t i = 0; i < (size_t)count * texels * 3; i++) bytes[i] = (uint8_t)txm_rng_next(&rng);
        for (size_t i = 0; i < (size_t)count * row * (size_t)side; i++)
            floats[i] = txm_rng_float(&rng) * 1e6f - 5e5f;
        for (size_t i = 0; i < (size_t)count * texels; i++) words[i] = (uint16_t)txm_rng_next(&rng);
        for (int t = 0; t < count; t++) { /* the second map bottom-up, rows apart */
            tiles[3 * t] = view(bytes + (size_t)t * texels * 3, side, side, 3, TXM_U8);
            tiles[3 * t + 1] = view(floats + ((size_t)t * (size_t)side + (size_t)side - 1) * row, side,
                                    side, 2, TXM_F32);
            tiles[3 * t + 1].stride = -(ptrdiff_t)(row * sizeof(float));
            tiles[3 * t + 2] = view(words + (size_t)t * texels, side, side, 1, TXM_U16);
        }
        textiles_desc d = desc_of((textiles_kind)k, NULL, 77, n);
        d.variants = k == TEXTILES_CORNER ? 2 : 0;
        if (k == TEXTILES_FRAME) d.colors = 3;
        textiles_set *set = NULL;
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        assert_int_equal(textiles_import(&d, tiles, count, 3, &env, &set), TXM_OK);
        memset(&env, 0xff, sizeof env); /* need not outlive the call */
        book b = open_book(set, 2 | 4 << 8);
        assert_int_equal(b.maps, 3);
        assert_int_equal(b.channels[0], 3);
        assert_int_equal(b.channels[1], 2);
        for (int t = 0; t < count; t++) {
            for (int y = 0; y < side; y++) {
                for (int x = 0; x < side; x++) {
                    const size_t p = place_of(&b, t, x, y);
                    assert_int_equal(b.sheet[p], -1);
                    if (!is_inside(&b, x, y)) continue;
                    for (int m = 0; m < 3; m++) {
                        const char *from = (const char *)txm_image_row_const(&tiles[3 * t + m], y);
                        assert_memory_equal(pixel(&b, m, p), from + (size_t)x * b.texel[m], b.texel[m]);
                    }
                }
            }
        }
        close_book(&b);
        textiles_free(set);
        assert_int_equal(tk_leaks(&memory), 0);
        free(bytes);
        free(words);
        free(floats);
        free(tiles);
    }
    textiles_free(NULL);
}

/* Beyond a triangle's third side anything may lie. */
static void test_import_beyond_triangles(void **state) {
    (void)state;
    enum { S = 33 };
    static float pixels[24][S * S];
    txm_image tiles[24];
    textiles_set *set = NULL;
    txm_env env = {0};
    for (int t = 0; t < 24; t++) {
        tiles[t] = view(pixels[t], S, S, 1, TXM_F32);
        for (int i = 0; i < S * S; i++)
            pixels[t][i] = i % S + i / S < S ? (float)(t + i) : (float)NAN;
    }
    const textiles_desc d = desc_of(TEXTILES_TRIANGLE, NULL, 0, S - 1);
    const txm_status status = textiles_import(&d, tiles, 24, 1, &env, &set);
    if (status != TXM_OK) fail_msg("what lies beyond is looked at: %d, %s", status, env.message);
    textiles_free(set);
}

static void refuses_import(const textiles_desc *d, const txm_image *tiles, int count, int maps,
                           txm_status expected, const char *what) {
    tk_memory memory = {0};
    txm_env env = tk_env(&memory, NULL);
    textiles_set *set = (textiles_set *)&memory;
    const txm_status status = textiles_import(d, tiles, count, maps, &env, &set);
    if (status != expected) fail_msg("%s: status %d, not %d", what, status, expected);
    if (set) fail_msg("%s: *out is not NULL", what);
    if (!env.message[0]) fail_msg("%s: no message", what);
    assert_int_equal(tk_leaks(&memory), 0);
}

static void test_import_refuses(void **state) {
    (void)state;
    static float pixels[128 * 32];
    txm_image tiles[32];
    textiles_desc d = desc_of(TEXTILES_WANG, NULL, 0, 32);
    txm_env env = {0};
    for (int t = 0; t < 32; t++) tiles[t] = view(pixels, 32, 32, 1, TXM_F32);
    assert_int_equal(textiles_import(&d, tiles, 16, 1, &env, NULL), TXM_BAD_ARGUMENT);
    assert_true(env.message[0] != 0);
    refuses_import(NULL, tiles, 16, 1, TXM_BAD_ARGUMENT, "desc NULL");
    refuses_import(&d, NULL, 16, 1, TXM_BAD_ARGUMENT, "tiles NULL");
    refuses_import(&d, tiles, 15, 1, TXM_BAD_ARGUMENT, "15 tiles");
    refuses_import(&d, tiles, 17, 1, TXM_BAD_ARGUMENT, "17 tiles");
    refuses_import(&d, tiles, 32, 1, TXM_BAD_ARGUMENT, "32 tiles");
    refuses_import(&d, tiles, 0, 1, TXM_BAD_ARGUMENT, "no tiles");
    refuses_import(&d, tiles, -16, 1, TXM_BAD_ARGUMENT, "-16 tiles");
    refuses_import(&d, tiles, 16, 0, TXM_BAD_ARGUMENT, "no maps");
    refuses_import(&d, tiles, 16, -1, TXM_BAD_ARGUMENT, "-1 maps");
    refuses_import(&d, tiles, 3, 9, TXM_BAD_ARGUMENT, "9 maps");
    for (int t = 0; t < 16; t += 15) {
        for (int i = 0; i < 9; i++) {
            const txm_image keep = tiles[t];
            float *sample = &((float *)tiles[t].pixels)[1000];
            txm_status expected = TXM_BAD_ARGUMENT;
            if (i == 0) tiles[t].pixels = NULL;
            if (i == 1) tiles[t].width = 31;
            if (i == 2) tiles[t].height = 33;
            if (i == 3) tiles[t].channels = 2;
            if (i == 4) tiles[t].sample = t ? TXM_U8 : TXM_U16;
            if (i == 5) tiles[t].stride = 31 * 4;
            if (i == 6) tiles[t].channels = 5;
            if (i == 7) *sample = (float)NAN;
            if (i == 8) tiles[t].width = INT_MAX, expected = TXM_TOO_LARGE;
            refuses_import(&d, tiles, 16, 1, expected, "one tile that does not fit");
            *sample = 0;
            tiles[t] = keep;
        }
    }
#define REFUSES_IMPORT(field, value)                                                   \
    do {                                                                               \
        textiles_desc e = d;                                                           \
        e.field = value;                                                               \
        refuses_import(&e, tiles, 16, 1, TXM_BAD_ARGUMENT, #field " = " #value);       \
    } while (0)
    REFUSES_IMPORT(kind, (textiles_kind)4);
    REFUSES_IMPORT(kind, TEXTILES_TRIANGLE);
    REFUSES_IMPORT(size, 31);
    REFUSES_IMPORT(size, 33);
    REFUSES_IMPORT(size, 0);
    REFUSES_IMPORT(size, 1025);
    REFUSES_IMPORT(colors, 3);
    REFUSES_IMPORT(colors, 5);
    REFUSES_IMPORT(variants, 2);
    REFUSES_IMPORT(variants, 17);
    REFUSES_IMPORT(reduced, 1);
    REFUSES_IMPORT(classes, common_classes);
    REFUSES_IMPORT(class_count, 5);

    /* every allocation in turn fails */
    for (int onward = 0; onward < 2; onward++) {
        for (long k = 1;; k++) {
            tk_memory memory = {0};
            memory.fail_at = k;
            memory.fail_onward = onward;
            txm_env failing = tk_env(&memory, NULL);
            textiles_set *set = (textiles_set *)&memory;
            const txm_status status = textiles_import(&d, tiles, 16, 1, &failing, &set);
            if (status == TXM_OK) textiles_free(set);
            assert_int_equal(tk_leaks(&memory), 0);
            if (memory.calls < k) {
                assert_true(status == TXM_OK && k > 3);
                break;
            }
            assert_int_equal(status, TXM_OUT_OF_MEMORY);
            assert_true(!set && failing.message[0]);
        }
    }
}

/* ---- tests: memory and cancelling -------------------------------------------------------------------- */

static txm_status try_make(const textiles_desc *d, txm_env *env) {
    textiles_set *set = (textiles_set *)env;
    const txm_status status = textiles_make(d, env, &set);
    if (status == TXM_OK) assert_non_null(set);
    else assert_null(set);
    textiles_free(set);
    return status;
}

/* Allocations fail, alone and onward: each of the first ones, from `all` on one in `step`. */
static void sweep(const textiles_desc *d, long all, long step) {
    for (int onward = 0; onward < 2; onward++) {
        for (long k = 1;; k += k < all ? 1 : step) {
            tk_memory memory = {0};
            tk_progress progress = {0};
            memory.fail_at = k;
            memory.fail_onward = onward;
            txm_env env = tk_env(&memory, &progress);
            const txm_status status = try_make(d, &env);
            assert_int_equal(tk_leaks(&memory), 0);
            assert_int_equal(progress.errors, 0);
            if (memory.calls < k) {
                assert_int_equal(status, TXM_OK);
                assert_true(k > 20);
                break;
            }
            if (status != TXM_OUT_OF_MEMORY) fail_msg("allocation %ld: status %d", k, status);
            assert_true(env.message[0] != 0);
        }
    }
}

static void sweep_cancel(const textiles_desc *d) {
    for (long k = 1;; k++) {
        tk_memory memory = {0};
        tk_progress progress = {0};
        progress.cancel_at = k;
        txm_env env = tk_env(&memory, &progress);
        const txm_status status = try_make(d, &env);
        assert_int_equal(tk_leaks(&memory), 0);
        assert_int_equal(progress.errors, 0);
        assert_int_equal(progress.late, 0);
        if (progress.calls < k) {
            assert_int_equal(status, TXM_OK);
            assert_true(k > 4 && progress.last == 1.0f);
            break;
        }
        if (status != TXM_CANCELLED) fail_msg("call %ld: status %d", k, status);
        assert_true(env.message[0] != 0);
    }
}

static void test_failing(void **state) {
    (void)state;
    txm_image maps[4];
    draw_maps(CELLS, 64, 64, 64, maps);
    maps[3] = draw(BLOBS, 64, 64, 1, 64);
    const textiles_exemplar exemplars[2] = {{maps + 2, 1}, {maps + 2, 1}}, plain = {maps + 3, 1};
    textiles_desc d = desc_of(TEXTILES_FRAME, exemplars, 2, 32);
    d.colors = 1;
    sweep(&d, 1000, 1);
    d.exemplar_count = 1;
    d.variants = 9; /* more than are at work at a time */
    sweep_cancel(&d);
    d = desc_of(TEXTILES_TRIANGLE, &plain, 1, 32);
    d.reduced = 1;
    sweep(&d, 34, 60);
    d = desc_of(TEXTILES_CORNER, &plain, 1, 32);
    sweep(&d, 1, 90);
    for (int m = 0; m < 4; m++) free(maps[m].pixels);
}

/* The head comment says how much memory making a set takes. */
static void test_peak_memory(void **state) {
    (void)state;
    static const int cases[][2] = {{32, 256}, {100, 64}}; /* tile, exemplar */
    for (int i = 0; i < 2; i++) {
        const int size = cases[i][0], n = cases[i][1];
        txm_image map = draw(CELLS, n, n, 3, 64);
        const textiles_exemplar exemplar = {&map, 1};
        textiles_desc d = desc_of(TEXTILES_FRAME, &exemplar, 1, size);
        tk_memory memory = {0};
        txm_env env = tk_env(&memory, NULL);
        textiles_set *set = NULL;
        d.colors = 1;
        d.variants = i ? 8 : 1;
        assert_int_equal(textiles_make(&d, &env, &set), TXM_OK);
        if (getenv("TEXTILES_TEST_SHOW"))
            printf("# tiles %d, exemplar %d: %zu bytes kept, %zu at most\n", size, n,
                   memory.live_bytes, memory.peak_bytes);
        const size_t kept = (size_t)(d.variants * size * size) * (3 + 4);
        assert_true(memory.live_bytes >= kept && memory.live_bytes < kept + 4096);
        assert_true(memory.peak_bytes < kept + (size_t)(n * n) * (40 + 8 * 3) +
                                            (size_t)(d.variants * size * size) * 190 +
                                            (size_t)d.variants * (1 << 20));
        textiles_free(set);
        assert_int_equal(tk_leaks(&memory), 0);
        free(map.pixels);
    }
}

static void test_quick_start(void **state) {
    (void)state;
    char line[120] = "";
    int tiles = 0, width = 0, height = 0, tile = -1;
    assert_int_equal(tk_quick_start("textiles.h", "textiles"), 0);
    FILE *file = fopen("build/tests/textiles_quick.txt", "r");
    assert_non_null(file);
    const char *got = fgets(line, sizeof line, file);
    fclose(file);
    assert_non_null(got);
    assert_int_equal(sscanf(line, "%d tiles, atlas %d x %d, tile %d at (5, 7)", &tiles, &width,
                            &height, &tile), 4);
    assert_int_equal(tiles, 16);
    assert_true(width * height >= 16 * 48 * 48);
    assert_between(tile, 0, 15);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_list_squares),
        cmocka_unit_test(test_list_reduced_wang),
        cmocka_unit_test(test_list_triangles),
        cmocka_unit_test(test_list_frames),
        cmocka_unit_test(test_find_refuses),
        cmocka_unit_test(test_borders),
        cmocka_unit_test(test_insides_differ),
        cmocka_unit_test(test_seeds_differ),
        cmocka_unit_test(test_pixels_are_the_exemplars),
        cmocka_unit_test(test_repair),
        cmocka_unit_test(test_register),
        cmocka_unit_test(test_triangle_values),
        cmocka_unit_test(test_sixteen_bits),
        cmocka_unit_test(test_several_exemplars),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_small_exemplars),
        cmocka_unit_test(test_constant),
        cmocka_unit_test(test_strides),
        cmocka_unit_test(test_measure_agrees),
        cmocka_unit_test(test_guarantee),
        cmocka_unit_test(test_measure_controls),
        cmocka_unit_test(test_measure_refuses),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_bad_arguments),
        cmocka_unit_test(test_bad_kinds),
        cmocka_unit_test(test_import_round_trip),
        cmocka_unit_test(test_import_beyond_triangles),
        cmocka_unit_test(test_import_refuses),
        cmocka_unit_test(test_failing),
        cmocka_unit_test(test_peak_memory),
        cmocka_unit_test(test_quick_start),
        cmocka_unit_test(test_tiny_exemplars), /* last: see there what it finds */
    };
    return cmocka_run_group_tests_name("textiles", tests, make_common, free_common);
}
