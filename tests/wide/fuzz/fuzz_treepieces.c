/* fuzz_treepieces.c - species, pieces, poses, winds and pictures of all kinds into treepieces.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   What is refused has a message and leaves its output alone; what succeeds is finite, in range, and
   closed: every rim has its piece, and a baked tree is one surface.                             */
#include "treepieces.h"

#define FUZZ_BYTES 240
#include "fuzzkit.h"

enum { MOST_KEYS = 96, MOST_NAMES = 16, MOST_TEXT = 20000, MOST_TREES = 5, MOST_OWN = 3 };

static int are_finite(const float *values, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (!txm_is_finite((double)values[i])) return 0;
    return 1;
}

/* One that a field may not be, or only just. */
static float odd_number(source *s) {
    static const float odd[] = {NAN, INFINITY, -INFINITY, -1, 0, 1e30f, -1e30f, 1e-30f, 3e-39f, 1e9f};
    return odd[pick(s, (int)(sizeof odd / sizeof odd[0]))];
}

/* ---- species ------------------------------------------------------------------------------ */

/* A key as the library tells of it. */
typedef struct key {
    char name[32], names[MOST_NAMES][16];
    int in_order, count, is_whole, name_count;
    double low, high;
} key;

static key keys[MOST_KEYS];
static int key_count;

/* The range of a key stands in the message about a value beyond it. */
static void learn_range(key *k) {
    char text[80];
    txm_env env;
    treepieces_species species;
    memset(&env, 0, sizeof env);
    snprintf(text, sizeof text, "%s%s 1e30", k->in_order ? "order 0\n" : "", k->name);
    must(treepieces_species_parse(text, strlen(text), &env, &species) == TXM_BAD_DATA);
    const char *range = strstr(env.message, " must be ");
    must(range != NULL);
    range += 9;
    if (!strncmp(range, "one of", 6)) {
        for (range += 6; *range == ' ' && k->name_count < MOST_NAMES; k->name_count++) {
            int used = 0;
            must(sscanf(range, " %15s%n", k->names[k->name_count], &used) == 1);
            range += used;
        }
        return;
    }
    k->is_whole = !strncmp(range, "a whole number of ", 18);
    must(sscanf(range + (k->is_whole ? 18 : 0), "%lf to %lf", &k->low, &k->high) == 2);
}

/* All keys: those that a printed species has, up to the second order. */
static void learn_keys(void) {
    static char text[MOST_TEXT];
    treepieces_species species;
    int order = -1, number;
    must(treepieces_species_parse(NULL, 0, NULL, &species) == TXM_OK);
    must(treepieces_species_print(&species, text, sizeof text) < sizeof text);
    for (char *line = strtok(text, "\n"); line; line = strtok(NULL, "\n")) {
        if (!strncmp(line, "name", 4)) continue;
        if (sscanf(line, "order %d", &number) == 1) order = number;
        else if (order < 1) {
            key *k = &keys[key_count++];
            must(key_count < MOST_KEYS && sscanf(line, "%31s", k->name) == 1);
            k->in_order = order == 0;
            for (const char *c = line; *c; c++) k->count += *c == ' ';
            learn_range(k);
        }
    }
    must(key_count > 30);
}

/* Append a key with values in its range, often at its ends, now and then beyond. */
static size_t put_key(char *text, size_t at, const key *k, source *s) {
    at += (size_t)snprintf(text + at, MOST_TEXT - at, "%s", k->name);
    for (int i = 0; i < k->count; i++) {
        const int form = pick(s, 12);
        const double part = (double)unit(s);
        double x = form == 0   ? k->low
                   : form == 1 ? k->high
                   : form < 5  ? k->low + (k->high - k->low) * part * part * part * part
                               : k->low + (k->high - k->low) * part;
        if (k->is_whole) x = floor(x + 0.5);
        if (pick(s, 800) == 0) x = (double)odd_number(s);
        if (k->name_count)
            at += (size_t)snprintf(text + at, MOST_TEXT - at, " %s", k->names[pick(s, k->name_count)]);
        else at += (size_t)snprintf(text + at, MOST_TEXT - at, " %.7g", x);
    }
    return at + (size_t)snprintf(text + at, MOST_TEXT - at, "\n");
}

/* Some keys of some orders, of a built-in species or of none. */
static size_t write_text(char *text, source *s) {
    size_t at = 0;
    if (pick(s, 2)) {
        char name[40] = "";
        sscanf(treepieces_preset_text(pick(s, treepieces_preset_count())), "name %39s", name);
        at += (size_t)snprintf(text, MOST_TEXT, "like %s\n", name);
    }
    const int density = 1 + pick(s, 6), orders = pick(s, TREEPIECES_MAX_ORDERS + 1);
    for (int order = -1; order < orders; order++) {
        if (order >= 0) at += (size_t)snprintf(text + at, MOST_TEXT - at, "order %d\n", order);
        for (int i = 0; i < key_count; i++)
            if (keys[i].in_order == (order >= 0) && pick(s, 6) < density) at = put_key(text, at, &keys[i], s);
    }
    return at;
}

