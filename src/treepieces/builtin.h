#ifndef TREEPIECES_BUILTIN_H
#define TREEPIECES_BUILTIN_H

#include "rim.h"

/* ---- the built-in pieces ----------------------------------------------------------------- */

/* A piece under construction. */
typedef struct tpc_shape {
    treepieces_piece piece;
    treepieces_vertex vertices[64];
    treepieces_quad quads[64];
} tpc_shape;

/* A vertex with weight `own` for the piece's own bone; the rest is shared evenly by the leaf rims
   of the bit mask `leaves`. */
static int tpc_add_vertex(tpc_shape *s, float x, float y, float z, float own, int leaves) {
    TXM_ASSERT(s->piece.vertex_count < (int)(sizeof s->vertices / sizeof *s->vertices));
    treepieces_vertex *v = &s->vertices[s->piece.vertex_count];
    const int count = (leaves & 1) + (leaves >> 1 & 1) + (leaves >> 2 & 1);
    memset(v, 0, sizeof *v);
    v->position[0] = x;
    v->position[1] = y;
    v->position[2] = z;
    v->weights[0] = count ? own : 1;
    for (int k = 0; k < TREEPIECES_MAX_LEAVES; k++)
        if (leaves >> k & 1) v->weights[1 + k] = (1 - own) / (float)count;
    return s->piece.vertex_count++;
}

/* Six vertices about the axis; radius `even` for vertices 0, 2, 4, `odd` for the others. */
static void tpc_add_ring(tpc_shape *s, float y, float even, float odd, float own, int leaves,
                         int ring[TREEPIECES_RIM]) {
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const float r = k & 1 ? odd : even;
        ring[k] = tpc_add_vertex(s, r * tpc_cos6[k], y, -r * tpc_sin6[k], own, leaves);
    }
}

static void tpc_begin(tpc_shape *s, const char *name) {
    memset(s, 0, sizeof *s);
    s->piece.name = name;
    tpc_add_ring(s, 0, 1, 1, 1, 0, s->piece.root_rim);
}

/* Add the vertices of the next leaf rim, whose building transform is set already; return them. */
static const int *tpc_add_rim(tpc_shape *s) {
    treepieces_piece *p = &s->piece;
    const int k = p->leaf_count++;
    for (int j = 0; j < TREEPIECES_RIM; j++) {
        float at[3], normal[3];
        tpc_leaf_vertex(&p->building[k], j, at, normal);
        p->leaf_rims[k][j] = tpc_add_vertex(s, at[0], at[1], at[2], 0, 1 << k);
    }
    return p->leaf_rims[k];
}

/* A leaf rim at (x, y, z), its axis inclined by `lean` degrees towards azimuth `turn` (degrees
   about y from +x to -z), its vertex 0 at that azimuth. */
static const int *tpc_add_leaf_rim(tpc_shape *s, float x, float y, float z, double turn, double lean,
                               float scale) {
    treepieces_similarity *b = &s->piece.building[s->piece.leaf_count];
    const double degree = TXM_PI / 180;
    double st, ct, sl, cl;
    txm_sincos(turn * degree / 2, &st, &ct);
    txm_sincos(lean * degree / 2, &sl, &cl);
    b->translation[0] = x;
    b->translation[1] = y;
    b->translation[2] = z;
    b->rotation[0] = txm_float(-st * sl); /* -lean about z, then turn about y */
    b->rotation[1] = txm_float(st * cl);
    b->rotation[2] = txm_float(-ct * sl);
    b->rotation[3] = txm_float(ct * cl);
    b->scale = scale;
    return tpc_add_rim(s);
}

static void tpc_add_quad(tpc_shape *s, int nw, int sw, int se, int ne, treepieces_class c,
                         int band) {
    TXM_ASSERT(s->piece.quad_count < (int)(sizeof s->quads / sizeof *s->quads));
    treepieces_quad *q = &s->quads[s->piece.quad_count++];
    q->corners[0] = (uint8_t)nw;
    q->corners[1] = (uint8_t)sw;
    q->corners[2] = (uint8_t)se;
    q->corners[3] = (uint8_t)ne;
    q->tile_class = (uint8_t)c;
    q->band = (uint8_t)band;
}

/* `count` quads between two loops of six vertices, from vertex `first` on. */
static void tpc_add_row(tpc_shape *s, const int *below, const int *above, int first, int count,
                        treepieces_class c, int band) {
    for (int i = first; i < first + count; i++) {
        const int k = i % TREEPIECES_RIM, n = (i + 1) % TREEPIECES_RIM;
        tpc_add_quad(s, above[k], below[k], below[n], above[n], c, band);
    }
}

static void tpc_make_i(tpc_shape *s) {
    int middle[TREEPIECES_RIM];
    tpc_begin(s, "I");
    tpc_add_ring(s, 0.5f, 0.95f, 0.95f, 0.5f, 1, middle);
    const int *top = tpc_add_leaf_rim(s, 0, 1, 0, 0, 0, 0.9f);
    tpc_add_row(s, s->piece.root_rim, middle, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, middle, top, 0, 6, TREEPIECES_BARK, 1);
}

