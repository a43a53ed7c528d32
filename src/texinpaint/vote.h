#ifndef TEXINPAINT_VOTE_H
#define TEXINPAINT_VOTE_H

#include "config.h"

/* ---- tensor voting ----------------------------------------------------------------------------
   C. Tang, G. Medioni. Inference of integrated surface, curve and junction descriptions from sparse
   3D data. PAMI 1998. Each token, a point of a line or surface, tells its neighbours which
   direction they would have if both were parts of one smooth line or surface. A symmetric tensor
   collects the votes:

       T = l1 e1 e1' + l2 e2 e2' + l3 e3 e3',  l1 >= l2 >= l3                             [1, (1)]
         = (l1 - l2) e1 e1' + (l2 - l3) (e1 e1' + e2 e2') + l3 I
            stick: a surface        plate: a line along e3    ball: a junction, or no
            with normal e1                                    preference

   Tensors are stored as xx xy xz yy yz zz.                                                       */

enum {
    TXI_VOTE_RADII = 40,  /* entries of the tables of the fields along the distance               */
    TXI_VOTE_ANGLES = 24, /* and along the angle, 0 to 90 degrees                                 */
    TXI_VOTE_STICKS = 32  /* sticks that are summed up for a plate, over a quarter turn           */
};

#define TXI_VOTE_BEND 3.733 /* c = -16 ln(0.1) (sigma - 1) / pi^2 [4]                             */

/* A token: where it is, and its tensor taken apart. */
typedef struct txi_token {
    txm_dvec3 place;
    txm_dvec3 normal;  /* e1                                                                     */
    txm_dvec3 tangent; /* e3                                                                     */
    double stick, plate, ball; /* l1 - l2, l2 - l3, l3                                            */
    int next;          /* next token in the same bucket, or -1                                    */
} txi_token;

/* The voting fields of one scale. */
typedef struct txi_fields {
    double sigma;     /* length unit: how far votes reach                                         */
    double c;         /* penalty of curvature                                                     */
    double reach;     /* no votes beyond                                                          */
    double ball[TXI_VOTE_RADII + 1][2];  /* along the connection, across it                       */
    double plate[TXI_VOTE_RADII + 1][TXI_VOTE_ANGLES + 1][4]; /* tt, tp, pp, qq, see below        */
} txi_fields;

/* Tokens in buckets, for the search of neighbours. */
typedef struct txi_tokens {
    txi_token *at;
    int count, room;
    int *bucket;      /* first token of each bucket, or -1                                        */
    uint32_t mask;    /* number of buckets less one                                               */
    double cell;      /* side of a cell of the grid                                               */
} txi_tokens;

/* theta / sin(theta) for s = sin(theta)^2 <= 1/2, by the series of the arc sine, to 1e-7. */
static double txi_arc(double s) {
    double sum = 1, term = 1;
    for (int k = 1; k <= 18; k++) {
        term *= s * (2 * k - 1) / (2 * k);
        sum += term / (2 * k + 1);
    }
    return sum;
}

/* The decay of a stick's vote over distance l at an angle theta between the connection and the
   tangent plane: along the arc of length s = l theta / sin(theta) and curvature k = 2 sin(theta) /
   l

       D = exp(-(s^2 + c k^2) / sigma^2)                                                          */
static double txi_decay(const txi_fields *f, double l, double sine) {
    const double s = l * txi_arc(sine * sine), k = 2 * sine / l;
    const double e = (s * s + f->c * k * k) / (f->sigma * f->sigma);
    return e < 600 ? txm_exp2(-e * TXI_LOG2_E) : 0;
}

static inline void txi_outer(double t[6], txm_dvec3 v, double weight) {
    t[0] += weight * v.x * v.x;
    t[1] += weight * v.x * v.y;
    t[2] += weight * v.x * v.z;
    t[3] += weight * v.y * v.y;
    t[4] += weight * v.y * v.z;
    t[5] += weight * v.z * v.z;
}

/* The vote of a stick with unit normal n at v from it: the normal of the circle that touches the
   stick's tangent plane and goes through v. Nothing beyond 45 degrees. */
