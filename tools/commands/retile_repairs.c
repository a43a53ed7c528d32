/* retile_repairs.c - texkit retile: what is repaired, as options and in words
   SPDX-License-Identifier: MIT OR Unlicense */
#include "retile.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* ---- options ------------------------------------------------------------------------------- */

/* The diagonal of the bounding box of the vertices that triangles use, as the positions have it. */
static double diagonal_of(const mesh_data *m) {
    double sum = 0;
    for (size_t axis = 0; axis < 3 && m->triangle_count; axis++) {
        double low = m->positions[3 * (size_t)m->indices[0] + axis], high = low;
        for (size_t c = 1; c < 3 * m->triangle_count; c++) {
            const double x = m->positions[3 * (size_t)m->indices[c] + axis];
            low = fmin(low, x);
            high = fmax(high, x);
        }
        sum += (high - low) * (high - low);
    }
    return sqrt(sum);
}

/* A number from 0 on, perhaps with a percent sign. */
static int parse_share(cli *run, const char *option, const char *text, const char *like,
                       double *value, int *is_percent) {
    char *end = NULL;
    const int starts = (text[0] >= '0' && text[0] <= '9') || text[0] == '.';
    *value = starts ? strtod(text, &end) : -1;
    *is_percent = starts && *end == '%';
    if (starts && end[*is_percent] == 0 && !strpbrk(text, "xX") && *value <= 1e30) return CLI_DONE;
    return cli_fail(run, CLI_USAGE, "%s '%s': give a number, as %s", option, text, like);
}

int retile_repair_options(retile_job *j) {
    double value = 0;
    int is_percent = 0;
    if (j->weld) {
        if (parse_share(&j->run, "--weld", j->weld, "0.01, 0.1% or 0", &value, &is_percent))
            return CLI_USAGE;
        const double size = diagonal_of(&j->input) * mesh_place_scale(&j->input.place);
        const double part = is_percent ? value / 100 : size > 0 ? value / size : 0;
        if (part > 0.01)
            return cli_fail(&j->run, CLI_USAGE, "--weld '%s': give at most 1%% of the diagonal, %g",
                            j->weld, 0.01 * size);
        j->desc.weld = value > 0 ? (float)fmax(part, 1e-30) : -1;
    }
    if (j->drop_below) {
        if (parse_share(&j->run, "--drop-below", j->drop_below, "0.1% or 0.001", &value,
                        &is_percent))
            return CLI_USAGE;
        if (is_percent) value /= 100;
        if (value > 1)
            return cli_fail(&j->run, CLI_USAGE, "--drop-below '%s': give 0%% to 100%%",
                            j->drop_below);
        j->desc.drop_below = (float)value;
    }
    return CLI_DONE;
}

/* ---- words --------------------------------------------------------------------------------- */

/* Add "N things" to a list, in the singular where there is one. */
static void add_repair(char *list, size_t room, size_t count, const char *one, const char *more) {
    const size_t n = strlen(list);
    if (!count) return;
    snprintf(list + n, room - n, "%s%lu %s", n ? ", " : "", (unsigned long)count,
             count == 1 ? one : more);
}

void retile_tell_repairs(retile_job *j) {
    const trimesh_report *r = &j->report;
    char list[800] = "";
    add_repair(list, sizeof list, r->degenerate, "triangle without area removed",
               "triangles without area removed");
    add_repair(list, sizeof list, r->duplicate, "duplicate triangle removed",
               "duplicate triangles removed");
    add_repair(list, sizeof list, r->fins, "triangle that stuck out of an edge removed",
               "triangles that stuck out of an edge removed");
    add_repair(list, sizeof list, r->overfull, "edge of more than two triangles taken apart in pairs",
               "edges of more than two triangles taken apart in pairs");
    add_repair(list, sizeof list, r->opened, "triangle left over there got a border",
               "triangles left over there got a border");
    add_repair(list, sizeof list, r->turned, "triangle reversed", "triangles reversed");
    add_repair(list, sizeof list, r->cut, "edge of a one-sided surface cut",
               "edges of a one-sided surface cut");
    add_repair(list, sizeof list, r->closed, "vertex on a border welded to a close one",
               "vertices on borders welded to close ones");
    add_repair(list, sizeof list, r->stitched, "T-junction stitched", "T-junctions stitched");
    add_repair(list, sizeof list, r->dropped, "loose piece dropped", "loose pieces dropped");
    if (r->dropped) {
        const size_t n = strlen(list);
        snprintf(list + n, sizeof list - n, " (%.2g %% of the area)", 100 * r->dropped_area);
    }
    if (list[0]) cli_warn(&j->run, "'%s' was repaired: %s", j->run.inputs[0], list);
}