/* The crotch runs from vertex 0 over m1 and m2 to vertex 3; arm 0 leans to -z, arm 1 to +z:

        2 - 1          the loop of an arm is half of the ring, and the crotch
       /     \
      3-m2-m1-0  --> x                                                                       */
static void tpc_make_y(tpc_shape *s) {
    int a[TREEPIECES_RIM];
    tpc_begin(s, "Y");
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const int side = k % 3 == 0; /* an end of the crotch */
        const int leaves = side ? 3 : k < 3 ? 1 : 2;
        a[k] = tpc_add_vertex(s, (side ? 0.97f : 0.98f) * tpc_cos6[k], side ? 0.66f : 0.5f,
                              -1.08f * tpc_sin6[k], 0.6f, leaves);
    }
    const int m1 = tpc_add_vertex(s, 0.4f, 0.94f, 0, 0.5f, 3);
    const int m2 = tpc_add_vertex(s, -0.4f, 0.94f, 0, 0.5f, 3);
    /* inclined about x, which keeps vertex 0 at +x */
    for (int arm = 0; arm < 2; arm++) {
        const float to = arm ? 1.0f : -1.0f;
        double sine, cosine;
        treepieces_similarity *b = &s->piece.building[arm];
        txm_sincos(13 * TXM_PI / 180, &sine, &cosine);
        b->translation[1] = 1.3f;
        b->translation[2] = 0.7f * to;
        b->rotation[0] = txm_float(to * sine);
        b->rotation[3] = txm_float(cosine);
        b->scale = 0.75f;
        tpc_add_rim(s);
    }
    const int loop0[TREEPIECES_RIM] = {a[0], a[1], a[2], a[3], m2, m1};
    const int loop1[TREEPIECES_RIM] = {a[0], m1, m2, a[3], a[4], a[5]};
    tpc_add_row(s, s->piece.root_rim, a, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, loop0, s->piece.leaf_rims[0], 0, 3, TREEPIECES_BARK, 1);
    tpc_add_row(s, loop0, s->piece.leaf_rims[0], 3, 3, TREEPIECES_FOLD, 1);
    tpc_add_row(s, loop1, s->piece.leaf_rims[1], 3, 3, TREEPIECES_BARK, 2);
    tpc_add_row(s, loop1, s->piece.leaf_rims[1], 0, 3, TREEPIECES_FOLD, 2);
}

/* A tube of three rows of quads; each branch replaces two quads of the middle row, left and right
   of vertex v = 0 (and 3). The loop around the hole, seen from the branch: bottom, bottom right,
   top right, top, top left, bottom left. */
static void tpc_make_branched(tpc_shape *s, const char *name, int branches) {
    int b[TREEPIECES_RIM], c[TREEPIECES_RIM];
    tpc_begin(s, name);
    tpc_add_ring(s, 0.28f, 0.99f, 0.99f, 0.8f, 1, b);
    tpc_add_ring(s, 0.74f, 0.96f, 0.96f, 0.4f, 1, c);
    const int *top = tpc_add_leaf_rim(s, 0, 1, 0, 0, 0, 0.93f);
    tpc_add_row(s, s->piece.root_rim, b, 0, 6, TREEPIECES_BARK, 0);
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const int at_first = k == 5 || k == 0, at_second = branches > 1 && (k == 2 || k == 3);
        const int open = at_first || at_second;
        if (!open) tpc_add_row(s, b, c, k, 1, TREEPIECES_BARK, 1);
        tpc_add_row(s, c, top, k, 1, open ? TREEPIECES_FOLD : TREEPIECES_BARK, 1);
    }
    for (int i = 0; i < branches; i++) {
        const int v = 3 * i, left = (v + 5) % 6, right = v + 1;
        const float side = i ? -1.0f : 1.0f;
        const int loop[TREEPIECES_RIM] = {b[v], b[right], c[right], c[v], c[left], b[left]};
        const int *rim = tpc_add_leaf_rim(s, 1.4f * side, 0.55f, 0, 180 * i, 60, 0.45f);
        tpc_add_row(s, loop, rim, 0, 1, TREEPIECES_BARK, 2 + i);
        tpc_add_row(s, loop, rim, 1, 1, TREEPIECES_TURN_RIGHT, 2 + i);
        tpc_add_row(s, loop, rim, 2, 2, TREEPIECES_FOLD, 2 + i);
        tpc_add_row(s, loop, rim, 4, 1, TREEPIECES_TURN_LEFT, 2 + i);
        tpc_add_row(s, loop, rim, 5, 1, TREEPIECES_BARK, 2 + i);
    }
}