static void txi_vote_stick(const txi_fields *f, txm_dvec3 n, txm_dvec3 v, double weight,
                           double t[6]) {
    const double l = txm_d3_len(v);
    if (!(l > 0) || l > f->reach) return;
    const txm_dvec3 u = txm_d3_scale(v, 1 / l);
    const double sine = txm_d3_dot(n, u);
    if (sine * sine > 0.5) return;
    /* the reflection of n in the plane at a right angle to the connection                        */
    txi_outer(t, txm_d3_mad(n, u, -2 * sine), weight * txi_decay(f, l, sine));
}

/* The tables. A ball's vote is the integral over the sphere of sticks; with s the sine of a stick's
   angle to the plane across the connection u it is, as sticks are reflected,

       3/2 int D s^2 ds  along u,  3/4 int D (1 - s^2) ds  across,  |s| <= sqrt(1/2)

   A plate's vote is the integral of sticks over the circle around its tangent t. In the frame t, p
   (across t in the plane of t and u), q = t x p it has the entries tt, tp, pp, qq.

   sigma   length unit: about half of the gap that votes can bridge
   plates  0: no plates will vote, which saves most of the time                                  */
static void txi_fields_make(txi_fields *f, double sigma, int plates) {
    f->sigma = sigma;
    f->c = sigma > 1 ? TXI_VOTE_BEND * (sigma - 1) : 0;
    f->reach = 2.5 * sigma;
    for (int i = 0; i <= TXI_VOTE_RADII; i++) {
        const double l = f->reach * (i > 0 ? i : 0.01) / (double)TXI_VOTE_RADII;
        f->ball[i][0] = f->ball[i][1] = 0;
        for (int k = 0; k < TXI_VOTE_STICKS; k++) { /* both signs of s                            */
            const double width = 0.70710678118654752 / (double)TXI_VOTE_STICKS,
                         s = width * (k + 0.5);
            const double d = 2 * width * txi_decay(f, l, s);
            f->ball[i][0] += 1.5 * d * s * s;
            f->ball[i][1] += 0.75 * d * (1 - s * s);
        }
        for (int j = 0; j <= TXI_VOTE_ANGLES && plates; j++) {
            double sine, cosine, *e = f->plate[i][j];
            /* u = cosine t + sine p */
            txm_sincos(0.5 * TXM_PI * j / (double)TXI_VOTE_ANGLES, &sine, &cosine);
            e[0] = e[1] = e[2] = e[3] = 0;
            for (int k = 0; k < TXI_VOTE_STICKS; k++) {
                double np, nq;
                txm_sincos(0.5 * TXM_PI * (k + 0.5) / (double)TXI_VOTE_STICKS, &nq, &np);
                const double s = np * sine;
                if (s * s > 0.5) continue;
                const double d = 2 * txi_decay(f, l, s) / (double)TXI_VOTE_STICKS;
                const double rt = -2 * s * cosine, rp = np - 2 * s * sine;
                e[0] += d * rt * rt;
                e[1] += d * rt * rp;
                e[2] += d * rp * rp;
                e[3] += d * nq * nq;
            }
        }
    }
}

/* The vote of a ball at v from it. */
static void txi_vote_ball(const txi_fields *f, txm_dvec3 v, double weight, double t[6]) {
    const double l = txm_d3_len(v), at = l * (double)TXI_VOTE_RADII / f->reach;
    if (!(l > 0) || l >= f->reach) return;
    const int i = (int)at;
    const double r = at - i;
    const double along = weight * (f->ball[i][0] * (1 - r) + f->ball[i + 1][0] * r);
    const double across = weight * (f->ball[i][1] * (1 - r) + f->ball[i + 1][1] * r);
    txi_outer(t, txm_d3_scale(v, 1 / l), along - across);
    t[0] += across;
    t[3] += across;
    t[5] += across;
}

