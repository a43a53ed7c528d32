/* tree_job.c - species, grown trees and their bones for 'texkit tree' and 'texkit forest'
   SPDX-License-Identifier: MIT OR Unlicense */
#include "tree.h"
#include "files/image_io.h"

#include <errno.h>
#include <stdio.h>

/* ---- the job ------------------------------------------------------------------------------- */

tree_job *new_tree_job(int is_forest) {
    tree_job *j = (tree_job *)calloc(1, sizeof *j);
    if (!j) {
        fprintf(stderr, "texkit %s: out of memory\n", is_forest ? "forest" : "tree");
        return NULL;
    }
    j->is_forest = is_forest;
    j->species_list = "oak";
    j->count = is_forest ? 0 : 1;
    j->level = 1;
    j->seconds = 4;
    j->sheet = 512;
    return j;
}

/* Of the trees that there are. */
static void free_trees(tree_job *j) {
    free(j->rest);
    free(j->posed);
    treepieces_forest_free(j->forest);
    j->rest = j->posed = NULL;
    j->forest = NULL;
}

void tree_fell(tree_job *j) {
    free_trees(j);
    treepieces_kit_free(j->kit);
    j->kit = NULL;
}

void free_tree_job(tree_job *j) {
    for (int s = 0; s < MAX_SPECIES; s++) {
        free(j->bark[s].png);
        free(j->relief[s].png);
        free(j->leaves[s].png);
    }
    for (int i = 0; i < MAX_LEVELS; i++) free(j->levels[i].bytes);
    tree_fell(j);
    free(j);
}

int tree_is_glb(const tree_job *j) {
    return !strcmp(j->extension, ".glb");
}

int tree_is_bare(const tree_job *j) {
    return !strcmp(j->extension, ".ply") || !strcmp(j->extension, ".stl");
}

int tree_is_copied(const tree_job *j) {
    return j->is_forest && tree_is_glb(j) && !j->variants;
}

/* ---- species ------------------------------------------------------------------------------- */

/* A built-in species, or one from a file: a name with a dot or a slash is a file. */
static int read_species(tree_job *j, const char *name, treepieces_species *species) {
    size_t size;
    if (!strpbrk(name, "./"))
        return check_result(&j->run, treepieces_preset(name, &j->run.env, species), name);
    const int status = cli_reads(&j->run, name);
    if (status) return status;
    unsigned char *text = file_read(name, &size);
    if (!text) return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", name, strerror(errno));
    const txm_status result =
        treepieces_species_parse((const char *)text, size, &j->run.env, species);
    free(text);
    return check_result(&j->run, result, name);
}

int tree_read_species(tree_job *j) {
    char name[MAX_PATH];
    const char *list = j->species_list;
    while (list) {
        if (j->species_count == MAX_SPECIES)
            return cli_fail(&j->run, CLI_USAGE, "--species: at most %d", MAX_SPECIES);
        if (!cli_take_name(&list, j->is_forest ? "," : "", name))
            return cli_fail(&j->run, CLI_USAGE, "--species: a name is empty or too long");
        const int status = read_species(j, name, &j->species[j->species_count]);
        if (status) return status;
        if (j->bare) j->species[j->species_count].leaf_count = 0;
        j->species_count++;
    }
    return CLI_DONE;
}

/* ---- growing ------------------------------------------------------------------------------- */

treepieces_wind tree_wind(const tree_job *j) {
    treepieces_wind wind = {0, 0, 0.6f, 0, 0};
    wind.speed = (float)j->wind;
    wind.seed = (uint32_t)j->run.seed;
    return wind;
}

treepieces_forest_desc tree_forest_desc(const tree_job *j) {
    treepieces_forest_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.kit = j->kit;
    desc.species = j->species;
    desc.species_count = j->species_count;
    desc.tree_count = j->count;
    desc.spacing = (float)j->spacing;
    desc.max_pieces = j->pieces;
    if (j->lod) { /* each level a third of the one before; -1: for collisions */
        if (!desc.max_pieces) desc.max_pieces = 600;
        for (int i = 0; i < j->lod; i++) desc.max_pieces /= 3;
        if (j->lod < 0 && desc.max_pieces > HULL_PIECES) desc.max_pieces = HULL_PIECES;
        if (desc.max_pieces < 8) desc.max_pieces = 8;
    }
    desc.seed = j->run.seed;
    return desc;
}

