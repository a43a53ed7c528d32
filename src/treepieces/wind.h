#ifndef TREEPIECES_WIND_H
#define TREEPIECES_WIND_H

#include "grow.h"

/* ---- wind -------------------------------------------------------------------------------- */

enum {
    TPC_WAVES = 4,
    TPC_PHASES = 8 /* of the flutter within a class of oscillators */
};

/* A gust that travels over the land: weight sin(2 pi (along . (x, z) - rate t + phase)) */
typedef struct tpc_wave {
    double along[2], rate, phase, weight;
} tpc_wave;

/* The wind of one moment, and the step of the oscillators that ends there. */
typedef struct tpc_air {
    float direction[3], pressure, gusts;
    tpc_wave waves[TPC_WAVES];
    double time;
    struct {
        float xx, xv, vx, vv; /* (x, v) -> (xx x + xv v, vx x + vv v), x from where it rests */
        float give;           /* radians at pressure 1 for a sixteenth of the tree's height  */
        float flutter[TPC_PHASES];
    } classes[TPC_CLASSES];
} tpc_air;

/* sine of so many turns, however many */
static double tpc_sine_of_turns(double turns) {
    double sine, cosine;
    txm_sincos((turns - floor(turns)) * (2 * TXM_PI), &sine, &cosine);
    return sine;
}

/* Waves of 90, 41, 19 and 9 m that run with the wind, a little to its sides, at about its speed. */
static void tpc_make_waves(const treepieces_wind *wind, tpc_air *air) {
    static const double lengths[TPC_WAVES] = {90, 41, 19, 9};
    static const double weights[TPC_WAVES] = {0.4, 0.3, 0.2, 0.1};
    txm_rng rng = txm_rng_make(wind->seed, 0x77696e64u);
    double sine, cosine;
    txm_sincos((double)wind->direction, &sine, &cosine);
    air->direction[0] = txm_float(cosine);
    air->direction[1] = 0;
    air->direction[2] = txm_float(-sine);
    air->pressure = wind->speed * wind->speed * 0.01f;
    air->gusts = wind->gusts;
    for (int i = 0; i < TPC_WAVES; i++) {
        tpc_wave *w = &air->waves[i];
        const double aside = 0.7 * ((double)txm_rng_float(&rng) - 0.5);
        txm_sincos((double)wind->direction + aside, &sine, &cosine);
        w->along[0] = cosine / lengths[i];
        w->along[1] = -sine / lengths[i];
        w->rate = (double)wind->speed * (0.8 + 0.4 * (double)txm_rng_float(&rng)) / lengths[i];
        w->phase = (double)txm_rng_float(&rng);
        w->weight = weights[i];
    }
}

static float tpc_pressure(const tpc_air *air, const float position[3], double time) {
    double sum = 0;
    for (int i = 0; i < TPC_WAVES; i++) {
        const tpc_wave *w = &air->waves[i];
        sum += w->weight * tpc_sine_of_turns(w->along[0] * (double)position[0] +
                                             w->along[1] * (double)position[2] - w->rate * time +
                                             w->phase);
    }
    const float pressure = air->pressure * (1 + air->gusts * 1.5f * txm_float(sum));
    return pressure > 0 ? pressure : 0;
}

static int tpc_is_wind(const treepieces_wind *w) {
    return w && fabsf(w->direction) <= 1e4f && w->speed >= 0 && w->speed <= 100 && w->gusts >= 0 &&
           w->gusts <= 1;
}

TREEPIECES_API float treepieces_gust(const treepieces_wind *wind, const float position[3],
                                     double time) {
    tpc_air air;
    if (!tpc_is_wind(wind) || !position || !txm_is_finite(time)) return 0;
    tpc_make_waves(wind, &air);
    return tpc_pressure(&air, position, time);
}

/* Class c swings 0.3 * 2^(c / 4) times a second, damped by a fifth. The step over dt is that of

       x'' + 2 d w x' + w^2 x = 0,   x = e^(-d w t) (a cos(k t) + b sin(k t)),  k = w sqrt(1 - d^2)

   so that it is right however long it is; nothing can grow. Thin branches give more, and flutter. */