/* Change, cut, double and swap bytes. */
static size_t mutate(char *text, size_t size, source *s) {
    static const char *const pieces[] = {"like oak\n", "order 4\n", "1e9", "\n", "#", "\r", " -", "\xef\xbb\xbf", "\xff"};
    for (int k = 1 + pick(s, 5); k > 0 && size; k--) {
        const size_t at = (size_t)pick(s, (int)size);
        const char *piece = pieces[pick(s, 9)];
        const size_t count = strlen(piece);
        switch (pick(s, 5)) {
        case 0: text[at] = (char)pick(s, 256); break;
        case 1: text[at] = (char)(text[at] ^ 1 << pick(s, 8)); break;
        case 2: size = pick(s, 4) ? size : at; break;
        case 3: memcpy(text + at, piece, count < size - at ? count : size - at); break;
        default:
            if (size + count > MOST_TEXT) break;
            memmove(text + at + count, text + at, size - at);
            memcpy(text + at, piece, count);
            size += count;
        }
    }
    return size;
}

/* A species of random text; 0 if that was refused. It must read as it is printed. */
static int make_species(treepieces_species *species, int mutations, pool *p, source *s) {
    static char text[MOST_TEXT], printed[MOST_TEXT];
    treepieces_species before, back;
    txm_env env;
    size_t size = write_text(text, s);
    if (mutations) size = mutate(text, size, s);
    char *exact = (char *)take(p, size); /* so that a read beyond is seen */
    memcpy(exact, text, size);
    memset(&env, 0, sizeof env);
    memset(species, FRESH, sizeof *species);
    before = *species;
    const txm_status status = treepieces_species_parse(exact, size, &env, species);
    if (status != TXM_OK) {
        must(status == TXM_BAD_DATA && !strncmp(env.message, "line ", 5));
        must(!memcmp(species, &before, sizeof before));
        return 0;
    }
    const size_t length = treepieces_species_print(species, printed, sizeof printed);
    must(length < sizeof printed && length == strlen(printed));
    must(treepieces_species_parse(printed, length, NULL, &back) == TXM_OK);
    must(!memcmp(species, &back, sizeof back));
    fuzz_succeeded++;
    return 1;
}

/* ---- pieces ------------------------------------------------------------------------------- */

typedef struct own_piece {
    treepieces_piece piece;
    treepieces_vertex vertices[TREEPIECES_MAX_VERTICES];
    treepieces_quad quads[TREEPIECES_MAX_QUADS];
} own_piece;

static void unit_quaternion(float q[4], source *s) {
    double square = 0, v[4];
    for (int k = 0; k < 4; k++) {
        v[k] = 2 * (double)unit(s) - 1 + (k == 3 ? 0.7 : 0);
        square += v[k] * v[k];
    }
    for (int k = 0; k < 4; k++) q[k] = square > 1e-6 ? (float)(v[k] / sqrt(square)) : (float)(k == 3);
}

static void rotate(const float q[4], const double v[3], double out[3]) {
    const double x = (double)q[0], y = (double)q[1], z = (double)q[2], w = (double)q[3];
    const double t[3] = {2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])};
    out[0] = v[0] + w * t[0] + y * t[2] - z * t[1];
    out[1] = v[1] + w * t[1] + z * t[0] - x * t[2];
    out[2] = v[2] + w * t[2] + x * t[1] - y * t[0];
}

/* Move a leaf rim of a piece to another place, size and direction. */
static void move_rim(own_piece *o, int rim, source *s) {
    treepieces_similarity *b = &o->piece.building[rim];
    const double tilt = 0.1, length = sqrt(1 + tilt * tilt);
    for (int k = 0; k < 3; k++) b->translation[k] += unit(s) - 0.5f;
    unit_quaternion(b->rotation, s);
    b->scale = pick(s, 20) ? 0.2f + unit(s) : pick(s, 2) ? 1e-4f : 1e4f;
    for (int j = 0; j < TREEPIECES_RIM; j++) {
        treepieces_vertex *v = &o->vertices[o->piece.leaf_rims[rim][j]];
        double sine, cosine, at[3], normal[3];
        txm_sincos(j * (TXM_PI / 3), &sine, &cosine);
        const double place[3] = {cosine, 0, -sine};
        const double cone[3] = {cosine / length, tilt / length, -sine / length};
        rotate(b->rotation, place, at);
        rotate(b->rotation, cone, normal);
        for (int k = 0; k < 3; k++) {
            v->position[k] = (float)((double)b->translation[k] + (double)b->scale * at[k]);
            v->normal[k] = (float)normal[k];
        }
    }
}

