/* tree_rig.c - the skeleton of 'texkit tree' and its animation by the wind
   SPDX-License-Identifier: MIT OR Unlicense

   A joint is the position and rotation of a piece's bone, without its stretch. Joints of thin pieces
   can be left out; their pieces move with the nearest joint below. Since a piece is left out only
   together with all that grows on it, joints only rotate relative to their parents.              */
#include "tree.h"

#include <stdio.h>

/* ---- rotations ----------------------------------------------------------------------------- */

static txm_dvec3 bone_place(const float *bone) {
    return txm_d3(bone[3], bone[7], bone[11]);
}

/* conj(a) b: b as seen from a */
static txm_quat rotation_from(txm_quat a, txm_quat b) {
    return txm_quat_mul(txm_quat_conjugate(a), b);
}

/* the same rotation for both signs */
static void store_rotation(float to[4], txm_quat q, double sign) {
    to[0] = (float)(sign * q.x);
    to[1] = (float)(sign * q.y);
    to[2] = (float)(sign * q.z);
    to[3] = (float)(sign * q.w);
}

static void store_place(float *to, txm_dvec3 v) {
    to[0] = (float)v.x;
    to[1] = (float)v.y;
    to[2] = (float)v.z;
}

/* ---- joints -------------------------------------------------------------------------------- */

typedef struct ranked {
    float radius; /* the smallest of this piece and all below it */
    uint32_t node;
} ranked;

static int compare_ranked(const void *a, const void *b) {
    const ranked *x = (const ranked *)a, *y = (const ranked *)b;
    if (x->radius != y->radius) return x->radius < y->radius ? 1 : -1;
    return x->node > y->node ? 1 : -1;
}

/* joint_of for the `most` thickest pieces; the others get that of the piece they stand on. No piece
   ranks before its parent, so the kept pieces are connected. */
static int choose_joints(tree_job *j, tree_rig *rig, uint32_t most) {
    const treepieces_node *nodes = j->forest->nodes;
    const uint32_t count = j->forest->node_count;
    ranked *list = (ranked *)new_array(count, sizeof *list);
    unsigned char *kept = (unsigned char *)new_array(count, 1);
    uint32_t joints = 0;
    if (!list || !kept) {
        free(list);
        free(kept);
        return fail_memory(&j->run);
    }
    for (uint32_t i = 0; i < count; i++) {
        list[i].node = i;
        list[i].radius = nodes[i].radius;
        if (nodes[i].parent < 0) continue;
        const float below = list[nodes[i].parent].radius;
        if (below < list[i].radius) list[i].radius = below;
    }
    qsort(list, count, sizeof *list, compare_ranked);
    for (uint32_t i = 0; i < most && i < count; i++) kept[list[i].node] = 1;
    for (uint32_t i = 0; i < count; i++)
        rig->joint_of[i] = kept[i] ? joints++ : rig->joint_of[nodes[i].parent];
    free(list);
    free(kept);
    return CLI_DONE;
}

/* Was a joint made for this node? */
static int is_joint(const tree_job *j, const tree_rig *rig, uint32_t node) {
    const int32_t parent = j->forest->nodes[node].parent;
    return parent < 0 || rig->joint_of[node] != rig->joint_of[parent];
}

static void make_joint(const tree_job *j, const tree_rig *rig, uint32_t node, mesh_joint *joint) {
    static const char *const names[] = {"trunk", "branch", "twig"};
    const treepieces_node *n = &j->forest->nodes[node];
    const float *rest = j->rest + TREEPIECES_BONE * (size_t)node;
    const float *posed = j->posed + TREEPIECES_BONE * (size_t)node;
    txm_quat local = tree_bone_rotation(posed);
    snprintf(joint->name, sizeof joint->name, "%s %lu", names[n->order < 2 ? n->order : 2],
             (unsigned long)node);
    joint->parent = -1;
    store_place(joint->translation, bone_place(posed));
    if (n->parent >= 0) {
        const float *below = j->posed + TREEPIECES_BONE * (size_t)n->parent;
        const txm_quat parent = tree_bone_rotation(below);
        const txm_dvec3 way = txm_d3_sub(bone_place(posed), bone_place(below));
        joint->parent = (int)rig->joint_of[n->parent];
        local = rotation_from(parent, local);
        store_place(joint->translation, txm_quat_rotate(txm_quat_conjugate(parent), way));
    }
    store_rotation(joint->rotation, local, 1);

    /* from the mesh at rest into the joint: the inverse of its position and rotation */
    const txm_quat back = txm_quat_conjugate(tree_bone_rotation(rest));
    memset(joint->bind, 0, sizeof joint->bind);
    for (int c = 0; c < 3; c++)
        store_place(joint->bind + 4 * c, txm_quat_rotate(back, txm_d3(c == 0, c == 1, c == 2)));
    store_place(joint->bind + 12, txm_d3_scale(txm_quat_rotate(back, bone_place(rest)), -1));
    joint->bind[15] = 1;
}

/* ---- the wind ------------------------------------------------------------------------------ */

/* Store the joints' rotations of one moment as a key. Signs are chosen nearest to those of the key before,
   or of the joints as they stand. */