/* One tree of --seed, or of this and the following seeds and of all species in turn, at the origin. */
static void place_at_origin(const tree_job *j, treepieces_place *places, int count) {
    for (int i = 0; i < count; i++) {
        places[i].scale = 1;
        places[i].species = i % j->species_count;
        places[i].seed = j->run.seed + (uint64_t)i;
    }
}

int tree_make_kit(tree_job *j) {
    if (j->kit) return CLI_DONE;
    return check_result(&j->run, treepieces_kit_make(NULL, 0, &j->run.env, &j->kit), "pieces");
}

/* places NULL: all trees of the forest, on the grid */
static int grow(tree_job *j, const treepieces_place *places, int count) {
    treepieces_forest_desc desc = tree_forest_desc(j);
    desc.places = places;
    desc.tree_count = count;
    cli_stage(&j->run, "grow");
    const int status = tree_make_kit(j);
    if (status) return status;
    desc.kit = j->kit;
    return check_result(&j->run, treepieces_forest_make(&desc, &j->run.env, &j->forest),
                        j->species[0].name);
}

/* The bones in their final pose, with the wind unless that is an animation of a rig, which needs the
   bones at rest too. */
static int pose(tree_job *j) {
    const treepieces_pose bent = {j->run.seed, (float)j->pose, NULL};
    const size_t nodes = j->forest->node_count;
    const treepieces_wind wind = tree_wind(j);
    const int has_rig = tree_is_glb(j) && !j->is_forest && !j->wind_attributes;
    txm_status result = TXM_OK;
    cli_stage(&j->run, "pose");
    j->posed = (float *)new_array(nodes, TREEPIECES_BONE * sizeof(float));
    if (has_rig) j->rest = (float *)new_array(nodes, TREEPIECES_BONE * sizeof(float));
    if (!j->posed || (has_rig && !j->rest)) return fail_memory(&j->run);
    if (has_rig) result = treepieces_bones(j->forest, NULL, &j->run.env, j->rest);
    if (result == TXM_OK) result = treepieces_bones(j->forest, &bent, &j->run.env, j->posed);
    if (result == TXM_OK && j->wind > 0 && !has_rig) {
        float *state = (float *)new_array(nodes, 4 * sizeof(float));
        if (!state) return fail_memory(&j->run);
        for (int i = WARM_UP - 1; i >= 0 && result == TXM_OK; i--)
            result = treepieces_sway(j->forest, &wind, -0.1 * i, 0.1, &bent, &j->run.env, state,
                                     j->posed);
        free(state);
    }
    return check_result(&j->run, result, j->species[0].name);
}

void tree_count(tree_job *j) {
    const treepieces_forest *f = j->forest;
    for (int t = 0; t < f->tree_count; t++)
        if (f->trees[t].height > j->grown.height) j->grown.height = f->trees[t].height;
    j->grown.pieces += f->node_count;
    j->grown.clusters += f->cluster_count;
    j->grown.bytes += f->bytes;
}

void tree_report(tree_job *j) {
    const int trees = j->variants ? j->variants : j->count;
    cli_figure(&j->run, "trees", j->count);
    cli_figure(&j->run, "pieces", (double)j->grown.pieces);
    cli_figure(&j->run, "clusters", (double)j->grown.clusters);
    cli_figure(&j->run, "height", (double)j->grown.height);
    cli_figure(&j->run, "bytes_per_tree", (double)j->grown.bytes / trees);
}

int tree_grow(tree_job *j) {
    treepieces_place places[MAX_VARIANTS] = {{{0, 0, 0}, 0, 0, 0, 0}};
    const int on_grid = j->is_forest && !j->variants;
    const int count = on_grid ? j->count : j->is_forest ? j->variants : 1;
    if (!on_grid) place_at_origin(j, places, count);
    const int status = grow(j, on_grid ? NULL : places, count);
    if (status) return status;
    memset(&j->grown, 0, sizeof j->grown);
    tree_count(j);
    if (!j->lod) tree_report(j);
    return pose(j);
}

int tree_grow_places(tree_job *j, const treepieces_place *places, int count) {
    free_trees(j);
    const int status = grow(j, places, count);
    return status ? status : pose(j);
}

/* ---- bones --------------------------------------------------------------------------------- */

/* The columns X, Y, Z of a bone are at right angles; as unit vectors they are a rotation. */
txm_quat tree_bone_rotation(const float *bone) {
    txm_dvec3 axis[3];
    for (int c = 0; c < 3; c++) axis[c] = txm_d3_unit(txm_d3(bone[c], bone[4 + c], bone[8 + c]));
    return txm_quat_unit(txm_quat_from_axes(axis[0], axis[1], axis[2]));
}
