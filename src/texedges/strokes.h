#ifndef TEXEDGES_STROKES_H
#define TEXEDGES_STROKES_H

#include "roughness.h"

/* ---- disturbed strokes ----------------------------------------------------------------- */

/* Points of the outline of a stroke; with points NULL they are only counted. */
typedef struct txe_outline {
    txe_point *points;
    size_t count;
} txe_outline;

static void txe_outline_add(txe_outline *o, double x, double y) {
    if (o->points) {
        o->points[o->count].x = x;
        o->points[o->count].y = y;
    }
    o->count++;
}

/* One side of a band around n points, to the left of the line (back: of the reversed line), and the
   round cap at its end. Where the line turns away the gap is filled in steps of about a pixel. */
static int txe_band_side(const txe_point *p, size_t n, int back, double half, txe_outline *o,
                         txe_progress *bar) {
    txe_point d, before;
    d.x = 1;
    d.y = 0;
    for (size_t i = 1; i < n; i++) { /* the first direction there is */
        const size_t at = back ? n - i : i - 1, next = back ? at - 1 : at + 1;
        if (txe_distance(p[at], p[next]) > 1e-9) {
            txe_direction(p[at], p[next], &d);
            break;
        }
    }
    for (size_t i = 0; i < n; i++) {
        const size_t at = back ? n - 1 - i : i;
        const size_t low = at > 2 ? at - 2 : 0, high = at + 2 < n ? at + 2 : n - 1;
        before = d;
        txe_direction(p[back ? high : low], p[back ? low : high], &d);
        const int turns = i ? (int)(half * txe_distance(before, d)) : 0;
        for (int k = 1; k <= turns; k++) {
            txe_point mid, zero;
            zero.x = zero.y = 0;
            mid = before;
            txe_direction(zero, txe_between(before, d, (double)k / (turns + 1)), &mid);
            txe_outline_add(o, p[at].x + half * mid.y, p[at].y - half * mid.x);
        }
        txe_outline_add(o, p[at].x + half * d.y, p[at].y - half * d.x);
        if (txe_advance(bar, (size_t)turns + 1)) return 0;
    }
    /* a half circle of two quarters ((1 - t^2) u + 2 t v) / (1 + t^2): left, ahead, right */
    const txe_point end = p[back ? 0 : n - 1];
    const int steps = (int)(1.6 * half) + 1;
    for (int k = 1; k < 2 * steps; k++) {
        const double t = (double)(k < steps ? k : k - steps) / steps;
        const double c = half * (1 - t * t) / (1 + t * t), s = half * 2 * t / (1 + t * t);
        const double left = k < steps ? c : -s, ahead = k < steps ? s : c;
        txe_outline_add(o, end.x + left * d.y + ahead * d.x, end.y - left * d.x + ahead * d.y);
    }
    return !txe_advance(bar, 4 * (size_t)steps);
}

/* The outline of a stroke as a closed line with its inside to the right: of a closed stroke its
   points in that order; of an open one both sides of its band. */
static txm_status txe_outline_make(const texedges_stroke *s, txe_outline *o, txm_arena *arena,
                                   txe_progress *bar, txm_env *env) {
    const size_t n = (size_t)s->count;
    txe_point *given = (txe_point *)txm_arena_alloc(arena, n, sizeof *given);
    double area = 0;
    if (!given) return txe_no_memory(env);
    for (size_t i = 0; i < n; i++) {
        const txm_vec2 p = s->points[i], q = s->points[i + 1 < n ? i + 1 : 0], p0 = s->points[0];
        given[i].x = p.x;
        given[i].y = p.y;
        area += ((double)p.x - p0.x) * ((double)q.y - p0.y) -
                ((double)q.x - p0.x) * ((double)p.y - p0.y);
        if (txe_advance(bar, 1)) return txe_stopped(env);
    }
    if (s->is_closed) {
        for (size_t i = 0, j = n - 1; i < j && area < 0; i++, j--) {
            const txe_point p = given[i];
            given[i] = given[j];
            given[j] = p;
        }
        o->points = given;
        o->count = n;
        return TXM_OK;
    }
    const double length = txe_length(given, n, 0, bar);
    if (length < 0) return txe_stopped(env);
    const size_t m = (size_t)length + 2;
    txe_point *even = (txe_point *)txm_arena_alloc(arena, 2 * m, sizeof *even);
    if (!even) return txe_no_memory(env);
    if (!txe_resample(given, n, 0, length, even, m, bar) ||
        !txe_soften(even, m, 0, TXE_CORNER_BLUR, even + m, bar))
        return txe_stopped(env);
    const double half = 0.5 * (s->width > 0 ? s->width : 8);
    for (int pass = 0; pass < 2; pass++) { /* count, then keep */
        o->points =
            pass ? (txe_point *)txm_arena_alloc(arena, o->count, sizeof *o->points) : NULL;
        if (pass && !o->points) return txe_no_memory(env);
        o->count = 0;
        if (!txe_band_side(even + m, m, 0, half, o, bar) ||
            !txe_band_side(even + m, m, 1, half, o, bar))
            return txe_stopped(env);
    }
    return TXM_OK;
}

