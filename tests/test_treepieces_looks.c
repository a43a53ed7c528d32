/* test_treepieces_looks.c - trees: bark sheets, drawn bark and leaves, leaf clouds, impostors, cards
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"
#include "testkit.h"

enum { TILE = 16, TILES = 5, SIDE = 8 * TILE, LEAF = 96, VIEW = 64 };

static treepieces_species species(const char *name) {
    treepieces_species s;
    assert_int_equal(treepieces_preset(name, NULL, &s), TXM_OK);
    return s;
}

static txm_image picture(void *pixels, int width, int height, int channels, txm_sample sample) {
    txm_image image;
    memset(&image, 0, sizeof image);
    image.pixels = pixels;
    image.width = width;
    image.height = height;
    image.channels = channels;
    image.sample = sample;
    return image;
}

/* ---- bark ----------------------------------------------------------------------------------- */

static uint8_t tile_pixels[TILES + 1][TILE * TILE * 3];
static txm_image tiles[TILES + 1];

/* Random tiles whose outermost pixels are those of the first. */
static void make_tiles(void) {
    txm_rng rng = txm_rng_make(6, 0);
    for (int t = 0; t <= TILES; t++) {
        tiles[t] = picture(tile_pixels[t], TILE, TILE, 3, TXM_U8);
        for (int i = 0; i < TILE * TILE * 3; i++) {
            const int x = i / 3 % TILE, y = i / 3 / TILE;
            const int is_frame = x == 0 || y == 0 || x == TILE - 1 || y == TILE - 1;
            tile_pixels[t][i] = (uint8_t)txm_rng_below(&rng, 256);
            if (is_frame && t) tile_pixels[t][i] = tile_pixels[0][i];
        }
    }
}

static const uint8_t *texel(const uint8_t *sheet, int layer, int x, int y) {
    return sheet + 3 * ((size_t)(layer * SIDE + y) * SIDE + (size_t)x);
}

/* Every layer has whole tiles but for its lowest row, whose south sides meet what they should. */
static void test_sheet(void **state) {
    (void)state;
    const int classes[TILES + 1] = {0, 0, 0, 0, 0, TREEPIECES_OWN + 1};
    treepieces_bark_desc d;
    make_tiles();
    memset(&d, 0, sizeof d);
    d.tiles = tiles;
    d.classes = classes;
    d.tile_count = TILES + 1;
    const int layers = treepieces_bark_layers(&d);
    assert_int_equal(layers, TREEPIECES_OWN + 2);
    uint8_t *sheet = (uint8_t *)calloc((size_t)(SIDE * SIDE * layers), 3);
    assert_non_null(sheet);
    const txm_image out = picture(sheet, SIDE, SIDE * layers, 3, TXM_U8);
    assert_int_equal(treepieces_bark(&d, NULL, out), TXM_OK);

    for (int layer = 0; layer < TREEPIECES_OWN; layer++)
        for (int cell = 0; cell < 64 - (layer ? 8 : 0); cell++) { /* each is one of the tiles */
            int like = 0;
            for (int t = 0; t < TILES; t++) {
                int same = 1;
                for (int y = 0; y < TILE; y++)
                    same &= !memcmp(texel(sheet, layer, cell % 8 * TILE, cell / 8 * TILE + y),
                                    tile_pixels[t] + 3 * TILE * y, 3 * TILE);
                like += same;
            }
            assert_int_equal(like, 1);
        }
    const int bottom = SIDE - 1;
    for (int x = 0; x < SIDE; x++)
        for (int c = 0; c < 3; c++) {
            const int in = x % TILE;
            /* folded: its own mirror, so two of them meet */
            assert_int_equal(texel(sheet, TREEPIECES_FOLD, x, bottom)[c],
                             texel(sheet, TREEPIECES_FOLD, x - in + TILE - 1 - in, bottom)[c]);
            /* turned: the west side of the frame from top to bottom, the east side upwards */
            assert_true(abs(texel(sheet, TREEPIECES_TURN_LEFT, x, bottom)[c] -
                            tile_pixels[0][3 * TILE * in + c]) <= 1);
            assert_true(abs(texel(sheet, TREEPIECES_TURN_RIGHT, x, bottom)[c] -
                            tile_pixels[0][3 * (TILE * (TILE - 1 - in) + TILE - 1) + c]) <= 1);
        }
    /* halving: the lowest row means over 2 x 2 texels, twice along a cell */
    for (int x = 0; x < TILE; x++) {
        const int a = texel(sheet, TREEPIECES_HALVING, x, bottom)[0];
        int like = 0;
        for (int t = 0; t < TILES; t++) {
            const uint8_t *p = tile_pixels[t] + 3 * (TILE * (TILE - 2) + 2 * x % TILE);
            like += abs((p[0] + p[3] + p[3 * TILE] + p[3 * TILE + 3]) / 4 - a) <= 1;
        }
        assert_true(like > 0);
    }
    /* an own class: its tile in the middle of 2 x 2 cells; a class without tiles shows another */
    for (int y = 0; y < TILE; y++)
        assert_memory_equal(texel(sheet, TREEPIECES_OWN + 1, TILE / 2, TILE / 2 + y),
                            tile_pixels[TILES] + 3 * TILE * y, 3 * TILE);
    free(sheet);
}