static void tpc_make_classes(const treepieces_wind *wind, double dt, tpc_air *air) {
    const double damping = 0.2, part = sqrt(1 - damping * damping);
    for (int c = 0; c < TPC_CLASSES; c++) {
        const double frequency = 0.3 * txm_exp2(c / 4.0), omega = 2 * TXM_PI * frequency;
        const double fade = damping * omega * dt;
        double e = 0, sine = 0, cosine = 0;
        if (fade < 60) { /* beyond that nothing of the old swing is left */
            e = txm_exp2(-fade * 1.44269504088896340736);
            txm_sincos(omega * part * dt, &sine, &cosine);
        }
        air->classes[c].xx = txm_float(e * (cosine + damping / part * sine));
        air->classes[c].xv = txm_float(e * sine / (omega * part));
        air->classes[c].vx = txm_float(-e * omega / part * sine);
        air->classes[c].vv = txm_float(e * (cosine - damping / part * sine));
        air->classes[c].give = txm_float(0.0065 * txm_exp2(c / 5.0));
        for (int k = 0; k < TPC_PHASES; k++)
            air->classes[c].flutter[k] =
                wind->gusts * txm_float(0.5 * tpc_sine_of_turns(frequency * air->time + k * 0.381966) +
                                        0.35 * tpc_sine_of_turns(1.618 * frequency * air->time +
                                                                 k * 0.723607));
    }
}

/* ---- bones ------------------------------------------------------------------------------- */

typedef struct tpc_posing {
    const treepieces_forest *forest;
    const treepieces_pose *pose;
    const tpc_air *air; /* NULL: no wind */
    float *state, *bones;
} tpc_posing;

/* q = q p, with p the rotation about the level axis (x, 0, z) by about its length, in radians */
static void tpc_bend(float q[4], float x, float z) {
    const float a = 0.5f * x, c = 0.5f * z, w = 1 / sqrtf(1 + a * a + c * c);
    const float p[4] = {w * a, 0, w * c, w};
    tpc_multiply(q, p, q);
}

/* A random bend of the pose, the same for this node at any time. */
static void tpc_pose_joint(const treepieces_pose *pose, uint32_t node, float q[4]) {
    if (pose->amount > 0) {
        const uint64_t h = txm_hash(pose->seed ^ ((uint64_t)node + 1) * 0x9e3779b97f4a7c15u);
        const float u = (float)(h & 0xffffff) * 1.1920929e-7f - 1, v = (float)(h >> 40) * 1.1920929e-7f - 1;
        tpc_bend(q, 0.7f * pose->amount * u, 0.7f * pose->amount * v);
    }
    if (pose->joints) tpc_multiply(q, pose->joints + 4 * (size_t)node, q);
}

/* The wind on a joint, seen in its frame (x and z across the stem), and one step of its swing. */
static void tpc_sway_joint(const tpc_air *air, const treepieces_node *n, uint32_t look,
                           const float wind[3], float yield, float *state, float q[4]) {
    const float back[4] = {-q[0], -q[1], -q[2], q[3]};
    float w[3];
    tpc_rotate(back, wind, w);
    const float flutter = air->classes[n->sway].flutter[look & (TPC_PHASES - 1)];
    const float other = air->classes[n->sway].flutter[look >> 3 & (TPC_PHASES - 1)];
    const float strength = sqrtf(wind[0] * wind[0] + wind[1] * wind[1] + wind[2] * wind[2]);
    const float give = air->classes[n->sway].give * txm_clampf(yield * n->length, 0.2f, 3);
    /* the stem leans with the wind: towards +z about +x, towards +x about -z */
    const float rest[2] = {txm_clampf(give * (w[2] + strength * flutter), -0.2f, 0.2f),
                           txm_clampf(-give * (w[0] + strength * other), -0.2f, 0.2f)};
    for (int k = 0; k < 2; k++) {
        const float x = state[2 * k] - rest[k], v = state[2 * k + 1];
        state[2 * k] = rest[k] + (air->classes[n->sway].xx * x + air->classes[n->sway].xv * v);
        state[2 * k + 1] = air->classes[n->sway].vx * x + air->classes[n->sway].vv * v;
    }
    tpc_bend(q, state[0], state[2]);
}