/* Make one thing wrong. Positions may happen to stay right. */
static void break_piece(own_piece *o, source *s) {
    treepieces_piece *p = &o->piece;
    treepieces_vertex *v = &o->vertices[pick(s, p->vertex_count)];
    treepieces_quad *q = &o->quads[pick(s, p->quad_count)];
    switch (pick(s, 14)) {
    case 0: p->vertex_count = pick(s, 300) - 1; break;
    case 1: p->quad_count = pick(s, 300) - 1; break;
    case 2: p->leaf_count = pick(s, 6) - 1; break;
    case 3: p->root_rim[pick(s, 6)] = pick(s, 300) - 1; break;
    case 4: p->leaf_rims[pick(s, 3)][pick(s, 6)] = pick(s, 300) - 1; break;
    case 5: q->corners[pick(s, 4)] = (uint8_t)pick(s, 256); break;
    case 6: q->band = (uint8_t)pick(s, 256); break;
    case 7: q->tile_class = (uint8_t)pick(s, 256); break;
    case 8: v->position[pick(s, 3)] = odd_number(s); break;
    case 9: v->normal[pick(s, 3)] = odd_number(s); break;
    case 10: v->weights[pick(s, 4)] = odd_number(s); break;
    case 11: p->building[pick(s, 3)].scale = odd_number(s); break;
    case 12: p->building[pick(s, 3)].rotation[pick(s, 4)] = odd_number(s); break;
    default: p->building[pick(s, 3)].translation[pick(s, 3)] = odd_number(s);
    }
    if (p->vertex_count > TREEPIECES_MAX_VERTICES && pick(s, 2)) p->vertices = NULL;
}

/* A built-in piece, changed: vertices, rims and tiles moved. */
static void make_piece(own_piece *o, const treepieces_piece *from, source *s) {
    memset(o, 0, sizeof *o);
    o->piece = *from;
    memcpy(o->vertices, from->vertices, (size_t)from->vertex_count * sizeof *o->vertices);
    memcpy(o->quads, from->quads, (size_t)from->quad_count * sizeof *o->quads);
    o->piece.vertices = o->vertices;
    o->piece.quads = o->quads;
    if (pick(s, 2)) o->piece.name = pick(s, 2) ? NULL : "a piece of one's own, with a name that is rather long";
    for (int k = 0; k < from->leaf_count; k++)
        if (pick(s, 3) == 0) move_rim(o, k, s);
    for (int i = 0; i < from->vertex_count; i++) {
        int on_rim = o->vertices[i].rim >= 0;
        for (int j = 0; j < TREEPIECES_RIM; j++) on_rim |= from->root_rim[j] == i;
        for (int k = 0; k < 3 && !on_rim; k++) o->vertices[i].position[k] += 0.4f * (unit(s) - 0.5f);
    }
    for (int i = 0; i < from->quad_count; i++) {
        if (pick(s, 8) == 0) o->quads[i].tile_class = (uint8_t)(TREEPIECES_OWN + pick(s, 5));
        if (pick(s, 8) == 0) o->quads[i].band = (uint8_t)pick(s, TREEPIECES_BANDS);
    }
    if (pick(s, 5) == 0) break_piece(o, s);
}

/* A kit of built-in pieces, often with others; NULL if it was refused. */
static treepieces_kit *make_kit(source *s) {
    static own_piece own[MOST_OWN];
    treepieces_piece pieces[MOST_OWN];
    treepieces_kit *plain, *kit = (treepieces_kit *)own;
    trouble t;
    const int count = pick(s, 2) ? 0 : 1 + pick(s, MOST_OWN);
    must(treepieces_kit_make(NULL, 0, NULL, &plain) == TXM_OK);
    must(treepieces_kit_count(plain) == TREEPIECES_BUILTIN);
    for (int i = 0; i < count; i++) {
        make_piece(&own[i], treepieces_kit_piece(plain, pick(s, TREEPIECES_BUILTIN)), s);
        pieces[i] = own[i].piece;
    }
    txm_env env = troubled(&t, s);
    const txm_status status = treepieces_kit_make(count ? pieces : NULL, count, &env, &kit);
    if (!succeeded(status, &t, &env)) {
        must(kit == NULL && t.memory.blocks == 0);
        treepieces_kit_free(plain);
        return NULL;
    }
    must(treepieces_kit_count(kit) == TREEPIECES_BUILTIN + count);
    treepieces_kit_free(kit);
    must(t.memory.blocks == 0);
    must(treepieces_kit_make(pieces, count, NULL, &kit) == TXM_OK); /* of malloc, to outlive this */
    treepieces_kit_free(plain); /* whose names the others have */
    must(!treepieces_kit_piece(kit, -1) && !treepieces_kit_piece(kit, treepieces_kit_count(kit)));
    fuzz_succeeded++;
    return kit;
}

/* ---- growing ------------------------------------------------------------------------------ */

/* A rule that attaches anything, and with `odd` what it must not. */
typedef struct habit {
    int types, odd;
} habit;

