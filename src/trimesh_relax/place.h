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

/* The place on the surface nearest to p, found by walking from a face while the distance falls:
   takes time proportional to the way, and cannot jump to another sheet. */
static tmr_place tmr_project(const tmr_surface *s, txm_dvec3 p, int32_t face) {
    tmr_place at = tmr_on_face(s, face, p);
    for (int guard = 0; guard < 4096 && at.part != 0; guard++) {
        tmr_place best = at;
        if (at.part <= 3) {
            const int32_t o = s->opposite[3 * at.face + at.part - 1];
            if (o >= 0) best = tmr_on_face(s, o / 3, p);
        } else {
            const int32_t first = s->corner[s->vertex[3 * at.face + at.part - 4]];
            int32_t c = first;
            do {
                const tmr_place there = c / 3 == at.face ? at : tmr_on_face(s, c / 3, p);
                if (there.d2 < best.d2) best = there;
                const int32_t o = s->opposite[tmr_next(c)];
                if (o < 0) break;
                c = tmr_next(o);
            } while (c != first);
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
