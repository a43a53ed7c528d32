/* test_treepieces_kit.c - pieces of the caller, which of them a kit refuses, and the species of a forest
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_treepieces_kit && build/tests/unit/test_treepieces_kit */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "treepieces.h"

#include "testkit.h"

/* A piece whose parts can be changed. */
typedef struct own_piece {
    treepieces_piece piece;
    treepieces_vertex vertices[300];
    treepieces_quad quads[300];
} own_piece;

/* A copy of a built-in piece as a caller would make it, without the marks of the library at the
   rims. */
static void copy_builtin(own_piece *own, int type) {
    treepieces_kit *kit = NULL;
    assert_int_equal(treepieces_kit_make(NULL, 0, NULL, &kit), TXM_OK);
    memset(own, 0, sizeof *own);
    own->piece = *treepieces_kit_piece(kit, type);
    memcpy(own->vertices, own->piece.vertices,
           (size_t)own->piece.vertex_count * sizeof *own->vertices);
    memcpy(own->quads, own->piece.quads, (size_t)own->piece.quad_count * sizeof *own->quads);
    for (int i = 0; i < own->piece.vertex_count; i++) own->vertices[i].rim = 0;
    own->piece.name = "mine";
    own->piece.vertices = own->vertices;
    own->piece.quads = own->quads;
    treepieces_kit_free(kit);
}

/* A tube of three rings between its rims, numbered from the top down. */
static void make_tube(own_piece *own) {
    static const float own_weights[5] = {0, 0.25f, 0.5f, 0.75f, 1};
    treepieces_piece *p = &own->piece;
    memset(own, 0, sizeof *own);
    p->name = "tube";
    p->vertices = own->vertices;
    p->quads = own->quads;
    p->vertex_count = 30;
    p->leaf_count = 1;
    p->building[0].translation[1] = 1;
    p->building[0].rotation[3] = 1;
    p->building[0].scale = 0.8f;
    for (int i = 0; i < p->vertex_count; i++) {
        treepieces_vertex *v = &own->vertices[i];
        const int ring = i / 6, k = i % 6;
        const float r = 0.8f + 0.05f * (float)ring;
        v->position[0] = r * (float)cos(k * TXM_PI / 3);
        v->position[1] = 1 - 0.25f * (float)ring;
        v->position[2] = -r * (float)sin(k * TXM_PI / 3);
        v->normal[0] = 10 / sqrtf(101) * (float)cos(k * TXM_PI / 3);
        v->normal[1] = 1 / sqrtf(101);
        v->normal[2] = -10 / sqrtf(101) * (float)sin(k * TXM_PI / 3);
        v->weights[0] = own_weights[ring];
        v->weights[1] = 1 - own_weights[ring];
    }
    for (int k = 0; k < 6; k++) {
        p->leaf_rims[0][k] = k;
        p->root_rim[k] = 24 + k;
        for (int ring = 0; ring < 4; ring++) {
            treepieces_quad *q = &own->quads[p->quad_count++];
            q->corners[0] = (uint8_t)(6 * ring + k);
            q->corners[1] = (uint8_t)(6 * ring + 6 + k);
            q->corners[2] = (uint8_t)(6 * ring + 6 + (k + 1) % 6);
            q->corners[3] = (uint8_t)(6 * ring + (k + 1) % 6);
            q->tile_class = (uint8_t)(k == 2 && ring == 1 ? TREEPIECES_OWN : TREEPIECES_BARK);
            q->band = (uint8_t)(ring < 2);
        }
    }
}

