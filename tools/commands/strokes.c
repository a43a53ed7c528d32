/* strokes.c - turns the strokes of 'texkit patch --control' into guides
   SPDX-License-Identifier: MIT OR Unlicense */
#include "patch.h"
#include "files/image_io.h"
#include "texedges.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>

enum { MAX_COORDINATE = 1 << 20 }; /* of a point, pixels */

/* A file of strokes: what to find in the exemplar, and what to draw. */
typedef struct strokes {
    texedges_desc find;
    texedges_control control;
    texedges_stroke *list;
    txm_vec2 *points;
    char why[120]; /* what is wrong with the file */
} strokes;

static int is_in(const cJSON *item, double low, double high) {
    return cJSON_IsNumber(item) && item->valuedouble >= low && item->valuedouble <= high;
}

/* The number low..high of that name; *value stays if there is none. */
static int get_number(strokes *s, const cJSON *from, const char *name, double low, double high,
                      int is_whole, double *value) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(from, name);
    if (!item) return 1;
    const int fits = is_in(item, low, high);
    if (fits && (!is_whole || (double)(int)item->valuedouble == item->valuedouble)) {
        *value = item->valuedouble;
        return 1;
    }
    snprintf(s->why, sizeof s->why, "\"%s\" must be a %snumber from %g to %g", name,
             is_whole ? "whole " : "", low, high);
    return 0;
}

/* Has the object only fields of these names? A misspelt one must not be ignored silently. */
static int knows_fields(strokes *s, const cJSON *object, const char *const *fields) {
    const cJSON *item;
    cJSON_ArrayForEach(item, object) {
        int k = 0;
        while (fields[k] && strcmp(fields[k], item->string) != 0) k++;
        if (fields[k]) continue;
        snprintf(s->why, sizeof s->why, "unknown field \"%.40s\"", item->string);
        return 0;
    }
    return 1;
}

/* Parse one stroke; its points go to `points`. */
static int parse_stroke(strokes *s, const cJSON *json, texedges_stroke *to, txm_vec2 *points) {
    static const char *const fields[] = {"layer", "closed", "width", "points", NULL};
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(json, "points"), *point;
    const cJSON *closed = cJSON_GetObjectItemCaseSensitive(json, "closed");
    double layer = 0, width = 0;
    if (!cJSON_IsObject(json)) {
        snprintf(s->why, sizeof s->why, "it must be an object");
        return 0;
    }
    if (!knows_fields(s, json, fields) ||
        !get_number(s, json, "layer", 0, s->find.levels - 1, 1, &layer) ||
        !get_number(s, json, "width", 2, 256, 0, &width))
        return 0;
    if (closed && !cJSON_IsBool(closed)) {
        snprintf(s->why, sizeof s->why, "\"closed\" must be true or false");
        return 0;
    }
    to->is_closed = cJSON_IsTrue(closed);
    to->layer = (int)layer;
    to->width = (float)width;
    to->points = points;
    cJSON_ArrayForEach(point, list) {
        const cJSON *x = cJSON_GetArrayItem(point, 0), *y = cJSON_GetArrayItem(point, 1);
        if (!cJSON_IsArray(point) || cJSON_GetArraySize(point) != 2 ||
            !is_in(x, -MAX_COORDINATE, MAX_COORDINATE) ||
            !is_in(y, -MAX_COORDINATE, MAX_COORDINATE)) {
            snprintf(s->why, sizeof s->why, "point %d must be [x,y] within -%d to %d", to->count,
                     MAX_COORDINATE, MAX_COORDINATE);
            return 0;
        }
        points[to->count].x = (float)x->valuedouble;
        points[to->count++].y = (float)y->valuedouble;
    }
    int moves = 0; /* a stroke whose points are all the same has no length */
    for (int i = 1; i < to->count; i++)
        moves |= points[i].x < points[0].x || points[i].x > points[0].x ||
                 points[i].y < points[0].y || points[i].y > points[0].y;
    if (cJSON_IsArray(list) && to->count >= 2 + to->is_closed && moves) return 1;
    snprintf(s->why, sizeof s->why,
             "\"points\" must be a list of %d or more [x,y], not all the same", 2 + to->is_closed);
    return 0;
}

