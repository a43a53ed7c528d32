/* test_treepieces.c - trees: growing, records, poses, wind and skinning
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include "treepieces.h"

#include "growkit.h"
#include "treekit.h"

/* ---- rims -------------------------------------------------------------------------------- */

enum { ALL_TYPES = TREEPIECES_BUILTIN, MOST_RIMS = 3 };

/* All vertices of all instances of a forest: first vertex of each node. */
typedef struct skinned {
    float *positions, *normals;
    size_t *first; /* by node */
} skinned;

static skinned skin_all(const treepieces_forest *f, const float *bones) {
    skinned s;
    size_t vertices = 0;
    s.first = (size_t *)room(f->node_count, sizeof *s.first);
    for (uint32_t i = 0; i < f->node_count; i++) {
        s.first[i] = vertices;
        vertices += (size_t)treepieces_kit_piece(f->kit, f->nodes[i].type)->vertex_count;
    }
    s.positions = (float *)room(vertices, 3 * sizeof(float));
    s.normals = (float *)room(vertices, 3 * sizeof(float));
    for (int t = 0; t < f->type_count; t++) {
        const treepieces_batch *b = &f->batches[t];
        for (uint32_t i = 0; i < b->count; i++) {
            const size_t at = 3 * s.first[b->words[(size_t)i * b->stride]];
            treepieces_skin(f, bones, t, i, s.positions + at, s.normals + at);
        }
    }
    return s;
}

static void free_skinned(skinned *s) {
    free(s->positions);
    free(s->normals);
    free(s->first);
}

/* The rims of children and parents in a skinned tree are equal to the bit. met: counts pairs of
   pieces. */
static void compare_rims(const treepieces_forest *f, const skinned *s,
                         int met[ALL_TYPES][MOST_RIMS][ALL_TYPES]) {
    for (uint32_t i = 0; i < f->node_count; i++) {
        const treepieces_node *n = &f->nodes[i], *up = n - i + n->parent;
        if (n->parent < 0) continue;
        const treepieces_piece *below = treepieces_kit_piece(f->kit, up->type);
        const treepieces_piece *above = treepieces_kit_piece(f->kit, n->type);
        const int rim = n->joint >> 3, turn = n->joint & 7;
        met[up->type][rim][n->type]++;
        for (int j = 0; j < TREEPIECES_RIM; j++) {
            const size_t a = s->first[n->parent] + (size_t)below->leaf_rims[rim][j];
            const size_t b = s->first[i] + (size_t)above->root_rim[(j + 6 - turn) % 6];
            assert_memory_equal(s->positions + 3 * a, s->positions + 3 * b, 12);
            assert_memory_equal(s->normals + 3 * a, s->normals + 3 * b, 12);
        }
    }
}

/* 1,000 random poses, all pairs of pieces: no gap at all, and no discontinuity of normals. */
static void test_rims(void **state) {
    (void)state;
    static int met[ALL_TYPES][MOST_RIMS][ALL_TYPES];
    treepieces_forest_desc d = describe(1, 60);
    d.own_rule = any_piece;
    for (int p = 0; p < 1000; p++) {
        treepieces_pose pose;
        memset(&pose, 0, sizeof pose);
        d.seed = (uint64_t)p;
        pose.seed = (uint64_t)p * 77;
        pose.amount = 0.6f;
        treepieces_forest *f = grow(&d);
        float *bones = make_bones(f, &pose);
        skinned s = skin_all(f, bones);
        compare_rims(f, &s, met);
        for (size_t i = 0; i < 3 * s.first[f->node_count - 1]; i++)
            assert_true(fabsf(s.positions[i]) < 1e4f && fabsf(s.normals[i]) <= 1.0001f);
        free_skinned(&s);
        free(bones);
        treepieces_forest_free(f);
    }
    for (int a = 0; a < ALL_TYPES; a++)
        for (int r = 0; r < treepieces_kit_piece(kit, a)->leaf_count; r++)
            for (int b = 0; b < ALL_TYPES; b++) assert_true(met[a][r][b] > 0);
}

/* Rims stay closed in wind, too. */
static void test_rims_in_wind(void **state) {
    (void)state;
    static int met[ALL_TYPES][MOST_RIMS][ALL_TYPES];
    treepieces_forest_desc d = describe(1, 400);
    treepieces_forest *f = grow(&d);
    float *bones = make_bones(f, NULL), *sway = (float *)room(f->node_count, 16);
    const treepieces_wind wind = {0.4f, 14, 0.8f, 3, 0};
    for (int i = 0; i < 20; i++) {
        assert_int_equal(treepieces_sway(f, &wind, i * 0.13, 0.13, NULL, NULL, sway, bones), TXM_OK);
        skinned s = skin_all(f, bones);
        compare_rims(f, &s, met);
        free_skinned(&s);
    }
    free(sway);
    free(bones);
    treepieces_forest_free(f);
}

/* ---- records ------------------------------------------------------------------------------- */