/* Three crotches meet in the middle; arm k leans towards vertex 1 + 2 k. */
static void tpc_make_spatial(tpc_shape *s) {
    int a[TREEPIECES_RIM], p[TREEPIECES_RIM];
    tpc_begin(s, "spatial trifurcation");
    for (int k = 0; k < TREEPIECES_RIM; k++) {
        const int arm = k / 2, before = (arm + 2) % 3; /* even ones lie between two arms */
        const int leaves = k & 1 ? 1 << arm : 1 << arm | 1 << before;
        const float r = k & 1 ? 1.06f : 0.97f;
        a[k] = tpc_add_vertex(s, r * tpc_cos6[k], k & 1 ? 0.5f : 0.64f, -r * tpc_sin6[k], 0.6f,
                              leaves);
        p[k] = 0;
        if (!(k & 1))
            p[k] = tpc_add_vertex(s, 0.5f * tpc_cos6[k], 0.88f, -0.5f * tpc_sin6[k], 0.5f, leaves);
    }
    const int middle = tpc_add_vertex(s, 0, 1, 0, 0.4f, 7);
    tpc_add_row(s, s->piece.root_rim, a, 0, 6, TREEPIECES_BARK, 0);
    for (int arm = 0; arm < 3; arm++) {
        const int to = 1 + 2 * arm, next = (to + 1) % 6, before = to - 1;
        const int loop[TREEPIECES_RIM] = {a[to], a[next], p[next], middle, p[before], a[before]};
        const int *rim = tpc_add_leaf_rim(s, 0.78f * tpc_cos6[to], 1.3f, -0.78f * tpc_sin6[to],
                                      60 * to, 32, 0.62f);
        tpc_add_row(s, loop, rim, 5, 2, TREEPIECES_BARK, 1 + arm);
        tpc_add_row(s, loop, rim, 1, 4, TREEPIECES_FOLD, 1 + arm);
    }
}

static void tpc_make_tip(tpc_shape *s) {
    int ring[TREEPIECES_RIM];
    tpc_begin(s, "tip");
    tpc_add_ring(s, 0.92f, 0.5f, 0.5f, 1, 0, ring);
    const int end = tpc_add_vertex(s, 0, 1, 0, 1, 0);
    tpc_add_row(s, s->piece.root_rim, ring, 0, 6, TREEPIECES_BARK, 0);
    for (int k = 0; k < TREEPIECES_RIM; k += 2)
        tpc_add_quad(s, end, ring[k], ring[k + 1], ring[(k + 2) % 6], TREEPIECES_BARK, 1);
}

static void tpc_make_flare(tpc_shape *s) {
    int low[TREEPIECES_RIM], high[TREEPIECES_RIM];
    tpc_begin(s, "root flare");
    tpc_add_ring(s, 0.2f, 0.92f, 0.7f, 1, 0, low);
    tpc_add_ring(s, 0.55f, 0.74f, 0.64f, 0.6f, 1, high);
    const int *top = tpc_add_leaf_rim(s, 0, 1, 0, 0, 0, 0.62f);
    tpc_add_row(s, s->piece.root_rim, low, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, low, high, 0, 6, TREEPIECES_BARK, 0);
    tpc_add_row(s, high, top, 0, 6, TREEPIECES_BARK, 1);
}

/* Normals of all vertices: the mean of the adjacent quads, weighted by area. Those of rims are
   replaced when the piece is added to the kit. */
static void tpc_smooth(tpc_shape *s) {
    float sums[64][3];
    memset(sums, 0, sizeof sums);
    for (int i = 0; i < s->piece.quad_count; i++) {
        const uint8_t *c = s->quads[i].corners;
        const float *p[4];
        float d[2][3], normal[3];
        for (int k = 0; k < 4; k++) p[k] = s->vertices[c[k]].position;
        for (int k = 0; k < 3; k++) {
            d[0][k] = p[2][k] - p[0][k];
            d[1][k] = p[3][k] - p[1][k];
        }
        tpc_cross(d[0], d[1], normal);
        for (int k = 0; k < 4; k++)
            for (int a = 0; a < 3; a++) sums[c[k]][a] += normal[a];
    }
    for (int i = 0; i < s->piece.vertex_count; i++) {
        tpc_unit(sums[i]);
        memcpy(s->vertices[i].normal, sums[i], sizeof sums[i]);
    }
    s->piece.vertices = s->vertices;
    s->piece.quads = s->quads;
}

static void tpc_make_builtin(int type, tpc_shape *s) {
    switch (type) {
    case TREEPIECES_I: tpc_make_i(s); break;
    case TREEPIECES_Y: tpc_make_y(s); break;
    case TREEPIECES_SIDE: tpc_make_branched(s, "side branch", 1); break;
    case TREEPIECES_PLANAR: tpc_make_branched(s, "planar trifurcation", 2); break;
    case TREEPIECES_SPATIAL: tpc_make_spatial(s); break;
    case TREEPIECES_TIP: tpc_make_tip(s); break;
    default: tpc_make_flare(s); break;
    }
    tpc_smooth(s);
}

#endif /* TREEPIECES_BUILTIN_H */