static int parse_strokes(strokes *s, const cJSON *json) {
    static const char *const fields[] = {"levels",     "smooth",  "least",  "background",
                                         "disturb",    "strokes", NULL};
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(json, "strokes"), *item;
    double levels = 4, smooth = 0, least = 0, background = -1, disturb = 1;
    size_t count = 0, points = 0;
    if (!cJSON_IsObject(json) || !cJSON_IsArray(list)) {
        snprintf(s->why, sizeof s->why, "not a list of strokes; see 'texkit patch --help'");
        return 0;
    }
    if (!knows_fields(s, json, fields) ||
        !get_number(s, json, "levels", 2, TEXEDGES_MAX_LEVELS, 1, &levels) ||
        !get_number(s, json, "smooth", 0, 16, 0, &smooth) ||
        !get_number(s, json, "least", 0, 1 << 30, 1, &least) ||
        !get_number(s, json, "background", -1, levels - 1, 1, &background) ||
        !get_number(s, json, "disturb", 0, 4, 0, &disturb))
        return 0;
    s->find.levels = (int)levels;
    s->find.smooth = (float)smooth;
    s->find.least = (int)least;
    s->control.background = (int)background;
    s->control.disturb = disturb > 0 ? (float)disturb : -1; /* the library's 0 is its default */
    cJSON_ArrayForEach(item, list) {
        count++;
        points += (size_t)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(item, "points"));
    }
    s->list = (texedges_stroke *)calloc(count + 1, sizeof *s->list);
    s->points = (txm_vec2 *)calloc(points + 1, sizeof *s->points);
    if (!s->list || !s->points) {
        snprintf(s->why, sizeof s->why, "out of memory");
        return 0;
    }
    s->control.strokes = s->list;
    points = 0;
    cJSON_ArrayForEach(item, list) {
        texedges_stroke *stroke = &s->list[s->control.stroke_count];
        if (!parse_stroke(s, item, stroke, s->points + points)) {
            char why[sizeof s->why];
            memcpy(why, s->why, sizeof why);
            snprintf(s->why, sizeof s->why, "stroke %d: %.95s", s->control.stroke_count, why);
            return 0;
        }
        points += (size_t)stroke->count;
        s->control.stroke_count++;
    }
    return 1;
}

static int read_strokes(patch_job *j, strokes *s) {
    size_t size;
    unsigned char *bytes = file_read(j->control, &size);
    if (!bytes)
        return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", j->control, strerror(errno));
    cJSON *json = cJSON_ParseWithLength((const char *)bytes, size);
    free(bytes);
    snprintf(s->why, sizeof s->why, "not a JSON file");
    const int ok = json && parse_strokes(s, json);
    cJSON_Delete(json);
    if (ok) return CLI_DONE;
    return cli_fail(&j->run, CLI_FAILED, "'%s': %s", j->control, s->why);
}

/* The layers of the exemplars become their guides, the disturbed strokes that of the output. */
static int follow_strokes(patch_job *j, strokes *s) {
    texpatch_desc *d = &j->desc;
    texedges_set *edges = NULL, *disturbed = NULL;
    texedges_control control = s->control;
    int status = CLI_DONE;
    s->find.image = j->pictures[0][0];
    status = check_result(&j->run, texedges_find(&s->find, &j->run.env, &edges), j->run.inputs[0]);
    for (int e = 0; e < d->exemplar_count && !status; e++) {
        const txm_image *image = &j->pictures[e][0];
        txm_image *layers = &j->exemplars[e].guide;
        s->find.image = *image;
        status = new_picture(&j->run, image->width, image->height, 1, TXM_U8, layers);
        if (!status)
            status = check_result(&j->run, texedges_layers(&s->find, edges, &j->run.env, layers),
                                  j->exemplar_names.at[e]);
    }
    control.edges = edges;
    control.seed = j->run.seed;
    if (!status) status = new_picture(&j->run, d->width, d->height, 1, TXM_U8, &d->guide);
    if (!status) status = new_picture(&j->run, d->width, d->height, 1, TXM_U8, &d->guide_mask);
    if (!status)
        status = check_result(&j->run, texedges_disturb(&control, d->width, d->height, &j->run.env,
                                                        &disturbed), j->control);
    if (!status)
        status = check_result(&j->run, texedges_guide(&control, disturbed, &j->run.env,
                                                      &d->guide, &d->guide_mask), j->control);
    texedges_set_free(edges);
    texedges_set_free(disturbed);
    return status;
}

int patch_take_strokes(patch_job *j) {
    strokes s;
    memset(&s, 0, sizeof s);
    int status = read_strokes(j, &s);
    if (!status) {
        cli_stage(&j->run, "strokes");
        cli_figure(&j->run, "stroke_count", s.control.stroke_count);
        status = follow_strokes(j, &s);
    }
    free(s.list);
    free(s.points);
    return status;
}
