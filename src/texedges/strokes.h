#ifndef TEXEDGES_STROKES_H
#define TEXEDGES_STROKES_H

#include "roughness.h"

/* ---- control: disturbed strokes ---------------------------------------------------------- */

/* Points of the outline of a stroke; with points NULL they are only counted. */
typedef struct txp_e_outline {
    txp_e_point *points;
    size_t count;
} txp_e_outline;

static void txp_e_put(txp_e_outline *o, double x, double y) {
    if (o->points) {
        o->points[o->count].x = x;
        o->points[o->count].y = y;
    }
    o->count++;
}

/* One side of a band around n points, to the left of the way (back: of the way back), and the round
   end behind it. Where the line turns outwards the gap is filled in steps of a pixel or so. */
static int txp_e_side(const txp_e_point *p, size_t n, int back, double half, txp_e_outline *o,
                      txp_e_bar *bar) {
    txp_e_point d, before;
    d.x = 1;
    d.y = 0;
    for (size_t i = 1; i < n; i++) { /* a direction to begin with */
        const size_t at = back ? n - i : i - 1, next = back ? at - 1 : at + 1;
        if (txp_e_distance(p[at], p[next]) > 1e-9) {
            txp_e_direction(p[at], p[next], &d);
            break;
        }
    }
    for (size_t i = 0; i < n; i++) {
        const size_t at = back ? n - 1 - i : i;
        const size_t low = at > 2 ? at - 2 : 0, high = at + 2 < n ? at + 2 : n - 1;
        before = d;
        txp_e_direction(p[back ? high : low], p[back ? low : high], &d);
        const int turns = i ? (int)(half * txp_e_distance(before, d)) : 0;
        for (int k = 1; k <= turns; k++) {
            txp_e_point mid, zero;
            zero.x = zero.y = 0;
            mid = before;
            txp_e_direction(zero, txp_e_between(before, d, (double)k / (turns + 1)), &mid);
            txp_e_put(o, p[at].x + half * mid.y, p[at].y - half * mid.x);
        }
        txp_e_put(o, p[at].x + half * d.y, p[at].y - half * d.x);
        if (txp_e_tick(bar, (size_t)turns + 1)) return 0;
    }
    /* half a circle, in two quarters ((1 - t^2) u + 2 t v) / (1 + t^2), from left over ahead to
       right */
    const txp_e_point end = p[back ? 0 : n - 1];
    const int steps = (int)(1.6 * half) + 1;
    for (int k = 1; k < 2 * steps; k++) {
        const double t = (double)(k < steps ? k : k - steps) / steps;
        const double c = half * (1 - t * t) / (1 + t * t), s = half * 2 * t / (1 + t * t);
        const double left = k < steps ? c : -s, ahead = k < steps ? s : c;
        txp_e_put(o, end.x + left * d.y + ahead * d.x, end.y - left * d.x + ahead * d.y);
    }
    return !txp_e_tick(bar, 4 * (size_t)steps);
}

/* The outline of a stroke as a closed line, its inside to the right: of a closed one, its points in
   the right order; of an open one, both sides of its band. */
static txm_status txp_e_outline_make(const texpatch_stroke *s, txp_e_outline *o, txm_arena *arena,
                                     txp_e_bar *bar, txm_env *env) {
    const size_t n = (size_t)s->count;
    txp_e_point *given = (txp_e_point *)txm_arena_alloc(arena, n, sizeof *given);
    double area = 0;
    if (!given) return txp_e_no_memory(env);
    for (size_t i = 0; i < n; i++) {
        const txm_vec2 p = s->points[i], q = s->points[i + 1 < n ? i + 1 : 0], p0 = s->points[0];
        given[i].x = p.x;
        given[i].y = p.y;
        area += ((double)p.x - p0.x) * ((double)q.y - p0.y) -
                ((double)q.x - p0.x) * ((double)p.y - p0.y);
        if (txp_e_tick(bar, 1)) return txp_e_stopped(env);
    }
    if (s->is_closed) {
        for (size_t i = 0, j = n - 1; i < j && area < 0; i++, j--) {
            const txp_e_point p = given[i];
            given[i] = given[j];
            given[j] = p;
        }
        o->points = given;
        o->count = n;
        return TXM_OK;
    }
    const double length = txp_e_length(given, n, 0, bar);
    if (length < 0) return txp_e_stopped(env);
    const size_t m = (size_t)length + 2;
    txp_e_point *even = (txp_e_point *)txm_arena_alloc(arena, 2 * m, sizeof *even);
    if (!even) return txp_e_no_memory(env);
    if (!txp_e_resample(given, n, 0, length, even, m, bar) ||
        !txp_e_soften(even, m, 0, TXP_E_CORNER, even + m, bar))
        return txp_e_stopped(env);
    const double half = 0.5 * (s->width > 0 ? s->width : 8);
    for (int pass = 0; pass < 2; pass++) { /* count, then keep */
        o->points =
            pass ? (txp_e_point *)txm_arena_alloc(arena, o->count, sizeof *o->points) : NULL;
        if (pass && !o->points) return txp_e_no_memory(env);
        o->count = 0;
        if (!txp_e_side(even + m, m, 0, half, o, bar) || !txp_e_side(even + m, m, 1, half, o, bar))
            return txp_e_stopped(env);
    }
    return TXM_OK;
}