static void own_pieces_are_taken(void **state) {
    (void)state;
    static own_piece own[TREEPIECES_BUILTIN + 1];
    treepieces_piece pieces[TREEPIECES_BUILTIN + 1];
    treepieces_kit *kit = NULL;
    txm_env env;
    memset(&env, 0, sizeof env);
    for (int i = 0; i < TREEPIECES_BUILTIN; i++) copy_builtin(&own[i], i);
    make_tube(&own[TREEPIECES_BUILTIN]);
    for (int i = 0; i <= TREEPIECES_BUILTIN; i++) pieces[i] = own[i].piece;
    pieces[2].name = NULL;
    if (treepieces_kit_make(pieces, TREEPIECES_BUILTIN + 1, &env, &kit) != TXM_OK)
        fail_msg("%s", env.message);
    assert_int_equal(treepieces_kit_count(kit), 2 * TREEPIECES_BUILTIN + 1);
    for (int i = 0; i < TREEPIECES_BUILTIN; i++) { /* a copy of a built-in piece becomes the same piece */
        const treepieces_piece *a = treepieces_kit_piece(kit, i);
        const treepieces_piece *b = treepieces_kit_piece(kit, TREEPIECES_BUILTIN + i);
        assert_memory_equal(a->vertices, b->vertices,
                            (size_t)a->vertex_count * sizeof *a->vertices);
        assert_memory_equal(a->quads, b->quads, (size_t)a->quad_count * sizeof *a->quads);
        assert_string_equal(b->name, i == 2 ? "" : "mine");
        assert_ptr_not_equal(b->vertices, own[i].vertices);
    }
    const treepieces_piece *tube = treepieces_kit_piece(kit, 2 * TREEPIECES_BUILTIN);
    for (int k = 0; k < 6; k++) { /* moved onto the hexagon and marked */
        assert_true(tube->vertices[k].rim == k && tube->vertices[24 + k].rim == -1);
        assert_true(tube->vertices[24 + k].position[1] == 0);
        assert_true(tube->vertices[6 + k].rim == -1);
    }
    assert_null(treepieces_kit_piece(kit, -1));
    assert_null(treepieces_kit_piece(kit, 2 * TREEPIECES_BUILTIN + 1));
    assert_null(treepieces_kit_piece(NULL, 0));
    assert_int_equal(treepieces_kit_count(NULL), 0);
    treepieces_kit_free(kit);
    treepieces_kit_free(NULL);
}

/* a rule that grows only tubes, then a tip */
static void choose_tubes(void *user, const treepieces_site *site, txm_rng *rng,
                         treepieces_choice *choice) {
    (void)rng;
    choice->type = site->depth < 20 ? *(const int *)user : TREEPIECES_TIP;
    choice->turn = site->depth % 6;
    choice->ratios[0] = 0.9f;
}

static void own_pieces_grow(void **state) {
    (void)state;
    static own_piece own;
    int type = TREEPIECES_BUILTIN;
    treepieces_kit *kit = NULL;
    treepieces_forest *forest = NULL;
    treepieces_species species;
    treepieces_forest_desc desc;
    txm_env env;
    memset(&env, 0, sizeof env);
    make_tube(&own);
    assert_int_equal(treepieces_kit_make(&own.piece, 1, &env, &kit), TXM_OK);
    memset(&own, 0xff, sizeof own); /* the kit has its own copy */
    assert_int_equal(treepieces_preset("oak", &env, &species), TXM_OK);
    memset(&desc, 0, sizeof desc);
    desc.kit = kit;
    desc.species = &species;
    desc.species_count = desc.tree_count = 1;
    desc.own_rule = choose_tubes;
    desc.own_user = &type;
    if (treepieces_forest_make(&desc, &env, &forest) != TXM_OK) fail_msg("%s", env.message);
    assert_int_equal(forest->node_count, 21);
    assert_int_equal(forest->batches[TREEPIECES_BUILTIN].count, 20);
    assert_int_equal(forest->batches[TREEPIECES_TIP].count, 1);
    float *bones = (float *)malloc(21 * TREEPIECES_BONE * sizeof *bones);
    assert_int_equal(treepieces_bones(forest, NULL, &env, bones), TXM_OK);
    float below[90], above[90];
    for (uint32_t i = 0; i + 1 < 20; i++) { /* the rims are equal to the bit */
        treepieces_skin(forest, bones, type, i, below, NULL);
        treepieces_skin(forest, bones, type, i + 1, above, NULL);
        const int turn = (int)(i + 1) % 6;
        for (int k = 0; k < 6; k++)
            assert_memory_equal(below + 3 * k, above + 3 * (24 + (k + 6 - turn) % 6), 12);
    }
    free(bones);
    treepieces_forest_free(forest);
    treepieces_kit_free(kit);
}

