/* options.c - the command line
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

/* Read up to `count` numbers separated by `separator`; returns how many there are, 0 if the text is
   malformed. */
static int read_numbers(const char *text, char separator, float *numbers, int count) {
    int n = 0;
    for (; n < count; n++) {
        char *end;
        numbers[n] = strtof(text, &end);
        if (end == text || !(fabsf(numbers[n]) <= 1e9f)) return 0;
        text = end + (*end == separator);
        if (*end == 0) return n + 1;
        if (*end != separator) return 0;
    }
    return 0;
}

/* Read one option and its value; returns how many arguments it used, 0 if it is not valid. */
int read_option(options *o, const char *name, const char *value) {
    float v[3] = {0, 0, 0};
    if (strcmp(name, "--bare") == 0) return o->is_bare = 1;
    if (strcmp(name, "--wire") == 0) return o->is_wire = 1;
    if (!value) return 0;
    if (strcmp(name, "--species") == 0) o->species = value;
    else if (strcmp(name, "--bark") == 0) o->bark = value;
    else if (strcmp(name, "--leaf") == 0) o->leaf = value;
    else if (strcmp(name, "--shaders") == 0) o->shaders = value;
    else if (strcmp(name, "--headless") == 0) o->headless = value;
    else if (strcmp(name, "--seed") == 0) o->seed = strtoull(value, NULL, 10);
    else if (strcmp(name, "--orbit") == 0) {
        if (read_numbers(value, ',', o->orbit, 3) < 2) return 0;
    } else if (strcmp(name, "--at") == 0) {
        o->has_at = 1;
        if (read_numbers(value, ',', o->at, 3) != 3) return 0;
    } else if (strcmp(name, "--size") == 0) {
        if (read_numbers(value, 'x', v, 2) != 2) return 0;
        o->width = (int)v[0];
        o->height = (int)v[1];
    } else {
        if (read_numbers(value, ',', v, 1) != 1) return 0;
        if (strcmp(name, "--count") == 0) o->count = (int)v[0];
        else if (strcmp(name, "--pieces") == 0) o->pieces = (int)v[0];
        else if (strcmp(name, "--frames") == 0) o->frames = (int)v[0];
        else if (strcmp(name, "--smooth") == 0) o->smooth = (int)v[0];
        else if (strcmp(name, "--time") == 0) o->time = (double)v[0];
        else if (strcmp(name, "--loop") == 0) o->loop = v[0];
        else if (strcmp(name, "--wind") == 0) o->wind = v[0];
        else if (strcmp(name, "--level") == 0) o->level = v[0];
        else if (strcmp(name, "--half") == 0) o->half = v[0];
        else if (strcmp(name, "--cards") == 0) o->cards = v[0];
        else return 0;
    }
    return 2;
}

options default_options(void) {
    options o;
    memset(&o, 0, sizeof o);
    o.species = "oak";
    o.count = o.frames = 1;
    o.seed = 1;
    o.smooth = 2;
    o.width = 960;
    o.height = 720;
    o.wind = 4;
    o.level = 6;
    o.half = 12;
    o.cards = 7;
    o.orbit[1] = 5;
    return o;
}

int options_are_valid(const options *o) {
    return o->count >= 1 && o->count <= 1000000 && o->frames >= 1 && o->frames <= 100000 &&
           o->width >= 16 && o->width <= 8192 && o->height >= 16 && o->height <= 8192 &&
           o->smooth >= 1 && o->smooth <= 4 && o->level >= 1 && o->level <= 64 && o->half > 0 &&
           o->cards >= 0 && o->loop >= 0 && o->loop <= 60 && (o->loop == 0 || o->headless) &&
           (o->frames == 1 || !o->headless || strchr(o->headless, '%'));
}
