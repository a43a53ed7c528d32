#ifndef TRIMESH_RELAX_CREASES_H
#define TRIMESH_RELAX_CREASES_H

#include "seams.h"
#include "bands.h"

/* ---- creases and borders as lines --------------------------------------------------------- */

/* Creases, seams and borders, cut into lines at the vertices that must stay: where they meet, end or turn
   sharply. A line is a run of segments, each an edge of the surface. */
typedef struct tmr_lines {
    int32_t line_count, segment_count;
    int32_t *first;   /* 1 per line and one more: its first segment                             */
    uint8_t *closed;  /* 1 per line: a loop without a corner                                    */
    uint8_t *border;  /* 1 per line: part of the border                                         */
    double *length;   /* 1 per line                                                             */
    int32_t *a, *b;   /* 1 per segment: its vertices on the surface                             */
    int32_t *face;    /* 1 per segment: a face beside it                                        */
    int32_t *line;    /* 1 per segment                                                          */
    double *start;    /* 1 per segment: distance from the beginning of the line to a            */
    int32_t *edge;    /* 1 per corner of the surface: 0, or 1 + the line that its edge is part of */
    uint8_t *kind;    /* 1 per vertex of the surface: trimesh_kind                              */
    uint8_t *smooth;  /* 1 per vertex of the surface: on seams, without a crease or border      */
    int32_t *segment; /* 1 per vertex of the surface: on a line one of its segments             */
} tmr_lines;

/* the edge opposite to corner c, seen from its vertex v: the other end */
static int32_t tmr_other_end(const tmr_surface *s, int32_t c, int32_t v) {
    const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
    return a == v ? b : a;
}

/* how far the surface turns at the edge opposite to c: 1 - cosine of the angle; 0 at the border */
static double tmr_turn_at(const tmr_surface *s, int32_t c) {
    const int32_t o = s->opposite[c];
    return o < 0 ? 0 : 1 - txm_d3_dot(s->normal[c / 3], s->normal[o / 3]);
}

#define TMR_GENTLE_CREASE 0.6 /* ours: see docs/choices.md#creases */

/* Which edges of the surface are creases? Those at which it turns by the angle or more, and clearly
   more than at the other edges of the two triangles, which tells a sharp edge from a coarse mesh:
   there it turns at most half as much. Where three or four edges of two triangles are sharp, as on
   small steps and pins, the angle alone decides if it is wide. Between flats as wide as about half
   an edge of the result, as beside a chamfer, TMR_GENTLE_CREASE of the angle is enough. Writes 1 per
   corner into s->edge_kind. Returns how many edges are creases. */
static size_t tmr_find_creases(tmr_surface *s, double angle, double spacing) {
    const double least = angle >= 180 ? 3 : 1 - txm_cos(angle * (TXM_PI / 180));
    const double gentle = angle >= 180 ? 3 : 1 - txm_cos(TMR_GENTLE_CREASE * angle * (TXM_PI / 180));
    const double sure = fmax(least, 1 - txm_cos(75 * (TXM_PI / 180)));
    size_t count = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t o = s->opposite[c];
        s->edge_kind[c] = o < 0 ? TMR_BORDER_EDGE : TMR_PLAIN_EDGE;
        const double turn = tmr_turn_at(s, c);
        if (o < 0 || turn < gentle) continue;
        /* how much the other edges turn, except those that are as sharp themselves */
        const double around[4] = {tmr_turn_at(s, tmr_next(c)), tmr_turn_at(s, tmr_prev(c)),
                                  tmr_turn_at(s, tmr_next(o)), tmr_turn_at(s, tmr_prev(o))};
        double sum = 0;
        int sharp = 0;
        for (int k = 0; k < 4; k++) {
            sharp += around[k] > 0.5 * turn;
            sum += around[k] > 0.5 * turn ? 0 : around[k];
        }
        if (turn < sure && (sharp > 2 || sum > 0.25 * turn)) continue;
        if (turn < least && !tmr_is_between_flats(s, c, spacing)) continue;
        s->edge_kind[c] = TMR_CREASE_EDGE;
        count++;
    }
    return count / 2;
}