static void test_sheet_refuses(void **state) {
    (void)state;
    static uint8_t sheet[SIDE * SIDE * TREEPIECES_OWN * 3], keep[sizeof sheet];
    static const int bad_class = 3;
    make_tiles();
    for (int i = 0; i < 8; i++) {
        treepieces_bark_desc d;
        txm_env env = tk_env(NULL, NULL);
        txm_image out = picture(sheet, SIDE, SIDE * TREEPIECES_OWN, 3, TXM_U8);
        memset(&d, 0, sizeof d);
        d.tiles = tiles;
        d.tile_count = TILES;
        switch (i) {
        case 0: d.tiles = NULL; break;
        case 1: d.tile_count = 0; break;
        case 2: out.height--; break;
        case 3: out.channels = 1; break;
        case 4: out.pixels = NULL; break;
        case 5: tiles[1].width--; break;
        case 6:
            d.classes = &bad_class;
            d.tile_count = 1;
            break;
        default: tiles[2].sample = TXM_U16; break;
        }
        assert_int_equal(treepieces_bark(&d, &env, out), TXM_BAD_ARGUMENT);
        assert_true(strlen(env.message) > 8);
        assert_memory_equal(sheet, keep, sizeof sheet);
        make_tiles();
    }
}

/* Drawn tiles share their border, and differ inside. */
static void test_drawn_bark(void **state) {
    (void)state;
    for (int preset = 0; preset < treepieces_preset_count(); preset++) {
        const char *text = treepieces_preset_text(preset);
        treepieces_species s;
        assert_int_equal(treepieces_species_parse(text, strlen(text), NULL, &s), TXM_OK);
        make_tiles();
        assert_int_equal(treepieces_draw_bark(&s, 4, NULL, tiles, TILES), TXM_OK);
        int differ = 0;
        for (int t = 1; t < TILES; t++)
            for (int i = 0; i < TILE * TILE * 3; i++) {
                const int x = i / 3 % TILE, y = i / 3 / TILE;
                if (x == 0 || y == 0 || x == TILE - 1 || y == TILE - 1)
                    assert_true(abs(tile_pixels[t][i] - tile_pixels[0][i]) <= 1);
                differ += tile_pixels[t][i] != tile_pixels[0][i];
            }
        assert_true(differ > TILE * TILE);
    }
    treepieces_species s = species("oak");
    assert_int_equal(treepieces_draw_bark(NULL, 0, NULL, tiles, 1), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_draw_bark(&s, 0, NULL, tiles, 0), TXM_BAD_ARGUMENT);
}

/* ---- leaves --------------------------------------------------------------------------------- */

static uint8_t leaf_pixels[6][LEAF * LEAF * 4];

