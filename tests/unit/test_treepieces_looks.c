/* test_treepieces_looks.c - trees: leaf clouds, drawn leaves, impostors and baked cards
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include "treepieces.h"

#include "growkit.h"

enum { SHAPES = TREEPIECES_LEAF_COMPOUND + 1, KINDS = TREEPIECES_CLOUD_STRIPS + 1 };
enum { SIDE = 96, VIEW = 72, MOST_CARDS = 256 };

static treepieces_species shaped(int shape) {
    treepieces_species s = oak;
    s.leaf_shape = shape;
    return s;
}

static txm_image draw_shape(int shape, uint64_t seed) {
    const treepieces_species s = shaped(shape);
    txm_image image = make_image(SIDE, SIDE, 4, TXM_U8);
    assert_int_equal(treepieces_draw_leaves(&s, seed, NULL, image), TXM_OK);
    return image;
}

/* ---- leaf clouds ------------------------------------------------------------------------- */

static void check_card(const treepieces_card *c) {
    const float width = dot(c->right, c->right), height = dot(c->up, c->up);
    assert_true(width > 0 && height > 0);
    assert_true(fabsf(dot(c->right, c->up)) < 1e-5f * (width + height));
    assert_true(fabsf(dot(c->normal, c->normal) - 1) < 1e-4f);
    const float *r = c->right, *u = c->up;
    const float front[3] = {r[1] * u[2] - r[2] * u[1], r[2] * u[0] - r[0] * u[2], r[0] * u[1] - r[1] * u[0]};
    assert_true(dot(front, c->normal) > 0); /* lit on its front */
    for (int k = 0; k < 4; k++) { /* all of it lies in the sphere, where impostors see it */
        float p[3];
        for (int a = 0; a < 3; a++)
            p[a] = c->center[a] + (k & 1 ? c->right[a] : -c->right[a]) +
                   (k & 2 ? c->up[a] : -c->up[a]);
        assert_true(dot(p, p) < 1.0001f);
    }
}

static void test_cloud(void **state) {
    (void)state;
    static const float sizes[] = {0.05f, 0.3f, 0.9f};
    static const float flats[] = {0.1f, 0.5f, 1, 2};
    static const int counts[] = {1, 2, 5, 40, MOST_CARDS};
    treepieces_card cards[MOST_CARDS];
    /* a step without a common divisor meets all values of each list */
    for (int i = 0; i < KINDS * 3 * 4 * 5; i += tk_full() ? 1 : 7) {
        treepieces_species s = shaped(i % SHAPES);
        s.cloud_kind = i % KINDS;
        s.leaf_size = sizes[i / KINDS % 3];
        s.cloud_flat = flats[i / KINDS / 3 % 4];
        s.leaf_count = counts[i / KINDS / 12];
        for (uint32_t look = 0; look < 3; look++) {
            assert_int_equal(treepieces_cloud(&s, look, NULL), s.leaf_count);
            assert_int_equal(treepieces_cloud(&s, look, cards), s.leaf_count);
            for (int k = 0; k < s.leaf_count; k++) {
                check_card(&cards[k]);
                /* the cards' size is what the species says */
                assert_true(fabsf(sqrtf(dot(cards[k].up, cards[k].up)) - s.leaf_size / 2) <
                            0.26f * s.leaf_size);
            }
        }
    }
    treepieces_species bare = oak;
    bare.leaf_count = 0;
    assert_int_equal(treepieces_cloud(&bare, 1, cards), 0);
    assert_int_equal(treepieces_cloud(NULL, 1, cards), 0);
}

/* The same look gives the same cloud, different looks different ones. */
static void test_looks(void **state) {
    (void)state;
    enum { LOOKS = 16 };
    treepieces_card cards[MOST_CARDS];
    for (int kind = 0; kind < KINDS; kind++) {
        treepieces_species s = oak;
        s.cloud_kind = kind;
        const size_t bytes = (size_t)s.leaf_count * sizeof *cards;
        uint64_t hashes[LOOKS];
        for (uint32_t look = 0; look < LOOKS; look++) {
            memset(cards, 0x55, sizeof cards);
            treepieces_cloud(&s, look, cards);
            hashes[look] = tk_hash(0, cards, bytes);
            memset(cards, 0xaa, sizeof cards);
            treepieces_cloud(&s, look, cards);
            assert_true(tk_hash(0, cards, bytes) == hashes[look]);
            for (uint32_t k = 0; k < look; k++) assert_true(hashes[k] != hashes[look]);
        }
    }
}

/* Over many looks cards are balanced about the centre, mostly near the surface, with normals
   outwards; flat clouds are flat. */
static void test_cloud_spread(void **state) {
    (void)state;
    enum { LOOKS = 64 };
    treepieces_card cards[MOST_CARDS];
    for (int kind = 0; kind < TREEPIECES_CLOUD_STRIPS; kind++) {
        treepieces_species s = oak;
        s.cloud_kind = kind;
        s.cloud_flat = 0.5f;
        s.leaf_size = 0.3f;
        double sum[3] = {0, 0, 0}, square[3] = {0, 0, 0};
        long outwards = 0, outside = 0, all = 0;
        for (uint32_t look = 0; look < LOOKS; look++) {
            const int count = treepieces_cloud(&s, look, cards);
            for (int k = 0; k < count; k++, all++) {
                for (int a = 0; a < 3; a++) {
                    sum[a] += (double)cards[k].center[a];
                    square[a] += (double)(cards[k].center[a] * cards[k].center[a]);
                }
                const float *c = cards[k].center;
                outside += c[0] * c[0] + 4 * c[1] * c[1] + c[2] * c[2] > 0.16f;
                outwards += dot(cards[k].normal, c) > 0;
            }
        }
        for (int a = 0; a < 3; a++) assert_true(fabs(sum[a]) < 0.06 * (double)all);
        assert_true(outside > all / 2);
        assert_true(outwards > all * 3 / 4);
        assert_true(square[1] < 0.5 * square[0] && square[1] < 0.5 * square[2]);
        assert_true(square[0] < 1.3 * square[2] && square[2] < 1.3 * square[0]);
    }
}