/* The vote of a plate, a line in direction tangent (unit), at v from it. */
static void txi_vote_plate(const txi_fields *f, txm_dvec3 tangent, txm_dvec3 v, double weight,
                           double t[6]) {
    const double l = txm_d3_len(v), at = l * (double)TXI_VOTE_RADII / f->reach;
    double e[4], cosine = txm_d3_dot(tangent, v) / (l > 0 ? l : 1);
    if (!(l > 0) || l >= f->reach) return;
    if (cosine < 0) { /* the field is the same behind                                             */
        tangent = txm_d3_scale(tangent, -1);
        cosine = -cosine;
    }
    txm_dvec3 p = txm_d3_mad(v, tangent, -cosine * l);
    const double far_off = txm_d3_len(p);
    if (far_off > 1e-9 * l) {
        p = txm_d3_scale(p, 1 / far_off);
    } else {
        const txm_vec3 any = txm_vec3_perpendicular(txm_v3(
            txm_float(tangent.x), txm_float(tangent.y), txm_float(tangent.z)));
        p = txm_d3_unit(txm_d3(any.x, any.y, any.z));
    }
    const txm_dvec3 q = txm_d3_cross(tangent, p);
    /* the angle from its sine or cosine, whichever is less: theta = x * arc(x^2)                 */
    const double sine = far_off / l;
    const double angle =
        sine < cosine
            ? sine * txi_arc(sine * sine < 0.5 ? sine * sine : 0.5)
            : 0.5 * TXM_PI - cosine * txi_arc(cosine * cosine < 0.5 ? cosine * cosine : 0.5);
    const double across = angle * (double)TXI_VOTE_ANGLES / (0.5 * TXM_PI);
    const int i = (int)at, j = txm_clampi((int)across, 0, TXI_VOTE_ANGLES - 1);
    const double r = at - i, a = across - j;
    for (int k = 0; k < 4; k++) {
        e[k] = weight * ((f->plate[i][j][k] * (1 - a) + f->plate[i][j + 1][k] * a) * (1 - r) +
                         (f->plate[i + 1][j][k] * (1 - a) + f->plate[i + 1][j + 1][k] * a) * r);
    }
    txi_outer(t, tangent, e[0] - e[1]); /* e1 (tp' + pt') = e1 ((t + p)(t + p)' - tt' - pp')      */
    txi_outer(t, p, e[2] - e[1]);
    txi_outer(t, txm_d3_add(tangent, p), e[1]);
    txi_outer(t, q, e[3]);
}

/* All of a token's vote at a place. */
static void txi_token_vote(const txi_fields *f, const txi_token *k, txm_dvec3 place, double t[6]) {
    const txm_dvec3 v = txm_d3_sub(place, k->place);
    if (txm_d3_len2(v) >= f->reach * f->reach) return;
    if (k->stick > 0) txi_vote_stick(f, k->normal, v, k->stick, t);
    if (k->plate > 0) txi_vote_plate(f, k->tangent, v, k->plate, t);
    if (k->ball > 0) txi_vote_ball(f, v, k->ball, t);
}

/* ---- tensors ----------------------------------------------------------------------------- */

/* Take a tensor apart. */
static void txi_token_set(txi_token *k, const double t[6]) {
    double value[3], e[3][3];
    k->stick = k->plate = k->ball = 0;
    k->normal = txm_d3(0, 0, 1);
    k->tangent = txm_d3(1, 0, 0);
    if (txm_eigen3(t, value, e) != TXM_OK) return;
    k->normal = txm_d3(e[0][0], e[0][1], e[0][2]);
    k->tangent = txm_d3(e[2][0], e[2][1], e[2][2]);
    k->stick = value[0] - value[1];
    k->plate = value[1] - value[2];
    k->ball = value[2] > 0 ? value[2] : 0;
}

/* The surface as a constraint: lines lie in it, so that only the part of a tensor in the tangent
   plane counts, P T P with P = I - n n'. A line in direction d, which is a plate (I - d d'),
   becomes the stick m m' with m = n x d, which votes within the surface only. */
static void txi_onto_surface(double t[6], txm_dvec3 n) {
    const txm_dvec3 tn =
        txm_d3(t[0] * n.x + t[1] * n.y + t[2] * n.z, t[1] * n.x + t[3] * n.y + t[4] * n.z,
               t[2] * n.x + t[4] * n.y + t[5] * n.z);
    const double nn = txm_d3_dot(n, tn);
    /* T - n (Tn)' - (Tn) n' + (n'Tn) n n'                                                        */
    t[0] += -2 * n.x * tn.x + nn * n.x * n.x;
    t[1] += -n.x * tn.y - n.y * tn.x + nn * n.x * n.y;
    t[2] += -n.x * tn.z - n.z * tn.x + nn * n.x * n.z;
    t[3] += -2 * n.y * tn.y + nn * n.y * n.y;
    t[4] += -n.y * tn.z - n.z * tn.y + nn * n.y * n.z;
    t[5] += -2 * n.z * tn.z + nn * n.z * n.z;
}

