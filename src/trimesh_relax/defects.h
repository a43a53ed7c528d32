#ifndef TRIMESH_RELAX_DEFECTS_H
#define TRIMESH_RELAX_DEFECTS_H

#include "count.h"
#include "trial.h"

/* ---- defects of the lattice --------------------------------------------------------------- */

/* A pair of neighbours of valence five and seven is a dislocation: a row of the lattice ends there. A
   flip moves it along the row, a vertex taken out or put in moves it across; two that meet may cancel.
   Relaxation alone moves none, since each step leads over a state that is worse than both its ends. So
   the steps are tried, relaxed and judged by the strain that is left.

   Not all dislocations can go: where a surface is curved, equal triangles need them. See
   docs/choices.md#defects. */
enum {
    TMR_DEFECT_PASSES = 6, /* ours: over the mesh, at most                                        */
    TMR_DEFECT_COST = 2,   /* ours: a flip may raise the cost of valences by so much              */
    TMR_DEFECT_BOUND = 8   /* ours: no trial where more triangles than this hang on lines         */
};
#define TMR_VERTEX_PRICE 0.01 /* ours: strain that a vertex is worth, for each one too many       */

typedef struct tmr_defects {
    tmr_work *w;
    tmr_patch *patch;
    uint8_t *was;   /* 1 per vertex: the mesh around it has changed in the last pass              */
    int32_t target; /* vertices                                                                   */
    double price;   /* strain that a vertex is worth, for each one too many                       */
} tmr_defects;

/* Mark the patch as changed, in w->mask_room, if the trial has succeeded. */
static int tmr_defect_done(tmr_defects *d, double price) {
    tmr_work *w = d->w;
    tmr_patch *patch = d->patch;
    if (!tmr_patch_judge(w, patch, price)) return 0;
    for (int i = 0; i < patch->core; i++) w->mask_room[patch->vertex[i].vertex] = 1;
    if (patch->added >= 0) w->mask_room[patch->added] = 1;
    return 1;
}

static int tmr_defect_keep(tmr_defects *d, int32_t c) {
    return tmr_patch_keep(d->w, d->patch, c) && d->patch->bound <= TMR_DEFECT_BOUND;
}

static int tmr_try_flip(tmr_defects *d, int32_t c) {
    tmr_work *w = d->w;
    if (tmr_flip_gain(&w->m, c) < -TMR_DEFECT_COST || !tmr_can_flip(&w->m, c)) return 0;
    if (!tmr_defect_keep(d, c)) return 0;
    tmr_flip(&w->m, c);
    return tmr_defect_done(d, 0);
}

static int tmr_try_removal(tmr_defects *d, int32_t c) {
    tmr_work *w = d->w;
    if (tmr_count_cost(&w->m, c, -1) > 0 || !tmr_can_collapse(&w->m, c)) return 0;
    if (!tmr_defect_keep(d, c) || !tmr_try_collapse(w, c, 0, 1)) return 0;
    return tmr_defect_done(d, -d->price * (w->m.live + 1 - d->target));
}

/* A vertex is put in by a split of c's edge a b, which gives it four neighbours, and a flip of one of
   the outer edges of the two triangles, which gives it a fifth: of a d, where d is the third corner of
   one of them, e that of the other, and y lies behind a d. There are four such edges. a has one
   neighbour less then, e and y have one more.

   Returns the corner at y, -1 if that edge stays; *cost receives the change of the cost of valences. */
static int32_t tmr_insertion(const tmr_mesh *m, int32_t c, int which, int64_t *cost) {
    const int32_t i = which & 2 ? m->opposite[c] : c; /* at d */
    const int32_t side = which & 1 ? tmr_next(i) : tmr_prev(i), y = m->opposite[side];
    const int32_t a = m->vertex[which & 1 ? tmr_prev(i) : tmr_next(i)];
    const int32_t e = m->vertex[m->opposite[i]];
    if (m->edge[side] || tmr_is_ghost(m, m->vertex[y])) return -1;
    *cost = 1; /* of v, which has five neighbours */
    *cost += tmr_valence_cost(m, a, -1) - tmr_valence_cost(m, a, 0);
    *cost += tmr_valence_cost(m, e, 1) - tmr_valence_cost(m, e, 0);
    *cost += tmr_valence_cost(m, m->vertex[y], 1) - tmr_valence_cost(m, m->vertex[y], 0);
    return y;
}

static int tmr_try_insertions(tmr_defects *d, int32_t c) {
    tmr_work *w = d->w;
    for (int which = 0; which < 4; which++) {
        int64_t cost;
        const int32_t y = tmr_insertion(&w->m, c, which, &cost);
        if (y < 0 || cost > 0 || !tmr_defect_keep(d, c)) continue;
        d->patch->added = tmr_split_edge(w, c);
        if (d->patch->added < 0) return 0;
        if (!tmr_can_flip(&w->m, y)) {
            tmr_patch_restore(w, d->patch);
            continue;
        }
        tmr_flip(&w->m, y);
        if (tmr_defect_done(d, d->price * (w->m.live - 1 - d->target))) return 1;
    }
    return 0;
}