/* One entry per vertex and line edge at it, in the order of the vertices. */
typedef struct tmr_ends {
    int32_t *first;  /* per vertex, and one more */
    int32_t *corner; /* the edge opposite to it  */
} tmr_ends;

/* does this one of an edge's two corners represent it? */
static int tmr_represents_edge(const tmr_surface *s, int32_t c) {
    return s->opposite[c] < c;
}

static txm_status tmr_list_ends(const tmr_surface *s, txm_arena *arena, tmr_ends *ends) {
    const int32_t n = s->vertex_count;
    int32_t total = 0;
    ends->first = (int32_t *)txm_arena_zero(arena, (size_t)n + 2, sizeof(int32_t));
    if (!ends->first) return TXM_OUT_OF_MEMORY;
    int32_t *count = ends->first + 1;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (s->edge_kind[c] == TMR_PLAIN_EDGE || !tmr_represents_edge(s, c)) continue;
        count[s->vertex[tmr_next(c)]]++;
        count[s->vertex[tmr_prev(c)]]++;
        total += 2;
    }
    ends->corner = (int32_t *)txm_arena_alloc(arena, (size_t)total + 1, sizeof(int32_t));
    if (!ends->corner) return TXM_OUT_OF_MEMORY;
    int32_t sum = 0; /* first[v + 1] counts up from the place of v's first entry to its end */
    for (int32_t v = 0; v < n; v++) {
        const int32_t k = count[v];
        count[v] = sum;
        sum += k;
    }
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (s->edge_kind[c] == TMR_PLAIN_EDGE || !tmr_represents_edge(s, c)) continue;
        TRIMESH_ASSERT(count[s->vertex[tmr_next(c)]] < total && count[s->vertex[tmr_prev(c)]] < total);
        ends->corner[count[s->vertex[tmr_next(c)]]++] = c;
        ends->corner[count[s->vertex[tmr_prev(c)]]++] = c;
    }
    return TXM_OK;
}

/* Connected lines of less than the given length in all are noise, or cannot be followed: make them
   plain. Those with an edge of one of the kinds in the mask `kept` stay. */
static txm_status tmr_drop_short_lines(tmr_surface *s, const tmr_ends *ends, double least, int kept,
                                       txm_arena *arena) {
    const int32_t n = s->vertex_count;
    int32_t *stack = (int32_t *)txm_arena_alloc(arena, (size_t)n, sizeof(int32_t));
    uint8_t *seen = (uint8_t *)txm_arena_zero(arena, (size_t)n, 1);
    if (!stack || !seen) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < n; v++) {
        int32_t size = 0, done = 0;
        double length = 0;
        int stays = 0;
        if (seen[v] || ends->first[v] == ends->first[v + 1]) continue;
        seen[v] = 1;
        stack[size++] = v;
        for (; done < size; done++) {
            const int32_t u = stack[done];
            for (int32_t e = ends->first[u]; e < ends->first[u + 1]; e++) {
                const int32_t w = tmr_other_end(s, ends->corner[e], u);
                stays |= s->edge_kind[ends->corner[e]] & kept;
                length += 0.5 * txm_d3_dist(s->point[u], s->point[w]);
                if (!seen[w]) {
                    seen[w] = 1;
                    TRIMESH_ASSERT(size < n);
                    stack[size++] = w;
                }
            }
        }
        if (length >= least || stays) continue;
        for (int32_t i = 0; i < size; i++) {
            for (int32_t e = ends->first[stack[i]]; e < ends->first[stack[i] + 1]; e++) {
                const int32_t c = ends->corner[e];
                s->edge_kind[c] = TMR_PLAIN_EDGE;
                if (s->opposite[c] >= 0) s->edge_kind[s->opposite[c]] = TMR_PLAIN_EDGE;
            }
        }
    }
    return TXM_OK;
}

/* Direction from v along the line that starts with the edge of corner c, over about the distance
   reach, or less if the line branches. */