static void test_records(void **state) {
    (void)state;
    treepieces_forest_desc d = describe(20, 300);
    treepieces_forest *f = grow(&d);
    uint32_t pieces = 0;
    uint8_t *seen = (uint8_t *)room(f->node_count, 1);
    for (int t = 0; t < f->type_count; t++) {
        const treepieces_batch *b = &f->batches[t];
        const treepieces_piece *p = treepieces_kit_piece(kit, t);
        pieces += b->count;
        assert_int_equal(b->quad_count, p->quad_count);
        for (uint32_t i = 0; i < b->count; i++) {
            const uint32_t *w = b->words + (size_t)i * b->stride;
            assert_true(w[0] < f->node_count && !seen[w[0]]++);
            assert_int_equal(f->nodes[w[0]].type, t);
            if (i) assert_true(w[0] > w[0 - (ptrdiff_t)b->stride]);
            const uint32_t child[3] = {w[1] & 0xffff, w[1] >> 16, w[2] & 0xffff};
            for (int k = 0; k < 3; k++) {
                assert_int_equal(child[k] != 0, k < p->leaf_count);
                if (!child[k]) continue;
                const treepieces_node *n = &f->nodes[w[0] + child[k]];
                assert_int_equal(n->joint, k * 8 + (int)(w[2] >> (16 + 4 * k) & 15));
            }
            for (int q = 0; q < p->quad_count; q++) {
                const int cell = (int)(w[4 + q / 4] >> (8 * (q % 4)) & 255);
                const uint32_t band = w[3] >> (8 * p->quads[q].band) & 255;
                const int across = 1 << (band & 7), along = 1 << (band >> 3 & 3);
                assert_true((cell & 7) + across <= (across > 8 ? 16 : TREEPIECES_SHEET));
                assert_true((cell >> 3) + along <= TREEPIECES_SHEET);
                if (p->quads[q].tile_class != TREEPIECES_BARK || (band & 32))
                    assert_int_equal((cell >> 3) + along, TREEPIECES_SHEET);
            }
        }
    }
    assert_int_equal(pieces, f->node_count);
    for (int t = 0; t < f->tree_count; t++) {
        const treepieces_tree *tree = &f->trees[t];
        for (uint32_t i = 0; i < tree->node_count; i++) {
            const treepieces_node *n = &f->nodes[tree->first_node + i];
            assert_true(i ? n->parent >= 0 && n->parent < (int32_t)i : n->parent == TREEPIECES_NONE);
            assert_true(n->radius > 0 && n->length > 0);
        }
        for (uint32_t i = 0; i < tree->cluster_count; i++) {
            const uint32_t node = f->clusters[tree->first_cluster + i].node - tree->first_node;
            assert_true(node < tree->node_count);
        }
    }
    free(seen);
    treepieces_forest_free(f);
}

/* The number of tiles is the same on both sides of a rim. */
static void test_bark_continues(void **state) {
    (void)state;
    treepieces_forest_desc d = describe(5, 500);
    treepieces_forest *f = grow(&d);
    uint32_t *bands = (uint32_t *)room(f->node_count, 4);
    int halved = 0;
    for (int t = 0; t < f->type_count; t++)
        for (uint32_t i = 0; i < f->batches[t].count; i++) {
            const uint32_t *w = f->batches[t].words + (size_t)i * f->batches[t].stride;
            bands[w[0]] = w[3];
        }
    for (int t = 0; t < f->tree_count; t++) {
        const treepieces_tree *tree = &f->trees[t];
        for (uint32_t i = 1; i < tree->node_count; i++) {
            const treepieces_node *n = &f->nodes[tree->first_node + i];
            const treepieces_node *up = &f->nodes[tree->first_node + (uint32_t)n->parent];
            const uint32_t above = bands[tree->first_node + i];
            const uint32_t below = bands[tree->first_node + (uint32_t)n->parent] >>
                                   (8 * ((n->joint >> 3) + 1));
            const uint32_t foot = (above & 7) + (above >> 5 & 1); /* halving: twice as many at the base */
            assert_int_equal(foot, below & 7);
            halved += (above >> 5 & 1) != 0;
            (void)up;
        }
    }
    assert_true(halved > 0);
    free(bands);
    treepieces_forest_free(f);
}

/* ---- growing ------------------------------------------------------------------------------- */

static uint64_t hash_tree(const treepieces_forest *f, int tree) {
    const treepieces_tree *t = &f->trees[tree];
    uint64_t h = tk_hash(0, f->nodes + t->first_node, t->node_count * sizeof *f->nodes);
    for (uint32_t i = 0; i < t->cluster_count; i++)
        h = tk_hash(h, &f->clusters[t->first_cluster + i].along, 12);
    return h;
}

/* The same tree from the same seed, in any forest and with threads; others from other seeds. */
static void test_seeds(void **state) {
    (void)state;
    treepieces_place places[70];
    treepieces_forest_desc d = describe(70, 200);
    memset(places, 0, sizeof places);
    for (int i = 0; i < 70; i++) {
        places[i].position[0] = (float)i;
        places[i].seed = (uint64_t)(i % 35);
    }
    d.places = places;
    treepieces_forest *f = grow(&d), *threaded;
    txm_env env = tk_env(NULL, NULL);
    env.parallel_for = tk_parallel_threads;
    assert_int_equal(treepieces_forest_make(&d, &env, &threaded), TXM_OK);
    for (int i = 0; i < 70; i++) {
        assert_true(hash_tree(f, i) == hash_tree(threaded, i));
        if (i >= 35) assert_int_equal(f->trees[i].node_count, f->trees[i - 35].node_count);
        for (int j = 0; j < i && i < 35; j++) assert_true(hash_tree(f, i) != hash_tree(f, j));
    }
    d.places = places + 9;
    d.tree_count = 1;
    treepieces_forest *alone = grow(&d);
    assert_true(hash_tree(alone, 0) == hash_tree(f, 9));
    for (int t = 0; t < f->type_count; t++) {
        const size_t bytes = (size_t)f->batches[t].count * f->batches[t].stride * 4;
        assert_int_equal(f->batches[t].count, threaded->batches[t].count);
        if (bytes) assert_memory_equal(f->batches[t].words, threaded->batches[t].words, bytes);
    }
    treepieces_forest_free(alone);
    treepieces_forest_free(threaded);
    treepieces_forest_free(f);
}