/* Strips hang, layers lie flatter than the rest, and all but strips grow outwards. */
static void test_cloud_kinds(void **state) {
    (void)state;
    enum { LOOKS = 32 };
    treepieces_card cards[MOST_CARDS];
    double down[KINDS], lying[KINDS], outwards[KINDS];
    for (int kind = 0; kind < KINDS; kind++) {
        treepieces_species s = oak;
        s.cloud_kind = kind;
        s.cloud_flat = kind == TREEPIECES_CLOUD_STRIPS ? 2 : 0.6f;
        long all = 0;
        down[kind] = lying[kind] = outwards[kind] = 0;
        for (uint32_t look = 0; look < LOOKS; look++) {
            const int count = treepieces_cloud(&s, look, cards);
            for (int k = 0; k < count; k++, all++) {
                const treepieces_card *c = &cards[k];
                const double high = sqrt((double)dot(c->up, c->up)), wide = sqrt((double)dot(c->right, c->right));
                const double across = (double)(c->up[2] * c->right[0] - c->up[0] * c->right[2]);
                down[kind] -= (double)c->up[1] / high;
                lying[kind] += fabs(across) / (high * wide);
                outwards[kind] += dot(c->up, c->center) > 0;
            }
        }
        down[kind] /= (double)all;
        lying[kind] /= (double)all;
        outwards[kind] /= (double)all;
    }
    assert_true(down[TREEPIECES_CLOUD_STRIPS] > 0.95);
    assert_true(lying[TREEPIECES_CLOUD_STRIPS] < 0.25);
    for (int kind = 0; kind < TREEPIECES_CLOUD_STRIPS; kind++) {
        assert_true(fabs(down[kind]) < 0.5);
        assert_true(outwards[kind] > 0.7);
    }
    assert_true(lying[TREEPIECES_CLOUD_LAYERS] > lying[TREEPIECES_CLOUD_ROUND] + 0.1);
}

/* ---- drawn leaves ------------------------------------------------------------------------ */

static void test_leaves(void **state) {
    (void)state;
    txm_image shapes[SHAPES];
    for (int shape = 0; shape < SHAPES; shape++) {
        long opaque = 0, clear = 0, dark = 0;
        double mean[3] = {0, 0, 0};
        shapes[shape] = draw_shape(shape, 3);
        for (int y = 0; y < SIDE; y++)
            for (int x = 0; x < SIDE; x++) {
                const uint8_t *p = rgba(&shapes[shape], x, y);
                opaque += p[3] == 255;
                clear += p[3] == 0;
                /* what cannot be seen is no darker than leaves: filters mix it in */
                dark += p[3] == 0 && (float)p[1] < 0.5f * 255 * oak.leaf_color[1];
                for (int c = 0; c < 3; c++) mean[c] += p[3] == 255 ? (double)p[c] / 255 : 0;
            }
        assert_in_range(opaque, SIDE * SIDE / 20, SIDE * SIDE * 3 / 4);
        assert_in_range(clear, SIDE * SIDE / 8, SIDE * SIDE * 9 / 10);
        assert_int_equal(dark, 0);
        for (int c = 0; c < 3 && shape != TREEPIECES_LEAF_BLOSSOM; c++) /* tinted */
            assert_true(fabs(mean[c] / (double)opaque - (double)oak.leaf_color[c]) < 0.15);
        for (int other = 0; other < shape; other++) {
            long unlike = 0;
            for (int i = 0; i < SIDE * SIDE; i++)
                unlike += (rgba(&shapes[shape], i % SIDE, i / SIDE)[3] ^
                           rgba(&shapes[other], i % SIDE, i / SIDE)[3]) >> 7;
            assert_true(unlike > SIDE * SIDE / 25);
        }
    }
    for (int shape = 0; shape < SHAPES; shape++) free(shapes[shape].pixels);
}

/* Smaller pictures, as textures seen from afar are, show about as much above half transparency. */
static void test_leaves_from_afar(void **state) {
    (void)state;
    enum { LARGE = 256, BLOCK = 16 };
    for (int i = 0; i <= SHAPES; i++) { /* the last: needles of pines */
        treepieces_species s = shaped(i < SHAPES ? i : TREEPIECES_LEAF_NEEDLE);
        if (i == SHAPES) s.cloud_kind = TREEPIECES_CLOUD_SHOOTS;
        txm_image image = make_image(LARGE, LARGE, 4, TXM_U8);
        long near = 0, afar = 0;
        assert_int_equal(treepieces_draw_leaves(&s, 5, NULL, image), TXM_OK);
        for (int block = 0; block < LARGE / BLOCK * (LARGE / BLOCK); block++) {
            const int x = block % (LARGE / BLOCK) * BLOCK, y = block / (LARGE / BLOCK) * BLOCK;
            long sum = 0;
            for (int k = 0; k < BLOCK * BLOCK; k++) {
                const int alpha = rgba(&image, x + k % BLOCK, y + k / BLOCK)[3];
                near += alpha > 127;
                sum += alpha;
            }
            afar += sum > 127 * BLOCK * BLOCK ? BLOCK * BLOCK : 0;
        }
        assert_in_range(afar, near / 2, near * 3 / 2);
        free(image.pixels);
    }
}

