#ifndef TRIMESH_RELAX_PLACE_H
#define TRIMESH_RELAX_PLACE_H

#include "creases.h"

/* ---- moving on the surface ---------------------------------------------------------------- */

/* The point of triangle a b c nearest to p, as weights of b and c; *part: 0 inside, 1 2 3 the edge
   opposite to a b c, 4 5 6 the corner a b c. */
static txm_dvec3 tmr_nearest(txm_dvec3 p, txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, double *u,
                             double *v, int *part) {
    const txm_dvec3 ab = txm_d3_sub(b, a), ac = txm_d3_sub(c, a), ap = txm_d3_sub(p, a);
    const double d1 = txm_d3_dot(ab, ap), d2 = txm_d3_dot(ac, ap);
    *u = *v = 0;
    *part = 4;
    if (d1 <= 0 && d2 <= 0) return a;
    const txm_dvec3 bp = txm_d3_sub(p, b);
    const double d3 = txm_d3_dot(ab, bp), d4 = txm_d3_dot(ac, bp);
    *u = 1;
    *part = 5;
    if (d3 >= 0 && d4 <= d3) return b;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        *u = d1 > d3 ? d1 / (d1 - d3) : 0;
        *part = 3;
        return txm_d3_mad(a, ab, *u);
    }
    const txm_dvec3 cp = txm_d3_sub(p, c);
    const double d5 = txm_d3_dot(ab, cp), d6 = txm_d3_dot(ac, cp);
    *u = 0;
    *v = 1;
    *part = 6;
    if (d6 >= 0 && d5 <= d6) return c;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        *v = d2 > d6 ? d2 / (d2 - d6) : 0;
        *part = 2;
        return txm_d3_mad(a, ac, *v);
    }
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        const double n = (d4 - d3) + (d5 - d6);
        *v = n > 0 ? (d4 - d3) / n : 0;
        *u = 1 - *v;
        *part = 1;
        return txm_d3_mad(b, txm_d3_sub(c, b), *v);
    }
    const double n = va + vb + vc;
    *u = n > 0 ? vb / n : 0;
    *v = n > 0 ? vc / n : 0;
    *part = 0;
    return txm_d3_add(txm_d3_mad(a, ab, *u), txm_d3_scale(ac, *v));
}

typedef struct tmr_place {
    txm_dvec3 p;  /* on the surface         */
    int32_t face; /* in this face of it     */
    double u, v;  /* weights of corners 1, 2 */
    double d2;    /* squared distance from what was projected */
    int part;     /* as tmr_nearest has it  */
} tmr_place;

static tmr_place tmr_on_face(const tmr_surface *s, int32_t face, txm_dvec3 p) {
    tmr_place at;
    const int32_t *v = s->vertex + 3 * face;
    at.face = face;
    at.p = tmr_nearest(p, s->point[v[0]], s->point[v[1]], s->point[v[2]], &at.u, &at.v, &at.part);
    at.d2 = txm_d3_dist2(p, at.p);
    return at;
}

/* ---- large fans ---------------------------------------------------------------------------- */

/* Where many faces meet in one vertex, as in the tip of a cone, or in the corner opposite to a side
   with many T-junctions, looking at all of them takes most of the time. So the corners of such fans
   are listed, and searched from coarse to fine. */
enum {
    TMR_FAN_SMALL = 48,   /* ours: all faces of fans up to so many are looked at                  */
    TMR_FAN_SAMPLES = 16, /* ours: of a large one so many first,                                  */
    TMR_FAN_FINER = 4     /* ours: then in steps of this part, around the best                    */
};

/* List the large fans in s->fan and s->spoke. */
static txm_status tmr_find_fans(tmr_surface *s, txm_arena *arena, txm_arena *scratch) {
    const size_t n = (size_t)s->vertex_count;
    size_t total = 0;
    s->fan = s->spoke = NULL;
    int32_t *valence = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    if (!valence) return TXM_OUT_OF_MEMORY;
    for (int32_t c = 0; c < 3 * s->face_count; c++) valence[s->vertex[c]]++;
    for (size_t v = 0; v < n; v++)
        if (valence[v] > TMR_FAN_SMALL) total += (size_t)valence[v] + 1;
    if (total == 0 || total > INT32_MAX) return TXM_OK; /* too many to number: slow, but as good */
    s->fan = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    s->spoke = (int32_t *)txm_arena_alloc(arena, total, sizeof(int32_t));
    if (!s->fan || !s->spoke) return TXM_OUT_OF_MEMORY;
    size_t at = 0;
    for (int32_t v = 0; v < s->vertex_count; v++) {
        const int32_t first = s->corner[v];
        s->fan[v] = -1;
        if (valence[v] <= TMR_FAN_SMALL) continue;
        s->fan[v] = (int32_t)at;
        s->spoke[at++] = valence[v];
        int32_t c = first;
        do { /* each vertex has one fan */
            TRIMESH_ASSERT(at < total && c >= 0);
            s->spoke[at++] = c;
            c = tmr_ccw(s->opposite, c);
        } while (c >= 0 && c != first);
        TRIMESH_ASSERT(at == (size_t)s->fan[v] + 1 + (size_t)valence[v]);
    }
    return TXM_OK;
}

