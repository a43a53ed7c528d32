#ifndef TRIMESH_RELAX_MEND_PAIRS_H
#define TRIMESH_RELAX_MEND_PAIRS_H

#include "surface.h"
#include "mend.h"

/* ---- mending: edges of more than two faces ------------------------------------------------ */

/* At such an edge the faces are paired, and each pair is joined as if the others were not there, so
   that sheets that touch along the edge become separate. Of an odd number one face is left over: the
   edge is part of its border. Every edge can be mended that way; which faces go together matters
   only for the shape. */

/* A face at an edge, as a spoke of a wheel seen along the edge, which runs from its lower vertex to
   the higher. */
typedef struct tmr_spoke {
    double angle;   /* around the edge, radians                                               */
    int32_t corner; /* opposite to the edge                                                   */
    int32_t patch;  /* faces that are connected over edges of two faces have the same number  */
    int along;      /* the face winds along the edge, not against it                          */
    int paired;
} tmr_spoke;

typedef struct tmr_wheel {
    tmr_spoke *spoke; /* room for the faces of any edge */
    int32_t *patch;   /* 1 per face                     */
    size_t pairs, singles; /* edges whose faces were paired; faces left over */
} tmr_wheel;

enum { TMR_WHEEL = 64 }; /* ours: of more faces at an edge neighbours are paired, the best are not sought */
#define TMR_APART 1e-4   /* ours: radians between two sheets that are clearly apart                   */
#define TMR_ALIKE 0.1    /* ours: radians: pairs that bend alike; then the patches decide, so that the
                            same sheets are paired all along a line of such edges                    */

static int tmr_spoke_before(const tmr_spoke *a, const tmr_spoke *b, int by_patch) {
    if (by_patch && a->patch != b->patch) return a->patch < b->patch;
    if (!by_patch && (a->angle < b->angle || a->angle > b->angle)) return a->angle < b->angle;
    return a->corner < b->corner;
}

/* Sort as a heap: no two spokes are equal. */
static void tmr_sort_spokes(tmr_spoke *spoke, int32_t count, int by_patch) {
    for (int32_t end = count, start = count / 2; end > 1;) {
        if (start > 0) start--; /* build the heap first, then take the last one off */
        else {
            const tmr_spoke last = spoke[--end];
            spoke[end] = spoke[0];
            spoke[0] = last;
        }
        for (int32_t root = start, child; (child = 2 * root + 1) < end; root = child) {
            if (child + 1 < end && tmr_spoke_before(spoke + child, spoke + child + 1, by_patch))
                child++;
            if (!tmr_spoke_before(spoke + root, spoke + child, by_patch)) break;
            const tmr_spoke moved = spoke[root];
            spoke[root] = spoke[child];
            spoke[child] = moved;
        }
    }
}

/* The faces around the edge of the sides begin to end - 1, by rising angle. Returns 0 if one of them
   has no area, so that its angle says nothing. */
static int tmr_spokes_make(const tmr_mend *m, int32_t begin, int32_t end, tmr_wheel *wheel) {
    const txm_mesh mesh = tmr_mend_mesh(m);
    const int32_t low = (int32_t)txm_mesh_low(&mesh, m->sides[begin]);
    const int32_t high = (int32_t)txm_mesh_high(&mesh, m->sides[begin]);
    const txm_dvec3 e = txm_d3_unit(txm_d3_sub(m->point[high], m->point[low]));
    txm_dvec3 u = txm_d3(0, 0, 0), w = u;
    int is_clear = 1;
    for (int32_t k = 0; k < end - begin; k++) {
        tmr_spoke *s = wheel->spoke + k;
        const int32_t c = tmr_opposite_corner(m, begin + k);
        txm_dvec3 d = txm_d3_sub(m->point[m->vertex[c]], m->point[low]);
        d = txm_d3_mad(d, e, -txm_d3_dot(d, e));
        is_clear &= !tmr_face_is_thin(m, c / 3);
        if (!(txm_d3_len2(u) > 0)) {
            u = txm_d3_unit(d);
            w = txm_d3_cross(e, u);
        }
        s->angle = k ? txm_atan2(txm_d3_dot(d, w), txm_d3_dot(d, u)) : 0;
        s->corner = c;
        s->patch = wheel->patch[c / 3];
        s->along = m->vertex[tmr_next(c)] == low;
        s->paired = 0;
    }
    tmr_sort_spokes(wheel->spoke, end - begin, 0);
    return is_clear;
}

static void tmr_pair_spokes(tmr_mend *m, tmr_spoke *a, tmr_spoke *b) {
    a->paired = b->paired = 1;
    m->opposite[a->corner] = b->corner;
    m->opposite[b->corner] = a->corner;
}

/* Two or more sheets that touch along an edge, seen along it, angles rising clockwise: the faces have
   alternating winding. Those with the inside between them belong together:

            \  solid /           e is the edge from its lower vertex to the higher. The normal of a
         -   \      /  +         face that winds along e (+) points to rising angles, so the solid
              \    /             lies between it and the one before it, which must wind against
               \  /              e (-).
         +_____ e _____-
               solid                                                                            */
static int tmr_pair_solids(tmr_mend *m, tmr_spoke *spoke, int32_t count) {
    if (count % 2) return 0;
    for (int32_t k = 0; k < count; k++) { /* clearly apart, and alternating? */
        const int32_t next = (k + 1) % count;
        const double gap = spoke[next].angle - spoke[k].angle + (next ? 0 : 2 * TXM_PI);
        if (gap < TMR_APART || spoke[k].along == spoke[next].along) return 0;
    }
    for (int32_t k = 0; k < count; k++)
        if (spoke[k].along) tmr_pair_spokes(m, spoke + k, spoke + (k + count - 1) % count);
    return 1;
}