static void any_choice(void *user, const treepieces_site *site, txm_rng *rng, treepieces_choice *choice) {
    const habit *h = (const habit *)user;
    must(site->radius > 0 && site->length > 0 && site->along >= 0 && site->along <= 1);
    must(are_finite(site->position, 3) && are_finite(site->direction, 3));
    must(choice->type >= 0 && choice->type < h->types);
    choice->type = (int)txm_rng_below(rng, (uint32_t)h->types);
    choice->turn = (int)txm_rng_below(rng, TREEPIECES_RIM);
    for (int k = 0; k < 3; k++) {
        const float aside = txm_rng_float(rng) - 0.5f;
        choice->direction[k] = site->direction[k] + 3 * aside;
        choice->ratios[k] = 0.3f + 0.7f * txm_rng_float(rng);
    }
    const float stretch = txm_rng_float(rng);
    choice->length = site->radius * (0.5f + 3 * stretch);
    choice->leaves = txm_rng_below(rng, 4) == 0;
    if (!h->odd || txm_rng_below(rng, 40)) return;
    switch (txm_rng_below(rng, 5)) {
    case 0: choice->type = (int)txm_rng_below(rng, 40) - 5; break;
    case 1: choice->turn = (int)txm_rng_below(rng, 20) - 6; break;
    case 2: choice->direction[1] = NAN; break;
    case 3: choice->length = (float)txm_rng_below(rng, 3) - 1; break;
    default: choice->ratios[0] = (float)txm_rng_below(rng, 3) - 1;
    }
}

/* Is every piece where it can be, with a piece on each of its rims? */
static void look_at_tree(const treepieces_forest *f, const treepieces_tree *t, int most) {
    const treepieces_node *nodes = f->nodes + t->first_node;
    uint8_t *rims = (uint8_t *)calloc(t->node_count, 1);
    must(rims && t->node_count > 0 && t->node_count <= (uint32_t)most);
    must(txm_is_finite((double)t->height) && t->height >= 0);
    for (uint32_t i = 0; i < t->node_count; i++) {
        const treepieces_node *n = &nodes[i];
        float square = 0;
        for (int k = 0; k < 4; k++) square += n->rotation[k] * n->rotation[k];
        must(n->type < f->type_count && fabsf(square - 1) < 1e-3f);
        must(n->radius > 0 && n->length > 0 && n->radius < 1e9f && n->length < 1e9f);
        must((n->parent < 0) == (i == 0) && n->parent < (int32_t)i);
        must((n->joint & 7) < TREEPIECES_RIM && n->order < TREEPIECES_MAX_ORDERS);
        if (i == 0) continue;
        const int rim = n->joint >> 3, bit = 1 << rim;
        must(rim < treepieces_kit_piece(f->kit, nodes[n->parent].type)->leaf_count);
        must(!(rims[n->parent] & bit));
        rims[n->parent] = (uint8_t)(rims[n->parent] | bit);
    }
    for (uint32_t i = 0; i < t->node_count; i++)
        must(rims[i] == (1 << treepieces_kit_piece(f->kit, nodes[i].type)->leaf_count) - 1);
    for (uint32_t i = 0; i < t->cluster_count; i++) {
        const treepieces_cluster *c = &f->clusters[t->first_cluster + i];
        must(c->node >= t->first_node && c->node < t->first_node + t->node_count);
        must(c->along >= 0 && c->along <= 1 && c->radius > 0 && c->radius < 1e9f);
    }
    free(rims);
}

static void look_at_forest(const treepieces_forest *f, const treepieces_forest_desc *d) {
    uint32_t nodes = 0, clusters = 0, records = 0;
    must(f->tree_count == d->tree_count && f->species_count == d->species_count);
    for (int i = 0; i < f->tree_count; i++) {
        const treepieces_tree *t = &f->trees[i];
        must(t->first_node == nodes && t->first_cluster == clusters);
        must(t->species >= 0 && t->species < d->species_count);
        nodes += t->node_count;
        clusters += t->cluster_count;
        look_at_tree(f, t, d->max_pieces ? d->max_pieces : 600);
    }
    for (int k = 0; k < f->type_count; k++) {
        const treepieces_batch *b = &f->batches[k];
        records += b->count;
        must(b->quad_count == treepieces_kit_piece(f->kit, k)->quad_count);
        for (uint32_t i = 0; i < b->count; i++)
            must(b->words[(size_t)i * b->stride] < nodes && f->nodes[b->words[(size_t)i * b->stride]].type == k);
    }
    must(nodes == f->node_count && clusters == f->cluster_count && records == nodes);
}

static void make_places(treepieces_place *places, int count, int species, source *s) {
    memset(places, 0, (size_t)count * sizeof *places);
    for (int i = 0; i < count; i++) {
        const float reach = pick(s, 20) ? 30 : 9e5f;
        for (int k = 0; k < 3; k++) places[i].position[k] = reach * (2 * unit(s) - 1);
        places[i].turn = 20 * unit(s) - 10;
        places[i].scale = pick(s, 20) ? (float)pick(s, 3) : pick(s, 2) ? 1000 : 1e-3f;
        places[i].species = pick(s, species);
        places[i].seed = (uint64_t)pick(s, 65536);
        if (pick(s, 200) == 0) places[i].position[pick(s, 3)] = odd_number(s);
        if (pick(s, 200) == 0) places[i].scale = odd_number(s);
        if (pick(s, 200) == 0) places[i].turn = odd_number(s);
        if (pick(s, 200) == 0) places[i].species = pick(s, 5) - 1;
    }
}