/* The place nearest to p in the faces of vertex v, or in a large fan about that. */
static tmr_place tmr_on_fan(const tmr_surface *s, int32_t v, txm_dvec3 p) {
    if (!s->fan || s->fan[v] < 0) {
        const int32_t first = s->corner[v];
        tmr_place best = tmr_on_face(s, first / 3, p);
        for (int32_t c = tmr_ccw(s->opposite, first); c >= 0 && c != first; c = tmr_ccw(s->opposite, c)) {
            const tmr_place there = tmr_on_face(s, c / 3, p);
            if (there.d2 < best.d2) best = there;
        }
        return best;
    }
    const int32_t n = s->spoke[s->fan[v]], *spoke = s->spoke + s->fan[v] + 1;
    int32_t step = (n + TMR_FAN_SAMPLES - 1) / TMR_FAN_SAMPLES, k = 0;
    tmr_place best = tmr_on_face(s, spoke[0] / 3, p);
    for (int32_t i = step; i < n; i += step) {
        const tmr_place there = tmr_on_face(s, spoke[i] / 3, p);
        if (there.d2 < best.d2) {
            best = there;
            k = i;
        }
    }
    while (step > 1) {
        const int32_t middle = k, reach = step;
        step = (step + TMR_FAN_FINER - 1) / TMR_FAN_FINER;
        for (int32_t i = -reach + step; i < reach; i += step) {
            const int32_t j = (middle + i + n) % n; /* across the border that is just another one */
            const tmr_place there = tmr_on_face(s, spoke[j] / 3, p);
            if (there.d2 < best.d2) {
                best = there;
                k = j;
            }
        }
    }
    return best;
}

/* ---- projecting ---------------------------------------------------------------------------- */

/* The place on the surface nearest to p, found by walking from a face while the distance falls:
   takes time proportional to the way, and cannot jump to another sheet. Large fans are crossed at
   once. */
static tmr_place tmr_project(const tmr_surface *s, txm_dvec3 p, int32_t face) {
    int32_t crossed = -1; /* the last large fan */
    tmr_place at = tmr_on_face(s, face, p);
    for (int guard = 0; guard < 4096 && at.part != 0; guard++) {
        tmr_place best = at;
        if (at.part <= 3) {
            const int32_t o = s->opposite[3 * at.face + at.part - 1];
            if (o >= 0) best = tmr_on_face(s, o / 3, p);
            for (int k = 0; k < 3 && s->fan; k++) {
                const int32_t v = s->vertex[3 * at.face + k];
                if (k == at.part - 1 || v == crossed || s->fan[v] < 0) continue;
                const tmr_place there = tmr_on_fan(s, v, p);
                if (there.d2 < best.d2) best = there;
                crossed = v;
            }
        } else {
            const int32_t v = s->vertex[3 * at.face + at.part - 4];
            const tmr_place there = tmr_on_fan(s, v, p);
            if (there.d2 < best.d2) best = there;
        }
        if (best.face == at.face || !(best.d2 < at.d2 * (1 - 1e-12))) break;
        at = best;
    }
    return at;
}

/* the smooth normal at a place; beside a crease that of the face */
static txm_dvec3 tmr_normal_at(const tmr_surface *s, const tmr_lines *l, const tmr_place *at) {
    const double w[3] = {1 - at->u - at->v, at->u, at->v};
    txm_dvec3 n = txm_d3(0, 0, 0);
    for (int k = 0; k < 3; k++) {
        const int32_t v = s->vertex[3 * at->face + k];
        const int sharp =
            (l->kind[v] == TRIMESH_CREASE || l->kind[v] == TRIMESH_CORNER) && !l->smooth[v];
        n = txm_d3_mad(n, sharp ? s->normal[at->face] : s->vertex_normal[v], w[k]);
    }
    return txm_d3_len2(n) > 0.01 ? txm_d3_unit(n) : s->normal[at->face];
}

static double tmr_scale_at(const tmr_surface *s, const tmr_place *at) {
    if (!s->scale) return 1;
    const int32_t *v = s->vertex + 3 * at->face;
    return (1 - at->u - at->v) * s->scale[v[0]] + at->u * s->scale[v[1]] +
           at->v * s->scale[v[2]];
}

#endif /* TRIMESH_RELAX_PLACE_H */