static txm_dvec3 tmr_line_direction(const tmr_surface *s, const tmr_ends *ends, int32_t v,
                                    int32_t c, double reach) {
    int32_t at = tmr_other_end(s, c, v), e = c;
    for (int i = 0; i < 1000; i++) {
        if (txm_d3_dist2(s->point[at], s->point[v]) >= reach * reach) break;
        if (ends->first[at + 1] - ends->first[at] != 2) break;
        const int32_t k = ends->first[at];
        e = ends->corner[k] == e ? ends->corner[k + 1] : ends->corner[k];
        at = tmr_other_end(s, e, at);
        if (at == v) break;
    }
    if (at == v) at = tmr_other_end(s, c, v);
    return txm_d3_unit(txm_d3_sub(s->point[at], s->point[v]));
}

/* The kind of every vertex; corners where lines meet, end, or turn by more than 40 degrees over
   the distance reach (the sharpest vertex of each bend only). */
static txm_status tmr_find_corners(const tmr_surface *s, const tmr_ends *ends, double reach,
                                   txm_arena *arena, uint8_t *kind) {
    const int32_t n = s->vertex_count;
    float *turn = (float *)txm_arena_zero(arena, (size_t)n, sizeof(float));
    if (!turn) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < n; v++) {
        const int32_t k = ends->first[v], count = ends->first[v + 1] - k;
        kind[v] = TRIMESH_FREE;
        if (count == 0) continue;
        kind[v] = TRIMESH_CORNER;
        if (count != 2) continue;
        const int32_t c = ends->corner[k], d = ends->corner[k + 1];
        if (tmr_line_class(s->edge_kind[c]) != tmr_line_class(s->edge_kind[d])) continue;
        kind[v] = s->edge_kind[c] == TMR_BORDER_EDGE ? TRIMESH_BORDER : TRIMESH_CREASE;
        turn[v] = (float)(1 + txm_d3_dot(tmr_line_direction(s, ends, v, c, reach),
                                         tmr_line_direction(s, ends, v, d, reach)));
    }
    const float limit = (float)(1 - txm_cos(40 * TXM_PI / 180));
    for (int32_t v = 0; v < n; v++) {
        int sharpest = turn[v] > limit;
        for (int32_t k = ends->first[v]; k < ends->first[v + 1] && sharpest; k++) {
            int32_t at = v, e = ends->corner[k];
            double way = 0;
            for (int i = 0; i < 1000 && sharpest; i++) {
                const int32_t next = tmr_other_end(s, e, at);
                way += txm_d3_dist(s->point[at], s->point[next]);
                at = next;
                if (way > reach || at == v || turn[at] <= 0) break;
                const float other = turn[at], own = turn[v];
                sharpest = other < own || (at >= v && other <= own);
                const int32_t j = ends->first[at];
                e = ends->corner[j] == e ? ends->corner[j + 1] : ends->corner[j];
            }
        }
        if (sharpest) kind[v] = TRIMESH_CORNER;
    }
    return TXM_OK;
}

enum { TMR_TIP_BALL = 64 }; /* vertices around a tip, at most                                  */
#define TMR_TIP_DEFECT 1.3  /* ours: radians of angle missing around a tip                    */

/* 2 pi minus the angles around each vertex: what is missing there for the surface to be flat. */
static void tmr_angle_defects(const tmr_surface *s, float *defect) {
    for (int32_t v = 0; v < s->vertex_count; v++) defect[v] = (float)(2 * TXM_PI);
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const txm_dvec3 p = s->point[s->vertex[c]];
        const txm_dvec3 a = txm_d3_sub(s->point[s->vertex[tmr_next(c)]], p);
        const txm_dvec3 b = txm_d3_sub(s->point[s->vertex[tmr_prev(c)]], p);
        defect[s->vertex[c]] -= txm_float(txm_atan2(txm_d3_len(txm_d3_cross(a, b)), txm_d3_dot(a, b)));
    }
}

/* Is v the tip of something thinner than an edge, such as a horn? The vertices within reach have a
   large angle defect in all, and none of them lies beyond v along its normal. */