/* The point at index u, a fraction, of a closed line of n points. */
static txe_point txe_point_at(const txe_point *p, size_t n, double u) {
    const double wide = (double)n;
    if (u < 0) u += wide;
    if (u >= wide) u -= wide;
    size_t i = (size_t)u;
    if (i >= n) i = n - 1;
    return txe_between(p[i], p[i + 1 < n ? i + 1 : 0], u - (double)i);
}

/* Do the segments a b and c d cross? Where they only touch they do not. */
static int txe_cross(txm_vec2 a, txm_vec2 b, txm_vec2 c, txm_vec2 d, txm_vec2 *at) {
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

/* Cut loops of fewer than TXE_LOOP points off a closed line. Points are pushed onto a stack; where
   the segment to the next one crosses an earlier one, the stack is cut back to that and continues
   from the crossing. A second pass starts from another point, for loops through the first. Returns
   how many points remain; 0 = cancelled.
   scratch: room for n points */
static size_t txe_cut_loops(txm_vec2 *points, size_t n, txm_vec2 *scratch, txe_progress *bar) {
    for (int round = 0; round < 2; round++) {
        const size_t turn = n / 2;
        size_t top = 0;
        for (size_t i = 0; i <= n; i++) { /* the first point again at the end */
            const txm_vec2 next = points[(turn + i) % n];
            for (size_t k = 2; top > k && k <= TXE_LOOP; k++) { /* newest first: small loops */
                const txm_vec2 *old = scratch + top - k - 1;
                txm_vec2 at;
                if (i == n && old == scratch) break; /* they share the first point */
                if (!txe_cross(scratch[top - 1], next, old[0], old[1], &at)) continue;
                top -= k;
                scratch[top++] = at;
                k = 1;
            }
            if (i < n) {
                TXM_ASSERT(top < n); /* each point is pushed once, a crossing replaces two or more */
                scratch[top++] = next;
            }
            if (txe_advance(bar, TXE_LOOP)) return 0;
        }
        n = top;
        memcpy(points, scratch, n * sizeof *points);
    }
    return n;
}

/* The outline o displaced by up to `most` pixels, in memory of the arena. */
static txm_status txe_displace(const txe_roughness *u, double most, txm_rng *rng,
                               const txe_outline *o, txm_vec2 **points, size_t *count,
                               txm_arena *arena, txe_progress *bar, txm_env *env) {
    const double length = txe_length(o->points, o->count, 1, bar);
    if (length < 0) return txe_stopped(env);
    if (most > length / 16) most = length / 16;
    if (length > 4 * (double)TXE_MAX_LENGTH)
        return txm_fail_at(env, TXM_TOO_LARGE, "strokes", "have too many turns for their width");
    const size_t n = length > 16 ? (size_t)(length + 0.5) : 16, shortest = TXE_PIECE / 3;
    size_t m = (size_t)(length / u->step + 0.5);
    if (m < shortest) m = shortest;
    txe_point *even = (txe_point *)txm_arena_alloc(arena, n, 2 * sizeof *even);
    txe_sample *row = (txe_sample *)txm_arena_alloc(arena, m, sizeof *row);
    txm_vec2 *line = (txm_vec2 *)txm_arena_alloc(arena, m + 1, 2 * sizeof *line);
    if (arena->failed) return txe_no_memory(env);
    const txe_point *soft = even + n;
    const size_t corner = n < 8 * TXE_CORNER_BLUR ? n / 8 : (size_t)TXE_CORNER_BLUR;
    if (!txe_resample(o->points, o->count, 1, length, even, n, bar) ||
        !txe_soften(even, n, 1, corner, even + n, bar) || !txe_chain_pieces(u, rng, row, m, bar))
        return txe_stopped(env);

    double sum = 0, at = 0;
    for (size_t k = 0; k < m; k++) sum += row[k].step;
    const double stretch = sum > 0 ? (double)n / sum : 0; /* stroke samples per step */
    const double scale = most / TXE_MAX_OFFSET;
    const double chord = n < 4 * TXE_CHORD ? (double)n / 4 : (double)TXE_CHORD;
    txe_point direction;
    direction.x = 1;
    direction.y = 0;
    for (size_t k = 0; k < m; k++) {
        const txe_point p = txe_point_at(soft, n, at), given = txe_point_at(even, n, at);
        txe_direction(txe_point_at(soft, n, at - chord), txe_point_at(soft, n, at + chord),
                      &direction);
        const double room = most - txe_distance(p, given);
        const double ahead = row[k].ahead * scale, right = row[k].right * scale;
        const double off = sqrt(ahead * ahead + right * right);
        const double factor = off <= room ? 1 : room > 0 ? room / off : 0;
        line[k].x = txm_float(p.x + factor * (ahead * direction.x - right * direction.y));
        line[k].y = txm_float(p.y + factor * (ahead * direction.y + right * direction.x));
        at += row[k].step * stretch;
        if (txe_advance(bar, 4)) return txe_stopped(env);
    }
    *points = line;
    *count = txe_cut_loops(line, m, line + m + 1, bar);
    return *count ? TXM_OK : txe_stopped(env);
}

/* The line of one stroke, in memory of `lines`. */
static txm_status txe_stroke(const texedges_control *c, int i, const txe_roughness *u,
                             txm_vec2 **points, size_t *count, txm_arena *lines, txe_progress *bar,
                             txm_env *env) {
    const texedges_stroke *s = &c->strokes[i];
    const double width = s->is_closed ? 256 : s->width > 0 ? s->width : 8; /* sides stay apart */
    const double most = width < 8 ? width * TXE_MAX_OFFSET / 8 : TXE_MAX_OFFSET;
    txm_arena work;
    txe_outline o;
    txm_vec2 *made = NULL;
    txm_rng rng = txm_rng_make(c->seed, (uint64_t)i);
    txm_arena_init(&work, env);
    memset(&o, 0, sizeof o);
    txm_status status = txe_outline_make(s, &o, &work, bar, env);
    const int is_plain = c->disturb < 0 || u->start_count == 0;
    *count = o.count;
    if (status == TXM_OK && !is_plain)
        status = txe_displace(u, most, &rng, &o, &made, count, &work, bar, env);
    if (status == TXM_OK) {
        *points = (txm_vec2 *)txm_arena_alloc(lines, *count, sizeof **points);
        if (!*points) status = txe_no_memory(env);
    }
    for (size_t k = 0; k < *count && status == TXM_OK; k++) {
        (*points)[k] =
            is_plain ? txm_v2(txm_float(o.points[k].x), txm_float(o.points[k].y)) : made[k];
        if (txe_advance(bar, 1)) status = txe_stopped(env);
    }
    txm_arena_free(&work);
    return status;
}

/* All strokes, layer by layer, so that the roughness of one layer at a time is held. */
static txm_status txe_disturb(const texedges_control *c, txe_progress *bar, txm_arena *lines,
                              texedges_set *e, txm_env *env) {
    const size_t n = (size_t)c->stroke_count;
    txm_vec2 **points = (txm_vec2 **)txm_arena_alloc(lines, n, sizeof(txm_vec2 *));
    e->lines = (texedges_polyline *)txm_arena_zero(&e->memory, n, sizeof *e->lines);
    if (lines->failed || e->memory.failed) return txe_no_memory(env);
    for (int layer = 0; layer < e->levels; layer++) {
        txm_arena held;
        txe_roughness u;
        int is_used = 0;
        txm_status status = TXM_OK;
        memset(&u, 0, sizeof u);
        for (int i = 0; i < c->stroke_count; i++) is_used |= c->strokes[i].layer == layer;
        txm_arena_init(&held, env);
        if (is_used && c->disturb >= 0)
            status = txe_measure_layer(&u, c->edges, layer, c->disturb > 0 ? c->disturb : 1, &held,
                                       bar, env);
        for (int i = 0; i < c->stroke_count && status == TXM_OK && is_used; i++) {
            if (c->strokes[i].layer != layer) continue;
            e->lines[i].layer = layer;
            status = txe_stroke(c, i, &u, &points[i], &e->lines[i].count, lines, bar, env);
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
    if (!e->points) return txe_no_memory(env);
    for (size_t i = 0; i < n; i++) {
        memcpy(e->points + e->lines[i].first, points[i], e->lines[i].count * sizeof *e->points);
        if (txe_advance(bar, e->lines[i].count)) return txe_stopped(env);
    }
    return TXM_OK;
}

TEXEDGES_API txm_status texedges_disturb(const texedges_control *control, int width, int height,
                                         txm_env *env, texedges_set **out) {
    txe_progress bar = txe_progress_of(env);
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (width < 1 || height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (width > TXE_MAX_SIDE || height > TXE_MAX_SIDE)
        return txm_fail(env, TXM_TOO_LARGE, "a side is longer than 2^20 pixels");
    txe_stage(&bar, "edges", 0.1, txe_points_of(control));
    txm_status status = txe_check_control(control, &bar, env);
    if (status != TXM_OK) return status;

    double work = 150 * (double)control->edges->point_count;
    for (int i = 0; i < control->stroke_count; i++) {
        const texedges_stroke *s = &control->strokes[i];
        for (int k = 1; k < s->count; k++) {
            const txm_vec2 p = s->points[k - 1], q = s->points[k];
            const double dx = (double)q.x - p.x, dy = (double)q.y - p.y;
            work += 250 * sqrt(dx * dx + dy * dy);
        }
    }
    txe_stage(&bar, "strokes", 1, work);
    txm_arena lines;
    texedges_set *set = txe_set_make(control->edges->levels, width, height, env);
    if (!set) return txe_no_memory(env);
    memcpy(set->thresholds, control->edges->thresholds, sizeof set->thresholds);
    memcpy(set->beside, control->edges->beside, sizeof set->beside);
    txm_arena_init(&lines, env);
    status = txe_disturb(control, &bar, &lines, set, env);
    txm_arena_free(&lines);
    if (status == TXM_OK) *out = set;
    else texedges_set_free(set);
    return status;
}

#endif /* TEXEDGES_STROKES_H */
