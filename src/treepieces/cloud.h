#ifndef TREEPIECES_CLOUD_H
#define TREEPIECES_CLOUD_H

#include "rim.h"

/* ---- foliage: leaf clouds ------------------------------------------------------------------ */

/* a random number, -1..1 */
static float tpc_signed(txm_rng *rng) {
    return 2 * txm_rng_float(rng) - 1;
}

/* Orient a card: its image grows along `along`, and its face is turned to `facing` as far as that
   allows. outward: normal of the cloud's surface there. */
static void tpc_orient_card(treepieces_card *card, float along[3], float facing[3],
                         const float outward[3], float half) {
    tpc_unit_or(along, 1, 0, 0);
    const float share = tpc_dot(facing, along);
    for (int k = 0; k < 3; k++) facing[k] -= share * along[k];
    if (tpc_dot(facing, facing) < 1e-6f) { /* any orthogonal direction */
        facing[0] = along[1];
        facing[1] = -along[0];
        facing[2] = 0;
    }
    tpc_unit_or(facing, 1, 0, 0);
    float right[3];
    tpc_cross(along, facing, right);
    for (int k = 0; k < 3; k++) {
        card->right[k] = half * right[k];
        card->up[k] = half * along[k];
        card->normal[k] = outward[k] + 0.6f * facing[k];
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

/* Broad leaves: cards distributed in the cloud, drooping as the leaf shape asks for. */
static void tpc_leafy_card(const treepieces_species *species, treepieces_card *cards, int index,
                           const float scale[3], float half, txm_rng *rng) {
    const int is_lance = species->leaf_shape == TREEPIECES_LEAF_LANCE;
    const int is_blossom = species->leaf_shape == TREEPIECES_LEAF_BLOSSOM;
    const float droop = is_lance ? 1.2f : is_blossom ? 0 : 0.35f, loose = is_lance ? 0.3f : 0.8f;
    const float reach = txm_maxf(1 - half, 0.05f);
    const float size[3] = {reach * scale[0], reach * scale[1], reach * scale[2]};
    float place[3] = {0, 0, 0}, outward[3], along[3], facing[3];
    tpc_far_place(cards, index, size, rng, place);
    for (int k = 0; k < 3; k++) {
        cards[index].center[k] = size[k] * place[k];
        outward[k] = place[k] / scale[k];
    }
    tpc_unit_or(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) {
        along[k] = 0.45f * outward[k] + loose * tpc_signed(rng) - (k == 1 ? droop : 0);
        facing[k] = 0.7f * outward[k] + 0.7f * tpc_signed(rng) + (k == 1 ? 0.4f : 0);
    }
    tpc_orient_card(&cards[index], along, facing, outward, half);
}

/* Needles: rows of cards along twigs that radiate from the centre, turned alternately about them. */
static void tpc_needle_card(int index, int count, float phase, const float scale[3], float half,
                            txm_rng *rng, treepieces_card *card) {
    const float reach = txm_maxf(1 - half, 0);
    const float fit = 0.7f * reach / txm_maxf(half, 0.01f) + 0.95f; /* overlapping by half */
    const int most = txm_clampi((int)txm_minf(fit, 4), 1, 4);
    const int twigs = (count + most - 1) / most, steps = (count + twigs - 1) / twigs;
    const int step = index / twigs;
    const float place = ((float)step + 0.5f + 0.5f * txm_rng_float(rng)) / (float)steps;
    const float roll = (float)((index % twigs + step) % 3 - 1);
    float along[3], facing[3], outward[3];
    tpc_sphere_direction(index % twigs, twigs, phase, rng, along);
    const float at = reach * (0.3f + 0.7f * place);
    for (int k = 0; k < 3; k++) along[k] *= scale[k];
    tpc_unit_or(along, 1, 0, 0);
    for (int k = 0; k < 3; k++) {
        card->center[k] = at * along[k];
        outward[k] = along[k] + (k == 1 ? 0.35f : 0);
    }
    tpc_unit_or(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) along[k] += 0.25f * tpc_signed(rng);
    /* across the twig, horizontal */
    facing[0] = -1.2f * roll * along[2] + 0.2f * tpc_signed(rng);
    facing[1] = 1;
    facing[2] = 1.2f * roll * along[0] + 0.2f * tpc_signed(rng);
    tpc_orient_card(card, along, facing, outward, half);
}

TREEPIECES_API int treepieces_cloud(const treepieces_species *species, uint32_t look,
                                    treepieces_card *cards) {
    const int count = species ? txm_clampi(species->leaf_count, 0, 256) : 0;
    if (!cards || !count) return count;
    txm_rng rng = txm_rng_make(look, 0x1eaf);
    const float phase = 6.2831853f * txm_rng_float(&rng);
    const float flat = txm_clampf(species->cloud_flat, 0.1f, 2);
    const float half = 0.5f * txm_clampf(species->leaf_size, 0.01f, 4);
    const float wide = txm_minf(1, 1 / flat), scale[3] = {wide, txm_minf(1, flat), wide};
    for (int i = 0; i < count; i++) {
        if (species->leaf_shape == TREEPIECES_LEAF_NEEDLE)
            tpc_needle_card(i, count, phase, scale, half, &rng, &cards[i]);
        else tpc_leafy_card(species, cards, i, scale, half, &rng);
        tpc_keep_inside(&cards[i]);
    }
    return count;
}

#endif /* TREEPIECES_CLOUD_H */