/* ---- what is done with a forest ------------------------------------------------------------ */

/* Are the rims of a piece and of its children the same to the bit? */
static void look_at_rims(const treepieces_forest *f, const float *bones, source *s) {
    float all[2][3 * TREEPIECES_MAX_VERTICES], normals[3 * TREEPIECES_MAX_VERTICES];
    for (int tries = 0; tries < 3; tries++) {
        const int type = pick(s, f->type_count);
        const treepieces_batch *b = &f->batches[type];
        const treepieces_piece *p = treepieces_kit_piece(f->kit, type);
        if (!b->count) continue;
        const uint32_t i = (uint32_t)pick(s, (int)b->count), *w = b->words + (size_t)i * b->stride;
        treepieces_skin(f, bones, type, i, all[0], normals);
        must(are_finite(all[0], 3 * (size_t)p->vertex_count) && are_finite(normals, 3 * (size_t)p->vertex_count));
        for (int k = 0; k < p->leaf_count; k++) {
            const uint32_t child = w[0] + (k == 0 ? w[1] & 0xffff : k == 1 ? w[1] >> 16 : w[2] & 0xffff);
            const int turn = (int)(w[2] >> (16 + 4 * k) & 15);
            must(child > w[0] && child < f->node_count);
            const treepieces_batch *its = &f->batches[f->nodes[child].type];
            const treepieces_piece *q = treepieces_kit_piece(f->kit, f->nodes[child].type);
            uint32_t n = 0;
            while (n < its->count && its->words[(size_t)n * its->stride] != child) n++;
            must(n < its->count);
            treepieces_skin(f, bones, f->nodes[child].type, n, all[1], NULL);
            for (int j = 0; j < TREEPIECES_RIM; j++)
                must(!memcmp(all[0] + 3 * p->leaf_rims[k][j],
                             all[1] + 3 * q->root_rim[(j + TREEPIECES_RIM - turn) % TREEPIECES_RIM], 3 * sizeof(float)));
        }
    }
}

/* Bones at rest, posed, and in the wind; the last of these stay in bones. */
static void move(const treepieces_forest *f, float *bones, pool *p, source *s) {
    const size_t count = (size_t)f->node_count;
    float *state = (float *)(void *)take(p, 16 * count), *joints = (float *)(void *)take(p, 16 * count);
    treepieces_pose pose = {(uint64_t)pick(s, 256), pick(s, 8) ? unit(s) : odd_number(s), NULL};
    treepieces_wind wind = {10 * unit(s), pick(s, 8) ? 100 * unit(s) * unit(s) : 100, pick(s, 3) ? unit(s) : 1, 7,
                            pick(s, 2) ? 0 : 30 * unit(s)};
    double time = pick(s, 20) ? 1000 * (double)unit(s) : (double)odd_number(s);
    txm_env env;
    memset(&env, 0, sizeof env);
    memset(state, 0, 16 * count);
    for (size_t i = 0; i < count; i++) unit_quaternion(joints + 4 * i, s);
    if (pick(s, 4) == 0) pose.joints = joints;
    if (pick(s, 30) == 0) wind.speed = odd_number(s);
    if (pick(s, 30) == 0) wind.gusts = odd_number(s);
    if (pick(s, 30) == 0) wind.direction = odd_number(s);
    if (pick(s, 30) == 0) wind.period = odd_number(s);
    must(treepieces_bones(f, NULL, &env, bones) == TXM_OK && are_finite(bones, TREEPIECES_BONE * count));
    if (treepieces_bones(f, &pose, &env, bones) != TXM_OK) must(env.message[0]);
    else must(are_finite(bones, TREEPIECES_BONE * count));
    const treepieces_pose *about = pick(s, 3) ? NULL : &pose;
    for (int step = 0; step < 4; step++) {
        const double dt = pick(s, 4) ? 1 / 60.0 : pick(s, 2) ? 0 : 1e9 * (double)unit(s) * (double)unit(s);
        env.message[0] = 0;
        time += pick(s, 2) ? dt : 0.01;
        if (treepieces_sway(f, &wind, time, dt, about, &env, state, bones) != TXM_OK) must(env.message[0]);
        must(are_finite(bones, TREEPIECES_BONE * count) && are_finite(state, 4 * count));
        const float gust = treepieces_gust(&wind, bones, time);
        must(gust >= 0 && gust <= 1000);
    }
}

