/* tree_rig.c - the skeleton of 'texkit tree' and its animation by the wind
   SPDX-License-Identifier: MIT OR Unlicense

   A joint is a piece without its stretch: position and rotation of its bone. Joints of thin pieces
   can be left out; their pieces move with the nearest joint below. As a piece is left out only with
   all that grows on it, no joint moves against its parent, it only turns.                        */
#include "tree.h"

#include <stdio.h>

/* ---- rotations ----------------------------------------------------------------------------- */

/* The columns X, Y, Z of a bone are at right angles; made unit vectors they are a rotation. */
void bone_rotation(const float *bone, double q[4]) {
    double m[3][3]; /* m[column][row] */
    for (int c = 0; c < 3; c++) {
        double length = 0;
        for (int r = 0; r < 3; r++) {
            m[c][r] = (double)bone[4 * r + c];
            length += m[c][r] * m[c][r];
        }
        length = sqrt(length);
        for (int r = 0; r < 3; r++) m[c][r] /= length;
    }
    /* four times the squares of x, y, z, w; the largest is safe to divide by */
    const double squares[4] = {1 + m[0][0] - m[1][1] - m[2][2], 1 - m[0][0] + m[1][1] - m[2][2],
                               1 - m[0][0] - m[1][1] + m[2][2], 1 + m[0][0] + m[1][1] + m[2][2]};
    int k = 3;
    for (int i = 0; i < 3; i++)
        if (squares[i] > squares[k]) k = i;
    const double two = sqrt(squares[k]);
    if (k == 3) {
        q[0] = (m[1][2] - m[2][1]) / two;
        q[1] = (m[2][0] - m[0][2]) / two;
        q[2] = (m[0][1] - m[1][0]) / two;
        q[3] = two;
    } else {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        q[k] = two;
        q[a] = (m[k][a] + m[a][k]) / two;
        q[b] = (m[k][b] + m[b][k]) / two;
        q[3] = (m[a][b] - m[b][a]) / two;
    }
    double norm = 0;
    for (int i = 0; i < 4; i++) norm += q[i] * q[i];
    norm = sqrt(norm);
    for (int i = 0; i < 4; i++) q[i] /= norm;
}

/* conj(a) b: b as seen from a */
static void rotation_from(const double a[4], const double b[4], double out[4]) {
    out[0] = a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1];
    out[1] = a[3] * b[1] + a[0] * b[2] - a[1] * b[3] - a[2] * b[0];
    out[2] = a[3] * b[2] - a[0] * b[1] + a[1] * b[0] - a[2] * b[3];
    out[3] = a[3] * b[3] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* m[column][row] of a unit quaternion */
static void rotation_matrix(const double q[4], double m[3][3]) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    m[0][0] = 1 - 2 * (y * y + z * z);
    m[0][1] = 2 * (x * y + w * z);
    m[0][2] = 2 * (x * z - w * y);
    m[1][0] = 2 * (x * y - w * z);
    m[1][1] = 1 - 2 * (x * x + z * z);
    m[1][2] = 2 * (y * z + w * x);
    m[2][0] = 2 * (x * z + w * y);
    m[2][1] = 2 * (y * z - w * x);
    m[2][2] = 1 - 2 * (x * x + y * y);
}

/* ---- joints -------------------------------------------------------------------------------- */

typedef struct ranked {
    float radius; /* the least on the way down to the ground */
    uint32_t node;
} ranked;

static int compare_ranked(const void *a, const void *b) {
    const ranked *x = (const ranked *)a, *y = (const ranked *)b;
    if (x->radius != y->radius) return x->radius < y->radius ? 1 : -1;
    return x->node > y->node ? 1 : -1;
}

/* joint_of for the `most` thickest pieces, and for the others that of the piece they stand on. As
   no piece ranks before its parent, what is kept hangs together. */