/* Pines have longer needles than other conifers, in a wider spray. */
static void test_needles(void **state) {
    (void)state;
    int width[2];
    for (int i = 0; i < 2; i++) {
        treepieces_species s = shaped(TREEPIECES_LEAF_NEEDLE);
        int low = 2 * SIDE, high = -1;
        s.cloud_kind = i ? TREEPIECES_CLOUD_SHOOTS : TREEPIECES_CLOUD_LAYERS;
        txm_image image = make_image(2 * SIDE, 2 * SIDE, 4, TXM_U8);
        assert_int_equal(treepieces_draw_leaves(&s, 5, NULL, image), TXM_OK);
        for (int x = 0; x < 2 * SIDE; x++) /* in the upper half, where others taper */
            for (int y = SIDE / 4; y < SIDE; y++) {
                if (rgba(&image, x, y)[3] < 128) continue;
                if (x < low) low = x;
                high = x;
            }
        width[i] = high - low;
        free(image.pixels);
    }
    assert_true(width[1] > width[0] + SIDE / 8);
}

/* Strips are several shoots side by side, all other sprays grow from one stem. Needles do not hang. */
static void test_strips(void **state) {
    (void)state;
    for (int i = 0; i < 3; i++) {
        treepieces_species s = shaped(i == 2 ? TREEPIECES_LEAF_NEEDLE : TREEPIECES_LEAF_LANCE);
        txm_image image = make_image(2 * SIDE, 2 * SIDE, 4, TXM_U8);
        int stems = 0;
        s.cloud_kind = i ? TREEPIECES_CLOUD_STRIPS : TREEPIECES_CLOUD_ROUND;
        assert_int_equal(treepieces_draw_leaves(&s, 5, NULL, image), TXM_OK);
        for (int x = 1; x < 2 * SIDE; x++) /* that begin in the lowest row */
            stems += rgba(&image, x, 2 * SIDE - 1)[3] > 99 && rgba(&image, x - 1, 2 * SIDE - 1)[3] <= 99;
        if (i == 1) assert_in_range(stems, 5, 7);
        else assert_int_equal(stems, 1);
        free(image.pixels);
    }
}

/* The same bytes with threads and with any stride; others with another seed. */
static void test_leaves_repeat(void **state) {
    (void)state;
    enum { WIDTH = 50, HEIGHT = 150, STRIDE = 256 };
    for (int shape = 0; shape < SHAPES; shape++) {
        const treepieces_species s = shaped(shape);
        txm_image plain = make_image(WIDTH, HEIGHT, 4, TXM_U8), other = plain, wide = plain;
        assert_int_equal(treepieces_draw_leaves(&s, 9, NULL, plain), TXM_OK);
        const uint64_t hash = hash_image(&plain);
        other.pixels = room(WIDTH * HEIGHT, 4);
        for (int kind = 0; kind < 2; kind++) {
            txm_env env = tk_env(NULL, NULL);
            env.parallel_for = kind ? tk_parallel_threads : tk_parallel_reverse;
            memset(other.pixels, 0x77, image_bytes(&other));
            assert_int_equal(treepieces_draw_leaves(&s, 9, &env, other), TXM_OK);
            assert_true(hash_image(&other) == hash);
        }
        uint8_t *bytes = (uint8_t *)room(HEIGHT, STRIDE);
        memset(bytes, 0x11, HEIGHT * STRIDE);
        wide.pixels = bytes;
        wide.stride = STRIDE;
        assert_int_equal(treepieces_draw_leaves(&s, 9, NULL, wide), TXM_OK);
        for (int y = 0; y < HEIGHT; y++) {
            assert_memory_equal(bytes + y * STRIDE, rgba(&plain, 0, y), 4 * WIDTH);
            for (int k = 4 * WIDTH; k < STRIDE; k++) assert_int_equal(bytes[y * STRIDE + k], 0x11);
        }
        assert_int_equal(treepieces_draw_leaves(&s, 10, NULL, other), TXM_OK);
        assert_true(hash_image(&other) != hash);
        free(bytes);
        free(other.pixels);
        free(plain.pixels);
    }
}

/* Images of any size and proportion. */
static void test_leaves_sizes(void **state) {
    (void)state;
    static const int sizes[][2] = {{1, 1}, {16, 16}, {1, 200}, {200, 1}, {17, 31}, {130, 65}};
    for (int i = 0; i < 6 * SHAPES; i++) {
        const treepieces_species s = shaped(i / 6);
        txm_image image = make_image(sizes[i % 6][0], sizes[i % 6][1], 4, TXM_U8);
        long covered = 0;
        assert_int_equal(treepieces_draw_leaves(&s, (uint64_t)i, NULL, image), TXM_OK);
        for (int k = 0; k < image.width * image.height; k++)
            covered += rgba(&image, k % image.width, k / image.width)[3];
        assert_true(covered > 0);
        free(image.pixels);
    }
}

static txm_status draw_leaves(void *context, txm_env *env) {
    return treepieces_draw_leaves(&oak, 1, env, *(const txm_image *)context);
}

