#ifndef TRIMESH_RELAX_COUNT_H
#define TRIMESH_RELAX_COUNT_H

#include "collapse.h"

/* ---- the right number --------------------------------------------------------------------- */

enum {
    TMR_MOST_COST = 4000000, /* costs above this rank alike: keys, which have three decimals, have 32 bits */
    TMR_IDLE = 3             /* ours: after so many passes without a change stronger means are tried */
};

/* how collapsing (sign -1) or splitting (+1) the edge of c would change the cost of valences */
static int64_t tmr_count_cost(const tmr_mesh *m, int32_t c, int sign) {
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
    int64_t cost = 0;
    if (!tmr_is_ghost(m, d)) cost += tmr_valence_cost(m, d, sign) - tmr_valence_cost(m, d, 0);
    if (!tmr_is_ghost(m, e)) cost += tmr_valence_cost(m, e, sign) - tmr_valence_cost(m, e, 0);
    if (sign > 0) return cost + 4;
    return cost + tmr_valence_cost(m, a, m->valence[b] - 4) - tmr_valence_cost(m, a, 0) -
           tmr_valence_cost(m, b, 0);
}

/* Mark the vertices around the edge of c; 0 if one of them is marked already. */
static int tmr_claim(tmr_work *w, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t end[2] = {tmr_next(c), tmr_prev(c)};
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < 2; k++) {
            int32_t i = end[k];
            do {
                const int32_t v = m->vertex[tmr_next(i)];
                if (pass == 0 && w->bad[v] && !tmr_is_ghost(m, v)) return 0;
                if (pass == 1) w->bad[v] = 1;
                i = tmr_swing(m, i);
            } while (i != end[k]);
        }
    }
    return 1;
}

/* Split or collapse edges where it disturbs the pattern least, until there are target vertices,
   with a few rounds of relaxation in between. *missing receives how many vertices are missing at
   the end (negative: too many). */
static txm_status tmr_fix_count(tmr_work *w, int32_t target, int relaxations, txm_arena *scratch,
                                int32_t *missing) {
    tmr_mesh *m = &w->m;
    const size_t most = (size_t)m->face_limit * 3 / 2 + 1; /* edges there can ever be */
    txm_pair *pairs, *room;
    *missing = target - m->live;
    if (*missing == 0) return TXM_OK;
    int idle = 0; /* passes without any change */
    pairs = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    room = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    for (int pass = 0; pass < 60 && *missing; pass++) {
        const int sign = *missing > 0 ? 1 : -1;
        size_t count = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (!tmr_is_real_edge(m, c)) continue;
            if ((m->flags[m->vertex[tmr_next(c)]] | m->flags[m->vertex[tmr_prev(c)]]) & TMR_PINNED)
                continue;
            const double size = tmr_edge_size(w, c);
            if (sign > 0 && size < 0.6 && pass < 30) continue;
            TRIMESH_ASSERT(count < most);
            const int64_t full = tmr_count_cost(m, c, sign);
            const int64_t cost = full < TMR_MOST_COST ? full : (int64_t)TMR_MOST_COST;
            pairs[count].key = (uint32_t)(1000 * (100 + cost) -
                                          sign * (int)(300 * fmin(size, 3)) +
                                          (m->edge[c] ? 2000 : 0));
            pairs[count++].value = (uint32_t)c;
        }
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        txm_sort_pairs(pairs, room, count);
        memset(w->bad, 0, (size_t)m->vertex_count);
        int32_t done = 0;
        for (size_t i = 0; i < count && *missing; i++) {
            const int32_t c = (int32_t)pairs[i].value, before = m->live;
            if (m->vertex[c] < 0 || (pass < 40 && !tmr_claim(w, c))) continue;
            if (sign > 0) {
                const int32_t v = tmr_split_edge(w, c);
                if (v >= 0) w->bad[v] = 1;
            } else {
                tmr_try_collapse(w, c, pass < 20 ? 1.9 : 0, 1);
            }
            done += m->live != before;
            *missing = target - m->live;
            /* not too many at once, so that the others are ranked again */
            if (pass < 8 && done * 4 > (*missing < 0 ? -*missing : *missing) + 8) break;
        }
        /* relax where something was changed */
        memcpy(w->mask_room, w->bad, (size_t)m->vertex_count);
        w->mask = pass % 4 == 3 ? NULL : w->mask_room;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        tmr_flip_valences(w, 2, 0.4);
        for (int k = 0; k < relaxations; k++) {
            if (tmr_tick(w, m->live)) return TXM_CANCELLED;
            tmr_relax(w);
        }
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        tmr_flip_delaunay(w, 2);
        w->mask = NULL;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
        if (done == 0 && pass >= 40) break;
        idle = done ? 0 : idle + 1;
        if (idle == TMR_IDLE) { /* go on to what allows more */
            pass = pass < 20 ? 19 : pass < 30 ? 29 : 39;
            idle = 0;
        }
    }
    return TXM_OK;
}

/* ---- resampling --------------------------------------------------------------------------- */

