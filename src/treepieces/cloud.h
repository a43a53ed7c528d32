#ifndef TREEPIECES_CLOUD_H
#define TREEPIECES_CLOUD_H

#include "rim.h"

/* ---- foliage: leaf clouds ------------------------------------------------------------------ */

/* a random number, -1..1 */
static float tpc_signed(txm_rng *rng) {
    return 2 * txm_rng_float(rng) - 1;
}

/* Orient a card: its image grows along `along`, and its face is turned to `facing` as far as that
   allows, or with its back. outward: normal of the cloud's surface there, to which its front is turned;
   the card is shaded as something between that surface and a flat twig. */
static void tpc_orient_card(treepieces_card *card, float along[3], float facing[3],
                            const float outward[3], float wide, float high) {
    tpc_unit_or(along, 1, 0, 0);
    const float share = tpc_dot(facing, along);
    for (int k = 0; k < 3; k++) facing[k] -= share * along[k];
    if (tpc_dot(facing, facing) < 1e-6f) { /* any orthogonal direction */
        facing[0] = along[1];
        facing[1] = -along[0];
        facing[2] = 0;
    }
    tpc_unit_or(facing, 1, 0, 0);
    if (tpc_dot(facing, outward) < 0)
        for (int k = 0; k < 3; k++) facing[k] = -facing[k];
    float right[3];
    tpc_cross(along, facing, right);
    for (int k = 0; k < 3; k++) {
        card->right[k] = wide * right[k];
        card->up[k] = high * along[k];
        card->normal[k] = outward[k] + facing[k];
    }
    tpc_unit_or(card->normal, outward[0], outward[1], outward[2]);
}

/* Impostors show only the unit sphere: move the centre of a card inwards until its corners are
   inside. */
static void tpc_keep_inside(treepieces_card *card) {
    for (int step = 0; step < 64; step++) {
        float most = 0;
        for (int corner = 0; corner < 4; corner++) {
            float p[3];
            for (int k = 0; k < 3; k++)
                p[k] = card->center[k] + (corner & 1 ? card->right[k] : -card->right[k]) +
                       (corner & 2 ? card->up[k] : -card->up[k]);
            most = txm_maxf(most, tpc_dot(p, p));
        }
        if (!(most > 1)) return;
        for (int k = 0; k < 3; k++) card->center[k] *= 0.93f;
    }
}

/* Direction `index` of `count` distributed evenly over the sphere, with some jitter. */
static void tpc_sphere_direction(int index, int count, float phase, txm_rng *rng, float direction[3]) {
    double sine, cosine;
    const float jitter = 0.6f * tpc_signed(rng), off = 0.3f * tpc_signed(rng);
    const float y = txm_clampf(1 - (2 * (float)index + 1 + jitter) / (float)count, -1, 1);
    const float ring = sqrtf(1 - y * y);
    txm_sincos((double)phase + 2.399963229728653 * index + (double)off, &sine, &cosine);
    direction[0] = ring * (float)cosine;
    direction[1] = y;
    direction[2] = ring * (float)sine;
}

/* A position in the unit ball far from the cards so far: the best of some random candidates. This
   avoids clusters and gaps, and puts most cards near the surface. */
static void tpc_far_place(const treepieces_card *cards, int taken, const float size[3],
                          txm_rng *rng, float place[3]) {
    enum { TRIES = 6 };
    float best = -1;
    for (int t = 0; t < TRIES;) {
        float p[3], room = 8;
        for (int k = 0; k < 3; k++) p[k] = tpc_signed(rng);
        if (tpc_dot(p, p) > 1) continue;
        t++;
        for (int i = 0; i < taken; i++) {
            float off[3];
            for (int k = 0; k < 3; k++) off[k] = cards[i].center[k] / size[k] - p[k];
            room = txm_minf(room, tpc_dot(off, off));
        }
        if (room <= best) continue;
        best = room;
        memcpy(place, p, sizeof p);
    }
}

/* What the cards of a cloud have in common. */
typedef struct tpc_cloud {
    int kind, count;
    float scale[3], half; /* of the cloud; half the side of a card */
    float phase;          /* radians, random                       */
    uint32_t seed;        /* of what belongs to no single card     */
    float droop;          /* of twigs                              */
    txm_rng rng;
} tpc_cloud;

/* Twigs that grow outwards, most of them near the surface. Layers: they spread horizontally. */
static void tpc_twig_card(tpc_cloud *c, treepieces_card *cards, int index) {
    const int is_flat = c->kind == TREEPIECES_CLOUD_LAYERS;
    const float half = c->half * (0.8f + 0.35f * txm_rng_float(&c->rng));
    const float reach = txm_maxf(1 - 0.8f * c->half, 0.05f);
    const float size[3] = {reach * c->scale[0], reach * c->scale[1], reach * c->scale[2]};
    float place[3] = {0, 0, 0}, outward[3], along[3], facing[3];
    tpc_far_place(cards, index, size, &c->rng, place);
    /* thinner inside, and a surface that is not a sphere */
    const float radius = sqrtf(tpc_dot(place, place));
    const float further = (1.5f - 0.5f * radius) * (0.84f + 0.16f * txm_rng_float(&c->rng));
    for (int k = 0; k < 3; k++) {
        cards[index].center[k] = size[k] * place[k] * further;
        outward[k] = place[k] / c->scale[k];
    }
    tpc_unit_or(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) {
        along[k] = 0.9f * outward[k] + 0.5f * tpc_signed(&c->rng);
        facing[k] = 0.35f * outward[k] + (is_flat ? 0.45f : 0.7f) * tpc_signed(&c->rng);
    }
    if (is_flat) along[1] *= 0.35f;
    along[1] -= c->droop;
    facing[1] += is_flat ? 1.1f : 0.6f;
    tpc_orient_card(&cards[index], along, facing, outward, half, half);
}