static void test_leaves_refusals(void **state) {
    (void)state;
    txm_image good = make_image(32, 32, 4, TXM_U8);
    const uint64_t hash = hash_image(&good);
    for (int kind = 0; kind < 7; kind++) {
        txm_image bad = good;
        tk_memory memory;
        memset(&memory, 0, sizeof memory);
        txm_env env = tk_env(&memory, NULL);
        if (kind == 0) bad.pixels = NULL;
        if (kind == 1) bad.width = 0;
        if (kind == 2) bad.height = -3;
        if (kind == 3) bad.channels = 3;
        if (kind == 4) bad.channels = 1;
        if (kind == 5) bad.sample = TXM_U16;
        bad.width = kind == 5 ? 8 : bad.width;
        assert_int_equal(treepieces_draw_leaves(kind == 6 ? NULL : &oak, 1, &env, bad),
                         TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_int_equal(memory.blocks, 0);
        assert_true(hash_image(&good) == hash);
    }
    const tk_output pixels[1] = {{good.pixels, image_bytes(&good)}};
    assert_true(tk_sweep_outputs(draw_leaves, &good, TK_ALLOCATION, pixels, 1) > 2);
    assert_true(tk_sweep_outputs(draw_leaves, &good, TK_ONWARD, pixels, 1) > 2);
    /* every 64 rows, and each level of the bleeding of hidden colour, up and down: 32 has 5, 300 has 9 */
    assert_int_equal(tk_sweep(draw_leaves, &good, TK_CANCEL), 1 + 5 + 5);
    txm_image tall = make_image(4, 300, 4, TXM_U8);
    assert_int_equal(tk_sweep(draw_leaves, &tall, TK_CANCEL), 5 + 9 + 9);
    free(tall.pixels);
    free(good.pixels);
}

/* ---- impostors --------------------------------------------------------------------------- */

/* A view along forward, right horizontal. */
static void set_view(treepieces_impostor_desc *d, float x, float y, float z) {
    const float length = sqrtf(x * x + y * y + z * z), level = sqrtf(x * x + z * z);
    const float f[3] = {x / length, y / length, z / length};
    d->right[0] = level > 0 ? -z / level : 1;
    d->right[1] = 0;
    d->right[2] = level > 0 ? x / level : 0;
    for (int k = 0; k < 3; k++) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        d->forward[k] = f[k];
        d->up[k] = d->right[a] * f[b] - d->right[b] * f[a];
    }
}

static treepieces_impostor_desc view_cards(const treepieces_card *cards, int count,
                                         txm_image leaves) {
    treepieces_impostor_desc d;
    memset(&d, 0, sizeof d);
    d.cards = cards;
    d.card_count = count;
    d.leaves = leaves;
    d.light[0] = 0.48f;
    d.light[1] = 0.8f;
    d.light[2] = 0.36f;
    set_view(&d, 0, 0, -1);
    return d;
}

static float depth_at(const txm_image *depth, int x, int y) {
    return ((const float *)txm_image_row_const(depth, y))[x];
}

/* The texel where a ray hits a card, or NULL; *z: distance towards the eye. In three dimensions, in
   double. */
static const uint8_t *cast_ray(const treepieces_impostor_desc *d, const treepieces_card *card,
                               double x, double y, double *z) {
    double n[3], st[2], facing = 0, size = 0, away = 0;
    for (int k = 0; k < 3; k++) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        n[k] = (double)card->right[a] * (double)card->up[b] -
               (double)card->right[b] * (double)card->up[a];
        size += n[k] * n[k];
    }
    for (int k = 0; k < 3; k++) {
        n[k] /= sqrt(size);
        facing += n[k] * (double)d->forward[k];
        away += n[k] * ((double)card->center[k] - x * (double)d->right[k] - y * (double)d->up[k]);
    }
    if (fabs(facing) < 0.1) return NULL;
    *z = -away / facing;
    for (int side = 0; side < 2; side++) {
        const float *v = side ? card->up : card->right;
        double along = 0, square = 0;
        for (int k = 0; k < 3; k++) {
            const double p = x * (double)d->right[k] + y * (double)d->up[k] -
                             *z * (double)d->forward[k];
            along += (p - (double)card->center[k]) * (double)v[k];
            square += (double)v[k] * (double)v[k];
        }
        st[side] = along / square;
    }
    if (fabs(st[0]) >= 1 || fabs(st[1]) >= 1) return NULL;
    const uint8_t *texel = rgba(&d->leaves, (int)((st[0] + 1) / 2 * d->leaves.width),
                                (int)((1 - st[1]) / 2 * d->leaves.height));
    return texel[3] < 128 ? NULL : texel;
}

/* The brightness of a card, by the formula of the header. */
static double light_of(const treepieces_impostor_desc *d, const treepieces_card *card) {
    double lit = 0, through = 0;
    for (int k = 0; k < 3; k++) {
        lit += (double)card->normal[k] * (double)d->light[k];
        through += (double)d->forward[k] * (double)d->light[k];
    }
    lit = 0.35 + 0.65 * lit;
    lit = lit < 0 ? 0 : lit > 1 ? 1 : lit;
    return 0.82 + 0.36 * lit + 0.2 * (through > 0 ? through : 0);
}

static int agrees(const treepieces_impostor_desc *d, const txm_image *color,
                  const txm_image *depth, int column, int row) {
    const double x = (2 * column + 1.0) / color->width - 1;
    const double y = 1 - (2 * row + 1.0) / color->height;
    double best = -2, shade = 0;
    const uint8_t *seen = NULL, *p = rgba(color, column, row);
    for (int i = 0; i < d->card_count; i++) {
        double z;
        const uint8_t *texel = cast_ray(d, &d->cards[i], x, y, &z);
        if (!texel || z <= best) continue;
        best = z;
        seen = texel;
        const double square = x * x + y * y + z * z;
        shade = light_of(d, &d->cards[i]) * (0.75 + 0.25 * (square < 1 ? square : 1));
    }
    if (!seen) return p[3] == 0;
    if (p[3] != 255 || fabs((double)depth_at(depth, column, row) - best) > 1e-3) return 0;
    for (int c = 0; c < 3; c++) {
        const double lit = seen[c] * shade < 255 ? seen[c] * shade : 255;
        if (fabs(p[c] - lit) > 1.01) return 0;
    }
    return 1;
}