/* The place at u on a closed line of n points. */
static txp_e_point txp_e_at(const txp_e_point *p, size_t n, double u) {
    const double wide = (double)n;
    if (u < 0) u += wide;
    if (u >= wide) u -= wide;
    size_t i = (size_t)u;
    if (i >= n) i = n - 1;
    return txp_e_between(p[i], p[i + 1 < n ? i + 1 : 0], u - (double)i);
}

/* Do the segments a b and c d cross? Touching does not count. */
static int txp_e_cross(txm_vec2 a, txm_vec2 b, txm_vec2 c, txm_vec2 d, txm_vec2 *at) {
    if (txm_maxf(a.x, b.x) < txm_minf(c.x, d.x) || txm_maxf(c.x, d.x) < txm_minf(a.x, b.x) ||
        txm_maxf(a.y, b.y) < txm_minf(c.y, d.y) || txm_maxf(c.y, d.y) < txm_minf(a.y, b.y))
        return 0;
    const double ux = (double)b.x - a.x, uy = (double)b.y - a.y;
    const double vx = (double)d.x - c.x, vy = (double)d.y - c.y;
    const double wx = (double)c.x - a.x, wy = (double)c.y - a.y;
    const double c_side = ux * wy - uy * wx, d_side = c_side + (ux * vy - uy * vx);
    const double a_side = vy * wx - vx * wy, b_side = a_side + (vx * uy - vy * ux);
    if (!((c_side < 0 && d_side > 0) || (c_side > 0 && d_side < 0))) return 0;
    if (!((a_side < 0 && b_side > 0) || (a_side > 0 && b_side < 0))) return 0;
    const double t = a_side / (a_side - b_side);
    *at = txm_v2(txm_float(a.x + ux * t), txm_float(a.y + uy * t));
    return 1;
}

/* Cut loops of fewer than TXP_E_LOOP points off a closed line: points are put on a stack; where the
   segment to the next one crosses an earlier one, the stack goes back to that and on from where
   they cross. Then once more from another point, for loops through the first. Returns how many
   points remain; 0 = cancelled.
   scratch: room for n points */
static size_t txp_e_unloop(txm_vec2 *points, size_t n, txm_vec2 *scratch, txp_e_bar *bar) {
    for (int round = 0; round < 2; round++) {
        const size_t turn = n / 2;
        size_t top = 0;
        for (size_t i = 0; i <= n; i++) { /* the last is the first again */
            const txm_vec2 next = points[(turn + i) % n];
            for (size_t k = 2; top > k && k <= TXP_E_LOOP; k++) { /* youngest first: small loops */
                const txm_vec2 *old = scratch + top - k - 1;
                txm_vec2 at;
                if (i == n && old == scratch) break; /* these two meet in the first point */
                if (!txp_e_cross(scratch[top - 1], next, old[0], old[1], &at)) continue;
                top -= k;
                scratch[top++] = at;
                k = 1;
            }
            if (i < n) scratch[top++] = next;
            if (txp_e_tick(bar, TXP_E_LOOP)) return 0;
        }
        n = top;
        memcpy(points, scratch, n * sizeof *points);
    }
    return n;
}

