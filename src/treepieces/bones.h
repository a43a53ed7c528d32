#ifndef TREEPIECES_BONES_H
#define TREEPIECES_BONES_H

#include "wind.h"

/* ---- bones ------------------------------------------------------------------------------- */

typedef struct tpc_posing {
    const treepieces_forest *forest;
    const treepieces_pose *pose;
    const tpc_air *air; /* NULL: no wind */
    float *state, *bones;
} tpc_posing;

/* q = q p, with p the rotation about the axis (x, 0, z) by about its length, in radians */
static void tpc_bend(float q[4], float x, float z) {
    const float a = 0.5f * x, c = 0.5f * z, w = 1 / sqrtf(1 + a * a + c * c);
    const float p[4] = {w * a, 0, w * c, w};
    tpc_multiply(q, p, q);
}

/* Apply the pose to joint i of a tree: its random bend, a hash of its number and of the tree's seed, and
   its own rotation. */
static void tpc_pose_joint(const treepieces_pose *pose, const treepieces_tree *t, uint32_t i, float q[4]) {
    if (pose->amount > 0) {
        const uint64_t number = (uint64_t)t->seed << 32 | ((uint64_t)i + 1);
        const uint64_t h = txm_hash(pose->seed ^ number * 0x9e3779b97f4a7c15u);
        const float u = (float)(h & 0xffffff) * 1.1920929e-7f - 1, v = (float)(h >> 40) * 1.1920929e-7f - 1;
        tpc_bend(q, 0.7f * pose->amount * u, 0.7f * pose->amount * v);
    }
    if (pose->joints) tpc_multiply(q, pose->joints + 4 * (size_t)(t->first_node + i), q);
}

/* An angle as it is where it is small, and below 0.12 radians in any wind. */
static float tpc_soften(float angle) {
    return angle / (1 + fabsf(angle) * (1 / 0.12f));
}

/* One time step of a joint: the wind in its frame (x and z across the stem) drives its oscillator. The
   two directions differ in phase, so that branches move round and round. */
static void tpc_sway_joint(const tpc_air *air, const treepieces_node *n, float yield,
                           const float wind[3], float *state, float q[4]) {
    const int mode = n->sway % TPC_CLASSES, phase = n->sway / TPC_CLASSES;
    const float back[4] = {-q[0], -q[1], -q[2], q[3]};
    float w[3];
    tpc_rotate(back, wind, w);
    const float flutter = air->classes[mode].flutter[phase];
    const float other = air->classes[mode].flutter[(phase + 3) % TPC_PHASES];
    const float strength = sqrtf(wind[0] * wind[0] + wind[1] * wind[1] + wind[2] * wind[2]);
    const float give = air->classes[mode].give * txm_clampf(yield * n->length, 0.1f, 3);
    /* equilibrium, leaning with the wind: towards +z about +x, towards +x about -z */
    const float rest[2] = {tpc_soften(give * (w[2] + strength * flutter)),
                           tpc_soften(-give * (w[0] + strength * other))};
    for (int k = 0; k < 2; k++) {
        const float x = state[2 * k] - rest[k], v = state[2 * k + 1];
        state[2 * k] = rest[k] + (air->classes[mode].xx * x + air->classes[mode].xv * v);
        state[2 * k + 1] = air->classes[mode].vx * x + air->classes[mode].vv * v;
    }
    tpc_bend(q, state[0], state[2]);
}

