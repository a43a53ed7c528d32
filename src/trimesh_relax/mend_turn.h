#ifndef TRIMESH_RELAX_MEND_TURN_H
#define TRIMESH_RELAX_MEND_TURN_H

#include "surface.h"
#include "mend_pairs.h"

/* ---- mending: orientation ----------------------------------------------------------------- */

/* Does the face beyond the edge of corner c have the same winding? */
static int tmr_winds_alike(const tmr_mend *m, int32_t c) {
    return m->vertex[tmr_next(c)] == m->vertex[tmr_prev(m->opposite[c])];
}

/* List the component of face first in m->list, and flag its faces: 1 = stays, 2 = to be reversed.
   Edges whose faces have different winding are crossed only where no other is left, so that a
   surface that cannot be oriented is cut there. Returns how many faces. */
static int32_t tmr_flag_windings(tmr_mend *m, int32_t first) {
    uint32_t *later = m->sides + 3 * m->face_count; /* 1 per corner at most: each is looked at once */
    int32_t count = 0, done = 0, waiting = 0, next = 0;
    m->flag[first] = 1;
    m->list[count++] = first;
    for (;;) {
        if (done < count) {
            const int32_t f = m->list[done++];
            for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
                const int32_t o = m->opposite[c];
                if (o < 0 || m->flag[o / 3]) continue;
                if (!tmr_winds_alike(m, c)) {
                    TRIMESH_ASSERT(waiting < 3 * m->face_count);
                    later[waiting++] = (uint32_t)c;
                    continue;
                }
                m->flag[o / 3] = m->flag[f];
                m->list[count++] = o / 3;
            }
        } else if (next < waiting) {
            const int32_t c = (int32_t)later[next++], g = m->opposite[c] / 3;
            if (m->flag[g]) continue;
            m->flag[g] = (uint8_t)(3 - m->flag[c / 3]);
            m->list[count++] = g;
        } else return count;
    }
}

/* Would the faces at the edge of corner c still have different winding? */
static int tmr_is_twisted(const tmr_mend *m, int32_t c) {
    const int32_t o = m->opposite[c];
    return o >= 0 && tmr_winds_alike(m, c) != (m->flag[c / 3] == m->flag[o / 3]);
}

/* The other way round, would face f have shorter twisted edges? */
static int tmr_untwists(const tmr_mend *m, int32_t f) {
    double gain = 0, all = 0;
    for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
        const double length = m->opposite[c] < 0 ? 0
                                                 : txm_d3_dist(m->point[m->vertex[tmr_next(c)]],
                                                               m->point[m->vertex[tmr_prev(c)]]);
        gain += tmr_is_twisted(m, c) ? length : -length;
        all += length;
    }
    return gain > 1e-6 * all;
}

/* Cut the twisted edges of the count faces of m->list: lines from border to border, or loops, as
   around each vertex they are even in number. First let them become shorter. */
static void tmr_cut_twisted(tmr_mend *m, int32_t count) {
    int turned = 1;
    for (int sweep = 0; turned && sweep < TMR_FLIP_SWEEPS; sweep++) {
        turned = 0;
        for (int32_t i = 0; i < count; i++) {
            if (!tmr_untwists(m, m->list[i])) continue;
            m->flag[m->list[i]] = (uint8_t)(3 - m->flag[m->list[i]]);
            turned = 1;
        }
    }
    for (int32_t i = 0; i < count; i++) {
        for (int32_t c = 3 * m->list[i]; c < 3 * m->list[i] + 3; c++) {
            if (!tmr_is_twisted(m, c)) continue;
            m->opposite[m->opposite[c]] = -1;
            m->opposite[c] = -1;
            m->report.cut++;
        }
    }
}

/* Flag the component of face first: 1 = stays, 2 = to be reversed, so that all of it has the
   winding of most of its area (if equal: of the first face). Cut it where it is one-sided. */
static void tmr_orient_component(tmr_mend *m, int32_t first) {
    double stays = 0, turns = 0; /* area */
    int twisted = 0;
    const int32_t count = tmr_flag_windings(m, first);
    for (int32_t i = 0; i < count; i++) {
        const int32_t f = m->list[i];
        txm_dvec3 p[3];
        tmr_face_points(m, f, p);
        const double area = txm_d3_len(txm_d3_area2(p[0], p[1], p[2]));
        if (m->flag[f] == 1) stays += area;
        else turns += area;
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) twisted |= tmr_is_twisted(m, c);
    }
    if (twisted) tmr_cut_twisted(m, count);
    if (turns > stays * (1 + 1e-9)) { /* if equal up to rounding, the first face stays   */
        for (int32_t i = 0; i < count; i++)
            m->flag[m->list[i]] = (uint8_t)(3 - m->flag[m->list[i]]);
    }
}

/* Reverse the faces with flag 2: swap their corners 1 and 2. */
static void tmr_turn_flagged(tmr_mend *m) {
    for (int32_t f = 0; f < m->face_count; f++) {
        if (m->flag[f] != 2) continue;
        const int32_t c = 3 * f + 1, v = m->vertex[c], o = m->opposite[c];
        m->vertex[c] = m->vertex[c + 1];
        m->vertex[c + 1] = v;
        m->opposite[c] = m->opposite[c + 1];
        m->opposite[c + 1] = o;
        if (m->turn[f] != TMR_MAPPED) m->turn[f] ^= 4;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        const int32_t o = m->opposite[c];
        if (o >= 0 && m->flag[o / 3] == 2 && o % 3) m->opposite[c] = 6 * (o / 3) + 3 - o;
    }
}

static void tmr_mend_orient(tmr_mend *m) {
    tmr_clear_flags(m);
    m->report.cut = 0;
    for (int32_t f = 0; f < m->face_count; f++)
        if (!m->flag[f]) tmr_orient_component(m, f);
    tmr_turn_flagged(m);
}

/* Faces without duplicates, at most two at an edge, consistently oriented. */
static txm_status tmr_mend_faces(tmr_mend *m) {
    tmr_mend_compact(m);
    tmr_mend_duplicates(m);
    txm_status status = tmr_mend_cancel(m, 0.02f);
    if (status == TXM_OK) status = tmr_mend_edges(m);
    if (status == TXM_OK && m->face_count == 0)
        status = txm_fail(m->env, TXM_TOO_SMALL, "the surface has no area");
    if (status == TXM_OK) tmr_mend_orient(m);
    return status;
}

#endif /* TRIMESH_RELAX_MEND_TURN_H */