/* The outline o disturbed by up to stray pixels, in memory from the arena. */
static txm_status txp_e_shake(const txp_e_unrest *u, double stray, txm_rng *rng,
                              const txp_e_outline *o, txm_vec2 **points, size_t *count,
                              txm_arena *arena, txp_e_bar *bar, txm_env *env) {
    const double length = txp_e_length(o->points, o->count, 1, bar);
    if (length < 0) return txp_e_stopped(env);
    if (stray > length / 16) stray = length / 16;
    if (length > 4 * (double)TXP_E_LENGTH)
        return txm_fail_at(env, TXM_TOO_LARGE, "strokes", "turn too often for their width");
    const size_t n = length > 16 ? (size_t)(length + 0.5) : 16, shortest = TXP_E_PIECE / 3;
    size_t m = (size_t)(length / u->step + 0.5);
    if (m < shortest) m = shortest;
    txp_e_point *even = (txp_e_point *)txm_arena_alloc(arena, n, 2 * sizeof *even);
    txp_e_sample *row = (txp_e_sample *)txm_arena_alloc(arena, m, sizeof *row);
    txm_vec2 *line = (txm_vec2 *)txm_arena_alloc(arena, m + 1, 2 * sizeof *line);
    if (!even || !row || !line) return txp_e_no_memory(env);
    const txp_e_point *soft = even + n;
    const size_t corner = n < 8 * TXP_E_CORNER ? n / 8 : (size_t)TXP_E_CORNER;
    if (!txp_e_resample(o->points, o->count, 1, length, even, n, bar) ||
        !txp_e_soften(even, n, 1, corner, even + n, bar) || !txp_e_weave(u, rng, row, m, bar))
        return txp_e_stopped(env);

    double sum = 0, at = 0;
    for (size_t k = 0; k < m; k++) sum += row[k].step;
    const double stretch = sum > 0 ? (double)n / sum : 0; /* samples of the stroke for each step */
    const double scale = stray / TXP_E_STRAY;
    const double chord = n < 4 * TXP_E_CHORD ? (double)n / 4 : (double)TXP_E_CHORD;
    txp_e_point direction;
    direction.x = 1;
    direction.y = 0;
    for (size_t k = 0; k < m; k++) {
        const txp_e_point p = txp_e_at(soft, n, at), given = txp_e_at(even, n, at);
        txp_e_direction(txp_e_at(soft, n, at - chord), txp_e_at(soft, n, at + chord), &direction);
        const double most = stray - txp_e_distance(p, given);
        const double ahead = row[k].ahead * scale, right = row[k].right * scale;
        const double off = sqrt(ahead * ahead + right * right);
        const double factor = off <= most ? 1 : most > 0 ? most / off : 0;
        line[k].x = txm_float(p.x + factor * (ahead * direction.x - right * direction.y));
        line[k].y = txm_float(p.y + factor * (ahead * direction.y + right * direction.x));
        at += row[k].step * stretch;
        if (txp_e_tick(bar, 4)) return txp_e_stopped(env);
    }
    *points = line;
    *count = txp_e_unloop(line, m, line + m + 1, bar);
    return *count ? TXM_OK : txp_e_stopped(env);
}

/* One stroke: its line, in memory from `lines`. */
static txm_status txp_e_stroke(const texpatch_control *c, int i, const txp_e_unrest *u,
                               txm_vec2 **points, size_t *count, txm_arena *lines, txp_e_bar *bar,
                               txm_env *env) {
    const texpatch_stroke *s = &c->strokes[i];
    const double width = s->is_closed ? 256 : s->width > 0 ? s->width : 8; /* sides must not meet */
    const double stray = width < 8 ? width * TXP_E_STRAY / 8 : TXP_E_STRAY;
    txm_arena work;
    txp_e_outline o;
    txm_vec2 *made = NULL;
    txm_rng rng = txm_rng_make(c->seed, (uint64_t)i);
    txm_arena_init(&work, env);
    memset(&o, 0, sizeof o);
    txm_status status = txp_e_outline_make(s, &o, &work, bar, env);
    const int is_still = c->disturb < 0 || u->start_count == 0;
    *count = o.count;
    if (status == TXM_OK && !is_still)
        status = txp_e_shake(u, stray, &rng, &o, &made, count, &work, bar, env);
    if (status == TXM_OK) {
        *points = (txm_vec2 *)txm_arena_alloc(lines, *count, sizeof **points);
        if (!*points) status = txp_e_no_memory(env);
    }
    for (size_t k = 0; k < *count && status == TXM_OK; k++) {
        (*points)[k] =
            is_still ? txm_v2(txm_float(o.points[k].x), txm_float(o.points[k].y)) : made[k];
        if (txp_e_tick(bar, 1)) status = txp_e_stopped(env);
    }
    txm_arena_free(&work);
    return status;
}