/* The bones of a tree, parents first. */
static void tpc_pose_tree(void *context, int index) {
    const tpc_posing *p = (const tpc_posing *)context;
    const treepieces_tree *t = &p->forest->trees[index];
    const float stiffness = p->forest->species[t->species].stiffness;
    const float yield = 16 / (stiffness * txm_maxf(t->height, 0.1f)); /* of one metre of stem */
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
        if (p->pose) tpc_pose_joint(p->pose, t, i, q);
        if (p->air) {
            const float *d = p->air->direction;
            const float wind[3] = {pressure * (r[0] * d[0] + r[6] * d[2]),
                                   pressure * (r[1] * d[0] + r[7] * d[2]),
                                   pressure * (r[2] * d[0] + r[8] * d[2])};
            tpc_sway_joint(p->air, n, yield, wind, p->state + 4 * (size_t)number, q);
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

/* ---- skinning ---------------------------------------------------------------------------- */

static void tpc_move_point(const float *bone, const float p[3], float out[3]) {
    for (int k = 0; k < 3; k++)
        out[k] = ((bone[4 * k] * p[0] + bone[4 * k + 1] * p[1]) + bone[4 * k + 2] * p[2]) +
                 bone[4 * k + 3];
}

/* squares of the lengths of a bone's columns */
static void tpc_columns(const float *bone, float squares[3]) {
    for (int k = 0; k < 3; k++)
        squares[k] = (bone[k] * bone[k] + bone[4 + k] * bone[4 + k]) + bone[8 + k] * bone[8 + k];
}

/* n by the inverse transpose: as columns are orthogonal, each is divided by its square */
static void tpc_move_normal(const float *bone, const float n[3], float out[3]) {
    float squares[3];
    tpc_columns(bone, squares);
    const float m[3] = {n[0] / squares[0], n[1] / squares[1], n[2] / squares[2]};
    for (int k = 0; k < 3; k++)
        out[k] = (bone[4 * k] * m[0] + bone[4 * k + 1] * m[1]) + bone[4 * k + 2] * m[2];
}

/* The bones of a record's children, relative to its own; 0 where there is none. */
static void tpc_children(const uint32_t *record, uint32_t children[TREEPIECES_MAX_LEAVES]) {
    children[0] = record[1] & 0xffffu;
    children[1] = record[1] >> 16;
    children[2] = record[2] & 0xffffu;
}

/* An instance of a piece with what its bones have in common for all its vertices. */
typedef struct tpc_instance {
    const treepieces_piece *piece;
    const tpc_local_vertex *local;                   /* vertex_count for each leaf rim       */
    const float *own, *child[TREEPIECES_MAX_LEAVES]; /* bones                                */
    float own_squares[3], squares[TREEPIECES_MAX_LEAVES][3]; /* of the bones' columns        */
    float stretch[TREEPIECES_MAX_LEAVES];            /* of the own piece over the child's    */
    int turn[TREEPIECES_MAX_LEAVES];
} tpc_instance;

static void tpc_find_instance(const treepieces_forest *forest, const float *bones, int type,
                              uint32_t number, tpc_instance *s) {
    const treepieces_batch *batch = &forest->batches[type];
    const uint32_t *word = batch->words + (size_t)number * batch->stride;
    uint32_t difference[TREEPIECES_MAX_LEAVES];
    s->piece = &forest->kit->pieces[type];
    s->local = forest->kit->local[type];
    s->own = bones + TREEPIECES_BONE * (size_t)word[0];
    tpc_columns(s->own, s->own_squares);
    tpc_children(word, difference);
    for (int k = 0; k < s->piece->leaf_count; k++) {
        s->child[k] = s->own + TREEPIECES_BONE * (size_t)difference[k];
        s->turn[k] = (int)(word[2] >> (16 + 4 * k) & 15u);
        tpc_columns(s->child[k], s->squares[k]);
        /* products of the squares would underflow where a species at its limits is that small */
        s->stretch[k] = sqrtf((s->squares[k][0] / s->own_squares[0]) *
                              (s->own_squares[1] / s->squares[k][1]));
    }
}

/* Vertex i, which is on no leaf rim; the normal has no unit length yet. */
static void tpc_blend_vertex(const tpc_instance *s, int i, float position[3], float normal[3]) {
    const treepieces_vertex *v = &s->piece->vertices[i];
    const float w = v->weights[0];
    float p[3], n[3], moved[3];
    tpc_move_point(s->own, v->position, position);
    tpc_move_normal(s->own, v->normal, normal);
    for (int c = 0; c < 3 && w < 1; c++) position[c] *= w;
    for (int c = 0; c < 3 && w < 1; c++) normal[c] *= w * sqrtf(s->own_squares[0]);
    for (int k = 0; k < s->piece->leaf_count; k++) {
        const float wk = v->weights[1 + k];
        const tpc_local_vertex *at = &s->local[k * s->piece->vertex_count + i];
        if (!(wk > 0)) continue;
        tpc_turn((TREEPIECES_RIM - s->turn[k]) % TREEPIECES_RIM, at->position, p);
        tpc_turn((TREEPIECES_RIM - s->turn[k]) % TREEPIECES_RIM, at->normal, n);
        p[1] *= s->stretch[k];
        n[1] /= s->stretch[k];
        tpc_move_point(s->child[k], p, moved);
        for (int c = 0; c < 3; c++) position[c] += wk * moved[c];
        tpc_move_normal(s->child[k], n, moved);
        for (int c = 0; c < 3; c++) normal[c] += wk * sqrtf(s->squares[k][0]) * moved[c];
    }
}

TREEPIECES_API void treepieces_skin(const treepieces_forest *forest, const float *bones, int type,
                                    uint32_t instance, float *positions, float *normals) {
    tpc_instance s;
    tpc_find_instance(forest, bones, type, instance, &s);
    for (int i = 0; i < s.piece->vertex_count; i++) {
        const int rim = s.piece->vertices[i].rim;
        float p[3], n[3], normal[3];
        if (rim >= 0) {
            const int k = rim / TREEPIECES_RIM;
            tpc_rim_vertex((rim + TREEPIECES_RIM - s.turn[k]) % TREEPIECES_RIM, p, n);
            tpc_move_point(s.child[k], p, positions + 3 * i);
            if (!normals) continue;
            tpc_move_normal(s.child[k], n, normal);
        } else {
            tpc_blend_vertex(&s, i, positions + 3 * i, normal);
            if (!normals) continue;
        }
        tpc_unit(normal);
        memcpy(normals + 3 * i, normal, sizeof normal);
    }
}

#endif /* TREEPIECES_BONES_H */
