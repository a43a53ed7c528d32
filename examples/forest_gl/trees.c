/* trees.c - species, the forest, its bones in the wind, its bounding box
   SPDX-License-Identifier: MIT OR Unlicense  */
#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"

#include "forest_gl.h"

int read_species(forest_gl *f) {
    char name[256];
    for (const char *at = f->o.species; *at; at += *at == ',') {
        const size_t length = strcspn(at, ",");
        if (f->species_count == MAX_SPECIES || length >= sizeof name)
            return fail(f, "more than %d species, or a name that is too long", MAX_SPECIES);
        memcpy(name, at, length);
        name[length] = 0;
        at += length;
        treepieces_species *species = &f->species[f->species_count++];
        char *text = strpbrk(name, "./") ? read_file(name) : NULL;
        const txm_status status = text
            ? treepieces_species_parse(text, strlen(text), &f->env, species)
            : treepieces_preset(name, &f->env, species);
        free(text);
        if (!check(f, status)) return 0;
        if (f->o.is_bare) species->leaf_count = 0;
    }
    return f->species_count ? 1 : fail(f, "no species");
}

/* Advance the wind to a time, in steps of 1/30 s at most (up to 10 s). */
int advance_wind(forest_gl *f, double time) {
    const treepieces_wind wind = {0.4f, f->o.wind, 0.7f, 7, f->o.loop};
    const double from = f->now;
    const int steps = txm_clampi((int)((time - from) * 30 + 0.999), 1, 300);
    for (int i = 1; i <= steps; i++)
        if (!check(f, treepieces_sway(f->forest, &wind, from + (time - from) * i / steps,
                                      (time - from) / steps, NULL, &f->env, f->sway, f->bones)))
            return 0;
    f->now = time;
    return 1;
}

static void extend_box(forest_gl *f, const float p[3], float radius) {
    for (int k = 0; k < 3; k++) {
        f->low[k] = txm_minf(f->low[k], p[k] - radius);
        f->high[k] = txm_maxf(f->high[k], p[k] + radius);
    }
}

/* The point at `along` (0..1) of the axis of a node's piece, in world coordinates. */
void axis_point(const forest_gl *f, uint32_t node, float along, float p[3]) {
    const float *b = f->bones + (size_t)TREEPIECES_BONE * node;
    for (int k = 0; k < 3; k++) p[k] = b[4 * k + 3] + along * b[4 * k + 1];
}

int grow_trees(forest_gl *f) {
    treepieces_forest_desc desc = {0};
    if (!check(f, treepieces_kit_make(NULL, 0, &f->env, &f->kit))) return 0;
    const treepieces_place alone = {{0, 0, 0}, 0, 0, 0, f->o.seed};
    desc.kit = f->kit;
    desc.species = f->species;
    desc.species_count = f->species_count;
    desc.tree_count = f->o.count;
    desc.places = f->o.count == 1 ? &alone : NULL;
    desc.max_pieces = f->o.pieces;
    desc.seed = f->o.seed;
    if (!check(f, treepieces_forest_make(&desc, &f->env, &f->forest))) return 0;
    f->bones = (float *)allocate(f, f->forest->node_count, TREEPIECES_BONE * sizeof(float));
    f->sway = (float *)allocate(f, f->forest->node_count, 4 * sizeof(float));
    if (!f->bones || !f->sway) return 0;
    /* the sway settles in 10 seconds; where it is to repeat itself, in 30 and in the steps of the pictures */
    const double step = f->o.loop > 0 ? (double)f->o.loop / f->o.frames : 10;
    const int steps = f->o.loop > 0 ? (int)(30 / step) + 1 : 1;
    f->now = f->o.time - steps * step;
    for (int i = steps - 1; i >= 0; i--)
        if (!advance_wind(f, f->o.time - i * step)) return 0;
    for (int k = 0; k < 3; k++) {
        f->low[k] = k == 1 ? 0 : 1e9f;
        f->high[k] = -1e9f;
    }
    for (uint32_t i = 0; i < f->forest->node_count; i++) {
        float p[3];
        axis_point(f, i, 1, p);
        extend_box(f, p, 0.1f);
    }
    for (uint32_t i = 0; i < f->forest->cluster_count; i++) {
        const treepieces_cluster *c = &f->forest->clusters[i];
        float p[3];
        axis_point(f, c->node, c->along, p);
        extend_box(f, p, c->radius);
    }
    return 1;
}