/* a rule that grows thin branches */
static void choose_branches(void *user, const treepieces_site *site, txm_rng *rng,
                            treepieces_choice *choice) {
    (void)user;
    (void)rng;
    for (int k = 0; k < 3; k++) assert_true(txm_is_finite((double)site->direction[k]));
    choice->type = site->depth < 6 ? TREEPIECES_BUILTIN : TREEPIECES_TIP;
    choice->ratios[0] = 0.9f;
    choice->ratios[1] = 0.05f;
}

/* A branch whose rim lies near the axis of its stem, where it cannot keep clear of that. */
static void own_branches_grow_from_within(void **state) {
    (void)state;
    static own_piece own;
    treepieces_kit *kit = NULL;
    treepieces_forest *forest = NULL;
    treepieces_species species;
    treepieces_forest_desc desc;
    copy_builtin(&own, TREEPIECES_SIDE);
    float *to = own.piece.building[1].translation, move[3] = {-0.7f * to[0], 0, -0.7f * to[2]};
    for (int k = 0; k < 3; k++) {
        to[k] += move[k];
        for (int j = 0; j < 6; j++) own.vertices[own.piece.leaf_rims[1][j]].position[k] += move[k];
    }
    assert_int_equal(treepieces_kit_make(&own.piece, 1, NULL, &kit), TXM_OK);
    assert_int_equal(treepieces_preset("oak", NULL, &species), TXM_OK);
    memset(&desc, 0, sizeof desc);
    desc.kit = kit;
    desc.species = &species;
    desc.species_count = desc.tree_count = 1;
    desc.own_rule = choose_branches;
    assert_int_equal(treepieces_forest_make(&desc, NULL, &forest), TXM_OK);
    assert_true(forest->batches[TREEPIECES_BUILTIN].count > 20);
    treepieces_forest_free(forest);
    treepieces_kit_free(kit);
}

/* Faults of a tube, and what the message must name. */
typedef struct piece_fault {
    void (*spoil)(own_piece *own);
    const char *where, *what;
} piece_fault;

