/* lipids.c - lipids of a few beads each; the tails begin at z = 0, the heads are above
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "membrane.h"

#include <string.h>

#define TAIL(x, y) \
    {"C", x, y, -2.5f, 3.3f, {222, 200, 140}}, {"C", 1.1f * (x), y, -5.6f, 3.3f, {222, 200, 140}}, \
    {"C", 1.2f * (x), y, -8.6f, 3.3f, {216, 190, 126}}, {"C", x, 1.3f * (y), -11, 3.2f, {206, 178, 112}}
#define GLYCEROL {"O", -1.7f, 0, 1, 3.2f, {214, 96, 70}}, {"O", 1.7f, 0, 1, 3.2f, {214, 96, 70}}

static const bead choline[] = {{"N", 0.8f, 0, 8.4f, 4.3f, {70, 110, 210}},
                               {"P", 0, 0, 4.4f, 3.8f, {240, 150, 40}},
                               GLYCEROL, TAIL(-2.1f, 0), TAIL(2.1f, 0.6f)};
static const bead ethanolamine[] = {{"N", -0.5f, 0.4f, 7.6f, 3.7f, {90, 190, 220}},
                                    {"P", 0, 0, 4.2f, 3.8f, {240, 150, 40}},
                                    GLYCEROL, TAIL(-2.2f, 0.5f), TAIL(1.9f, -0.5f)};
static const bead serine[] = {{"N", 1.6f, 0, 8, 3.4f, {150, 90, 200}},
                              {"O", -1.6f, 0.3f, 7.8f, 3.2f, {220, 70, 110}},
                              {"P", 0, 0, 4.4f, 3.8f, {240, 150, 40}},
                              GLYCEROL, TAIL(-2, -0.6f), TAIL(2.2f, 0)};
static const bead cholesterol[] = {{"O", 0, 0, 1.5f, 3.2f, {210, 80, 70}},
                                   {"C", -1, 0, -1.6f, 3.4f, {130, 180, 110}},
                                   {"C", 1, 0, -3.6f, 3.4f, {130, 180, 110}},
                                   {"C", -0.6f, 0, -6.2f, 3.4f, {120, 170, 100}},
                                   {"C", 0.4f, 0, -9.6f, 3.1f, {120, 160, 96}}};

const lipid lipids[KINDS] = {{choline, sizeof choline / sizeof *choline, 5},
                             {ethanolamine, sizeof ethanolamine / sizeof *ethanolamine, 2},
                             {serine, sizeof serine / sizeof *serine, 1},
                             {cholesterol, sizeof cholesterol / sizeof *cholesterol, 3}};

/* A lipid as one mesh: a sphere of 8 steps^2 triangles for each bead. */
int make_lipid(int kind, int steps, mesh_data *out, const char **why) {
    mesh_data balls[MOST_BEADS];
    mesh_instances beads[MOST_BEADS];
    float at[3 * MOST_BEADS], scales[3 * MOST_BEADS];
    int made = 0, ok = 1;
    memset(beads, 0, sizeof beads);
    for (; made < lipids[kind].count && ok; made++) {
        const bead *d = &lipids[kind].beads[made];
        const float centre[3] = {d->x, d->y, d->z};
        ok = mesh_sphere(steps, &balls[made]);
        for (size_t i = 0; ok && i < balls[made].vertex_count; i++)
            memcpy(balls[made].colors + 4 * i, d->color, 3);
        for (int k = 0; k < 3; k++) {
            at[3 * made + k] = centre[k];
            scales[3 * made + k] = d->radius;
        }
        beads[made].mesh = &balls[made];
        beads[made].count = 1;
        beads[made].translations = at + 3 * made;
        beads[made].scales = scales + 3 * made;
    }
    if (!ok) *why = "no memory";
    ok = ok && mesh_bake(beads, made, out, why);
    while (made > 0) mesh_free(&balls[--made]);
    return ok;
}
