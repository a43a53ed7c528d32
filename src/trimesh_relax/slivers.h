#ifndef TRIMESH_RELAX_SLIVERS_H
#define TRIMESH_RELAX_SLIVERS_H

#include "trial.h"

/* ---- the worst triangles ------------------------------------------------------------------ */

/* Where a surface is curved more tightly than triangles can follow, at tips, and between creases, some
   triangles stay thin whatever relaxation does. Around each of these every flip, collapse and split is
   tried, as with dislocations, until none helps. See docs/choices.md#slivers. */
enum {
    TMR_SLIVER_PASSES = 4, /* ours: over the mesh, at most                                        */
    TMR_SLIVER_SHARE = 50  /* ours: one for so many vertices is tried; with more the input is thin */
};
#define TMR_SLIVER 0.75         /* ours: quality below which a triangle is worth it                  */
#define TMR_SHORT_LINE 0.5      /* ours: two corners so close, in edge lengths, may become one       */

static int tmr_is_sliver(const tmr_work *w, int32_t face) {
    const tmr_mesh *m = &w->m;
    const int32_t *v = m->vertex + 3 * face;
    if (v[0] < 0 || tmr_is_ghost_face(m, face)) return 0;
    return tmr_quality(m->p[v[0]], m->p[v[1]], m->p[v[2]],
                       tmr_expected_normal(w, v[0], v[1], v[2])) < TMR_SLIVER;
}

/* May b = vertex[prev(c)], a corner, be merged into a = vertex[next(c)], another one, to which a short
   line leads at which the mesh turns by less than 60 degrees? The lines of b end in a then. */
static int tmr_can_merge(tmr_work *w, int32_t c) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const uint8_t flags = m->flags[b];
    if (!m->edge[c] || tmr_edge_size(w, c) > TMR_SHORT_LINE) return 0;
    const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
    if (tmr_is_ghost(m, d) || tmr_is_ghost(m, e)) return 0;
    const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[d], m->p[a], m->p[b]));
    if (txm_d3_dot(n, txm_d3_unit(txm_d3_area2(m->p[e], m->p[b], m->p[a]))) < 0.5) return 0;
    m->flags[b] = (uint8_t)(flags - TRIMESH_CORNER + TRIMESH_CREASE); /* otherwise it must stay */
    const int can = tmr_can_collapse(m, c);
    m->flags[b] = flags;
    return can && tmr_collapse_is_fair(w, c, m->p[a], 0);
}

/* Collapse the edge opposite to c, on trial. */
static int tmr_try_merge(tmr_work *w, tmr_patch *patch, int32_t c) {
    tmr_mesh *m = &w->m;
    const int corners = tmr_kind_of(m, m->vertex[tmr_next(c)]) == TRIMESH_CORNER &&
                        tmr_kind_of(m, m->vertex[tmr_prev(c)]) == TRIMESH_CORNER;
    /* where lines are spaced otherwise than the inside, what is on them stays */
    if (m->edge[c] && (w->line_scale < 1 || w->line_scale > 1)) return 0;
    if (corners && !tmr_can_merge(w, c)) return 0;
    if (!tmr_patch_keep(w, patch, c)) return 0;
    if (corners) tmr_collapse(m, c);
    else if (!tmr_try_collapse(w, c, 0, 1)) return 0;
    return tmr_patch_judge(w, patch, 0);
}

static int tmr_try_split(tmr_work *w, tmr_patch *patch, int32_t c) {
    if (!tmr_patch_keep(w, patch, c)) return 0;
    patch->added = tmr_split_edge(w, c);
    return patch->added >= 0 && tmr_patch_judge(w, patch, 0);
}

static int tmr_try_turn(tmr_work *w, tmr_patch *patch, int32_t c) {
    if (!tmr_can_flip(&w->m, c) || !tmr_patch_keep(w, patch, c)) return 0;
    tmr_flip(&w->m, c);
    return tmr_patch_judge(w, patch, 0);
}

/* One pass over the mesh. Returns how many triangles were mended; -1: cancelled. */
static int32_t tmr_sliver_pass(tmr_work *w, tmr_patch *patch, int count_too, int32_t *budget) {
    const int32_t faces = w->m.face_count;
    int32_t steps = 0;
    for (int32_t f = 0; f < faces && *budget > 0; f++) {
        if (!tmr_is_sliver(w, f)) continue;
        --*budget;
        if (tmr_tick(w, 10 * TMR_TICK_TRIAL)) return -1; /* each way of mending it is tried */
        int done = 0;
        for (int32_t c = 3 * f; c < 3 * f + 3 && !done; c++) done = tmr_try_turn(w, patch, c);
        for (int32_t c = 3 * f; c < 3 * f + 3 && !done && count_too; c++) {
            if (tmr_is_ghost(&w->m, w->m.vertex[w->m.opposite[c]])) continue;
            done = tmr_try_merge(w, patch, c) || tmr_try_merge(w, patch, w->m.opposite[c]) ||
                   tmr_try_split(w, patch, c);
        }
        steps += done;
    }
    return steps;
}

/* Mend the worst triangles. count_too: the number of vertices may change. */
static txm_status tmr_mend_slivers(tmr_work *w, int count_too, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    tmr_patch *patch = (tmr_patch *)txm_arena_zero(scratch, 1, sizeof *patch);
    if (!patch) return TXM_OUT_OF_MEMORY;
    patch->lines_too = 1;
    w->pull = w->step = 1;
    memset(w->bad, 0, (size_t)m->vertex_limit);
    memset(w->flag, 0, (size_t)m->face_limit);
    int32_t budget = m->live / TMR_SLIVER_SHARE + 20;
    for (int pass = 0; pass < TMR_SLIVER_PASSES; pass++) {
        const int32_t steps = tmr_sliver_pass(w, patch, count_too, &budget);
        if (steps < 0) return TXM_CANCELLED;
        if (steps == 0) break;
        if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_SLIVERS_H */