static void test_leaves(void **state) {
    (void)state;
    treepieces_species s = species("oak");
    for (int shape = 0; shape < 6; shape++) {
        const txm_image out = picture(leaf_pixels[shape], LEAF, LEAF, 4, TXM_U8);
        s.leaf_shape = shape;
        assert_int_equal(treepieces_draw_leaves(&s, 3, NULL, out), TXM_OK);
        int solid = 0, clear = 0;
        for (int i = 0; i < LEAF * LEAF; i++) {
            const uint8_t *p = leaf_pixels[shape] + 4 * i;
            solid += p[3] == 255;
            clear += p[3] == 0;
            assert_true(p[0] + p[1] + p[2] > 0); /* colour under what is clear too */
        }
        assert_true(solid > LEAF * LEAF / 20 && clear > LEAF * LEAF / 5);
        for (int other = 0; other < shape; other++)
            assert_true(memcmp(leaf_pixels[other], leaf_pixels[shape], sizeof leaf_pixels[0]) != 0);
    }
    txm_image bad = picture(leaf_pixels[0], LEAF, LEAF, 3, TXM_U8);
    assert_int_equal(treepieces_draw_leaves(&s, 3, NULL, bad), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_draw_leaves(NULL, 3, NULL, bad), TXM_BAD_ARGUMENT);
    for (long k = 1;; k++) { /* every allocation in turn fails */
        tk_memory memory;
        memset(&memory, 0, sizeof memory);
        memory.fail_at = k;
        txm_env env = tk_env(&memory, NULL);
        const txm_image out = picture(leaf_pixels[0], LEAF, LEAF, 4, TXM_U8);
        const txm_status status = treepieces_draw_leaves(&s, 3, &env, out);
        assert_int_equal(tk_leaks(&memory), 0);
        if (memory.calls < k) {
            assert_int_equal(status, TXM_OK);
            break;
        }
        assert_int_equal(status, TXM_OUT_OF_MEMORY);
    }
}

static void test_clouds(void **state) {
    (void)state;
    static treepieces_card cards[256], again[256], other[256];
    for (int preset = 0; preset < treepieces_preset_count(); preset++) {
        const char *text = treepieces_preset_text(preset);
        treepieces_species s;
        assert_int_equal(treepieces_species_parse(text, strlen(text), NULL, &s), TXM_OK);
        const int count = treepieces_cloud(&s, 7, cards);
        assert_int_equal(count, s.leaf_count);
        assert_int_equal(treepieces_cloud(&s, 7, NULL), count);
        treepieces_cloud(&s, 7, again);
        treepieces_cloud(&s, 8, other);
        if (count) assert_memory_equal(cards, again, (size_t)count * sizeof *cards);
        if (count) assert_true(memcmp(cards, other, (size_t)count * sizeof *cards) != 0);
        for (int i = 0; i < count; i++) {
            const treepieces_card *c = &cards[i];
            assert_true(tpc_dot(c->center, c->center) <= 1.0001f);
            assert_true(fabsf(tpc_dot(c->normal, c->normal) - 1) < 1e-3f);
            assert_true(fabsf(tpc_dot(c->right, c->up)) < 1e-3f * tpc_dot(c->up, c->up) + 1e-6f);
        }
    }
    assert_int_equal(treepieces_cloud(NULL, 0, NULL), 0);
}

/* ---- impostors ------------------------------------------------------------------------------ */

static uint8_t seen[VIEW * VIEW * 4];
static float depths[VIEW * VIEW];

static treepieces_impostor_desc look(const treepieces_species *s, treepieces_card *cards, int back) {
    treepieces_impostor_desc d;
    const float turn = back ? -1.0f : 1.0f;
    memset(&d, 0, sizeof d);
    d.leaves = picture(leaf_pixels[0], LEAF, LEAF, 4, TXM_U8);
    assert_int_equal(treepieces_draw_leaves(s, 3, NULL, d.leaves), TXM_OK);
    d.card_count = treepieces_cloud(s, 1, cards);
    d.cards = cards;
    d.right[0] = 0.8f * turn;
    d.right[2] = 0.6f * turn;
    d.up[1] = 1;
    d.forward[0] = 0.6f * turn;
    d.forward[2] = -0.8f * turn;
    d.light[1] = 1;
    return d;
}