/* ---- buckets ----------------------------------------------------------------------------- */

static uint32_t txi_bucket(const txi_tokens *k, int64_t x, int64_t y, int64_t z) {
    const uint64_t h = (uint64_t)x * 0x9e3779b97f4a7c15u + (uint64_t)y * 0xc2b2ae3d27d4eb4fu +
                       (uint64_t)z * 0x165667b19e3779f9u;
    return (uint32_t)(txm_hash(h) & k->mask);
}

static int64_t txi_cell(const txi_tokens *k, double x) {
    return (int64_t)floor((double)txm_clampf(txm_float(x / k->cell), -1e9f, 1e9f));
}

/* No tokens; room for that many. */
static txm_status txi_tokens_make(txi_tokens *k, int room, double reach, txm_arena *arena,
                                  txm_env *env) {
    uint32_t buckets = 16;
    while (buckets < (uint32_t)room) buckets *= 2;
    k->at = (txi_token *)txm_arena_alloc(arena, (size_t)(room > 0 ? room : 1), sizeof *k->at);
    k->bucket = (int *)txm_arena_alloc(arena, buckets, sizeof *k->bucket);
    if (arena->failed) return txi_no_memory(env);
    k->count = 0;
    k->room = room;
    k->mask = buckets - 1;
    k->cell = reach > 1e-9 ? reach : 1e-9;
    for (uint32_t i = 0; i < buckets; i++) k->bucket[i] = -1;
    return TXM_OK;
}

/* Add a token of tensor t; nothing happens if there is no room. */
static void txi_tokens_add(txi_tokens *k, txm_dvec3 place, const double t[6]) {
    if (k->count >= k->room) return;
    txi_token *token = &k->at[k->count];
    txi_token_set(token, t);
    token->place = place;
    const uint32_t b =
        txi_bucket(k, txi_cell(k, place.x), txi_cell(k, place.y), txi_cell(k, place.z));
    token->next = k->bucket[b];
    k->bucket[b] = k->count++;
}

/* The sum of all votes at a place, with balls: as if all tokens were unit balls. cost: O(tokens
   within reach) */
static void txi_votes_at(const txi_fields *f, const txi_tokens *k, txm_dvec3 place, int balls,
                         double t[6]) {
    const int64_t cx = txi_cell(k, place.x), cy = txi_cell(k, place.y), cz = txi_cell(k, place.z);
    for (int i = 0; i < 6; i++) t[i] = 0;
    for (int i = 0; i < 27; i++) {
        const int64_t x = cx + i % 3 - 1, y = cy + i / 3 % 3 - 1, z = cz + i / 9 - 1;
        for (int j = k->bucket[txi_bucket(k, x, y, z)]; j >= 0; j = k->at[j].next) {
            const txi_token *o = &k->at[j];
            /* another cell may share the bucket                                                  */
            if (txi_cell(k, o->place.x) != x || txi_cell(k, o->place.y) != y ||
                txi_cell(k, o->place.z) != z)
                continue;
            if (balls) txi_vote_ball(f, txm_d3_sub(place, o->place), 1, t);
            else txi_token_vote(f, o, place, t);
        }
    }
}

/* Sparse voting: each token receives the votes of the others, which replace its tensor. balls: the
   first round, in which only the places are known. normals: one per token, the surface on which
   lines lie, or NULL. scratch: 6 numbers per token. */
static void txi_vote_sparse(const txi_fields *f, txi_tokens *k, int balls, const txm_dvec3 *normals,
                            double *scratch) {
    for (int i = 0; i < k->count; i++) {
        double *t = scratch + 6 * (size_t)i;
        txi_votes_at(f, k, k->at[i].place, balls, t);
        if (normals) txi_onto_surface(t, normals[i]);
    }
    for (int i = 0; i < k->count; i++) txi_token_set(&k->at[i], scratch + 6 * (size_t)i);
}

#endif /* TEXINPAINT_VOTE_H */
