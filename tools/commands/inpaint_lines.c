/* inpaint_lines.c - the lines of --guide and --prior of 'texkit inpaint'
   SPDX-License-Identifier: MIT OR Unlicense */
#include "inpaint.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>

#define MAX_COORDINATE 1e9 /* of a point; a float holds it */

/* ---- JSON ------------------------------------------------------------------------------------ */

/* The points of a line, `dimensions` numbers each, relative to the mesh's place, to `to`. 0: one of them
   is none. */
static int get_points(const cJSON *list, int dimensions, const mesh_place *place, float *to) {
    const cJSON *point, *number;
    size_t at = 0; /* in to: 3 numbers a point */
    cJSON_ArrayForEach(point, list) {
        size_t k = 0;
        if (!cJSON_IsArray(point) || cJSON_GetArraySize(point) != dimensions) return 0;
        to[at + 2] = 0;
        cJSON_ArrayForEach(number, point) {
            if (!cJSON_IsNumber(number) || !(fabs(number->valuedouble) <= MAX_COORDINATE)) return 0;
            to[at + k] = mesh_place_in(place, number->valuedouble, (int)k);
            if (!txm_is_finite((double)to[at + k++])) return 0;
        }
        at += 3;
    }
    return 1;
}

/* Lines of a JSON file: objects with "points", closed ones with their first point at the end again. */
static int take_json(inpaint_job *j, const cJSON *json, int dimensions, char why[120]) {
    const cJSON *lines = cJSON_GetObjectItemCaseSensitive(json, "strokes"), *line;
    size_t count = 0, points = 0;
    if (!lines) lines = cJSON_GetObjectItemCaseSensitive(json, "lines");
    if (!cJSON_IsArray(lines) || cJSON_GetArraySize(lines) == 0) {
        snprintf(why, 120, "no list of \"strokes\" in it; see 'texkit inpaint --help'");
        return 0;
    }
    cJSON_ArrayForEach(line, lines) {
        count++;
        points += 1 + (size_t)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(line, "points"));
    }
    j->drawn.points = (float *)new_array(points, 3 * sizeof(float));
    j->drawn.first = (size_t *)new_array(count + 1, sizeof(size_t));
    if (!j->drawn.points || !j->drawn.first) {
        snprintf(why, 120, "out of memory");
        return 0;
    }
    points = 0;
    cJSON_ArrayForEach(line, lines) {
        const cJSON *list = cJSON_GetObjectItemCaseSensitive(line, "points");
        float *to = j->drawn.points + 3 * points;
        const int n = cJSON_GetArraySize(list);
        if (!cJSON_IsArray(list) || n < 2 || !get_points(list, dimensions, &j->mesh.place, to)) {
            snprintf(why, 120, "stroke %lu: \"points\" must be a list of 2 or more %s",
                     (unsigned long)j->drawn.count, dimensions == 2 ? "[x,y]" : "[x,y,z]");
            return 0;
        }
        points += (size_t)n;
        if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(line, "closed")) ||
            cJSON_GetObjectItemCaseSensitive(line, "hole")) /* of 'texkit edges': all closed */
            memcpy(j->drawn.points + 3 * points++, to, 3 * sizeof(float));
        j->drawn.first[++j->drawn.count] = points;
    }
    return 1;
}

/* ---- either form ------------------------------------------------------------------------------ */

static int decode(inpaint_job *j, const unsigned char *bytes, size_t size, char why[120]) {
    const int on_mesh = j->mesh_path != NULL;
    const char *text = "not a JSON file";
    size_t at = 0;
    while (at < size && (bytes[at] == ' ' || bytes[at] == '\t' || bytes[at] == '\n' || bytes[at] == '\r'))
        at++;
    if (on_mesh && (at == size || bytes[at] != '{')) {
        const int ok = mesh_decode_lines(bytes, size, &j->mesh.place, &j->drawn, &text);
        if (!ok) snprintf(why, 120, "%s", text);
        return ok;
    }
    cJSON *json = cJSON_ParseWithLength((const char *)bytes, size);
    snprintf(why, 120, "%s", text);
    const int ok = json && take_json(j, json, on_mesh ? 3 : 2, why);
    cJSON_Delete(json);
    return ok;
}

int inpaint_read_lines(inpaint_job *j, const char *path) {
    char why[120];
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    if (!bytes) return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", path, strerror(errno));
    const int ok = decode(j, bytes, size, why);
    free(bytes);
    if (!ok) return cli_fail(&j->run, CLI_FAILED, "'%s': %s", path, why);
    const mesh_lines *drawn = &j->drawn;
    if (drawn->count > INT_MAX || drawn->first[drawn->count] > INT_MAX)
        return cli_fail(&j->run, CLI_FAILED, "'%s': too many lines", path);
    j->lines = (texinpaint_line *)new_array(drawn->count, sizeof *j->lines);
    if (!j->lines) return fail_memory(&j->run);
    for (size_t i = 0; i < drawn->count; i++) {
        j->lines[i].points = drawn->points + 3 * drawn->first[i];
        j->lines[i].count = (int)(drawn->first[i + 1] - drawn->first[i]);
    }
    j->desc.lines = j->lines;
    j->desc.line_count = (int)drawn->count;
    return CLI_DONE;
}