/* how much a sheet of these two faces would bend at the edge, 0..pi; more if one of them had to be
   reversed for that */
static double tmr_spoke_bend(const tmr_spoke *a, const tmr_spoke *b) {
    const double apart = fabs(a->angle - b->angle);
    return TXM_PI - fmin(apart, 2 * TXM_PI - apart) + (a->along == b->along ? 2 * TXM_PI : 0);
}

/* Pair the faces of which a sheet bends least, again and again. */
static void tmr_pair_straightest(tmr_mend *m, tmr_spoke *spoke, int32_t count) {
    tmr_sort_spokes(spoke, count, 1);
    for (int32_t left = count; left > 1; left -= 2) {
        int32_t a = -1, b = -1;
        double least = 0;
        for (int32_t i = 0; i < count; i++) {
            for (int32_t j = i + 1; j < count && !spoke[i].paired; j++) {
                const double bend = tmr_spoke_bend(spoke + i, spoke + j);
                if (spoke[j].paired || (a >= 0 && bend > least - TMR_ALIKE)) continue;
                least = bend;
                a = i;
                b = j;
            }
        }
        tmr_pair_spokes(m, spoke + a, spoke + b);
    }
}

/* Pair neighbours by angle: those of different winding as brackets are paired, then the others. */
static void tmr_pair_neighbors(tmr_mend *m, tmr_spoke *spoke, int32_t count) {
    for (int pass = 0; pass < 2; pass++) {
        int32_t open = -1; /* the last one without a partner; m->list: the one before it */
        for (int32_t k = 0; k < count; k++) {
            if (spoke[k].paired) continue;
            if (open >= 0 && (pass || spoke[open].along != spoke[k].along)) {
                tmr_pair_spokes(m, spoke + open, spoke + k);
                open = m->list[open];
            } else {
                m->list[k] = open;
                open = k;
            }
        }
    }
}

/* Pair the faces of the edge of the sides begin to end - 1. */
static void tmr_pair_edge(tmr_mend *m, int32_t begin, int32_t end, tmr_wheel *wheel) {
    const int32_t count = end - begin;
    const int is_clear = tmr_spokes_make(m, begin, end, wheel);
    if (!is_clear || !tmr_pair_solids(m, wheel->spoke, count)) {
        if (count <= TMR_WHEEL) tmr_pair_straightest(m, wheel->spoke, count);
        else tmr_pair_neighbors(m, wheel->spoke, count);
    }
    for (int32_t k = 0; k < count; k++) {
        if (wheel->spoke[k].paired) continue;
        m->opposite[wheel->spoke[k].corner] = -1;
        wheel->singles++;
    }
    wheel->pairs++;
}

/* Number the patches of faces. */
static void tmr_find_patches(tmr_mend *m, int32_t *patch) {
    for (int32_t f = 0; f < m->face_count; f++) patch[f] = -1;
    for (int32_t f = 0; f < m->face_count; f++) {
        int32_t count = 0;
        if (patch[f] >= 0) continue;
        patch[f] = f;
        m->list[count++] = f;
        for (int32_t i = 0; i < count; i++) {
            for (int32_t c = 3 * m->list[i]; c < 3 * m->list[i] + 3; c++) {
                const int32_t o = m->opposite[c];
                if (o < 0 || patch[o / 3] >= 0) continue;
                patch[o / 3] = f;
                m->list[count++] = o / 3;
            }
        }
    }
}

/* Pair the faces of all edges that have more than two. */
static txm_status tmr_mend_pairs(tmr_mend *m) {
    int32_t longest = 0;
    tmr_wheel wheel;
    memset(&wheel, 0, sizeof wheel);
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        end = tmr_run_end(m, i);
        if (end - i > longest) longest = end - i;
    }
    wheel.spoke = (tmr_spoke *)txm_arena_alloc(m->scratch, (size_t)longest, sizeof(tmr_spoke));
    wheel.patch = (int32_t *)txm_arena_alloc(m->scratch, (size_t)m->face_count, sizeof(int32_t));
    if (m->scratch->failed)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    tmr_find_patches(m, wheel.patch);
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        end = tmr_run_end(m, i);
        if (end - i > 2) tmr_pair_edge(m, i, end, &wheel);
    }
    m->report.overfull = wheel.pairs;
    m->report.opened = wheel.singles;
    return TXM_OK;
}

/* Find the opposites, mending edges until each has at most two faces. */
static txm_status tmr_mend_edges(tmr_mend *m) {
    m->report.overfull = m->report.opened = 0;
    for (int round = 0; tmr_mend_opposites(m) > 0; round++) {
        tmr_clear_flags(m);
        for (int32_t f = 0; f < m->face_count; f++) m->single |= !m->twin[f];
        if (round == TMR_MEND_ROUNDS) return tmr_mend_pairs(m);
        if (tmr_mend_overfull(m, tmr_cut_fins)) m->report.fins += tmr_cut_flagged(m);
        else if (tmr_mend_overfull(m, tmr_cut_twins)) m->report.duplicate += tmr_cut_flagged(m);
        else return tmr_mend_pairs(m);
    }
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_MEND_PAIRS_H */