/* The bones of a tree, from its foot on. */
static void tpc_pose_tree(void *context, int index) {
    const tpc_posing *p = (const tpc_posing *)context;
    const treepieces_tree *t = &p->forest->trees[index];
    const float stiffness = p->forest->species[t->species].stiffness;
    const float yield = 16 / (stiffness * txm_maxf(t->height, 0.1f)); /* of a metre of stem */
    float pressure = 0;
    if (p->air) pressure = tpc_pressure(p->air, t->position, p->air->time);
    for (uint32_t i = 0; i < t->node_count; i++) {
        const uint32_t number = t->first_node + i;
        const treepieces_node *n = &p->forest->nodes[number];
        float *b = p->bones + TREEPIECES_BONE * (size_t)number;
        float q[4] = {n->rotation[0], n->rotation[1], n->rotation[2], n->rotation[3]};
        float r[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}; /* rows of the parent's rotation */
        float at[3] = {t->position[0], t->position[1], t->position[2]};
        if (n->parent >= 0) {
            const treepieces_node *up = n - i + n->parent;
            const float *a = p->bones + TREEPIECES_BONE * (size_t)(t->first_node + (uint32_t)n->parent);
            const float *to = p->forest->kit->pieces[up->type].building[n->joint >> 3].translation;
            const float by_radius = 1 / up->radius, by_length = 1 / up->length;
            for (int k = 0; k < 3; k++) {
                r[3 * k] = a[4 * k] * by_radius;
                r[3 * k + 1] = a[4 * k + 1] * by_length;
                r[3 * k + 2] = a[4 * k + 2] * by_radius;
                at[k] = ((a[4 * k] * to[0] + a[4 * k + 1] * to[1]) + a[4 * k + 2] * to[2]) + a[4 * k + 3];
            }
        }
        if (p->pose) tpc_pose_joint(p->pose, number, q);
        if (p->air) {
            const float *d = p->air->direction;
            const float wind[3] = {pressure * (r[0] * d[0] + r[6] * d[2]),
                                   pressure * (r[1] * d[0] + r[7] * d[2]),
                                   pressure * (r[2] * d[0] + r[8] * d[2])};
            tpc_sway_joint(p->air, n, (i * 0x9e3779b9u + t->seed) >> 16, wind, yield,
                           p->state + 4 * (size_t)number, q);
        }
        const float x2 = q[0] + q[0], y2 = q[1] + q[1], z2 = q[2] + q[2];
        const float m[9] = {1 - (q[1] * y2 + q[2] * z2), q[0] * y2 - q[3] * z2, q[0] * z2 + q[3] * y2,
                            q[0] * y2 + q[3] * z2, 1 - (q[0] * x2 + q[2] * z2), q[1] * z2 - q[3] * x2,
                            q[0] * z2 - q[3] * y2, q[1] * z2 + q[3] * x2, 1 - (q[0] * x2 + q[1] * y2)};
        for (int k = 0; k < 3; k++) {
            const float *row = r + 3 * k;
            b[4 * k] = n->radius * ((row[0] * m[0] + row[1] * m[3]) + row[2] * m[6]);
            b[4 * k + 1] = n->length * ((row[0] * m[1] + row[1] * m[4]) + row[2] * m[7]);
            b[4 * k + 2] = n->radius * ((row[0] * m[2] + row[1] * m[5]) + row[2] * m[8]);
            b[4 * k + 3] = at[k];
        }
    }
}

static txm_status tpc_check_pose(const treepieces_pose *pose, txm_env *env) {
    if (pose && !(pose->amount >= 0 && pose->amount <= 2))
        return txm_fail(env, TXM_BAD_ARGUMENT, "amount must be 0 to 2 radians");
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_bones(const treepieces_forest *forest,
                                           const treepieces_pose *pose, txm_env *env, float *bones) {
    if (!forest || !bones) return txm_fail(env, TXM_BAD_ARGUMENT, "forest or bones is NULL");
    const txm_status status = tpc_check_pose(pose, env);
    if (status != TXM_OK) return status;
    tpc_posing p;
    memset(&p, 0, sizeof p);
    p.forest = forest;
    p.pose = pose;
    p.bones = bones;
    txm_parallel_for(env, forest->tree_count, tpc_pose_tree, &p);
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_sway(const treepieces_forest *forest,
                                          const treepieces_wind *wind, double time, double dt,
                                          const treepieces_pose *pose, txm_env *env, float *state,
                                          float *bones) {
    if (!forest || !state || !bones)
        return txm_fail(env, TXM_BAD_ARGUMENT, "forest, state or bones is NULL");
    if (!tpc_is_wind(wind))
        return txm_fail(env, TXM_BAD_ARGUMENT, "wind is NULL, or a field of it out of range");
    if (!(fabs(time) <= 1e9) || !(dt >= 0 && dt <= 1e9))
        return txm_fail(env, TXM_BAD_ARGUMENT, "time and dt must be finite, dt not below 0");
    const txm_status status = tpc_check_pose(pose, env);
    if (status != TXM_OK) return status;
    tpc_air air;
    tpc_posing p;
    memset(&p, 0, sizeof p);
    tpc_make_waves(wind, &air);
    air.time = time;
    tpc_make_classes(wind, dt, &air);
    p.forest = forest;
    p.pose = pose;
    p.air = &air;
    p.state = state;
    p.bones = bones;
    txm_parallel_for(env, forest->tree_count, tpc_pose_tree, &p);
    return TXM_OK;
}

#endif /* TREEPIECES_WIND_H */
