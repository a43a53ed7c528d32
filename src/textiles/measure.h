#ifndef TEXTILES_MEASURE_H
#define TEXTILES_MEASURE_H

#include "set.h"

/* ---- public: measuring ------------------------------------------------------------------- */

/* sum over the channels of the absolute difference of two texels; colours count as they show */
static double txt_texel_step(const txt_map *m, const uint8_t *p, const uint8_t *q) {
    const size_t last = (size_t)m->channels - 1;
    const double full = m->sample == TXM_F32 ? 1 : m->sample == TXM_U16 ? 65535 : 255;
    double sum = 0, shown_p = 1, shown_q = 1;
    if (m->has_alpha) {
        shown_p = fmin(fmax(txt_stored(m->sample, p, last) / full, 0), 1);
        shown_q = fmin(fmax(txt_stored(m->sample, q, last) / full, 0), 1);
    }
    for (size_t c = 0; c <= last; c++) {
        const int is_alpha = m->has_alpha && c == last;
        sum += fabs(txt_stored(m->sample, p, c) * (is_alpha ? 1 : shown_p) -
                    txt_stored(m->sample, q, c) * (is_alpha ? 1 : shown_q));
    }
    return sum;
}

/* The mean difference of neighbours inside a tile: axis 0 from row to row, 1 from column to column;
   of triangles in all three directions. */
static double txt_inside_step(const textiles_set *s, int map, int tile, int axis) {
    const int side = s->side;
    const int dx[3] = {1, 0, -1}, dy[3] = {0, 1, 1};
    double sum = 0;
    int count = 0;
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            for (int d = 0; d < 3; d++) {
                const int u = x + dx[d], v = y + dy[d];
                if (s->kind != TEXTILES_TRIANGLE && d != !axis) continue;
                if (u < 0 || u >= side || v >= side) continue;
                if (s->kind == TEXTILES_TRIANGLE && (x + y > s->size || u + v > s->size)) continue;
                sum += txt_texel_step(&s->maps[map], txt_texel(s, map, tile, x, y),
                                      txt_texel(s, map, tile, u, v));
                count++;
            }
        }
    }
    return sum / count;
}

/* texel a = 0..size, row r = 0.. of side k of a triangle; row r has size + 1 - r texels */
static void txt_side_texel(const textiles_set *s, int k, int a, int r, int *x, int *y) {
    const int n = s->size;
    if (k == 0) { /* down the left side: rows go right */
        *x = r;
        *y = a;
    } else if (k == 1) { /* up the slanting side: rows go left and up */
        *x = a;
        *y = n - r - a;
    } else { /* back along the top: rows go down */
        *x = n - r - a;
        *y = r;
    }
}

/* The mean difference between the texels on side k of triangle a and the row beside it in triangle
   b, whose side m is at the same edge in the opposite direction. */
static double txt_row_step(const textiles_set *s, int map, int a, int k, int b, int m) {
    double sum = 0;
    for (int i = 0; i < s->size; i++) {
        for (int e = 0; e < 2; e++) { /* texel i of row 1 lies between the edge's i and i + 1 */
            int x, y, u, v;
            txt_side_texel(s, k, s->size - i - e, 0, &x, &y);
            txt_side_texel(s, m, i, 1, &u, &v);
            sum += txt_texel_step(&s->maps[map], txt_texel(s, map, a, x, y),
                                  txt_texel(s, map, b, u, v));
        }
    }
    return sum / (2 * s->size);
}

typedef struct txt_tally {
    textiles_joints *joints;
    double step, inside;
} txt_tally;

static void txt_count_joint(txt_tally *t, double step, double inside) {
    /* flat interiors: without a step the joint is perfect, else bad */
    const double ratio = inside > 0 ? step / inside : step > 0 ? 1e9 : 1;
    textiles_joints *j = t->joints;
    if (j->pairs == 0 || ratio > j->worst) j->worst = ratio;
    if (j->pairs == 0 || ratio < j->least) j->least = ratio;
    j->mean += ratio;
    j->pairs++;
    t->step += step;
    t->inside += inside;
}

static void txt_measure_squares(const textiles_set *s, int map, int a, int b, const double *inside,
                                txt_tally *tally) {
    const int last = s->size - 1;
    for (int axis = 0; axis < 2; axis++) { /* 0: b under a, 1: b right of a */
        double sum = 0;
        if (!txt_joins(s, a, b, !axis)) continue;
        for (int k = 0; k <= last; k++)
            sum += txt_texel_step(&s->maps[map],
                                  txt_texel(s, map, a, axis ? last : k, axis ? k : last),
                                  txt_texel(s, map, b, axis ? 0 : k, axis ? k : 0));
        txt_count_joint(tally, sum / s->size, 0.5 * (inside[2 * a + axis] + inside[2 * b + axis]));
    }
}

static void txt_measure_triangles(const textiles_set *s, int map, int a, int b,
                                  const double *inside, txt_tally *tally) {
    for (int k = 0; k < 3; k++) {
        for (int m = 0; m < 3; m++) {
            if (s->tiles[a].edges[k] != s->tiles[b].edges[m] ||
                s->tiles[a].directions[k] == s->tiles[b].directions[m])
                continue;
            txt_count_joint(tally,
                            0.5 * (txt_row_step(s, map, a, k, b, m) + txt_row_step(s, map, b, m, a, k)),
                            0.5 * (inside[2 * a] + inside[2 * b]));
        }
    }
}

TEXTILES_API txm_status textiles_measure(const textiles_set *set, int map, txm_env *env,
                                         textiles_joints *joints) {
    if (!set || !joints) return txm_fail(env, TXM_BAD_ARGUMENT, "set or joints is NULL");
    if (map < 0 || map >= set->map_count) return txm_fail(env, TXM_BAD_ARGUMENT, "map: no such map");
    const size_t count = (size_t)set->count;
    double *inside = (double *)txm_alloc(env, count * 2 * sizeof(double));
    if (!inside) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to measure");
    textiles_joints result = {0, 0, 0, 0, 0};
    txt_tally tally = {&result, 0, 0};
    const int is_triangle = set->kind == TEXTILES_TRIANGLE;
    for (int t = 0; t < set->count; t++) {
        for (int axis = 0; axis < 2; axis++) inside[2 * t + axis] = txt_inside_step(set, map, t, axis);
    }
    for (int a = 0; a < set->count; a++) {
        for (int b = 0; b < set->count; b++) {
            if (is_triangle) txt_measure_triangles(set, map, a, b, inside, &tally);
            else txt_measure_squares(set, map, a, b, inside, &tally);
        }
    }
    txm_free(env, inside);
    if (result.pairs) {
        result.mean /= result.pairs;
        result.overall = tally.inside > 0 ? tally.step / tally.inside : 1;
    }
    *joints = result;
    return TXM_OK;
}

#endif /* TEXTILES_MEASURE_H */