/* Each pixel against all cards, one after the other. */
static void test_impostor(void **state) {
    (void)state;
    static treepieces_card cards[256];
    static uint8_t front[VIEW * VIEW];
    const treepieces_species s = species("beech");
    const txm_image color = picture(seen, VIEW, VIEW, 4, TXM_U8);
    const txm_image depth = picture(depths, VIEW, VIEW, 1, TXM_F32);
    treepieces_impostor_desc d = look(&s, cards, 0);
    assert_int_equal(treepieces_impostor(&d, NULL, color, depth), TXM_OK);
    int covered = 0, wrong = 0;
    for (int i = 0; i < VIEW * VIEW; i++) {
        const double sx = (i % VIEW + 0.5) / (VIEW / 2) - 1, sy = 1 - (i / VIEW + 0.5) / (VIEW / 2);
        double nearest = -2;
        for (int k = 0; k < d.card_count; k++) {
            double c[3], r[3], u[3];
            const float *axes[3] = {d.right, d.up, d.forward};
            for (int a = 0; a < 3; a++) {
                c[a] = (double)tpc_dot(cards[k].center, axes[a]);
                r[a] = (double)tpc_dot(cards[k].right, axes[a]);
                u[a] = (double)tpc_dot(cards[k].up, axes[a]);
            }
            const double det = r[0] * u[1] - r[1] * u[0];
            const double size = (double)tpc_dot(cards[k].right, cards[k].right) *
                                (double)tpc_dot(cards[k].up, cards[k].up);
            if (det * det <= 0.01 * size) continue; /* seen from the edge: not shown */
            const double a = ((sx - c[0]) * u[1] - (sy - c[1]) * u[0]) / det;
            const double b = (r[0] * (sy - c[1]) - r[1] * (sx - c[0])) / det;
            if (fabs(a) >= 1 || fabs(b) >= 1) continue;
            const int tx = (int)((0.5 + 0.5 * a) * LEAF), ty = (int)((0.5 - 0.5 * b) * LEAF);
            const double z = -(c[2] + a * r[2] + b * u[2]);
            if (leaf_pixels[0][4 * (ty * LEAF + tx) + 3] >= 128 && z > nearest) nearest = z;
        }
        const int is_there = seen[4 * i + 3] == 255;
        assert_true(is_there || seen[4 * i + 3] == 0);
        assert_true(is_there ? fabsf(depths[i]) <= 1.001f : depths[i] == -2);
        covered += front[i] = (uint8_t)is_there;
        wrong += (nearest > -2) != is_there || (is_there && fabs(nearest - (double)depths[i]) > 1e-3);
    }
    assert_true(covered > VIEW * VIEW / 10);
    assert_true(wrong * 200 < VIEW * VIEW);
    /* from behind the same outline, mirrored */
    d = look(&s, cards, 1);
    assert_int_equal(treepieces_impostor(&d, NULL, color, depth), TXM_OK);
    wrong = 0;
    for (int i = 0; i < VIEW * VIEW; i++)
        wrong += (seen[4 * i + 3] == 255) != front[i / VIEW * VIEW + VIEW - 1 - i % VIEW];
    assert_true(wrong * 100 < VIEW * VIEW);

    for (int i = 0; i < 6; i++) {
        treepieces_impostor_desc bad = d;
        txm_image far = depth, to = color;
        switch (i) {
        case 0: bad.cards = NULL; break;
        case 1: bad.right[0] = 2; break;
        case 2: bad.forward[1] = (float)NAN; break;
        case 3: far.width--; break;
        case 4: to.channels = 3; break;
        default: bad.leaves.pixels = NULL; break;
        }
        assert_int_equal(treepieces_impostor(&bad, NULL, to, far), TXM_BAD_ARGUMENT);
    }
}