static int tmr_is_tip(const tmr_surface *s, const float *defect, const uint8_t *kind, int32_t v,
                      double reach) {
    int32_t list[TMR_TIP_BALL];
    int count = 1;
    double sum = 0;
    list[0] = v;
    for (int i = 0; i < count; i++) {
        const int32_t u = list[i], first = s->corner[u];
        if (kind[u] != TRIMESH_FREE) return 0;
        if (txm_d3_dot(txm_d3_sub(s->point[u], s->point[v]), s->vertex_normal[v]) > 1e-9) return 0;
        sum += defect[u];
        for (int32_t c = first; c >= 0;) {
            const int32_t x = s->vertex[tmr_next(c)];
            int known = txm_d3_dist2(s->point[x], s->point[v]) > reach * reach;
            for (int j = 0; j < count && !known; j++) known = list[j] == x;
            if (!known && count == TMR_TIP_BALL) return 0;
            if (!known) list[count++] = x;
            c = tmr_ccw(s->opposite, c);
            if (c == first) break;
        }
    }
    return sum >= TMR_TIP_DEFECT;
}

/* Make the tips corners, so that they stay. */
static txm_status tmr_find_tips(const tmr_surface *s, double reach, txm_arena *scratch,
                                uint8_t *kind) {
    float *defect = (float *)txm_arena_alloc(scratch, (size_t)s->vertex_count, sizeof(float));
    if (!defect) return TXM_OUT_OF_MEMORY;
    tmr_angle_defects(s, defect);
    for (int32_t v = 0; v < s->vertex_count; v++)
        if (kind[v] == TRIMESH_FREE && defect[v] > 0 && tmr_is_tip(s, defect, kind, v, reach))
            kind[v] = TRIMESH_CORNER;
    return TXM_OK;
}

/* Add a line: from v over the edge of corner c to its end. */
static void tmr_trace(const tmr_surface *s, const tmr_ends *ends, tmr_lines *l, int32_t v,
                      int32_t c) {
    const int32_t id = l->line_count++, begin = v;
    double length = 0;
    l->first[id] = l->segment_count;
    l->border[id] = s->edge_kind[c] == TMR_BORDER_EDGE;
    for (;;) {
        TRIMESH_ASSERT(l->segment_count < ends->first[s->vertex_count] / 2);
        const int32_t k = l->segment_count++, w = tmr_other_end(s, c, v);
        l->a[k] = v;
        l->b[k] = w;
        l->face[k] = c / 3;
        l->line[k] = id;
        l->start[k] = length;
        length += txm_d3_dist(s->point[v], s->point[w]);
        l->edge[c] = 1 + id;
        if (s->opposite[c] >= 0) l->edge[s->opposite[c]] = 1 + id;
        l->segment[v] = l->segment[w] = k;
        v = w;
        if (v == begin || l->kind[v] == TRIMESH_CORNER) break;
        const int32_t e = ends->first[v];
        c = ends->corner[e] == c ? ends->corner[e + 1] : ends->corner[e];
    }
    l->closed[id] = v == begin && l->kind[v] != TRIMESH_CORNER;
    l->length[id] = length;
    l->first[id + 1] = l->segment_count;
}

/* Is this seam the only line at its end opposite to v? */
static int tmr_is_spoke(const tmr_surface *s, const tmr_ends *ends, int32_t v, int32_t c) {
    const int32_t w = tmr_other_end(s, c, v);
    return s->edge_kind[c] == TMR_SEAM_EDGE && ends->first[w + 1] - ends->first[w] == 1;
}

/* At the pole of a globe each triangle has texture coordinates of its own, and all edges there are seams
   that end at once: spokes, which are no cuts. Make plain those of vertices with two or more. */
static void tmr_drop_spokes(tmr_surface *s, const tmr_ends *ends) {
    for (int32_t v = 0; v < s->vertex_count; v++) {
        int spokes = 0;
        for (int32_t e = ends->first[v]; e < ends->first[v + 1]; e++)
            spokes += tmr_is_spoke(s, ends, v, ends->corner[e]);
        for (int32_t e = ends->first[v]; e < ends->first[v + 1] && spokes > 1; e++) {
            const int32_t c = ends->corner[e];
            if (!tmr_is_spoke(s, ends, v, c)) continue;
            s->edge_kind[c] = s->edge_kind[s->opposite[c]] = TMR_PLAIN_EDGE;
        }
    }
}