static void store_turns(const tree_job *j, const tree_rig *rig, const float *bones, int keys, int key) {
    for (uint32_t i = 0; i < j->forest->node_count; i++) {
        const int32_t parent = j->forest->nodes[i].parent;
        const size_t joint = rig->joint_of[i];
        float *turn = rig->turns + 4 * (joint * (size_t)keys + (size_t)key);
        const float *last = key ? turn - 4 : rig->joints[joint].rotation;
        if (!is_joint(j, rig, i)) continue;
        txm_quat local = tree_bone_rotation(bones + TREEPIECES_BONE * (size_t)i);
        if (parent >= 0)
            local = rotation_from(tree_bone_rotation(bones + TREEPIECES_BONE * (size_t)parent), local);
        const double dot = local.x * (double)last[0] + local.y * (double)last[1] +
                           local.z * (double)last[2] + local.w * (double)last[3];
        store_rotation(turn, local, dot < 0 ? -1 : 1);
    }
}

/* Simulate in the steps of the keys: first until the start no longer matters, then the animation. Wind and
   trees repeat themselves in its time, so that the last key is the first. */
static int record(tree_job *j, tree_rig *rig, float *state, float *bones) {
    treepieces_wind wind = tree_wind(j);
    const treepieces_pose pose = {j->run.seed, (float)j->pose, NULL};
    const int keys = rig->skeleton.key_count, steps = keys - 1;
    const double step = 1.0 / j->rate;
    const int periods = (int)(0.1 * WARM_UP / (steps * step)) + 1;
    txm_status result = TXM_OK;
    wind.period = (float)(steps * step);
    for (int i = -periods * steps + 1; i < steps && result == TXM_OK; i++) {
        result = treepieces_sway(j->forest, &wind, i * step, step, &pose, &j->run.env, state, bones);
        if (result == TXM_OK && i >= 0) store_turns(j, rig, bones, keys, i);
    }
    for (int i = 0; i < rig->skeleton.joint_count; i++) {
        float *turns = rig->turns + 4 * (size_t)keys * (size_t)i;
        memcpy(turns + 4 * steps, turns, 4 * sizeof(float));
    }
    return check_result(&j->run, result, j->species[0].name);
}

static int make_clip(tree_job *j, tree_rig *rig) {
    const size_t nodes = j->forest->node_count, joints = (size_t)rig->skeleton.joint_count;
    const int steps = (int)(j->seconds * j->rate + 0.5) > 2 ? (int)(j->seconds * j->rate + 0.5) : 2;
    const int keys = steps + 1;
    size_t all;
    if (!txm_mul((size_t)keys, joints, 4, &all)) return fail_memory(&j->run);
    float *state = (float *)new_array(nodes, 4 * sizeof(float));
    float *bones = (float *)new_array(nodes, TREEPIECES_BONE * sizeof(float));
    int status = CLI_DONE;
    rig->times = (float *)new_array((size_t)keys, sizeof(float));
    rig->turns = (float *)new_array(all, sizeof(float));
    rig->skeleton.key_count = keys;
    rig->skeleton.clip = "wind";
    if (!state || !bones || !rig->times || !rig->turns) status = fail_memory(&j->run);
    if (!status) status = record(j, rig, state, bones);
    for (int i = 0; i < keys && !status; i++) rig->times[i] = (float)((double)i / j->rate);
    rig->skeleton.times = rig->times;
    rig->skeleton.turns = rig->turns;
    free(state);
    free(bones);
    return status;
}

/* ---- the rig ------------------------------------------------------------------------------- */

int tree_make_rig(tree_job *j, tree_rig *rig) {
    const uint32_t nodes = j->forest->node_count;
    const uint32_t most = j->bones > 0 ? (uint32_t)j->bones : MOST_JOINTS;
    const uint32_t count = nodes < most ? nodes : most;
    memset(rig, 0, sizeof *rig);
    rig->joint_of = (uint32_t *)new_array(nodes, sizeof(uint32_t));
    rig->joints = (mesh_joint *)new_array(count, sizeof(mesh_joint));
    if (!rig->joint_of || !rig->joints) return fail_memory(&j->run);
    int status = choose_joints(j, rig, count);
    if (status) return status;
    for (uint32_t i = 0; i < nodes; i++)
        if (is_joint(j, rig, i)) make_joint(j, rig, i, &rig->joints[rig->joint_of[i]]);
    rig->skeleton.name = "tree";
    rig->skeleton.joints = rig->joints;
    rig->skeleton.joint_count = (int)count;
    return j->wind > 0 ? make_clip(j, rig) : CLI_DONE;
}

void tree_free_rig(tree_rig *rig) {
    free(rig->joint_of);
    free(rig->joints);
    free(rig->times);
    free(rig->turns);
}

int tree_bind_mesh(tree_job *j, const tree_rig *rig, const treepieces_mesh *from, mesh_data *to) {
    const size_t count = 4 * from->vertex_count;
    uint32_t *joints = (uint32_t *)new_array(count, sizeof(uint32_t));
    float *weights = (float *)new_array(count, sizeof(float));
    if (!joints || !weights) {
        free(joints);
        free(weights);
        return fail_memory(&j->run);
    }
    for (size_t i = 0; i < count; i += 4) {
        size_t used = 0;
        for (size_t k = 0; k < 4; k++) {
            const float weight = from->weights[i + k];
            if (!(weight > 0)) continue;
            const uint32_t joint = rig->joint_of[from->joints[i + k]];
            size_t at = 0;
            while (at < used && joints[i + at] != joint) at++;
            used += at == used;
            joints[i + at] = joint;
            weights[i + at] += weight;
        }
    }
    to->joints = joints;
    to->weights = weights;
    return CLI_DONE;
}