static void test_impostor(void **state) {
    (void)state;
    static const float views[][3] = {
        {0, 0, -1}, {1, 0, 0}, {0.3f, -1, 0.2f}, {-1, 2, 3}, {0, -1, 0}};
    treepieces_card cards[MOST_CARDS];
    txm_image color = make_image(VIEW, VIEW, 4, TXM_U8), depth = make_image(VIEW, VIEW, 1, TXM_F32);
    for (int i = 0; i < 5 * SHAPES; i++) {
        if (!tk_full() && i % 5 != i / 5 % 5) continue; /* each shape in one view */
        const treepieces_species s = shaped(i / 5);
        txm_image leaves = draw_shape(i / 5, 1);
        treepieces_impostor_desc d =
            view_cards(cards, treepieces_cloud(&s, (uint32_t)i, cards), leaves);
        set_view(&d, views[i % 5][0], views[i % 5][1], views[i % 5][2]);
        memset(color.pixels, 0x33, image_bytes(&color));
        memset(depth.pixels, 0x33, image_bytes(&depth));
        assert_int_equal(treepieces_impostor(&d, NULL, color, depth), TXM_OK);
        long good = 0, covered = 0;
        for (int y = 0; y < VIEW; y++)
            for (int x = 0; x < VIEW; x++) {
                const int alpha = rgba(&color, x, y)[3];
                const float z = depth_at(&depth, x, y);
                assert_true(alpha == 0 || alpha == 255);
                assert_true(alpha ? z >= -1 && z <= 1 : z == -2);
                covered += alpha == 255;
                good += agrees(&d, &color, &depth, x, y);
            }
        assert_true(covered > VIEW * VIEW / 20);
        assert_true((double)good >= 0.995 * VIEW * VIEW);
        free(leaves.pixels);
    }
    free(color.pixels);
    free(depth.pixels);
}

/* From the opposite side the silhouette is mirrored. */
static void test_impostor_behind(void **state) {
    (void)state;
    treepieces_card cards[MOST_CARDS];
    txm_image color[2], depth[2], leaves = draw_shape(TREEPIECES_LEAF_LOBED, 1);
    treepieces_impostor_desc d = view_cards(cards, treepieces_cloud(&oak, 7, cards), leaves);
    for (int side = 0; side < 2; side++) {
        color[side] = make_image(VIEW, VIEW, 4, TXM_U8);
        depth[side] = make_image(VIEW, VIEW, 1, TXM_F32);
        set_view(&d, side ? -0.4f : 0.4f, 0, side ? 0.7f : -0.7f);
        assert_int_equal(treepieces_impostor(&d, NULL, color[side], depth[side]), TXM_OK);
    }
    long unlike = 0, inside_out = 0;
    for (int i = 0; i < VIEW * VIEW; i++) {
        const int x = i % VIEW, y = i / VIEW, mirrored = VIEW - 1 - x;
        const int is_there = rgba(&color[0], x, y)[3] > 0;
        unlike += is_there != (rgba(&color[1], mirrored, y)[3] > 0);
        /* the nearest from behind lies no nearer to the front than the nearest from there */
        inside_out += is_there && rgba(&color[1], mirrored, y)[3] > 0 &&
                      -depth_at(&depth[1], mirrored, y) > depth_at(&depth[0], x, y) + 1e-3f;
    }
    assert_true(unlike <= VIEW * VIEW / 500);
    assert_int_equal(inside_out, 0);
    for (int side = 0; side < 2; side++) {
        free(color[side].pixels);
        free(depth[side].pixels);
    }
    free(leaves.pixels);
}

/* A card that faces the eye: position, orientation, occlusion. */
static void test_impostor_card(void **state) {
    (void)state;
    static const treepieces_card pair[2] = {
        {{0.5f, 0.25f, 0.5f}, {0.25f, 0, 0}, {0, 0.25f, 0}, {0, 0, 1}},
        {{0.5f, 0.25f, -0.5f}, {0.25f, 0, 0}, {0, 0.25f, 0}, {0, 0, 1}},
    };
    uint8_t texels[4][4] = {{200, 0, 0, 255}, {0, 200, 0, 255}, {0, 0, 200, 128}, {9, 9, 9, 127}};
    txm_image leaves, color = make_image(16, 8, 4, TXM_U8), depth = make_image(16, 8, 1, TXM_F32);
    memset(&leaves, 0, sizeof leaves);
    leaves.pixels = texels;
    leaves.width = leaves.height = 2;
    leaves.channels = 4;
    treepieces_impostor_desc d = view_cards(pair, 2, leaves);
    assert_int_equal(treepieces_impostor(&d, NULL, color, depth), TXM_OK);
    for (int y = 0; y < 8; y++)
        for (int x = 0; x < 16; x++) { /* it covers 0.25..0.75 by 0..0.5 of -1..1 */
            const uint8_t *p = rgba(&color, x, y);
            const int column = x < 10 || x > 13 ? -1 : (x - 10) / 2;
            const int row = y < 2 || y > 3 ? -1 : y - 2;
            const int is_there = column >= 0 && row >= 0 && column + row < 2;
            assert_int_equal(p[3], is_there ? 255 : 0);
            assert_true(depth_at(&depth, x, y) == (is_there ? 0.5f : -2.0f));
            for (int c = 0; c < 3 && is_there; c++)
                assert_int_equal(p[c] > 0, c == column + 2 * row);
        }
    d.card_count = 0; /* an empty cloud is an empty picture */
    d.cards = NULL;
    assert_int_equal(treepieces_impostor(&d, NULL, color, depth), TXM_OK);
    for (int i = 0; i < 128; i++) {
        assert_int_equal(rgba(&color, i % 16, i / 16)[3], 0);
        assert_true(depth_at(&depth, i % 16, i / 16) == -2);
    }
    free(color.pixels);
    free(depth.pixels);
}