/* Rows of cards along shoots that radiate from the centre and turn upwards, turned alternately about
   them. */
static void tpc_shoot_card(tpc_cloud *c, treepieces_card *cards, int index) {
    const float reach = txm_maxf(1 - c->half, 0);
    const float fit = 0.7f * reach / txm_maxf(c->half, 0.01f) + 0.95f; /* overlapping by half */
    const int most = txm_clampi((int)txm_minf(fit, 4), 1, 4);
    const int shoots = (c->count + most - 1) / most, steps = (c->count + shoots - 1) / shoots;
    const int step = index / shoots;
    const float place = ((float)step + 0.5f + 0.5f * txm_rng_float(&c->rng)) / (float)steps;
    const float roll = (float)((index % shoots + step) % 3 - 1);
    treepieces_card *card = &cards[index];
    float along[3], facing[3], outward[3];
    tpc_sphere_direction(index % shoots, shoots, c->phase, &c->rng, along);
    const float at = reach * (0.3f + 0.7f * place);
    for (int k = 0; k < 3; k++) along[k] *= c->scale[k];
    tpc_unit_or(along, 1, 0, 0);
    for (int k = 0; k < 3; k++) {
        card->center[k] = at * along[k] * (k == 1 ? txm_minf(1, 1.6f * c->scale[1]) : 1);
        outward[k] = along[k] + (k == 1 ? 0.35f : 0);
    }
    tpc_unit_or(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) along[k] += 0.25f * tpc_signed(&c->rng);
    along[1] += 0.35f;
    /* across the shoot, horizontal */
    facing[0] = -1.2f * roll * along[2] + 0.2f * tpc_signed(&c->rng);
    facing[1] = 1;
    facing[2] = 1.2f * roll * along[0] + 0.2f * tpc_signed(&c->rng);
    tpc_orient_card(card, along, facing, outward, c->half, c->half);
}

/* Columns of narrow hanging cards, one below the other, that begin and end at different heights. */
static void tpc_strip_card(tpc_cloud *c, treepieces_card *cards, int index) {
    enum { ROWS = 2 };
    const int columns = (c->count + ROWS - 1) / ROWS, column = index % columns, row = index / columns;
    const float share = ((float)column + 0.5f) / (float)columns;
    const float ring = sqrtf(share) * txm_maxf(c->scale[0] - 0.3f * c->half, 0.05f);
    const uint64_t own = txm_hash(c->seed + (uint64_t)column); /* of the column */
    const float high = c->half * (0.75f + 0.5f * (float)(own >> 52) / 4096);
    const float hang = txm_maxf(2 * c->scale[1] - 2.4f * high, 0) * (float)(own >> 40 & 4095) / 4096;
    double sine, cosine;
    float along[3], facing[3], outward[3];
    txm_sincos((double)c->phase + 2.399963229728653 * column, &sine, &cosine);
    treepieces_card *card = &cards[index];
    outward[0] = (float)cosine;
    outward[1] = 0.25f;
    outward[2] = (float)sine;
    tpc_unit_or(outward, 0, 1, 0);
    card->center[0] = ring * (float)cosine + 0.1f * c->half * tpc_signed(&c->rng);
    card->center[1] = c->scale[1] - high - hang - (row ? 0.9f : 0.1f) * high;
    card->center[2] = ring * (float)sine + 0.1f * c->half * tpc_signed(&c->rng);
    for (int k = 0; k < 3; k++) {
        along[k] = 0.12f * tpc_signed(&c->rng) - (k == 1 ? 1.0f : 0);
        facing[k] = 0.5f * outward[k] + tpc_signed(&c->rng);
    }
    tpc_orient_card(card, along, facing, outward, 0.5f * high, high);
}

TREEPIECES_API int treepieces_cloud(const treepieces_species *species, uint32_t look,
                                    treepieces_card *cards) {
    const int count = species ? txm_clampi(species->leaf_count, 0, 256) : 0;
    if (!cards || !count) return count;
    const float flat = txm_clampf(species->cloud_flat, 0.1f, 2);
    tpc_cloud cloud;
    cloud.kind = species->cloud_kind;
    cloud.count = count;
    cloud.half = 0.5f * txm_clampf(species->leaf_size, 0.01f, 4);
    cloud.scale[0] = cloud.scale[2] = txm_minf(1, 1 / flat);
    cloud.scale[1] = txm_minf(1, flat);
    cloud.rng = txm_rng_make(look, 0x1eaf);
    cloud.phase = 6.2831853f * txm_rng_float(&cloud.rng);
    cloud.seed = txm_rng_next(&cloud.rng);
    cloud.droop = species->leaf_shape == TREEPIECES_LEAF_LANCE     ? 0.8f
                  : species->leaf_shape == TREEPIECES_LEAF_BLOSSOM ? 0
                                                                   : 0.2f;
    for (int i = 0; i < count; i++) {
        if (cloud.kind == TREEPIECES_CLOUD_SHOOTS) tpc_shoot_card(&cloud, cards, i);
        else if (cloud.kind == TREEPIECES_CLOUD_STRIPS) tpc_strip_card(&cloud, cards, i);
        else tpc_twig_card(&cloud, cards, i);
        tpc_keep_inside(&cards[i]);
    }
    return count;
}

#endif /* TREEPIECES_CLOUD_H */
