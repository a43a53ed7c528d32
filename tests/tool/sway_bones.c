/* sway_bones.c - where the bones of a tree are in the wind, by the library alone
   SPDX-License-Identifier: MIT OR Unlicense

   sway_bones SPECIES PIECES SEED SPEED SECONDS RATE

   The tree and the wind of 'texkit tree --species SPECIES --pieces PIECES --seed SEED --wind SPEED
   --seconds SECONDS --rate RATE'. Prints as JSON some times of keys, and for each piece and time the bone
   without its stretch: a matrix of 3 x 4, row after row. It sways for longer than the tool lets it
   before the clip begins. tests/tool/check_tree.py and load_three.js compare what they read.      */
#include "treepieces.h"

#include <stdio.h>

enum { TIMES = 4, PERIODS = 25 };

static void print_bone(const float *bone) {
    double length[3];
    for (int c = 0; c < 3; c++) {
        const double x = (double)bone[c], y = (double)bone[4 + c], z = (double)bone[8 + c];
        length[c] = sqrt(x * x + y * y + z * z);
    }
    for (int k = 0; k < TREEPIECES_BONE; k++)
        printf("%s%.7g", k ? "," : "[", k % 4 < 3 ? (double)bone[k] / length[k % 4] : (double)bone[k]);
    printf("]");
}

int main(int argc, char **argv) {
    treepieces_species species;
    treepieces_kit *kit = NULL;
    treepieces_forest *f = NULL;
    treepieces_place place;
    treepieces_forest_desc desc;
    treepieces_wind wind;
    memset(&place, 0, sizeof place);
    memset(&desc, 0, sizeof desc);
    memset(&wind, 0, sizeof wind);
    if (argc != 7 || treepieces_preset(argv[1], NULL, &species) != TXM_OK ||
        treepieces_kit_make(NULL, 0, NULL, &kit) != TXM_OK)
        return 2;
    const int rate = atoi(argv[6]), steps = (int)(atof(argv[5]) * rate + 0.5);
    place.scale = 1;
    place.seed = strtoull(argv[3], NULL, 10);
    wind.speed = (float)atof(argv[4]);
    wind.gusts = 0.6f;
    wind.seed = (uint32_t)place.seed;
    wind.period = (float)steps / (float)rate;
    desc.kit = kit;
    desc.species = &species;
    desc.species_count = desc.tree_count = 1;
    desc.places = &place;
    desc.max_pieces = atoi(argv[2]);
    desc.seed = place.seed;
    if (treepieces_forest_make(&desc, NULL, &f) != TXM_OK) return 1;
    const size_t size = TREEPIECES_BONE * sizeof(float) * f->node_count;
    float *bones = (float *)malloc(TIMES * size), *state = (float *)calloc(f->node_count, 4 * sizeof(float));
    if (!bones || !state) return 1;
    int keys[TIMES], next = 0; /* spread over the clip */
    for (int k = 0; k < TIMES; k++) keys[k] = k * steps / TIMES + (k > 0);
    for (int i = -PERIODS * steps; i < steps && next < TIMES; i++) {
        float *now = bones + (size_t)next * TREEPIECES_BONE * f->node_count;
        if (treepieces_sway(f, &wind, (double)i / rate, 1.0 / rate, NULL, NULL, state, now) != TXM_OK) return 1;
        next += i == keys[next];
    }
    printf("{\"times\": [");
    for (int k = 0; k < TIMES; k++) printf("%s%.9g", k ? ", " : "", (double)keys[k] / rate);
    printf("], \"pieces\": [");
    for (uint32_t n = 0; n < f->node_count; n++) {
        printf("%s\n[", n ? "," : "");
        for (int k = 0; k < TIMES; k++) {
            if (k) printf(", ");
            print_bone(bones + ((size_t)k * f->node_count + n) * TREEPIECES_BONE);
        }
        printf("]");
    }
    printf("]}\n");
    free(bones);
    free(state);
    treepieces_forest_free(f);
    treepieces_kit_free(kit);
    return 0;
}
