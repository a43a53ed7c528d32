/* mesh_place.c - where a mesh lies, so that floats hold its shape
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

/* How many times a mesh's extent may lie away from zero before an origin is taken off: floats then
   still hold 2^-20 of it. */
static const double MOST_OFFSET = 16;

/* Extents in which floats compute well: areas and volumes are products of up to four of them. */
enum { LEAST_EXPONENT = -24, MOST_EXPONENT = 24 };

/* Significant digits that tell all floats and all doubles apart. */
enum { MOST_DIGITS = 17, FLOAT_DIGITS = 9 };

mesh_place place_choose(const double *positions, const unsigned char *is_used, size_t count) {
    mesh_place place = {{0, 0, 0}, 1};
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0}, extent = 0, most = 0;
    int any = 0, exponent = 0;
    for (size_t i = 0; i < count; i++) {
        if (is_used && !is_used[i]) continue;
        for (int k = 0; k < 3; k++) {
            const double p = positions[3 * i + (size_t)k];
            if (!any || p < low[k]) low[k] = p;
            if (!any || p > high[k]) high[k] = p;
        }
        any = 1;
    }
    for (int k = 0; k < 3; k++) {
        extent = fmax(extent, high[k] - low[k]);
        most = fmax(most, fmax(fabs(low[k]), fabs(high[k])));
    }
    if (!(extent > 0)) return place; /* a point, which has no size that could be lost */
    frexp(extent, &exponent);
    const double step = ldexp(1, exponent); /* at least the extent */
    for (int k = 0; k < 3 && most > MOST_OFFSET * extent; k++) /* few bits: exact differences */
        place.origin[k] = step * floor((low[k] + (high[k] - low[k]) / 2) / step + 0.5);
    if (exponent < LEAST_EXPONENT || exponent > MOST_EXPONENT) place.scale = step;
    return place;
}

int place_is_plain(const mesh_place *place) {
    const double scale = mesh_place_scale(place), most = ldexp(1, 100);
    return place->origin[0] == 0 && place->origin[1] == 0 && place->origin[2] == 0 &&
           scale <= most && scale >= 1 / most;
}

int place_digits(const mesh_place *place, const mesh_data *m) {
    double extent = 0, origin = 0;
    int digits = FLOAT_DIGITS;
    const size_t corners = 3 * m->triangle_count, count = corners ? corners : m->vertex_count;
    for (int k = 0; k < 3; k++) {
        float low = 0, high = 0;
        for (size_t i = 0; i < count; i++) { /* what is not used may lie far away */
            const float p = m->positions[3 * (corners ? m->indices[i] : i) + (size_t)k];
            if (i == 0 || p < low) low = p;
            if (i == 0 || p > high) high = p;
        }
        extent = fmax(extent, ((double)high - (double)low) * mesh_place_scale(place));
        origin = fmax(origin, fabs(place->origin[k]));
    }
    for (; origin > extent && digits < MOST_DIGITS; digits++) extent *= 10;
    return digits;
}