/* All strokes, layer by layer, so that the unrest of one layer at a time is held. */
static txm_status txp_e_disturb(const texpatch_control *c, txp_e_bar *bar, txm_arena *lines,
                                texpatch_edges *e, txm_env *env) {
    const size_t n = (size_t)c->stroke_count;
    txm_vec2 **points = (txm_vec2 **)txm_arena_alloc(lines, n, sizeof(txm_vec2 *));
    e->lines = (texpatch_polyline *)txm_arena_zero(&e->memory, n, sizeof *e->lines);
    if (n && (!points || !e->lines)) return txp_e_no_memory(env);
    for (int layer = 0; layer < e->levels; layer++) {
        txm_arena held;
        txp_e_unrest u;
        int is_used = 0;
        txm_status status = TXM_OK;
        memset(&u, 0, sizeof u);
        for (int i = 0; i < c->stroke_count; i++) is_used |= c->strokes[i].layer == layer;
        txm_arena_init(&held, env);
        if (is_used && c->disturb >= 0)
            status = txp_e_listen_layer(&u, c->edges, layer, c->disturb > 0 ? c->disturb : 1, &held,
                                        bar, env);
        for (int i = 0; i < c->stroke_count && status == TXM_OK && is_used; i++) {
            if (c->strokes[i].layer != layer) continue;
            e->lines[i].layer = layer;
            status = txp_e_stroke(c, i, &u, &points[i], &e->lines[i].count, lines, bar, env);
        }
        txm_arena_free(&held);
        if (status != TXM_OK) return status;
    }
    e->line_count = n;
    for (size_t i = 0; i < n; i++) {
        e->lines[i].first = e->point_count;
        e->point_count += e->lines[i].count;
    }
    if (n == 0) return TXM_OK;
    e->points = (txm_vec2 *)txm_arena_alloc(&e->memory, e->point_count, sizeof *e->points);
    if (!e->points) return txp_e_no_memory(env);
    for (size_t i = 0; i < n; i++) {
        memcpy(e->points + e->lines[i].first, points[i], e->lines[i].count * sizeof *e->points);
        if (txp_e_tick(bar, e->lines[i].count)) return txp_e_stopped(env);
    }
    return TXM_OK;
}

TEXEDGES_API txm_status texpatch_disturb(const texpatch_control *control, int width, int height,
                                         txm_env *env, texpatch_edges *out) {
    txp_e_bar bar;
    memset(&bar, 0, sizeof bar);
    bar.env = env;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    if (width < 1 || height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (width > TXP_E_SIDE || height > TXP_E_SIDE)
        return txm_fail(env, TXM_TOO_LARGE, "a side is longer than 2^20 pixels");
    txp_e_stage(&bar, "edges", 0.1, txp_e_points_of(control));
    txm_status status = txp_e_check_control(control, &bar, env);
    if (status != TXM_OK) return status;

    double work = 150 * (double)control->edges->point_count;
    for (int i = 0; i < control->stroke_count; i++) {
        const texpatch_stroke *s = &control->strokes[i];
        for (int k = 1; k < s->count; k++) {
            const txm_vec2 p = s->points[k - 1], q = s->points[k];
            const double dx = (double)q.x - p.x, dy = (double)q.y - p.y;
            work += 250 * sqrt(dx * dx + dy * dy);
        }
    }
    txp_e_stage(&bar, "strokes", 1, work);
    txm_arena lines;
    texpatch_edges e;
    memset(&e, 0, sizeof e);
    e.levels = control->edges->levels;
    e.width = width;
    e.height = height;
    memcpy(e.thresholds, control->edges->thresholds, sizeof e.thresholds);
    memcpy(e.beside, control->edges->beside, sizeof e.beside);
    txm_arena_init(&lines, env);
    txm_arena_init(&e.memory, env);
    status = txp_e_disturb(control, &bar, &lines, &e, env);
    txm_arena_free(&lines);
    if (status == TXM_OK) *out = e;
    else txm_arena_free(&e.memory);
    return status;
}

#endif /* TEXEDGES_STROKES_H */