/* All hidden pixels have colours between those of the visible ones. */
static void assert_bled(const txm_image *image) {
    int low[3] = {255, 255, 255}, high[3] = {0, 0, 0};
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < image->width * image->height; i++) {
            const uint8_t *p = rgba(image, i % image->width, i / image->width);
            for (int c = 0; c < 3; c++) {
                if (pass && !p[3]) assert_in_range(p[c], low[c], high[c]);
                if (pass || !p[3]) continue;
                low[c] = p[c] < low[c] ? p[c] : low[c];
                high[c] = p[c] > high[c] ? p[c] : high[c];
            }
        }
    }
}

static void test_hidden_colors(void **state) {
    (void)state;
    enum { TILE = 16, TILES = 3 };
    treepieces_card cards[MOST_CARDS];
    txm_image leaves = draw_shape(0, 1), color = make_image(VIEW, VIEW, 4, TXM_U8);
    txm_image depth = make_image(VIEW, VIEW, 1, TXM_F32), tiles[TILES];
    assert_bled(&leaves);
    const treepieces_impostor_desc d = view_cards(cards, treepieces_cloud(&oak, 3, cards), leaves);
    assert_int_equal(treepieces_impostor(&d, NULL, color, depth), TXM_OK);
    assert_bled(&color);

    /* bark in shreds: what is hidden makes no difference */
    treepieces_bark_desc bark;
    memset(&bark, 0, sizeof bark);
    bark.tiles = tiles;
    bark.tile_count = TILES;
    for (int k = 0; k < TILES; k++) tiles[k] = make_image(TILE, TILE, 4, TXM_U8);
    const int side = TREEPIECES_SHEET * TILE;
    txm_image sheet = make_image(side, side * treepieces_bark_layers(&bark), 4, TXM_U8);
    uint64_t hash = 0;
    for (int hidden = 0; hidden < 3; hidden++) {
        for (int k = 0; k < TILES; k++) {
            for (int i = 0; i < TILE * TILE; i++) {
                uint8_t *p = (uint8_t *)txm_image_row(&tiles[k], i / TILE) + 4 * (i % TILE);
                const int alpha = 40 * ((i % TILE * 3 + i / TILE + 5 * k) % 9) - 60;
                p[3] = (uint8_t)(alpha < 0 ? 0 : alpha > 255 ? 255 : alpha);
                for (int c = 0; c < 3; c++)
                    p[c] = (uint8_t)(p[3] ? 90 + 10 * c + i % 7 : hidden * 127);
            }
        }
        assert_int_equal(treepieces_bark(&bark, NULL, sheet), TXM_OK);
        if (hidden) assert_true(hash_image(&sheet) == hash);
        hash = hash_image(&sheet);
        for (int i = 0; i < sheet.width * sheet.height; i++)
            for (int c = 0; c < 3; c++)
                assert_in_range(rgba(&sheet, i % side, i / side)[c], 90 + 10 * c, 96 + 10 * c);
    }
    for (int k = 0; k < TILES; k++) free(tiles[k].pixels);
    free(sheet.pixels);
    free(leaves.pixels);
    free(color.pixels);
    free(depth.pixels);
}