/* Find creases and seams, and list the ends of the edges that stay. */
static txm_status tmr_find_lines(tmr_surface *s, const trimesh_desc *desc, double angle,
                                 double spacing, txm_arena *scratch, tmr_ends *ends) {
    txm_status status;
    if (tmr_find_creases(s, angle, spacing)) {
        if ((status = tmr_list_ends(s, scratch, ends)) != TXM_OK) return status;
        status = tmr_drop_short_lines(s, ends, fmax(5 * spacing, 0.06), TMR_BORDER_EDGE, scratch);
        if (status != TXM_OK) return status;
    }
    if (desc->seams) {
        tmr_mark_seams(s, desc);
        if ((status = tmr_list_ends(s, scratch, ends)) != TXM_OK) return status;
        tmr_drop_spokes(s, ends);
        if ((status = tmr_list_ends(s, scratch, ends)) != TXM_OK) return status;
        status = tmr_drop_short_lines(s, ends, TMR_SHORTEST_SEAM * spacing,
                                      TMR_BORDER_EDGE | TMR_CREASE_EDGE, scratch);
        if (status != TXM_OK) return status;
    }
    return tmr_list_ends(s, scratch, ends);
}

/* Which vertices are on seams only? There the surface is smooth. */
static void tmr_find_smooth(const tmr_surface *s, const tmr_ends *ends, uint8_t *smooth) {
    for (int32_t v = 0; v < s->vertex_count; v++) {
        int kinds = 0;
        for (int32_t e = ends->first[v]; e < ends->first[v + 1]; e++)
            kinds |= s->edge_kind[ends->corner[e]];
        smooth[v] = kinds == TMR_SEAM_EDGE;
    }
}

/* Count the edges of creases and seams for the report. */
static void tmr_count_lines(const tmr_surface *s, trimesh_report *report) {
    report->crease_edges = report->seam_edges = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (!tmr_represents_edge(s, c)) continue;
        report->crease_edges += (s->edge_kind[c] & TMR_CREASE_EDGE) != 0;
        report->seam_edges += (s->edge_kind[c] & TMR_SEAM_EDGE) != 0;
    }
}

/* Find all lines. spacing: the edge length of the result, which decides which creases are too short
   and which bends too slight. */
static txm_status tmr_lines_build(tmr_surface *s, const trimesh_desc *desc, double angle,
                                  double spacing, txm_arena *arena, txm_arena *scratch,
                                  trimesh_report *report, tmr_lines *l) {
    tmr_ends ends;
    const size_t n = (size_t)s->vertex_count, corners = 3 * (size_t)s->face_count;
    txm_status status;
    if ((status = tmr_find_lines(s, desc, angle, spacing, scratch, &ends)) != TXM_OK) return status;
    /* each edge is listed at both its ends and becomes one segment; no line is without segments */
    const size_t segments = (size_t)ends.first[s->vertex_count] / 2;
    l->line_count = l->segment_count = 0;
    l->first = (int32_t *)txm_arena_zero(arena, segments + 1, sizeof(int32_t));
    l->closed = (uint8_t *)txm_arena_alloc(arena, segments + 1, 1);
    l->border = (uint8_t *)txm_arena_alloc(arena, segments + 1, 1);
    l->length = (double *)txm_arena_alloc(arena, segments + 1, sizeof(double));
    l->a = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->b = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->face = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->line = (int32_t *)txm_arena_alloc(arena, segments + 1, sizeof(int32_t));
    l->start = (double *)txm_arena_alloc(arena, segments + 1, sizeof(double));
    l->edge = (int32_t *)txm_arena_zero(arena, corners, sizeof(int32_t));
    l->kind = (uint8_t *)txm_arena_alloc(arena, n, 1);
    l->smooth = (uint8_t *)txm_arena_alloc(arena, n, 1);
    l->segment = (int32_t *)txm_arena_zero(arena, n, sizeof(int32_t));
    if ((status = tmr_check_memory(arena)) != TXM_OK) return status;
    tmr_find_smooth(s, &ends, l->smooth);
    status = tmr_find_corners(s, &ends, 0.75 * spacing, scratch, l->kind);
    if (status == TXM_OK && angle < 180)
        status = tmr_find_tips(s, 0.75 * spacing, scratch, l->kind);
    if (status != TXM_OK) return status;
    for (int pass = 0; pass < 2; pass++) { /* lines from corners; then closed ones  */
        for (int32_t v = 0; v < s->vertex_count; v++) {
            if ((l->kind[v] == TRIMESH_CORNER) != (pass == 0)) continue;
            for (int32_t k = ends.first[v]; k < ends.first[v + 1]; k++)
                if (!l->edge[ends.corner[k]]) tmr_trace(s, &ends, l, v, ends.corner[k]);
        }
    }
    tmr_count_lines(s, report);
    return TXM_OK;
}