/* Bring the copy of the surface to about two vertices per lattice point to come. */
static txm_status tmr_resample(tmr_work *w) {
    const double aim = sqrt(0.5); /* of edges, relative to w->length */
    /* lines first: the inside is then split to fit them */
    tmr_split_long(w, 1e9, 1.0);
    /* fine input: collapse edges, the shortest first, in one direction too: a fan over a side with a
       thousand vertices consists of splinters */
    double limit = 0.05 * aim;
    while (limit < 0.72 * aim) {
        w->splinters = 1;
        tmr_collapse_short(w, limit, limit * 1.2, 1.4 * aim, 0);
        w->splinters = 0;
        limit *= 1.5;
        if (txm_progress(w->env, 0, "resample")) return TXM_CANCELLED;
    }
    for (int round = 0; round < 24; round++) {
        const int32_t split = tmr_split_long(w, 1.4 * aim, 1.4);
        tmr_flip_delaunay(w, 4);
        const int32_t gone = tmr_collapse_short(w, 0.7 * aim, 0.7, 1.4 * aim, 0);
        tmr_flip_delaunay(w, 2);
        if (round >= 3 && (split + gone) * 200.0 < w->m.live) break;
        if (txm_progress(w->env, 0, "resample")) return TXM_CANCELLED;
    }
    return TXM_OK;
}

/* Collapse edges of lines that have more than fit their length; the others are spaced evenly later. */
static txm_status tmr_thin_lines(tmr_work *w, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    const tmr_lines *l = w->l;
    if (l->line_count == 0) return TXM_OK;
    int32_t *over = (int32_t *)txm_arena_alloc(scratch, (size_t)l->line_count, sizeof(int32_t));
    if (!over) return TXM_OUT_OF_MEMORY;
    for (int32_t i = 0; i < l->line_count; i++) {
        const int32_t fit = (int32_t)(l->length[i] / (w->length * w->line_scale) + 0.5);
        const int32_t least = l->closed[i] ? 3 : 1;
        over[i] = -(fit > least ? fit : least);
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++)
        if (tmr_is_real_edge(m, c) && m->edge[c]) over[m->edge[c] - 1]++;
    for (int32_t c = 0; c < 3 * m->face_count && !w->s->scale; c++) {
        if (!tmr_is_real_edge(m, c) || !m->edge[c] || over[m->edge[c] - 1] <= 0) continue;
        const int32_t line = m->edge[c] - 1;
        over[line] -= tmr_try_collapse(w, c, 0, 0);
    }
    return TXM_OK;
}

/* Spread the vertices of each line evenly along it. */
static void tmr_even_lines(tmr_work *w) {
    tmr_mesh *m = &w->m;
    int any = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        const int kind = m->corner[v] < 0 || tmr_is_ghost(m, v) ? 0 : tmr_kind_of(m, v);
        w->bad[v] = kind == TRIMESH_CREASE || kind == TRIMESH_BORDER; /* still to do */
        any |= w->bad[v];
        tmr_keep_place(w, v);
    }
    for (int32_t v = 0; v < m->vertex_count && any; v++) {
        int32_t two[2];
        if (!w->bad[v] || !tmr_line_neighbors(m, v, two)) continue;
        /* back to an end of the line, or all the way around to v */
        int32_t before = two[0], at = v, begin = -1;
        for (;;) {
            const int32_t next = before;
            if (tmr_kind_of(m, next) == TRIMESH_CORNER) {
                begin = next;
                break;
            }
            if (next == v || !tmr_line_neighbors(m, next, two)) break;
            before = two[0] == at ? two[1] : two[0];
            at = next;
        }
        /* now walk forward from there: first count, then place */
        const int32_t start = begin >= 0 ? begin : v, second = begin >= 0 ? at : -1;
        const int32_t line = w->l->line[m->source[v]];
        int32_t count = 0;
        for (int pass = 0; pass < 2; pass++) {
            int32_t from = start, to = second, i = 0;
            double way = 0;
            int forward = 1;
            if (begin < 0) {
                tmr_line_neighbors(m, v, two);
                to = two[1];
                way = tmr_line_way(w->s, w->l, m->p[v], m->source[v]);
            }
            if (pass == 1) {
                /* in which direction along the line? */
                const double w0 = tmr_line_way(w->s, w->l, m->p[to], m->source[to]);
                if (begin >= 0) {
                    const double nearby = w0, distant = w->l->length[line] - w0;
                    const txm_dvec3 first_point = w->s->point[w->l->a[w->l->first[line]]];
                    const txm_dvec3 last_point = w->s->point[w->l->b[w->l->first[line + 1] - 1]];
                    const double d_first = txm_d3_dist2(first_point, m->p[begin]);
                    const double d_last = txm_d3_dist2(last_point, m->p[begin]);
                    forward = d_first < d_last || (d_first <= d_last && nearby <= distant);
                    way = forward ? 0 : w->l->length[line];
                } else {
                    double d = w0 - way;
                    if (d < -0.5 * w->l->length[line]) d += w->l->length[line];
                    if (d > 0.5 * w->l->length[line]) d -= w->l->length[line];
                    forward = d >= 0;
                }
            }
            const double step = pass ? w->l->length[line] / (count + 1) * (forward ? 1 : -1) : 0;
            while (to != start && tmr_kind_of(m, to) != TRIMESH_CORNER) {
                i++;
                if (pass == 1) {
                    double x = way + step * i;
                    if (w->l->closed[line]) {
                        if (x < 0) x += w->l->length[line];
                        if (x >= w->l->length[line]) x -= w->l->length[line];
                    }
                    w->moved[to] = tmr_line_at(w->s, w->l, line, x, &w->landed[to]);
                    w->bad[to] = 0;
                }
                if (!tmr_line_neighbors(m, to, two)) break;
                const int32_t next = two[0] == from ? two[1] : two[0];
                from = to;
                to = next;
            }
            count = i;
        }
        w->bad[v] = 0;
    }
    if (any) tmr_settle(w);
}

#endif /* TRIMESH_RELAX_COUNT_H */