#define SPOIL(name) static void name(own_piece *own)
SPOIL(no_vertices) { own->piece.vertices = NULL; }
SPOIL(too_few_vertices) { own->piece.vertex_count = 6; }
SPOIL(too_many_vertices) { own->piece.vertex_count = 256; }
SPOIL(no_quads) { own->piece.quads = NULL; }
SPOIL(too_few_quads) { own->piece.quad_count = 5; }
SPOIL(too_many_quads) { own->piece.quad_count = 256; }
SPOIL(too_many_leaves) { own->piece.leaf_count = 4; }
SPOIL(negative_leaves) { own->piece.leaf_count = -1; }
SPOIL(corner_beyond) { own->quads[7].corners[2] = 30; }
SPOIL(corner_twice) { own->quads[7].corners[2] = own->quads[7].corners[0]; }
SPOIL(bad_band) { own->quads[9].band = 4; }
SPOIL(halving) { own->quads[9].tile_class = TREEPIECES_HALVING; }
SPOIL(class_beyond) { own->quads[9].tile_class = 64; }
SPOIL(rim_beyond) { own->piece.leaf_rims[0][3] = 30; }
SPOIL(rim_negative) { own->piece.root_rim[5] = -1; }
SPOIL(position_nan) { own->vertices[11].position[1] = (float)NAN; }
SPOIL(normal_infinite) { own->vertices[11].normal[2] = HUGE_VALF; }
SPOIL(normal_short) { own->vertices[11].normal[0] = 0.1f; }
SPOIL(weight_negative) {
    own->vertices[8].weights[0] = -0.25f;
    own->vertices[8].weights[1] = 1.25f;
}
SPOIL(weight_nan) { own->vertices[8].weights[0] = (float)NAN; }
SPOIL(weight_of_none) { own->vertices[8].weights[2] = 0.25f; own->vertices[8].weights[0] = 0; }
SPOIL(weight_sum) { own->vertices[8].weights[0] = 0.5f; }
SPOIL(rotation_long) { own->piece.building[0].rotation[3] = 2; }
SPOIL(rotation_nan) { own->piece.building[0].rotation[0] = (float)NAN; }
SPOIL(scale_zero) { own->piece.building[0].scale = 0; }
SPOIL(scale_infinite) { own->piece.building[0].scale = HUGE_VALF; }
SPOIL(translation_nan) { own->piece.building[0].translation[2] = (float)NAN; }
SPOIL(root_moved) { own->vertices[26].position[0] += 0.001f; }
SPOIL(leaf_moved) { own->vertices[4].position[1] += 0.001f; }
SPOIL(leaf_turned) { /* the vertices of the rim are shifted by one */
    for (int k = 0; k < 6; k++) own->piece.leaf_rims[0][k] = (k + 1) % 6;
}
SPOIL(root_normal) { own->vertices[27].normal[0] = -1; own->vertices[27].normal[1] = 0; }
SPOIL(leaf_normal) { own->vertices[3].normal[0] = -1; own->vertices[3].normal[1] = 0; }
SPOIL(root_weights) { own->vertices[25].weights[0] = 0.75f; own->vertices[25].weights[1] = 0.25f; }
SPOIL(leaf_weights) { own->vertices[2].weights[0] = 0.25f; own->vertices[2].weights[1] = 0.75f; }
SPOIL(rim_twice) { /* the leaf rim is also the root rim */
    own->piece.leaf_count = 2;
    own->piece.building[1] = own->piece.building[0];
    memcpy(own->piece.leaf_rims[1], own->piece.leaf_rims[0], sizeof own->piece.leaf_rims[0]);
}
SPOIL(flipped) { /* quad 8: columns 2, from ring 0 */
    const uint8_t c = own->quads[8].corners[0];
    own->quads[8].corners[0] = own->quads[8].corners[2];
    own->quads[8].corners[2] = c;
}
SPOIL(inside_out) {
    for (int i = 0; i < own->piece.quad_count; i++) {
        const uint8_t c = own->quads[i].corners[0];
        own->quads[i].corners[0] = own->quads[i].corners[2];
        own->quads[i].corners[2] = c;
    }
}
SPOIL(three_quads_at_a_side) { own->quads[own->piece.quad_count++] = own->quads[5]; }
SPOIL(hole) { own->quads[5] = own->quads[--own->piece.quad_count]; }
SPOIL(capped) { /* two quads close the root rim, which is no longer a border */
    static const uint8_t a[4] = {24, 27, 26, 25}, b[4] = {24, 29, 28, 27};
    memcpy(own->quads[own->piece.quad_count++].corners, a, 4);
    memcpy(own->quads[own->piece.quad_count++].corners, b, 4);
}
SPOIL(unused) {
    own->vertices[30] = own->vertices[12];
    own->piece.vertex_count++;
}
SPOIL(apart) { /* a separate cube */
    static const uint8_t cube[6][4] = {{0, 1, 2, 3}, {7, 6, 5, 4}, {0, 4, 5, 1},
                                       {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}};
    for (int i = 0; i < 8; i++) own->vertices[30 + i] = own->vertices[12];
    own->piece.vertex_count += 8;
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 4; k++)
            own->quads[own->piece.quad_count + i].corners[k] = (uint8_t)(30 + cube[i][k]);
    own->piece.quad_count += 6;
}
SPOIL(touching) { /* that cube touches vertex 14 with a corner */
    apart(own);
    own->piece.vertex_count--;
    for (int i = own->piece.quad_count - 6; i < own->piece.quad_count; i++)
        for (int k = 0; k < 4; k++)
            if (own->quads[i].corners[k] == 37) own->quads[i].corners[k] = 14;
}
#undef SPOIL