/* Is segment k part of a seam where the surface is smooth? */
static int tmr_is_smooth_segment(const tmr_lines *l, int32_t k) {
    return l->smooth[l->a[k]] && l->smooth[l->b[k]];
}

/* the segment behind (step 1) or before (-1) segment k of its line; -1 at the end */
static int32_t tmr_segment_step(const tmr_lines *l, int32_t k, int step) {
    const int32_t line = l->line[k], first = l->first[line], last = l->first[line + 1] - 1;
    if (step > 0 && k == last) return l->closed[line] ? first : -1;
    if (step < 0 && k == first) return l->closed[line] ? last : -1;
    return k + step;
}

/* The place on the line nearest to p, found by walking from segment *k while the distance falls. */
static txm_dvec3 tmr_project_line(const tmr_surface *s, const tmr_lines *l, txm_dvec3 p,
                                  int32_t *k) {
    txm_dvec3 best = p;
    double least = -1;
    int direction = 0;
    for (int32_t i = *k, guard = l->segment_count + 1; i >= 0 && guard > 0; guard--) {
        const txm_dvec3 a = s->point[l->a[i]], ab = txm_d3_sub(s->point[l->b[i]], a);
        const double t = txm_d3_dot(txm_d3_sub(p, a), ab) / (txm_d3_len2(ab) + 1e-300);
        const txm_dvec3 q = txm_d3_mad(a, ab, t < 0 ? 0 : t > 1 ? 1 : t);
        const double d = txm_d3_dist2(p, q);
        if (least >= 0 && d >= least) break;
        least = d;
        best = q;
        *k = i;
        const int step = t < 0 ? -1 : t > 1 ? 1 : 0;
        if (step == 0 || step == -direction) break;
        direction = step;
        i = tmr_segment_step(l, i, step);
    }
    return best;
}

/* the place on a line at the distance from its beginning; *k: the segment it lies on */
static txm_dvec3 tmr_line_at(const tmr_surface *s, const tmr_lines *l, int32_t line, double way,
                             int32_t *k) {
    int32_t low = l->first[line], high = l->first[line + 1] - 1;
    while (low < high) { /* the last segment that starts at way or before */
        const int32_t middle = (low + high + 1) / 2;
        if (l->start[middle] <= way) low = middle;
        else high = middle - 1;
    }
    const double end = low + 1 < l->first[line + 1] ? l->start[low + 1] : l->length[line];
    const double span = end - l->start[low];
    double t = span > 0 ? (way - l->start[low]) / span : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    *k = low;
    const txm_dvec3 a = s->point[l->a[low]];
    return txm_d3_mad(a, txm_d3_sub(s->point[l->b[low]], a), t);
}

/* how far from the beginning of its line a place on segment k lies */
static double tmr_line_way(const tmr_surface *s, const tmr_lines *l, txm_dvec3 p, int32_t k) {
    return l->start[k] + txm_d3_dist(s->point[l->a[k]], p);
}

#endif /* TRIMESH_RELAX_CREASES_H */