/* A tree is the same wherever it stands, where floats are centimetres apart too, and however small. */
static void test_far_away(void **state) {
    (void)state;
    treepieces_place places[4];
    treepieces_forest_desc d = describe(4, 300);
    memset(places, 0, sizeof places);
    for (int i = 0; i < 4; i++) {
        places[i].seed = 9;
        places[i].scale = i < 2 ? 1 : 0.002f;
        places[i].position[0] = i % 2 ? 9e5f : 0;
        places[i].position[2] = i % 2 ? -3e5f : 0;
    }
    d.places = places;
    treepieces_forest *f = grow(&d);
    for (int i = 0; i < 4; i += 2) {
        const treepieces_tree *here = &f->trees[i], *there = &f->trees[i + 1];
        assert_int_equal(here->node_count, there->node_count);
        assert_memory_equal(f->nodes + here->first_node, f->nodes + there->first_node,
                            here->node_count * sizeof *f->nodes);
        assert_float_equal(here->height, there->height, 0);
        assert_true(here->height > (i ? 0.01f : 5));
    }
    treepieces_forest_free(f);
}

/* The places of a forest can be had without it, and make the same one. */
static void test_scatter(void **state) {
    (void)state;
    treepieces_species both[2] = {oak, oak};
    treepieces_place places[30], before[30];
    both[1].orders[0].length *= 2;
    txm_env env = tk_env(NULL, NULL);
    for (int count = 1; count <= 30; count += 29) {
        treepieces_forest_desc d = describe(count, 60);
        d.species = both;
        d.species_count = 2;
        treepieces_forest *f = grow(&d);
        assert_int_equal(treepieces_scatter(&d, &env, places), TXM_OK);
        for (int i = 0; i < count; i++) {
            assert_memory_equal(places[i].position, f->trees[i].position, sizeof places[i].position);
            assert_true(places[i].turn == f->trees[i].turn);
            assert_int_equal(places[i].species, f->trees[i].species);
        }
        d.places = places;
        treepieces_forest *same = grow(&d);
        for (int i = 0; i < count; i++) assert_true(hash_tree(f, i) == hash_tree(same, i));
        assert_int_equal(treepieces_scatter(&d, &env, before), TXM_OK);
        assert_memory_equal(before, places, (size_t)count * sizeof *places);
        treepieces_forest_free(same);
        treepieces_forest_free(f);
    }
    treepieces_forest_desc d = describe(30, 60);
    assert_int_equal(treepieces_scatter(&d, &env, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_scatter(NULL, &env, places), TXM_BAD_ARGUMENT);
    d.spacing = -1;
    assert_int_equal(treepieces_scatter(&d, &env, places), TXM_BAD_ARGUMENT);
    assert_memory_equal(before, places, sizeof places);
}

/* a rule whose branches are a tenth as thick as what they stand on */
static void thinner(void *user, const treepieces_site *site, txm_rng *rng, treepieces_choice *choice) {
    (void)user;
    (void)rng;
    choice->type = site->depth < 6 ? TREEPIECES_SIDE : TREEPIECES_TIP;
    choice->length = 2.5f * site->radius;
    choice->ratios[0] = choice->ratios[1] = 0.1f;
}

/* A tree of a micrometre is skinned as any other. */
static void test_tiny(void **state) {
    (void)state;
    treepieces_species small = oak;
    treepieces_place place;
    memset(&place, 0, sizeof place);
    small.orders[0].length = 0.01f;
    small.orders[0].radius = 0.001f;
    place.scale = 1e-3f;
    treepieces_forest_desc d = describe(1, 300);
    d.species = &small;
    d.own_rule = thinner;
    d.places = &place;
    treepieces_forest *f = grow(&d);
    float *bones = make_bones(f, NULL);
    skinned s = skin_all(f, bones);
    for (uint32_t i = 0; i < f->node_count; i++) {
        const treepieces_piece *p = treepieces_kit_piece(f->kit, f->nodes[i].type);
        for (size_t k = 0; k < 3 * (size_t)p->vertex_count; k++) {
            assert_true(txm_is_finite((double)s.positions[3 * s.first[i] + k]));
            assert_true(txm_is_finite((double)s.normals[3 * s.first[i] + k]));
        }
    }
    free_skinned(&s);
    free(bones);
    treepieces_forest_free(f);
}

/* With fewer pieces: no more than the limit, all ends closed, the thick parts still there. */
static void test_budget(void **state) {
    (void)state;
    for (int most = 8; most <= 3000; most = most * 3 / 2) {
        treepieces_forest_desc d = describe(3, most);
        treepieces_forest *f = grow(&d);
        for (int i = 0; i < 3; i++) assert_true((int)f->trees[i].node_count <= most);
        if (most > 300) assert_true((int)f->trees[0].node_count > most / 3);
        treepieces_forest_free(f);
    }
}

/* The rules of the paper: I and Y alternate, or are random. */
static void test_rules(void **state) {
    (void)state;
    treepieces_forest_desc d = describe(1, 300);
    d.rule = TREEPIECES_ALTERNATE;
    treepieces_forest *f = grow(&d);
    for (uint32_t i = 2; i < f->node_count; i++) {
        const int type = f->nodes[i].type, up = f->nodes[f->nodes[i].parent].type;
        if (type == TREEPIECES_TIP) continue;
        assert_true(type == TREEPIECES_I || type == TREEPIECES_Y);
        if (up != TREEPIECES_FLARE) assert_int_not_equal(type, up);
    }
    assert_true(f->batches[TREEPIECES_Y].count > 10);
    treepieces_forest_free(f);
    d.rule = TREEPIECES_RANDOM;
    f = grow(&d);
    const uint32_t i = f->batches[TREEPIECES_I].count, y = f->batches[TREEPIECES_Y].count;
    assert_true(i > 20 && y > 20 && i < 3 * y && y < 3 * i);
    assert_int_equal(f->batches[TREEPIECES_SIDE].count, 0);
    treepieces_forest_free(f);
}

/* Nothing leaves the envelope by more than one piece, or grows where it is too dark. */
static void test_pruning(void **state) {
    (void)state;
    treepieces_species s = oak;
    s.envelope = TREEPIECES_CYLINDER;
    s.crown_base = 0.2f;
    s.crown_top = 0.7f;
    s.crown_width = 0.3f;
    treepieces_forest_desc d = describe(1, 2000);
    d.species = &s;
    treepieces_forest *f = grow(&d), *free_form, *dark;
    float *bones = make_bones(f, NULL);
    const float trunk = 0.45f * s.orders[0].length; /* at least half of it, pieces included */
    for (uint32_t i = 0; i < f->node_count; i++) {
        const float *b = bones + TREEPIECES_BONE * (size_t)i;
        const int32_t up = f->nodes[i].parent; /* stems of order 0 may leave it, with what ends on them */
        if (f->nodes[i].order == 0 || f->nodes[up].order == 0) continue;
        assert_true(b[3] * b[3] + b[11] * b[11] < trunk * trunk);
    }
    s = oak;
    s.envelope = TREEPIECES_FREE;
    s.shade = 0;
    free_form = grow(&d);
    s.shade = 0.5f;
    dark = grow(&d);
    assert_true(dark->node_count < free_form->node_count);
    free(bones);
    treepieces_forest_free(f);
    treepieces_forest_free(free_form);
    treepieces_forest_free(dark);
}

/* The mean part of the pieces of a tree that lies above one of them, in a column of 1 m^2. */
static double mean_shade(const treepieces_forest *f) {
    enum { SIDE = 80 }; /* metres; no oak is as wide */
    float *bones = make_bones(f, NULL);
    double pairs = 0;
    for (uint32_t i = 0; i < f->node_count; i++)
        for (uint32_t j = 0; j < f->node_count; j++) {
            const float *a = bones + TREEPIECES_BONE * (size_t)i, *b = bones + TREEPIECES_BONE * (size_t)j;
            const int same = (int)(a[3] + SIDE) == (int)(b[3] + SIDE) && (int)(a[11] + SIDE) == (int)(b[11] + SIDE);
            pairs += same && b[7] > a[7];
        }
    free(bones);
    return pairs / f->node_count / f->node_count;
}

/* Branches turn to the light: fewer pieces lie above each other, and the tree is as high. */
static void test_phototropism(void **state) {
    (void)state;
    treepieces_species dull = oak, keen = oak;
    treepieces_forest_desc d = describe(1, 1200);
    double in_dull = 0, in_keen = 0;
    dull.phototropism = 0;
    keen.phototropism = 0.4f;
    for (d.seed = 1; d.seed <= 8; d.seed++) {
        d.species = &dull;
        treepieces_forest *f = grow(&d);
        in_dull += mean_shade(f);
        const float height = f->trees[0].height;
        treepieces_forest_free(f);
        d.species = &keen;
        f = grow(&d);
        in_keen += mean_shade(f);
        assert_true(f->trees[0].height > 0.85f * height && f->trees[0].height < 1.15f * height);
        treepieces_forest_free(f);
    }
    assert_true(in_keen < 0.85 * in_dull);
}

/* ---- poses and wind ------------------------------------------------------------------------ */

/* A bone is a rotation times diag(radius, length, radius), at the position that the parent's gives. */
static void test_bones(void **state) {
    (void)state;
    treepieces_forest_desc d = describe(3, 400);
    treepieces_forest *f = grow(&d);
    treepieces_pose pose;
    memset(&pose, 0, sizeof pose);
    pose.amount = 0.2f;
    float *rest = make_bones(f, NULL), *posed = make_bones(f, &pose);
    float *joints = (float *)room(f->node_count, 16);
    for (uint32_t i = 0; i < f->node_count; i++) joints[4 * i + 3] = 1;
    pose.amount = 0;
    pose.joints = joints;
    float *same = make_bones(f, &pose);
    assert_memory_equal(rest, same, f->node_count * TREEPIECES_BONE * sizeof(float));
    int moved = 0;
    for (uint32_t i = 0; i < f->node_count; i++) {
        const float *b = posed + TREEPIECES_BONE * (size_t)i;
        const float want[3] = {f->nodes[i].radius, f->nodes[i].length, f->nodes[i].radius};
        for (int c = 0; c < 3; c++) {
            const float *x = b + c, *y = b + (c + 1) % 3;
            const float dot = x[0] * y[0] + x[4] * y[4] + x[8] * y[8];
            const float length = sqrtf(x[0] * x[0] + x[4] * x[4] + x[8] * x[8]);
            assert_true(fabsf(length - want[c]) <= 1e-4f * want[c]);
            assert_true(fabsf(dot) <= 1e-4f * want[c] * want[(c + 1) % 3]);
        }
        moved += memcmp(b, rest + TREEPIECES_BONE * (size_t)i, 48) != 0;
    }
    assert_true(moved > (int)f->node_count * 9 / 10);
    free(joints);
    free(same);
    free(posed);
    free(rest);
    treepieces_forest_free(f);
}

/* A tree is bent in the same way whatever other trees are in the forest, and differently from others. */
static void test_pose_alone(void **state) {
    (void)state;
    treepieces_place places[3] = {{{0, 0, 0}, 0, 1, 0, 7}, {{9, 0, 0}, 1, 1, 0, 8}, {{0, 0, 0}, 0, 1, 0, 9}};
    treepieces_forest_desc d = describe(3, 200);
    d.places = places;
    grown all = grow_posed(&d, 0.3f, 4);
    for (int i = 0; i < 3; i++) {
        const treepieces_tree *t = &all.forest->trees[i];
        const float *own = all.bones + TREEPIECES_BONE * (size_t)t->first_node;
        d.places = &places[i];
        d.tree_count = 1;
        grown one = grow_posed(&d, 0.3f, 4);
        assert_int_equal(one.forest->node_count, t->node_count);
        assert_memory_equal(one.bones, own, t->node_count * TREEPIECES_BONE * sizeof(float));
        free_grown(&one);
    }
    free_grown(&all);

    /* the same shape with another seed of the tree: another bend of its lowest joint */
    places[1] = places[0];
    d.places = places;
    d.tree_count = 2;
    grown two = grow_posed(&d, 0.3f, 4);
    const float *second = two.bones + TREEPIECES_BONE * (size_t)two.forest->trees[1].first_node;
    assert_memory_equal(two.bones, second, TREEPIECES_BONE * sizeof(float));
    free_grown(&two);
    places[1].seed++;
    two = grow_posed(&d, 0.3f, 4);
    second = two.bones + TREEPIECES_BONE * (size_t)two.forest->trees[1].first_node;
    assert_true(memcmp(two.bones, second, TREEPIECES_BONE * sizeof(float)) != 0);
    free_grown(&two);
}

static float farthest(const float *a, const float *b, uint32_t nodes) {
    float most = 0;
    for (uint32_t i = 0; i < nodes; i++)
        for (int k = 0; k < 3; k++)
            most = txm_maxf(most, fabsf(a[12 * (size_t)i + (size_t)(4 * k + 3)] -
                                        b[12 * (size_t)i + (size_t)(4 * k + 3)]));
    return most;
}

/* In steady wind trees lean and come to rest, with steps of any length; without wind they stand
   upright. */
static void test_wind(void **state) {
    (void)state;
    treepieces_forest_desc d = describe(2, 300);
    treepieces_forest *f = grow(&d);
    float *rest = make_bones(f, NULL), *lean = make_bones(f, NULL), *bones = make_bones(f, NULL);
    float *sway = (float *)room(f->node_count, 16);
    treepieces_wind wind = {0, 10, 0, 1, 0};
    assert_int_equal(treepieces_sway(f, &wind, 1e4, 1e4, NULL, NULL, sway, lean), TXM_OK);
    assert_true(farthest(rest, lean, f->node_count) > 0.02f);
    const float *tip = lean + 12 * (size_t)(f->trees[0].node_count - 1);
    assert_true(tip[3] > rest[12 * (size_t)(f->trees[0].node_count - 1) + 3]); /* to +x */
    for (int i = 0; i < 5; i++) {
        const double steps[5] = {1e-4, 0.5, 3, 1e3, 1e8};
        memset(sway, 0, f->node_count * 16);
        double time = 0;
        for (int k = 0; k < (i < 2 ? 4000 : 40); k++) {
            assert_int_equal(treepieces_sway(f, &wind, time, steps[i], NULL, NULL, sway, bones),
                             TXM_OK);
            time += steps[i] < 1e6 ? steps[i] : 0;
            if (k % 16 == 0) /* never further than one swing past the equilibrium */
                assert_true(farthest(rest, bones, f->node_count) <
                            2.2f * farthest(rest, lean, f->node_count));
        }
        if (i) assert_true(farthest(lean, bones, f->node_count) < 0.01f);
    }
    wind.speed = 0;
    for (int k = 0; k < 10; k++) treepieces_sway(f, &wind, 0, 100, NULL, NULL, sway, bones);
    assert_true(farthest(rest, bones, f->node_count) < 1e-3f);
    /* two steps are as good as one */
    wind.speed = 10;
    float *twice = (float *)room(f->node_count, 16);
    memset(sway, 0, f->node_count * 16);
    treepieces_sway(f, &wind, 0.2, 0.2, NULL, NULL, sway, lean);
    treepieces_sway(f, &wind, 0.1, 0.1, NULL, NULL, twice, bones);
    treepieces_sway(f, &wind, 0.2, 0.1, NULL, NULL, twice, bones);
    const float way = farthest(rest, lean, f->node_count); /* the equilibrium changes with the lean */
    assert_true(way > 0.01f && farthest(lean, bones, f->node_count) < 0.1f * way);
    free(twice);
    free(sway);
    free(rest);
    free(lean);
    free(bones);
    treepieces_forest_free(f);
}

/* How something moves: mean and standard deviation, and how often a second it passes the mean. */
typedef struct motion {
    double mean, deviation, passes;
} motion;

static motion motion_of(const float *way, int count, double rate) {
    motion m = {0, 0, 0};
    for (int i = 0; i < count; i++) m.mean += (double)way[i] / count;
    for (int i = 0; i < count; i++) {
        const double off = (double)way[i] - m.mean;
        m.deviation += off * off / count;
        if (i && off * ((double)way[i - 1] - m.mean) < 0) m.passes += rate / count;
    }
    m.deviation = sqrt(m.deviation);
    return m;
}

/* The end of a piece along the wind, which blows to +x: of a trunk in the world, of others as seen from
   the piece on which their axis stands; over the distance that it has from there at rest. */
static float way_of(const treepieces_forest *f, const float *rest, const float *bones, uint32_t node) {
    uint32_t base = node;
    float from[2][3], along = 0, square = 0, length = 0;
    while (f->nodes[base].parent >= 0 && f->nodes[base].order >= f->nodes[node].order)
        base = (uint32_t)f->nodes[base].parent;
    for (int k = 0; k < 3; k++) {
        const size_t row = 4 * (size_t)k, b = TREEPIECES_BONE * (size_t)base, n = TREEPIECES_BONE * (size_t)node;
        from[0][k] = bones[n + row + 3] + bones[n + row + 1] - bones[b + row + 3];
        from[1][k] = rest[n + row + 3] + rest[n + row + 1] - rest[b + row + 3];
        along += bones[b + row] * from[0][k];
        square += bones[b + row] * bones[b + row];
        length += from[1][k] * from[1][k];
    }
    const float way = f->nodes[node].order ? along / sqrtf(square) : from[0][0];
    return way / sqrtf(length);
}

/* In a fresh breeze the top of the trunk moves by some hundredths of the height; branches swing as far for
   their length, and faster, twigs faster still. All joints of a branch swing together. */
static void test_sway_has_scales(void **state) {
    (void)state;
    enum { STEPS = 900, RATE = 30 };
    static const char *const names[] = {"oak", "birch", "almond"};
    for (int s = 0; s < 3; s++) {
        treepieces_forest_desc d = describe(1, 500);
        treepieces_species species;
        assert_int_equal(treepieces_preset(names[s], NULL, &species), TXM_OK);
        d.species = &species;
        treepieces_forest *f = grow(&d);
        const uint32_t nodes = f->node_count;
        float *rest = make_bones(f, NULL), *bones = make_bones(f, NULL);
        float *sway = (float *)room(nodes, 16), *way = (float *)room(nodes, STEPS * sizeof(float));
        const treepieces_wind wind = {0, 8, 0.6f, 1, 0};
        uint32_t top = 0;
        for (int i = -20 * RATE; i < STEPS; i++) {
            const double time = (double)i / RATE;
            assert_int_equal(treepieces_sway(f, &wind, time, 1.0 / RATE, NULL, NULL, sway, bones), TXM_OK);
            for (uint32_t n = 0; n < nodes && i >= 0; n++)
                way[n * (size_t)STEPS + (size_t)i] = way_of(f, rest, bones, n);
        }
        double deviation[3] = {0, 0, 0}, passes[3] = {0, 0, 0}; /* of trunk, branches, twigs */
        int counts[3] = {1, 0, 0};
        for (uint32_t n = 0; n < nodes; n++) {
            const int order = f->nodes[n].order < 2 ? f->nodes[n].order : 2;
            const int32_t up = f->nodes[n].parent;
            if (up >= 0 && f->nodes[up].type == TREEPIECES_I)
                assert_int_equal(f->nodes[n].sway, f->nodes[up].sway);
            if (order == 0 && rest[12 * n + 7] > rest[12 * top + 7]) top = n;
            if (order == 0 || f->nodes[n].type != TREEPIECES_TIP) continue;
            const motion m = motion_of(way + n * (size_t)STEPS, STEPS, RATE);
            deviation[order] += m.deviation;
            passes[order] += m.passes;
            counts[order]++;
        }
        for (int i = 0; i < STEPS; i++) way[(size_t)top * STEPS + (size_t)i] -= way_of(f, rest, rest, top);
        const motion trunk = motion_of(way + (size_t)top * STEPS, STEPS, RATE);
        deviation[0] = trunk.deviation;
        passes[0] = trunk.passes;
        for (int k = 0; k < 3; k++) {
            assert_true(counts[k] > 0);
            deviation[k] /= counts[k];
            passes[k] /= counts[k];
            print_message("# %s, order %d: deviation %.4f of the length, %.2f passes a second\n", names[s], k,
                          deviation[k], passes[k]);
        }
        assert_true(trunk.mean > 0.01 && trunk.mean < 0.1); /* leans with the wind */
        assert_true(deviation[0] > 0.004 && deviation[0] < 0.04);
        assert_true(deviation[1] > 0.7 * deviation[0] && deviation[1] < 0.12);
        assert_true(passes[1] > 2 * passes[0] && passes[2] > 1.3 * passes[1] && passes[2] < 9);
        free(way);
        free(sway);
        free(bones);
        free(rest);
        treepieces_forest_free(f);
    }
}

/* A wind with a period repeats itself, and trees that sway for some time do so too. */
static void test_period(void **state) {
    (void)state;
    enum { STEPS = 40, WARM = 12 };
    treepieces_forest_desc d = describe(2, 200);
    treepieces_forest *f = grow(&d);
    float *first = make_bones(f, NULL), *bones = make_bones(f, NULL), *half = make_bones(f, NULL);
    float *sway = (float *)room(f->node_count, 16);
    const treepieces_wind wind = {0.3f, 9, 0.7f, 3, 4};
    const float place[3] = {3, 0, -7};
    for (int i = 0; i < 40; i++) {
        const float gust = treepieces_gust(&wind, place, 0.1 * i);
        assert_true(fabsf(gust - treepieces_gust(&wind, place, 0.1 * i + 4)) < 1e-5f);
        assert_true(i == 0 || gust != treepieces_gust(&wind, place, 0.1 * (i - 1)));
    }
    for (int i = 0; i <= (WARM + 1) * STEPS; i++) {
        assert_int_equal(treepieces_sway(f, &wind, 4.0 * i / STEPS, 4.0 / STEPS, NULL, NULL, sway, bones), TXM_OK);
        const size_t bytes = f->node_count * TREEPIECES_BONE * sizeof(float);
        if (i == WARM * STEPS) memcpy(first, bones, bytes);
        if (i == WARM * STEPS + STEPS / 2) memcpy(half, bones, bytes);
    }
    assert_true(farthest(first, half, f->node_count) > 0.05f);
    assert_true(farthest(first, bones, f->node_count) < 1e-4f);
    treepieces_wind bad = wind;
    bad.period = -1;
    assert_int_equal(treepieces_sway(f, &bad, 0, 0, NULL, NULL, sway, bones), TXM_BAD_ARGUMENT);
    bad.period = (float)NAN;
    assert_int_equal(treepieces_sway(f, &bad, 0, 0, NULL, NULL, sway, bones), TXM_BAD_ARGUMENT);
    free(sway);
    free(half);
    free(bones);
    free(first);
    treepieces_forest_free(f);
}

/* Trees of one seed in different places do not sway in unison: the correlation of their tops. */
static void test_no_unison(void **state) {
    (void)state;
    enum { TREES = 8, STEPS = 400 };
    static double way[TREES][STEPS];
    treepieces_place places[TREES];
    treepieces_forest_desc d = describe(TREES, 150);
    memset(places, 0, sizeof places);
    for (int i = 0; i < TREES; i++) {
        places[i].position[0] = 9.0f * (float)i;
        places[i].position[2] = 5.0f * (float)(i % 3);
        places[i].seed = (uint64_t)i;
    }
    d.places = places;
    treepieces_forest *f = grow(&d);
    float *bones = make_bones(f, NULL), *sway = (float *)room(f->node_count, 16);
    const treepieces_wind wind = {0, 8, 0.7f, 2, 0};
    for (int s = -60; s < STEPS; s++) {
        assert_int_equal(treepieces_sway(f, &wind, s * 0.1, 0.1, NULL, NULL, sway, bones), TXM_OK);
        for (int i = 0; i < TREES && s >= 0; i++) {
            const treepieces_tree *t = &f->trees[i];
            double sum = 0; /* of all its joints, along the wind */
            for (uint32_t n = 0; n < t->node_count; n++)
                sum += (double)bones[12 * (size_t)(t->first_node + n) + 3];
            way[i][s] = sum / t->node_count;
        }
    }
    for (int i = 0; i < TREES; i++)
        for (int j = 0; j < i; j++) {
            double mi = 0, mj = 0, ii = 0, jj = 0, ij = 0;
            for (int s = 0; s < STEPS; s++) {
                mi += way[i][s] / STEPS;
                mj += way[j][s] / STEPS;
            }
            for (int s = 0; s < STEPS; s++) {
                ii += (way[i][s] - mi) * (way[i][s] - mi);
                jj += (way[j][s] - mj) * (way[j][s] - mj);
                ij += (way[i][s] - mi) * (way[j][s] - mj);
            }
            assert_true(ij / sqrt(ii * jj) < 0.95);
        }
    free(sway);
    free(bones);
    treepieces_forest_free(f);
}

/* Gusts travel with the wind: later they are downwind, a little changed. */
static void test_gusts(void **state) {
    (void)state;
    const treepieces_wind wind = {0, 10, 1, 4, 0};
    double here = 0, there = 0, still = 0;
    for (int i = 0; i < 400; i++) {
        const float x = 3.0f * (float)i, a[3] = {x, 0, 0}, b[3] = {x + 10, 0, 0};
        const double p = (double)treepieces_gust(&wind, a, 5);
        assert_true(p >= 0);
        here += p;
        there += fabs(p - (double)treepieces_gust(&wind, b, 6));
        still += fabs(p - (double)treepieces_gust(&wind, a, 6));
    }
    assert_true(fabs(here / 400 - 1) < 0.35);
    assert_true(there < 0.5 * still);
}

/* ---- faults -------------------------------------------------------------------------------- */

static void bad_rule(void *user, const treepieces_site *site, txm_rng *rng,
                     treepieces_choice *choice) {
    (void)site;
    (void)rng;
    switch (*(const int *)user) {
    case 0: choice->type = 99; break;
    case 1: choice->turn = 6; break;
    case 2: choice->length = 0; break;
    case 3: choice->direction[1] = (float)INFINITY; break;
    default: choice->ratios[0] = 2; break;
    }
}

static void test_arguments(void **state) {
    (void)state;
    treepieces_forest *f = NULL;
    txm_env env = tk_env(NULL, NULL);
    for (int i = 0; i < 14; i++) {
        treepieces_place place;
        treepieces_forest_desc d = describe(1, 100);
        memset(&place, 0, sizeof place);
        switch (i) {
        case 0: d.kit = NULL; break;
        case 1: d.species = NULL; break;
        case 2: d.species_count = 0; break;
        case 3: d.tree_count = 0; break;
        case 4: d.max_pieces = 7; break;
        case 5: d.max_pieces = 65536; break;
        case 6: d.rule = 3; break;
        case 7: d.spacing = -1; break;
        case 8: place.position[1] = (float)NAN; break;
        case 9: place.scale = -1; break;
        case 10: place.species = 1; break;
        case 11: place.scale = 1e-30f; break; /* bones would not be finite */
        case 12: place.scale = 1001; break;
        default: place.turn = (float)INFINITY; break;
        }
        if (i >= 8) d.places = &place;
        env.message[0] = 0;
        f = (treepieces_forest *)1;
        assert_int_equal(treepieces_forest_make(&d, &env, &f), TXM_BAD_ARGUMENT);
        assert_null(f);
        assert_true(strlen(env.message) > 8);
    }
    for (int i = 0; i < 5; i++) {
        treepieces_forest_desc d = describe(2, 100);
        d.own_rule = bad_rule;
        d.own_user = &i;
        assert_int_equal(treepieces_forest_make(&d, &env, &f), TXM_BAD_ARGUMENT);
        assert_non_null(strstr(env.message, "own_rule"));
    }
    treepieces_forest_desc d = describe(1, 50);
    f = grow(&d);
    float *bones = make_bones(f, NULL), *sway = (float *)room(f->node_count, 16);
    treepieces_wind wind = {0, 5, 0.5f, 0, 0};
    treepieces_pose pose;
    memset(&pose, 0, sizeof pose);
    pose.amount = -1;
    assert_int_equal(treepieces_bones(f, &pose, &env, bones), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_bones(f, NULL, &env, NULL), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_sway(f, NULL, 0, 0, NULL, &env, sway, bones), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_sway(f, &wind, 0, -1, NULL, &env, sway, bones), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_sway(f, &wind, NAN, 0, NULL, &env, sway, bones), TXM_BAD_ARGUMENT);
    wind.speed = -1;
    assert_int_equal(treepieces_sway(f, &wind, 0, 0, NULL, &env, sway, bones), TXM_BAD_ARGUMENT);
    free(sway);
    free(bones);
    treepieces_forest_free(f);
    treepieces_forest_free(NULL);
}

/* Under failing allocations and cancelled reports nothing leaks and nothing is made. */
static txm_status make_forest(void *context, txm_env *env) {
    treepieces_forest *f = (treepieces_forest *)env;
    const txm_status status = treepieces_forest_make((const treepieces_forest_desc *)context, env, &f);
    if (status != TXM_OK) assert_null(f);
    treepieces_forest_free(f);
    return status;
}

static void test_faults(void **state) {
    (void)state;
    treepieces_forest_desc d = describe(65, 60); /* in blocks of 64 */
    treepieces_species small = oak;
    small.order_count = 1;
    d.species = &small;
    assert_true(tk_sweep(make_forest, &d, TK_ALLOCATION) > 300);
    assert_true(tk_sweep(make_forest, &d, TK_ONWARD) > 300);
    assert_true(tk_sweep(make_forest, &d, TK_CANCEL) == 4);
}

/* forest->bytes is right, and 1,000 trees of 4,000 triangles take less than 24 KB each, bones and
   sway state included. */
static void test_memory(void **state) {
    (void)state;
    tk_memory memory;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    treepieces_forest_desc d = describe(1000, 165);
    treepieces_forest *f;
    assert_int_equal(treepieces_forest_make(&d, &env, &f), TXM_OK);
    size_t triangles = 0;
    for (int t = 0; t < f->type_count; t++)
        triangles += 2 * (size_t)f->batches[t].count * (size_t)f->batches[t].quad_count;
    assert_true(triangles >= 4000 * 1000);
    assert_true(memory.live_bytes <= f->bytes + 4096 && memory.live_bytes + 4096 >= f->bytes);
    assert_true(f->bytes + f->node_count * (48 + 16) <= 24 * 1024 * (size_t)1000);
    treepieces_forest_free(f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rims),      cmocka_unit_test(test_rims_in_wind),
        cmocka_unit_test(test_records),   cmocka_unit_test(test_bark_continues),
        cmocka_unit_test(test_far_away),
        cmocka_unit_test(test_seeds),     cmocka_unit_test(test_budget),
        cmocka_unit_test(test_rules),     cmocka_unit_test(test_pruning),
        cmocka_unit_test(test_phototropism),
        cmocka_unit_test(test_bones),     cmocka_unit_test(test_pose_alone),
        cmocka_unit_test(test_wind),
        cmocka_unit_test(test_no_unison), cmocka_unit_test(test_gusts),
        cmocka_unit_test(test_arguments), cmocka_unit_test(test_faults),
        cmocka_unit_test(test_memory),    cmocka_unit_test(test_scatter),
        cmocka_unit_test(test_sway_has_scales), cmocka_unit_test(test_period),
        cmocka_unit_test(test_tiny),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