/* One pass over the edges of which an end or opposite vertex has changed. Returns how many steps were
   taken; -1: cancelled. */
static int32_t tmr_defect_pass(tmr_defects *d) {
    tmr_work *w = d->w;
    tmr_mesh *m = &w->m;
    const int32_t corners = 3 * m->face_count;
    int32_t steps = 0;
    memcpy(d->was, w->mask_room, (size_t)m->vertex_count);
    memset(d->was + m->vertex_count, 0, (size_t)(m->vertex_limit - m->vertex_count));
    memset(w->mask_room, 0, (size_t)m->vertex_limit);
    for (int32_t c = 0; c < corners; c++) {
        if (!tmr_is_real_edge(m, c) || m->edge[c]) continue;
        const int32_t end[4] = {m->vertex[tmr_next(c)], m->vertex[tmr_prev(c)], m->vertex[c],
                                m->vertex[m->opposite[c]]};
        int changed = 0, loose = 0;
        for (int k = 0; k < 4; k++) {
            changed |= d->was[end[k]] | w->mask_room[end[k]];
            loose += tmr_kind_of(m, end[k]) == TRIMESH_FREE;
        }
        if (changed && tmr_tick(w, TMR_TICK_TRIAL)) return -1;
        if (!changed || loose < 2 || tmr_is_ghost(m, end[2]) || tmr_is_ghost(m, end[3])) continue;
        const int is_free =
            tmr_kind_of(m, end[0]) == TRIMESH_FREE && tmr_kind_of(m, end[1]) == TRIMESH_FREE;
        steps += tmr_try_flip(d, c) ||
                 (is_free && (tmr_try_removal(d, c) || tmr_try_insertions(d, c)));
    }
    return steps;
}

static txm_status tmr_defects_begin(tmr_defects *d, tmr_work *w, int32_t target, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    d->w = w;
    d->target = target;
    d->price = TMR_VERTEX_PRICE;
    d->patch = (tmr_patch *)txm_arena_zero(scratch, 1, sizeof *d->patch);
    d->was = (uint8_t *)txm_arena_alloc(scratch, (size_t)m->vertex_limit, 1);
    if (!d->patch || !d->was) return TXM_OUT_OF_MEMORY;
    w->pull = w->step = 1;
    w->length = tmr_ideal_length(w) * sqrt((double)m->live / target);
    memset(w->bad, 0, (size_t)m->vertex_limit);
    memset(w->flag, 0, (size_t)m->face_limit);
    memset(w->mask_room, 1, (size_t)m->vertex_limit);
    return TXM_OK;
}

/* Move and cancel the dislocations of a mesh that is nearly relaxed, at about target vertices. */
static txm_status tmr_mend_defects(tmr_work *w, int32_t target, txm_arena *scratch) {
    tmr_defects d;
    const txm_status status = tmr_defects_begin(&d, w, target, scratch);
    for (int pass = 0; pass < TMR_DEFECT_PASSES && status == TXM_OK; pass++) {
        if (txm_progress(w->env, 0, "relax")) return TXM_CANCELLED;
        const int32_t steps = tmr_defect_pass(&d);
        if (steps < 0) return TXM_CANCELLED;
        if (steps == 0) break;
    }
    return status;
}

enum { TMR_COUNT_PASSES = 6 }; /* ours: at most                                                    */
#define TMR_COUNT_PRICE 0.05   /* ours: strain that one vertex may cost in the first pass          */

/* Bring a finished mesh from nearly the right number to the target: beside dislocations, where
   that costs little strain, from pass to pass twice as much. Some may be left. */
static txm_status tmr_count_beside_defects(tmr_work *w, int32_t target, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    tmr_defects d;
    if (m->live == target) return TXM_OK;
    const txm_status status = tmr_defects_begin(&d, w, target, scratch);
    double price = TMR_COUNT_PRICE;
    for (int pass = 0; pass < TMR_COUNT_PASSES && status == TXM_OK; pass++, price *= 2) {
        if (txm_progress(w->env, 0, "relax")) return TXM_CANCELLED;
        for (int32_t c = 0; c < 3 * m->face_count && m->live != target; c++) {
            const int32_t missing = target - m->live;
            if (!tmr_is_real_edge(m, c) || m->edge[c]) continue;
            if (tmr_kind_of(m, m->vertex[tmr_next(c)]) != TRIMESH_FREE ||
                tmr_kind_of(m, m->vertex[tmr_prev(c)]) != TRIMESH_FREE)
                continue;
            if (tmr_tick(w, TMR_TICK_TRIAL)) return TXM_CANCELLED;
            d.price = price / (missing < 0 ? -missing : missing);
            if (missing < 0) tmr_try_removal(&d, c);
            else tmr_try_insertions(&d, c);
        }
    }
    return status;
}

#endif /* TRIMESH_RELAX_DEFECTS_H */