static void test_impostor_refusals(void **state) {
    (void)state;
    treepieces_card cards[MOST_CARDS];
    txm_image leaves = draw_shape(0, 1), color = make_image(8, 8, 4, TXM_U8);
    txm_image depth = make_image(8, 8, 1, TXM_F32);
    const treepieces_impostor_desc good = view_cards(cards, treepieces_cloud(&oak, 0, cards), leaves);
    for (int kind = 0; kind < 13; kind++) {
        treepieces_impostor_desc d = good;
        txm_image c = color, z = depth;
        txm_env env = tk_env(NULL, NULL);
        if (kind == 0) d.cards = NULL;
        if (kind == 1) d.card_count = -1;
        if (kind == 2) d.leaves.pixels = NULL;
        if (kind == 3) d.leaves.channels = 3;
        if (kind == 4) c.channels = 3;
        if (kind == 5) c.sample = TXM_U16;
        if (kind == 6) z.sample = TXM_U8;
        if (kind == 7) z.width = 7;
        if (kind == 8) d.right[0] = 0.5f;
        if (kind == 9) memcpy(d.up, d.right, sizeof d.up);
        if (kind == 10) d.light[1] = (float)NAN;
        if (kind == 11) c.width = 0;
        assert_int_equal(treepieces_impostor(kind == 12 ? NULL : &d, &env, c, z), TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        assert_int_equal(rgba(&color, 4, 4)[3], 0);
    }
    /* cards of anything else are simply not seen */
    for (int k = 0; k < good.card_count; k++) {
        cards[k].center[k % 3] = k & 1 ? (float)NAN : (float)INFINITY;
        if (k & 2) cards[k].right[k % 3] = 1e38f;
    }
    assert_int_equal(treepieces_impostor(&good, NULL, color, depth), TXM_OK);
    free(leaves.pixels);
    free(color.pixels);
    free(depth.pixels);
}

/* ---- baked cards ------------------------------------------------------------------------- */

static grown grow_three(const treepieces_species *species) {
    treepieces_forest_desc d = describe(3, 200);
    d.species = species;
    return grow_posed(&d, 0.1f, 4);
}

/* v as the cloud of a cluster is turned about y */
static void turn_about(const treepieces_cluster *cluster, const float v[3], float out[3]) {
    const double angle = (cluster->look >> 8 & 255u) * 6.283185307179586 / 256;
    out[0] = (float)(cos(angle) * (double)v[0] + sin(angle) * (double)v[2]);
    out[1] = v[1];
    out[2] = (float)(cos(angle) * (double)v[2] - sin(angle) * (double)v[0]);
}

/* Card `card` of the cluster, as vertices 4 i.. of the mesh; crown: below the middle of the
   clusters by half of what they reach up and down. */
static void check_baked(const grown *g, const treepieces_tree *tree, const double crown[3],
                        const treepieces_cluster *cluster, const treepieces_card *card,
                        const treepieces_mesh *m, size_t i) {
    const float *bone = g->bones + TREEPIECES_BONE * (size_t)cluster->node;
    float middle[3], right[3], up[3], outward[3], normal[3], size = 0;
    int seen = 0;
    turn_about(cluster, card->center, middle);
    turn_about(cluster, card->right, right);
    turn_about(cluster, card->up, up);
    for (int a = 0; a < 3; a++) {
        const float at = bone[4 * a + 3] + cluster->along * bone[4 * a + 1] + cluster->radius * middle[a];
        outward[a] = at - (float)crown[a];
    }
    /* the front is turned away from the trunk */
    const float aside[3] = {outward[0], 0.1f * outward[1], outward[2]};
    float face[3] = {right[1] * up[2] - right[2] * up[1], right[2] * up[0] - right[0] * up[2],
                     right[0] * up[1] - right[1] * up[0]};
    const float side = dot(face, aside) < 0 ? -1 : 1, area = sqrtf(dot(face, face));
    for (int a = 0; a < 3; a++) right[a] *= side;
    for (int a = 0; a < 3; a++)
        normal[a] = 0.8f * outward[a] / sqrtf(dot(outward, outward)) + 0.4f * side * face[a] / area;
    size = sqrtf(dot(normal, normal));
    for (int a = 0; a < 3; a++) normal[a] /= size;
    for (size_t v = 4 * i; v < 4 * i + 4; v++) {
        assert_int_equal(m->joints[4 * v], cluster->node - tree->first_node);
        assert_true(m->weights[4 * v] == 1);
        for (size_t k = 1; k < 4; k++) assert_true(m->weights[4 * v + k] == 0);
        for (size_t k = 1; k < 4; k++) assert_int_equal(m->joints[4 * v + k], 0);
        assert_true(dot(m->normals + 3 * v, normal) > 0.9999f);
        assert_memory_equal(m->normals + 3 * v, m->normals + 12 * i, 3 * sizeof(float));
    }
    for (size_t c = 6 * i; c < 6 * i + 6; c++) { /* where the picture's corner says */
        const float s = 2 * m->uvs[2 * c] - 1, t = 1 - 2 * m->uvs[2 * c + 1];
        const uint32_t v = m->indices[c];
        assert_true(fabsf(s) == 1 && fabsf(t) == 1);
        assert_true(v / 4 == i);
        seen |= 1 << (v % 4);
        for (int a = 0; a < 3; a++) {
            const float center = bone[4 * a + 3] + cluster->along * bone[4 * a + 1];
            const float off = middle[a] + s * right[a] + t * up[a];
            assert_true(fabsf(m->positions[3 * v + (uint32_t)a] - center - cluster->radius * off) <
                        1e-4f * (1 + fabsf(center)));
        }
    }
    assert_int_equal(seen, 15);
}

static void test_bake_leaves(void **state) {
    (void)state;
    static const int looks[] = {1, 5, 64};
    treepieces_card cards[MOST_CARDS];
    grown g = grow_three(&oak);
    for (int tree = 0; tree < 3; tree++) {
        const treepieces_tree *t = &g.forest->trees[tree];
        treepieces_mesh *m;
        assert_true(t->cluster_count > 0);
        assert_int_equal(treepieces_bake_leaves(g.forest, tree, g.bones, looks[tree], NULL, &m),
                         TXM_OK);
        assert_int_equal(m->vertex_count, 4 * (size_t)oak.leaf_count * t->cluster_count);
        assert_int_equal(m->triangle_count, 2 * (size_t)oak.leaf_count * t->cluster_count);
        double crown[3] = {0, 0, 0}, square = 0; /* of heights */
        for (uint32_t i = 0; i < t->cluster_count; i++) {
            const treepieces_cluster *c = &g.forest->clusters[t->first_cluster + i];
            const float *bone = g.bones + TREEPIECES_BONE * (size_t)c->node;
            for (int a = 0; a < 3; a++) {
                const double at = (double)(bone[4 * a + 3] + c->along * bone[4 * a + 1]);
                crown[a] += at / t->cluster_count;
                square += a == 1 ? at * at / t->cluster_count : 0;
            }
        }
        crown[1] -= 0.5 * (1.9 * sqrt(square - crown[1] * crown[1]) + 0.01);
        for (uint32_t i = 0; i < t->cluster_count; i++) {
            const treepieces_cluster *cluster = &g.forest->clusters[t->first_cluster + i];
            const int count =
                treepieces_cloud(&oak, cluster->look % (uint32_t)looks[tree], cards);
            for (int k = 0; k < count; k++)
                check_baked(&g, t, crown, cluster, &cards[k], m, (size_t)i * (size_t)count + (size_t)k);
        }
        treepieces_mesh_free(m);
    }
    free_grown(&g);
    treepieces_species bare = oak;
    treepieces_mesh *m;
    bare.leaf_count = 0;
    g = grow_three(&bare);
    assert_int_equal(treepieces_bake_leaves(g.forest, 1, g.bones, 4, NULL, &m), TXM_OK);
    assert_int_equal(m->triangle_count, 0);
    assert_int_equal(m->vertex_count, 0);
    treepieces_mesh_free(m);
    free_grown(&g);
}

/* Factors of the picture: those of bark get darker with the radius of the stem, most on a birch, and near
   the ground; those of leaves towards the middle of the crown. */
static void test_colors(void **state) {
    (void)state;
    double mean[2][3][2]; /* of oak and birch; trunk, twigs, foot; sum and count */
    treepieces_species species;
    for (int i = 0; i < 2; i++) {
        assert_int_equal(treepieces_preset(i ? "birch" : "oak", NULL, &species), TXM_OK);
        treepieces_forest_desc d = describe(1, 400);
        treepieces_bake_desc desc;
        treepieces_mesh *m;
        d.species = &species;
        grown g = grow_posed(&d, 0, 1);
        const treepieces_tree *tree = &g.forest->trees[0];
        memset(&desc, 0, sizeof desc);
        memset(mean[i], 0, sizeof mean[i]);
        desc.forest = g.forest;
        desc.bones = g.bones;
        assert_int_equal(treepieces_bake(&desc, NULL, &m), TXM_OK);
        for (size_t v = 0; v < m->vertex_count; v++) {
            const uint8_t *c = m->colors + 4 * v;
            const float height = m->positions[3 * v + 1] - tree->position[1];
            assert_int_equal(c[3], 255);
            if (m->weights[4 * v] < 1) continue;
            const float radius = g.forest->nodes[m->joints[4 * v]].radius;
            const int kind = radius < 0.012f ? 1 : radius < 0.06f ? -1 : height > 0.9f ? 0 : height < 0.05f ? 2 : -1;
            if (kind < 0) continue;
            if (kind == 0) assert_in_range(c[0] + c[1] + c[2], 760, 765);
            mean[i][kind][0] += c[0] + c[1] + c[2];
            mean[i][kind][1]++;
        }
        treepieces_mesh_free(m);
        assert_int_equal(treepieces_bake_leaves(g.forest, 0, g.bones, 4, NULL, &m), TXM_OK);
        double middle[3] = {0, 0, 0}, light[2] = {0, 0}, count[2] = {0, 0}, far = 0;
        for (size_t v = 0; v < 3 * m->vertex_count; v++)
            middle[v % 3] += (double)m->positions[v] / (double)m->vertex_count;
        for (int pass = 0; pass < 2; pass++) {
            for (size_t v = 0; v < m->vertex_count; v++) {
                const uint8_t *c = m->colors + 4 * v;
                double square = 0;
                for (size_t k = 0; k < 3; k++) {
                    const double off = (double)m->positions[3 * v + k] - middle[k];
                    square += off * off;
                }
                if (pass == 0 && square > far) far = square;
                const int is_outside = square > 0.3 * far, is_inside = square < 0.03 * far;
                if (pass == 0 || !(is_outside || is_inside)) continue;
                light[is_inside] += c[0] + c[1] + c[2];
                count[is_inside]++;
            }
        }
        assert_true(count[0] > 100 && count[1] > 100);
        assert_true(light[1] / count[1] < 0.9 * light[0] / count[0]);
        treepieces_mesh_free(m);
        free_grown(&g);
    }
    for (int i = 0; i < 2; i++) assert_true(mean[i][2][0] / mean[i][2][1] < 690);
    assert_true(mean[1][1][1] > 10); /* an oak's twigs are thicker */
    assert_true(mean[1][1][0] / mean[1][1][1] < 420);
}

static txm_status bake_leaves(void *context, txm_env *env) {
    const grown *g = (const grown *)context;
    treepieces_mesh *m = (treepieces_mesh *)env;
    const txm_status status = treepieces_bake_leaves(g->forest, 0, g->bones, 8, env, &m);
    if (status != TXM_OK) assert_null(m);
    treepieces_mesh_free(m);
    return status;
}

static void test_bake_leaves_faults(void **state) {
    (void)state;
    grown g = grow_three(&oak);
    assert_true(tk_sweep(bake_leaves, &g, TK_ALLOCATION) > 7);
    assert_true(tk_sweep(bake_leaves, &g, TK_ONWARD) > 7);
    for (int kind = 0; kind < 7; kind++) {
        treepieces_mesh *m = (treepieces_mesh *)1;
        txm_env env = tk_env(NULL, NULL);
        assert_int_equal(
            treepieces_bake_leaves(kind == 0 ? NULL : g.forest, kind == 1 ? -1 : kind == 2 ? 3 : 0,
                                   kind == 3 ? NULL : g.bones, kind == 4 ? 0 : kind == 5 ? 65 : 8,
                                   &env, kind == 6 ? NULL : &m),
            TXM_BAD_ARGUMENT);
        assert_true(env.message[0] != 0);
        if (kind < 6) assert_null(m);
    }
    free_grown(&g);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cloud),           cmocka_unit_test(test_looks),
        cmocka_unit_test(test_cloud_spread),    cmocka_unit_test(test_cloud_kinds),
        cmocka_unit_test(test_leaves),          cmocka_unit_test(test_leaves_from_afar),
        cmocka_unit_test(test_needles),
        cmocka_unit_test(test_strips),
        cmocka_unit_test(test_leaves_repeat),   cmocka_unit_test(test_leaves_sizes),
        cmocka_unit_test(test_leaves_refusals), cmocka_unit_test(test_impostor),
        cmocka_unit_test(test_impostor_behind), cmocka_unit_test(test_impostor_card),
        cmocka_unit_test(test_impostor_refusals), cmocka_unit_test(test_bake_leaves),
        cmocka_unit_test(test_hidden_colors),
        cmocka_unit_test(test_bake_leaves_faults), cmocka_unit_test(test_colors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