static void every_fault_of_a_piece_is_named(void **state) {
    (void)state;
    static const piece_fault faults[] = {
        {no_vertices, "", "needs 7 to 255 vertices"},
        {too_few_vertices, "", "needs 7 to 255 vertices"},
        {too_many_vertices, "", "needs 7 to 255 vertices"},
        {no_quads, "", "needs 6 to 255 quads"},
        {too_few_quads, "", "needs 6 to 255 quads"},
        {too_many_quads, "", "needs 6 to 255 quads"},
        {too_many_leaves, "", "leaf_count must be 0 to 3"},
        {negative_leaves, "", "leaf_count must be 0 to 3"},
        {corner_beyond, "quad 7", "a corner is not a vertex"},
        {corner_twice, "quad 7", "two corners are one vertex"},
        {bad_band, "quad 9", "band"},
        {halving, "quad 9", "tile_class"},
        {class_beyond, "quad 9", "tile_class"},
        {rim_beyond, "place 3", "not a vertex"},
        {rim_negative, "place 5", "not a vertex"},
        {position_nan, "vertex 11", "is not finite"},
        {normal_infinite, "vertex 11", "is not finite"},
        {normal_short, "vertex 11", "length is not 1"},
        {weight_negative, "vertex 8", "weight is negative"},
        {weight_nan, "vertex 8", "weight is negative"},
        {weight_of_none, "vertex 8", "of a joint that does not exist"},
        {weight_sum, "vertex 8", "sum of the weights is not 1"},
        {rotation_long, "leaf rim 0", "unit quaternion"},
        {rotation_nan, "leaf rim 0", "unit quaternion"},
        {scale_zero, "leaf rim 0", "scale"},
        {scale_infinite, "leaf rim 0", "scale"},
        {translation_nan, "vertex 0", "place on a leaf rim"},
        {root_moved, "vertex 26", "place on the root rim"},
        {leaf_moved, "vertex 4", "place on a leaf rim"},
        {leaf_turned, "vertex 1", "place on a leaf rim"},
        {root_normal, "vertex 27", "cone"},
        {leaf_normal, "vertex 3", "cone"},
        {root_weights, "vertex 25", "own bone alone"},
        {leaf_weights, "vertex 2", "terminal joint alone"},
        {rim_twice, "vertex 0", ""},
        {flipped, "vertex ", "of opposite orientation"},
        {inside_out, "vertex 24", "runs the wrong way"},
        {three_quads_at_a_side, "vertex ", "of opposite orientation"},
        {hole, "", "border that is not a rim"},
        {capped, "vertex 24", "is no border"},
        {unused, "vertex 30", "is unused"},
        {apart, "vertex 30", "is not connected to vertex 0"},
        {touching, "vertex 14", "touches itself"},
    };
    static own_piece own[2];
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        treepieces_kit *kit = (treepieces_kit *)own;
        tk_memory memory = {0};
        tk_progress progress = {0};
        txm_env env = tk_env(&memory, &progress);
        char where[64];
        make_tube(&own[0]);
        make_tube(&own[1]);
        faults[i].spoil(&own[1]);
        const treepieces_piece pieces[2] = {own[0].piece, own[1].piece};
        const txm_status status = treepieces_kit_make(pieces, 2, &env, &kit);
        if (status != TXM_BAD_ARGUMENT)
            fail_msg("fault %d (%s) gives status %d", (int)i, faults[i].what, status);
        assert_null(kit);
        assert_int_equal(tk_leaks(&memory), 0);
        snprintf(where, sizeof where, "piece 1 (tube)%s%s", faults[i].where[0] ? ", " : ": ",
                 faults[i].where);
        if (strncmp(env.message, where, strlen(where)) || !strstr(env.message, faults[i].what))
            fail_msg("\"%s\" does not say \"%s\" and \"%s\"", env.message, where, faults[i].what);
    }
}

static void a_kit_checks_its_arguments(void **state) {
    (void)state;
    static own_piece own;
    static treepieces_piece many[TREEPIECES_MAX_TYPES - TREEPIECES_BUILTIN + 1];
    treepieces_kit *kit = NULL;
    make_tube(&own);
    for (size_t i = 0; i < sizeof many / sizeof many[0]; i++) many[i] = own.piece;
    const int most = TREEPIECES_MAX_TYPES - TREEPIECES_BUILTIN;
    assert_int_equal(treepieces_kit_make(many, most + 1, NULL, &kit), TXM_TOO_LARGE);
    assert_int_equal(treepieces_kit_make(many, -1, NULL, &kit), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_kit_make(NULL, 1, NULL, &kit), TXM_BAD_ARGUMENT);
    assert_int_equal(treepieces_kit_make(many, most, NULL, NULL), TXM_BAD_ARGUMENT);
    assert_null(kit);
    assert_int_equal(treepieces_kit_make(many, most, NULL, &kit), TXM_OK);
    assert_int_equal(treepieces_kit_count(kit), TREEPIECES_MAX_TYPES);
    treepieces_kit_free(kit);
}