/* ---- cards ----------------------------------------------------------------------------------- */

static void test_baked_leaves(void **state) {
    (void)state;
    const treepieces_species s = species("birch");
    treepieces_kit *kit;
    treepieces_forest *f;
    treepieces_mesh *m;
    treepieces_forest_desc d;
    assert_int_equal(treepieces_kit_make(NULL, 0, NULL, &kit), TXM_OK);
    memset(&d, 0, sizeof d);
    d.kit = kit;
    d.species = &s;
    d.species_count = 1;
    d.tree_count = 3;
    d.max_pieces = 120;
    assert_int_equal(treepieces_forest_make(&d, NULL, &f), TXM_OK);
    float *bones = (float *)malloc(f->node_count * TREEPIECES_BONE * sizeof(float));
    assert_non_null(bones);
    assert_int_equal(treepieces_bones(f, NULL, NULL, bones), TXM_OK);
    for (int tree = 0; tree < 3; tree++) {
        const treepieces_tree *t = &f->trees[tree];
        assert_true(t->cluster_count > 0);
        assert_int_equal(treepieces_bake_leaves(f, tree, bones, 4, NULL, &m), TXM_OK);
        const size_t cards = (size_t)t->cluster_count * (size_t)s.leaf_count;
        assert_int_equal(m->vertex_count, 4 * cards);
        assert_int_equal(m->triangle_count, 2 * cards);
        for (size_t v = 0; v < m->vertex_count; v++) {
            assert_true(m->joints[4 * v] < t->node_count && m->weights[4 * v] == 1);
            float far = 1e9f; /* every card lies in a cloud of its joint */
            for (uint32_t i = 0; i < t->cluster_count; i++) {
                const treepieces_cluster *c = &f->clusters[t->first_cluster + i];
                const float *b = bones + TREEPIECES_BONE * (size_t)c->node;
                float off[3];
                if (c->node - t->first_node != m->joints[4 * v]) continue;
                for (int k = 0; k < 3; k++)
                    off[k] = m->positions[3 * v + (size_t)k] - (b[4 * k + 3] + c->along * b[4 * k + 1]);
                far = txm_minf(far, sqrtf(tpc_dot(off, off)) / c->radius);
            }
            assert_true(far <= 1.01f);
        }
        for (size_t i = 0; i < 3 * m->triangle_count; i++) {
            assert_true(m->indices[i] < m->vertex_count);
            assert_true(m->uvs[2 * i] >= 0 && m->uvs[2 * i + 1] <= 1);
        }
        treepieces_mesh_free(m);
    }
    for (long k = 1;; k++) {
        tk_memory memory;
        memset(&memory, 0, sizeof memory);
        memory.fail_at = k;
        txm_env env = tk_env(&memory, NULL);
        const txm_status status = treepieces_bake_leaves(f, 0, bones, 4, &env, &m);
        if (memory.calls < k) {
            assert_int_equal(status, TXM_OK);
            treepieces_mesh_free(m);
            assert_int_equal(tk_leaks(&memory), 0);
            break;
        }
        assert_int_equal(status, TXM_OUT_OF_MEMORY);
        assert_null(m);
        assert_int_equal(tk_leaks(&memory), 0);
    }
    assert_int_equal(treepieces_bake_leaves(f, 3, bones, 4, NULL, &m), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_bake_leaves(f, 0, NULL, 4, NULL, &m), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_bake_leaves(f, 0, bones, 0, NULL, &m), TXM_BAD_ARGUMENT);
    free(bones);
    treepieces_forest_free(f);
    treepieces_kit_free(kit);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sheet),    cmocka_unit_test(test_sheet_refuses),
        cmocka_unit_test(test_drawn_bark), cmocka_unit_test(test_leaves),
        cmocka_unit_test(test_clouds),   cmocka_unit_test(test_impostor),
        cmocka_unit_test(test_baked_leaves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