static int choose_joints(tree_job *j, tree_rig *rig, uint32_t most) {
    const treepieces_node *nodes = j->forest->nodes;
    const uint32_t count = j->forest->node_count;
    ranked *list = (ranked *)tree_array(count, sizeof *list);
    unsigned char *kept = (unsigned char *)tree_array(count, 1);
    uint32_t joints = 0;
    if (!list || !kept) {
        free(list);
        free(kept);
        return tree_fail_memory(j);
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

/* Is the node the one that its joint was made for? */
static int is_joint(const tree_job *j, const tree_rig *rig, uint32_t node) {
    const int32_t parent = j->forest->nodes[node].parent;
    return parent < 0 || rig->joint_of[node] != rig->joint_of[parent];
}

static void make_joint(const tree_job *j, const tree_rig *rig, uint32_t node, mesh_joint *joint) {
    static const char *const names[] = {"trunk", "branch", "twig"};
    const treepieces_node *n = &j->forest->nodes[node];
    const float *rest = j->rest + TREEPIECES_BONE * (size_t)node;
    const float *posed = j->posed + TREEPIECES_BONE * (size_t)node;
    double q[4], local[4], m[3][3];
    snprintf(joint->name, sizeof joint->name, "%s %lu", names[n->order < 2 ? n->order : 2],
             (unsigned long)node);
    joint->parent = -1;
    bone_rotation(posed, local);
    for (int r = 0; r < 3; r++) joint->translation[r] = posed[4 * r + 3];
    if (n->parent >= 0) {
        const float *below = j->posed + TREEPIECES_BONE * (size_t)n->parent;
        double parent[4];
        joint->parent = (int)rig->joint_of[n->parent];
        bone_rotation(posed, q);
        bone_rotation(below, parent);
        rotation_from(parent, q, local);
        rotation_matrix(parent, m);
        for (int r = 0; r < 3; r++) {
            double sum = 0;
            for (int k = 0; k < 3; k++)
                sum += m[r][k] * ((double)posed[4 * k + 3] - (double)below[4 * k + 3]);
            joint->translation[r] = (float)sum;
        }
    }
    for (int k = 0; k < 4; k++) joint->rotation[k] = (float)local[k];

    /* from the mesh, which is at rest, into the joint: turned back about its place */
    bone_rotation(rest, q);
    rotation_matrix(q, m);
    for (int c = 0; c < 4; c++) {
        for (int r = 0; r < 4; r++) joint->bind[4 * c + r] = r == 3 ? (float)(c == 3) : 0;
        for (int r = 0; r < 3; r++) {
            double sum = c < 3 ? m[r][c] : 0;
            for (int k = 0; k < 3 && c == 3; k++) sum -= m[r][k] * (double)rest[4 * k + 3];
            joint->bind[4 * c + r] = (float)sum;
        }
    }
}

/* ---- the wind ------------------------------------------------------------------------------ */

/* The joints' rotations of one moment into place `key` of lists of `stride` rotations each, of the
   sign that is next to `before`, or to the joint's own if that is NULL. */
static void store_turns(const tree_job *j, const tree_rig *rig, const float *bones, float *turns,
                        size_t stride, size_t key, const float *before, size_t before_stride) {
    for (uint32_t i = 0; i < j->forest->node_count; i++) {
        const int32_t parent = j->forest->nodes[i].parent;
        const size_t joint = rig->joint_of[i];
        double q[4], below[4] = {0, 0, 0, 1}, local[4], dot = 0;
        if (!is_joint(j, rig, i)) continue;
        bone_rotation(bones + TREEPIECES_BONE * (size_t)i, q);
        if (parent >= 0) bone_rotation(bones + TREEPIECES_BONE * (size_t)parent, below);
        rotation_from(below, q, local);
        const float *last = rig->joints[joint].rotation;
        if (before) last = before + 4 * joint * before_stride;
        for (int k = 0; k < 4; k++) dot += local[k] * (double)last[k];
        float *to = turns + 4 * (joint * stride + key);
        for (int k = 0; k < 4; k++) to[k] = (float)(dot < 0 ? -local[k] : local[k]);
    }
}

/* The last keys turn into what was before the first, so that the clip goes on without a step:

       key K - blend + i  =  mix(itself, lead i, i / blend),  lead `blend` = key 0             */
static void close_loop(const tree_rig *rig, const float *lead, int blend) {
    const size_t keys = (size_t)rig->skeleton.key_count;
    for (size_t joint = 0; joint < (size_t)rig->skeleton.joint_count; joint++) {
        float *turns = rig->turns + 4 * keys * joint;
        const float *from = lead + 4 * (size_t)(blend + 1) * joint;
        for (int i = 0; i <= blend; i++) {
            float *q = turns + 4 * (keys - 1 - (size_t)blend + (size_t)i);
            const double t = (double)i / blend, s = t * t * (3 - 2 * t);
            double mixed[4], length = 0;
            for (int k = 0; k < 4; k++) {
                mixed[k] = (1 - s) * (double)q[k] + s * (double)from[4 * i + k];
                length += mixed[k] * mixed[k];
            }
            for (int k = 0; k < 4; k++) q[k] = (float)(mixed[k] / sqrt(length));
        }
        memcpy(turns + 4 * (keys - 1), turns, 4 * sizeof(float));
    }
}

/* Let it sway: first until it has forgotten its beginning, then `blend` keys ahead, then the clip. */
static int record(tree_job *j, tree_rig *rig, float *state, float *bones, float *lead, int blend) {
    const treepieces_wind wind = tree_wind(j);
    const treepieces_pose pose = {j->run.seed, (float)j->pose, NULL};
    const int keys = rig->skeleton.key_count;
    const double step = 1.0 / j->rate, start = -(blend + 1) * step + 0.1;
    txm_status result = TXM_OK;
    size_t key = 0; /* of all, those ahead included */
    for (int i = WARM_UP; i > 0 && result == TXM_OK; i--)
        result = treepieces_sway(j->forest, &wind, start - 0.1 * i, 0.1, &pose, &j->run.env, state,
                                 bones);
    for (int i = -blend; i < keys && result == TXM_OK; i++) {
        result =
            treepieces_sway(j->forest, &wind, i * step, step, &pose, &j->run.env, state, bones);
        if (result != TXM_OK) break;
        const size_t lead_stride = (size_t)blend + 1, place = key++;
        if (i <= 0)
            store_turns(j, rig, bones, lead, lead_stride, place,
                        place ? lead + 4 * (place - 1) : NULL, lead_stride);
        if (i >= 0)
            store_turns(j, rig, bones, rig->turns, (size_t)keys, (size_t)i,
                        i ? rig->turns + 4 * (size_t)(i - 1) : lead + 4 * place,
                        i ? (size_t)keys : lead_stride);
    }
    return result == TXM_OK ? CLI_DONE : fail_library(&j->run, result, j->species[0].name);
}

static int make_clip(tree_job *j, tree_rig *rig) {
    const size_t nodes = j->forest->node_count, joints = (size_t)rig->skeleton.joint_count;
    const int steps = (int)(j->seconds * j->rate + 0.5) > 2 ? (int)(j->seconds * j->rate + 0.5) : 2;
    const int keys = steps + 1, blend = j->rate < steps / 2 ? j->rate : steps / 2;
    size_t all;
    if (!txm_mul((size_t)keys, joints, 4, &all)) return tree_fail_memory(j);
    float *state = (float *)tree_array(nodes, 4 * sizeof(float));
    float *bones = (float *)tree_array(nodes, TREEPIECES_BONE * sizeof(float));
    float *lead = (float *)tree_array(((size_t)blend + 1) * joints, 4 * sizeof(float));
    int status = CLI_DONE;
    rig->times = (float *)tree_array((size_t)keys, sizeof(float));
    rig->turns = (float *)tree_array(all, sizeof(float));
    rig->skeleton.key_count = keys;
    rig->skeleton.clip = "wind";
    if (!state || !bones || !lead || !rig->times || !rig->turns) status = tree_fail_memory(j);
    if (!status) status = record(j, rig, state, bones, lead, blend);
    if (!status) {
        for (int i = 0; i < keys; i++) rig->times[i] = (float)((double)i / j->rate);
        close_loop(rig, lead, blend);
    }
    rig->skeleton.times = rig->times;
    rig->skeleton.turns = rig->turns;
    free(state);
    free(bones);
    free(lead);
    return status;
}

/* ---- the rig ------------------------------------------------------------------------------- */

int make_rig(tree_job *j, tree_rig *rig) {
    const uint32_t nodes = j->forest->node_count;
    const uint32_t most = j->bones > 0 ? (uint32_t)j->bones : 65535;
    const uint32_t count = nodes < most ? nodes : most;
    memset(rig, 0, sizeof *rig);
    rig->joint_of = (uint32_t *)tree_array(nodes, sizeof(uint32_t));
    rig->joints = (mesh_joint *)tree_array(count, sizeof(mesh_joint));
    if (!rig->joint_of || !rig->joints) return tree_fail_memory(j);
    int status = choose_joints(j, rig, count);
    if (status) return status;
    for (uint32_t i = 0; i < nodes; i++)
        if (is_joint(j, rig, i)) make_joint(j, rig, i, &rig->joints[rig->joint_of[i]]);
    rig->skeleton.name = "tree";
    rig->skeleton.joints = rig->joints;
    rig->skeleton.joint_count = (int)count;
    return j->wind > 0 ? make_clip(j, rig) : CLI_DONE;
}

void free_rig(tree_rig *rig) {
    free(rig->joint_of);
    free(rig->joints);
    free(rig->times);
    free(rig->turns);
}

int bind_mesh(tree_job *j, const tree_rig *rig, const treepieces_mesh *from, mesh_data *to) {
    const size_t count = 4 * from->vertex_count;
    uint32_t *joints = (uint32_t *)tree_array(count, sizeof(uint32_t));
    float *weights = (float *)tree_array(count, sizeof(float));
    if (!joints || !weights) {
        free(joints);
        free(weights);
        return tree_fail_memory(j);
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
