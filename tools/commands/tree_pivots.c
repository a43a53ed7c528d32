/* tree_pivots.c - what a shader needs to move a tree in the wind without a skeleton
   SPDX-License-Identifier: MIT OR Unlicense

   Two motions: the whole tree sways about its foot, and each branch on the trunk flutters about the
   place where it leaves the trunk. How far a vertex goes with either is the way from the ground, or
   from that place, along the axes; so it is 0 there and grows along every axis. See docs/trees.md. */
#include "tree.h"

/* Of a piece, at its root rim. */
typedef struct pivot {
    float way, aside; /* along the axes: from the ground, from the trunk; metres, then 0..1 */
    uint32_t base;    /* the piece in which its branch begins; the first of all for the trunk */
} pivot;

static txm_dvec3 root_of(const tree_job *j, uint32_t node) {
    const float *bone = j->posed + TREEPIECES_BONE * (size_t)node;
    return txm_d3(bone[3], bone[7], bone[11]);
}

/* The pivots of a tree's pieces; NULL: no memory. */
static pivot *list_pivots(const tree_job *j, const treepieces_tree *t) {
    const treepieces_node *nodes = j->forest->nodes + t->first_node;
    pivot *list = (pivot *)new_array(t->node_count, sizeof *list);
    float longest = 0, widest = 0;
    for (uint32_t i = 1; i < t->node_count && list; i++) {
        const uint32_t parent = (uint32_t)nodes[i].parent;
        const txm_dvec3 on = txm_d3_sub(root_of(j, t->first_node + i), root_of(j, t->first_node + parent));
        const float step = (float)sqrt(txm_d3_dot(on, on));
        const int leaves_trunk = nodes[i].order > 0 && nodes[parent].order == 0;
        list[i].way = list[parent].way + step;
        list[i].base = leaves_trunk ? i : list[parent].base;
        list[i].aside = nodes[i].order == 0 || leaves_trunk ? 0 : list[parent].aside + step;
        if (list[i].way > longest) longest = list[i].way;
        if (list[i].aside > widest) widest = list[i].aside;
    }
    for (uint32_t i = 0; i < t->node_count && list; i++) {
        if (longest > 0) list[i].way /= longest;
        if (widest > 0) list[i].aside /= widest;
    }
    return list;
}

/* A number 0..1 of a branch. */
static float phase_of(const treepieces_tree *t, uint32_t base) {
    return (float)(txm_hash(((uint64_t)t->seed << 32) + base) >> 40) / 16777216.0f;
}

int tree_add_pivots(tree_job *j, int tree, const treepieces_mesh *from, mesh_data *to) {
    const treepieces_tree *t = &j->forest->trees[tree];
    const size_t first = to->vertex_count - from->vertex_count;
    pivot *list = list_pivots(j, t);
    float *wind = (float *)realloc(to->wind, to->vertex_count * MESH_WIND * sizeof(float));
    if (wind) to->wind = wind;
    if (!list || !wind) {
        free(list);
        return fail_memory(&j->run);
    }
    for (size_t i = 0; i < from->vertex_count; i++) {
        float *w = wind + MESH_WIND * (first + i), way = 0, aside = 0;
        size_t most = 4 * i;
        for (size_t k = 4 * i; k < 4 * i + 4; k++) {
            way += from->weights[k] * list[from->joints[k]].way;
            aside += from->weights[k] * list[from->joints[k]].aside;
            if (from->weights[k] > from->weights[most]) most = k;
        }
        const uint32_t base = list[from->joints[most]].base;
        const txm_dvec3 at = root_of(j, t->first_node + base);
        w[0] = txm_clampf(way, 0, 1);
        w[1] = txm_clampf(aside, 0, 1);
        w[2] = (float)at.x;
        w[3] = (float)at.y;
        w[4] = (float)at.z;
        w[5] = phase_of(t, base);
    }
    free(list);
    return CLI_DONE;
}