static int compare_sides(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* Is a baked mesh sound? closed: has it no border? */
static void look_at_mesh(const treepieces_mesh *m, uint32_t nodes, int is_surface, int closed) {
    const size_t corners = 3 * m->triangle_count;
    must(are_finite(m->positions, 3 * m->vertex_count) && are_finite(m->normals, 3 * m->vertex_count));
    must(are_finite(m->uvs, 2 * corners));
    for (size_t i = 0; i < m->vertex_count; i++) {
        float sum = 0;
        for (size_t k = 4 * i; k < 4 * i + 4; k++) {
            must(m->weights[k] >= 0 && m->joints[k] < nodes && (m->weights[k] > 0 || m->joints[k] == 0));
            sum += m->weights[k];
        }
        must(fabsf(sum - 1) < 1e-5f);
    }
    for (size_t i = 0; i < corners; i++) must(m->indices[i] < m->vertex_count);
    if (!is_surface) return;
    uint64_t *sides = (uint64_t *)malloc(corners * sizeof *sides);
    must(sides != NULL);
    for (size_t i = 0; i < corners; i++)
        sides[i] = (uint64_t)m->indices[i] << 32 | m->indices[i % 3 == 2 ? i - 2 : i + 1];
    qsort(sides, corners, sizeof *sides, compare_sides);
    for (size_t i = 0; i < corners; i++) {
        const uint64_t back = sides[i] << 32 | sides[i] >> 32;
        must(i == 0 || sides[i] != sides[i - 1]);
        if (closed) must(bsearch(&back, sides, corners, sizeof *sides, compare_sides) != NULL);
    }
    free(sides);
}

/* Are the pieces of a tree so large against its coordinates that no two vertices of it coincide? */
static int is_coarse(const treepieces_forest *f, const treepieces_tree *t, const float *bones) {
    float far = 0, thinnest = INFINITY;
    for (uint32_t i = t->first_node; i < t->first_node + t->node_count; i++) {
        const float *b = bones + TREEPIECES_BONE * (size_t)i;
        for (int k = 0; k < 3; k++) far = txm_maxf(far, fabsf(b[4 * k + 3]));
        thinnest = txm_minf(thinnest, txm_minf(f->nodes[i].radius, f->nodes[i].length));
    }
    return thinnest > 1e-4f * far;
}

static void bake(const treepieces_forest *f, const float *bones, source *s) {
    trouble t;
    treepieces_lod lod;
    treepieces_bake_desc d;
    treepieces_mesh *mesh = NULL;
    memset(&d, 0, sizeof d);
    memset(&lod, 0, sizeof lod);
    d.forest = f;
    d.bones = bones;
    d.tree = pick(s, f->tree_count + (pick(s, 40) == 0));
    d.capped = pick(s, 2);
    d.sheet_size = pick(s, 3) ? 0 : pick(s, 2000) - (pick(s, 20) == 0);
    d.sheet_layers = pick(s, 3) ? 0 : pick(s, 66) - (pick(s, 20) == 0);
    if (pick(s, 3) == 0) d.lod = &lod;
    memcpy(lod.eye, f->trees[0].position, sizeof lod.eye);
    lod.max_level = pick(s, 20) ? 3 * unit(s) : odd_number(s);
    lod.half_distance = pick(s, 20) ? 20 * unit(s) : odd_number(s);
    lod.shape = pick(s, 20) ? 2 * unit(s) - 1 : odd_number(s);
    if (lod.max_level > 64 || f->node_count > 200) lod.max_level = 2;
    txm_env env = troubled(&t, s);
    if (succeeded(treepieces_bake(&d, &env, &mesh), &t, &env)) {
        look_at_mesh(mesh, f->trees[d.tree].node_count, is_coarse(f, &f->trees[d.tree], bones), d.capped);
        treepieces_mesh_free(mesh);
        fuzz_succeeded++;
    } else must(mesh == NULL);
    must(t.memory.blocks == 0);
    env = troubled(&t, s);
    const int looks = pick(s, 20) ? 1 + pick(s, 5) : pick(s, 70);
    if (succeeded(treepieces_bake_leaves(f, d.tree, bones, looks, &env, &mesh), &t, &env)) {
        const treepieces_tree *tree = &f->trees[d.tree];
        must(mesh->vertex_count == 4 * (size_t)tree->cluster_count * (size_t)f->species[tree->species].leaf_count);
        look_at_mesh(mesh, tree->node_count, 0, 0);
        treepieces_mesh_free(mesh);
        fuzz_succeeded++;
    } else must(mesh == NULL);
    must(t.memory.blocks == 0);
}

static void grow(pool *p, source *s) {
    treepieces_species species[3];
    treepieces_place places[MOST_TREES], all[MOST_TREES];
    treepieces_forest_desc d;
    treepieces_forest *f = NULL;
    trouble t;
    memset(&d, 0, sizeof d);
    d.species_count = 1 + pick(s, 3);
    for (int i = 0; i < d.species_count; i++) {
        if (!make_species(&species[i], 0, p, s)) return;
        if (species[i].leaf_count > 20 && pick(s, 10)) species[i].leaf_count = pick(s, 20);
    }
    if (pick(s, 30) == 0) { /* one field that no text can give */
        const size_t at = sizeof species[0].name / 4 + (size_t)pick(s, (int)(sizeof species[0] / 4 - sizeof species[0].name / 4));
        const float odd = odd_number(s);
        memcpy((char *)&species[0] + 4 * at, &odd, sizeof odd);
    }
    treepieces_kit *kit = make_kit(s);
    if (!kit) return;
    habit h = {treepieces_kit_count(kit), pick(s, 3) == 0};
    d.kit = kit;
    d.species = species;
    d.tree_count = pick(s, 60) ? 1 + pick(s, MOST_TREES) : 0;
    make_places(places, MOST_TREES, d.species_count, s);
    if (pick(s, 2)) d.places = places;
    d.spacing = pick(s, 20) ? 10 * unit(s) : odd_number(s);
    d.max_pieces = pick(s, 30) ? 8 + pick(s, pick(s, 6) ? 80 : 700) : pick(s, 8);
    d.rule = pick(s, 30) ? pick(s, 3) : pick(s, 5) - 1;
    if (pick(s, 3) == 0) d.own_rule = any_choice;
    d.own_user = &h;
    d.seed = (uint64_t)pick(s, 65536);
    txm_env env = troubled(&t, s);
    if (succeeded(treepieces_forest_make(&d, &env, &f), &t, &env)) {
        float *bones = (float *)(void *)take(p, (size_t)f->node_count * TREEPIECES_BONE * sizeof(float));
        fuzz_succeeded++;
        look_at_forest(f, &d);
        must(treepieces_scatter(&d, NULL, all) == TXM_OK);
        for (int i = 0; i < f->tree_count; i++) must(!memcmp(all[i].position, f->trees[i].position, 12));
        move(f, bones, p, s);
        look_at_rims(f, bones, s);
        bake(f, bones, s);
        treepieces_forest_free(f);
    } else must(f == NULL);
    must(t.memory.blocks == 0);
    treepieces_kit_free(kit);
}

/* ---- pictures ------------------------------------------------------------------------------ */

static void bark(pool *p, source *s) {
    enum { MOST_TILES = 5 };
    treepieces_bark_desc d;
    txm_image tiles[MOST_TILES];
    int classes[MOST_TILES];
    trouble t;
    const int side = pick(s, 20) ? 4 + 2 * pick(s, 8) : 1 + pick(s, 20), channels = 1 + pick(s, 4);
    const txm_sample sample = any_sample(s);
    memset(&d, 0, sizeof d);
    d.tile_count = 1 + pick(s, MOST_TILES);
    for (int i = 0; i < d.tile_count; i++) {
        tiles[i] = any_image(p, s, side, side - (pick(s, 80) == 0), channels, pick(s, 80) ? sample : TXM_U8);
        classes[i] = i == 0 || pick(s, 3) ? 0 : pick(s, 20) ? TREEPIECES_OWN + pick(s, 4) : pick(s, 70) - 2;
    }
    d.tiles = tiles;
    if (pick(s, 2)) d.classes = classes;
    d.seed = (uint64_t)pick(s, 256);
    const int layers = treepieces_bark_layers(&d), width = TREEPIECES_SHEET * side;
    const txm_image out = fresh_image(p, s, width, pick(s, 40) ? width * layers : width, channels, sample);
    txm_env env = troubled(&t, s);
    const int done = succeeded(treepieces_bark(&d, &env, out), &t, &env);
    fuzz_succeeded += done;
    look_at_results(done, &out, 1);
    must(t.memory.blocks == 0);
}

static void drawn(pool *p, source *s) {
    treepieces_species species;
    txm_image tiles[3];
    trouble t;
    if (!make_species(&species, 0, p, s)) return;
    const int count = 1 + pick(s, 3), side = 1 + pick(s, 40), channels = pick(s, 20) ? 3 + pick(s, 2) : 1 + pick(s, 4);
    for (int i = 0; i < count; i++)
        tiles[i] = fresh_image(p, s, side, side + (pick(s, 60) == 0), channels, any_sample(s));
    txm_env env = troubled(&t, s);
    int done = succeeded(treepieces_draw_bark(&species, (uint64_t)pick(s, 256), &env, tiles, count), &t, &env);
    look_at_results(done, tiles, count);
    for (int i = 0; i < count && done; i++)
        for (int k = 0; k < 3; k++) {
            const float v = txm_image_get(&tiles[i], pick(s, side), pick(s, side), k);
            must(v >= 0 && v <= 1);
        }
    must(t.memory.blocks == 0);
    fuzz_succeeded += done;
    const txm_image leaves = fresh_image(p, s, 1 + pick(s, 60), 1 + pick(s, 60), pick(s, 20) ? 4 : 3, TXM_U8);
    env = troubled(&t, s);
    done = succeeded(treepieces_draw_leaves(&species, (uint64_t)pick(s, 256), &env, leaves), &t, &env);
    look_at_results(done, &leaves, 1);
    must(t.memory.blocks == 0);
    fuzz_succeeded += done;
}

static void impostor(pool *p, source *s) {
    treepieces_card cards[256];
    treepieces_species species;
    treepieces_impostor_desc d;
    txm_image out[2];
    trouble t;
    float q[4];
    if (!make_species(&species, 0, p, s)) return;
    memset(&d, 0, sizeof d);
    d.cards = cards;
    d.card_count = treepieces_cloud(&species, (uint32_t)pick(s, 65536), cards);
    must(d.card_count == species.leaf_count && treepieces_cloud(&species, 0, NULL) == d.card_count);
    for (int i = 0; i < d.card_count; i++) {
        must(are_finite(cards[i].center, 3) && are_finite(cards[i].right, 3) && are_finite(cards[i].up, 3));
        float square = 0;
        for (int k = 0; k < 3; k++) square += cards[i].normal[k] * cards[i].normal[k];
        must(fabsf(square - 1) < 1e-3f);
    }
    if (d.card_count > 40 && pick(s, 10)) d.card_count = 40;
    d.leaves = any_image(p, s, 1 + pick(s, 30), 1 + pick(s, 30), pick(s, 30) ? 4 : 3, TXM_U8);
    const double axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    unit_quaternion(q, s);
    for (int k = 0; k < 3; k++) {
        double v[3];
        rotate(q, axes[k], v);
        for (int c = 0; c < 3; c++) (k == 0 ? d.right : k == 1 ? d.up : d.forward)[c] = (float)v[c];
    }
    memcpy(d.light, d.up, sizeof d.light);
    if (pick(s, 20) == 0) d.light[pick(s, 3)] = odd_number(s);
    if (pick(s, 20) == 0) d.forward[pick(s, 3)] = odd_number(s);
    const int width = 1 + pick(s, 40), height = 1 + pick(s, 40);
    out[0] = fresh_image(p, s, width, height, 4, TXM_U8);
    out[1] = fresh_image(p, s, width, height + (pick(s, 40) == 0), 1, TXM_F32);
    txm_env env = troubled(&t, s);
    const int done = succeeded(treepieces_impostor(&d, &env, out[0], out[1]), &t, &env);
    look_at_results(done, out, 2);
    for (int y = 0; y < height && done; y++)
        for (int x = 0; x < width; x++) {
            const float depth = txm_image_get(&out[1], x, y, 0), alpha = txm_image_get(&out[0], x, y, 3);
            must(alpha == 0 ? depth == -2 : alpha == 1 && depth > -2 && depth < 9);
        }
    must(t.memory.blocks == 0);
    fuzz_succeeded += done;
}

/* ---- tessellation -------------------------------------------------------------------------- */

static void tessellate(pool *p, source *s) {
    const int most = pick(s, 4) ? 9 : 66;
    int edges[4], triangles = 0, again = 0;
    for (int k = 0; k < 4; k++) edges[k] = pick(s, most);
    const int inner = pick(s, most);
    const int count = treepieces_pattern(edges, inner, NULL, NULL, &triangles);
    float *coords = (float *)(void *)take(p, 2 * sizeof(float) * (size_t)count), position[3], normal[3];
    uint16_t *indices = (uint16_t *)(void *)take(p, 3 * sizeof(uint16_t) * (size_t)triangles);
    must(treepieces_pattern(edges, inner, coords, indices, &again) == count && again == triangles);
    double area = 0;
    for (int i = 0; i < 2 * count; i++) must(coords[i] >= 0 && coords[i] <= 1);
    for (int i = 0; i < triangles; i++) {
        const uint16_t *c = indices + 3 * i;
        must(c[0] < count && c[1] < count && c[2] < count);
        const float *a = coords + 2 * c[0], *b = coords + 2 * c[1], *e = coords + 2 * c[2];
        area -= 0.5 * ((double)(b[0] - a[0]) * (double)(e[1] - a[1]) - (double)(b[1] - a[1]) * (double)(e[0] - a[0]));
    }
    must(fabs(area - 1) < 1e-4);
    treepieces_lod lod = {{unit(s), unit(s), unit(s)}, 64 * unit(s), 20 * unit(s), 2 * unit(s) - 1};
    float corners[12], normals[12];
    for (int i = 0; i < 12; i++) {
        corners[i] = (pick(s, 20) ? 10 : 1e6f) * (2 * unit(s) - 1);
        normals[i] = (float)(i % 3 == 1);
    }
    const int level = treepieces_edge_level(&lod, corners, corners + 3), inside = treepieces_inner_level(&lod, corners);
    must(level == treepieces_edge_level(&lod, corners + 3, corners));
    must(level >= 1 && level <= 64 && inside >= 1 && inside <= 64);
    treepieces_patch_point(corners, normals, lod.shape, unit(s), unit(s), position, normal);
    must(are_finite(position, 3) && are_finite(normal, 3));
    fuzz_succeeded++;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static pool p;
    treepieces_species species;
    source s = source_of(data, size);
    if (!key_count) learn_keys();
    switch (pick(&s, 12)) {
    case 0:
    case 1: make_species(&species, 1, &p, &s); break;
    case 2: bark(&p, &s); break;
    case 3: drawn(&p, &s); break;
    case 4: impostor(&p, &s); break;
    case 5: tessellate(&p, &s); break;
    case 6: treepieces_kit_free(make_kit(&s)); break;
    default: grow(&p, &s);
    }
    drain(&p);
    return 0;
}