/* Two tubes and a preset, which needs no memory. */
static txm_status make_kit(void *context, txm_env *env) {
    const long calls = ((const tk_memory *)env->memory_user)->calls;
    treepieces_kit *kit = (treepieces_kit *)env;
    treepieces_species species;
    assert_int_equal(treepieces_preset("spruce", env, &species), TXM_OK);
    assert_int_equal(((const tk_memory *)env->memory_user)->calls, calls);
    const txm_status status = treepieces_kit_make((const treepieces_piece *)context, 2, env, &kit);
    if (status != TXM_OK) assert_null(kit);
    treepieces_kit_free(kit);
    return status;
}

static void kits_and_species_survive_failing_memory(void **state) {
    (void)state;
    static own_piece own[2];
    make_tube(&own[0]);
    make_tube(&own[1]);
    treepieces_piece pieces[2] = {own[0].piece, own[1].piece};
    assert_true(tk_sweep(make_kit, pieces, TK_ALLOCATION) > 40);
    assert_true(tk_sweep(make_kit, pieces, TK_ONWARD) > 40);
}

/* What the text does not say has values that grow. */
static void a_short_text_grows_a_tree(void **state) {
    (void)state;
    static const char text[] = "name bush\norder 0\nlength 3\norder 4\nlength 0.25";
    treepieces_species species;
    treepieces_kit *kit = NULL;
    treepieces_forest *forest = NULL;
    treepieces_forest_desc desc;
    txm_env env;
    memset(&env, 0, sizeof env);
    assert_int_equal(treepieces_species_parse(text, strlen(text), &env, &species), TXM_OK);
    assert_int_equal(treepieces_kit_make(NULL, 0, &env, &kit), TXM_OK);
    memset(&desc, 0, sizeof desc);
    desc.kit = kit;
    desc.species = &species;
    desc.species_count = desc.tree_count = 1;
    assert_int_equal(treepieces_forest_make(&desc, &env, &forest), TXM_OK);
    assert_true(forest->node_count > 100);
    assert_true(forest->cluster_count > 20);
    treepieces_forest_free(forest);
    treepieces_kit_free(kit);
}

static void a_forest_refuses_a_bad_species(void **state) {
    (void)state;
    treepieces_kit *kit = NULL;
    assert_int_equal(treepieces_kit_make(NULL, 0, NULL, &kit), TXM_OK);
    for (int fault = 0; fault < 8; fault++) {
        static const char *const messages[] = {"name",      "name",    "name",        "envelope",
                                               "leaf_shape", "roll",   "crown_top must be above",
                                               "order_count"};
        treepieces_species species;
        treepieces_forest *forest = (treepieces_forest *)&species;
        treepieces_forest_desc desc;
        txm_env env;
        memset(&env, 0, sizeof env);
        assert_int_equal(treepieces_preset("pine", NULL, &species), TXM_OK);
        if (fault == 0) memset(species.name, 'x', sizeof species.name);
        if (fault == 1) species.name[1] = '\n';
        if (fault == 2) species.name[0] = ' ';
        if (fault == 3) species.envelope = 4;
        if (fault == 4) species.leaf_shape = -1;
        if (fault == 5) species.orders[1].roll = HUGE_VALF;
        if (fault == 6) species.crown_base = species.crown_top;
        if (fault == 7) species.order_count = INT_MAX;
        memset(&desc, 0, sizeof desc);
        desc.kit = kit;
        desc.species = &species;
        desc.species_count = desc.tree_count = 1;
        assert_int_equal(treepieces_forest_make(&desc, &env, &forest), TXM_BAD_ARGUMENT);
        assert_null(forest);
        if (!strstr(env.message, messages[fault])) fail_msg("%s", env.message);
    }
    treepieces_kit_free(kit);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_short_text_grows_a_tree),
        cmocka_unit_test(a_forest_refuses_a_bad_species),
        cmocka_unit_test(own_pieces_are_taken),
        cmocka_unit_test(own_pieces_grow),
        cmocka_unit_test(own_branches_grow_from_within),
        cmocka_unit_test(every_fault_of_a_piece_is_named),
        cmocka_unit_test(a_kit_checks_its_arguments),
        cmocka_unit_test(kits_and_species_survive_failing_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
