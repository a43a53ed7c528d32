#ifndef TRIMESH_RELAX_RIDGES_H
#define TRIMESH_RELAX_RIDGES_H

#include "bands.h"
#include "mend_all.h"
#include "work.h"

/* ---- ridges: strips become lines ------------------------------------------------------------- */

/* The flats on both sides of each strip are extended to the line in which they meet. Each vertex of
   a strip moves to the planes of the flats that walks over its faces have seen, and of its own faces
   that are no part of a strip; where three flats meet, that is their corner. Vertices that come to
   the same place are merged. The volume that this adds to the surface (or takes away where it is
   concave) is kept as the cross-section of the strip, and given back by the finished mesh, whose
   vertices on the line move inwards by as much: tmr_return_volume. */
enum {
    TMR_RIDGE_TRIES = 4,   /* a strip that folds the surface is left as it is: so many times      */
    TMR_RIDGE_PASSES = 8,  /* of merging                                                          */
    TMR_RIDGE_FILLS = 64   /* of filling corners                                                  */
};
#define TMR_RIDGE_LEVELS 64.0    /* merging: edges are sorted by steps of this part of an edge length */
#define TMR_RIDGE_LEAST 5.0      /* strips shorter than this are left out, in edge lengths,       */
#define TMR_RIDGE_SHARE 0.06     /* or than this, in diagonals of the bounding box: as creases    */
#define TMR_RIDGE_REACH 1.7      /* vertices move by no more than this, in edge lengths           */
#define TMR_RIDGE_CORNER 1.25    /* largest corner, relative to that                              */
#define TMR_RIDGE_OFF 0.004      /* merged vertices may miss their planes by this, in edge lengths */
#define TMR_RIDGE_PULL 1e-3      /* weight of the old place against one plane                     */
#define TMR_RIDGE_RATE 0.05      /* moving a vertex by one edge takes so much volume at least, in
                                    edge lengths to the third                                    */
#define TMR_RIDGE_ALONG 0.95     /* edges along a ridge: cosine                                  */
#define TMR_RIDGE_AGREE 0.9      /* faces beside a strip keep their normals: cosine               */

/* A vertex of a strip. */
typedef struct tmr_ridge {
    double plane[10]; /* sum of n n^T (xx xy xz yy yz zz), n d (x y z), d d over its planes n x = d */
    txm_dvec3 old, to; /* where it was, goes to; of merged ones the mean of where they were       */
    double merged;     /* how many                                                               */
    txm_dvec3 low, high; /* the box of where they were                                           */
    double reach;      /* how far they may move                                                  */
    int planes;        /* 0 = it has none yet, 1 = own ones, more: from neighbours               */
    int32_t into;      /* the ridge that it was merged into, or itself                           */
} tmr_ridge;

typedef struct tmr_ridges {
    tmr_surface *s;
    txm_env *env;
    double sharp, spacing;
    uint8_t *strip;     /* 1 per face: part of a strip                                            */
    uint8_t *seen;      /* 1 per face: bit k: a strip was seen from the edge opposite to its corner k */
    int32_t *component; /* 1 per face: of a connected strip, its first face                       */
    float *length;      /* 1 per face: its part of the length of the strip                        */
    float (*section)[2]; /* 1 per face: sum of the cross-sections that walks have seen, how many   */
    int32_t *number;    /* 1 per vertex: of its ridge, -1 = none                                  */
    int32_t count;      /* of ridges                                                              */
    tmr_ridge *ridge;
} tmr_ridges;

static void tmr_add_plane(tmr_ridge *r, txm_dvec3 n, txm_dvec3 p) {
    const double d = txm_d3_dot(n, p);
    const double add[10] = {n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z,
                            n.z * n.z, n.x * d,   n.y * d,   n.z * d,   d * d};
    for (int k = 0; k < 10; k++) r->plane[k] += add[k];
}

/* the mean squared distance of p from the planes */
static double tmr_plane_error(const tmr_ridge *r, txm_dvec3 p) {
    const double *q = r->plane, count = q[0] + q[3] + q[5];
    const double error = q[0] * p.x * p.x + q[3] * p.y * p.y + q[5] * p.z * p.z +
                         2 * (q[1] * p.x * p.y + q[2] * p.x * p.z + q[4] * p.y * p.z) -
                         2 * (q[6] * p.x + q[7] * p.y + q[8] * p.z) + q[9];
    return count > 0 ? fmax(0, error) / count : 0;
}

/* The place nearest to all planes; where they leave it open, nearest to where the vertex was.
   Solves (A + e 1) (x - old) = b - A old by Cramer's rule. */
static txm_dvec3 tmr_ridge_place(const tmr_ridge *r) {
    const double *q = r->plane, e = TMR_RIDGE_PULL;
    const txm_dvec3 o = r->old;
    const txm_dvec3 x = txm_d3(q[0] + e, q[1], q[2]), y = txm_d3(q[1], q[3] + e, q[4]),
                    z = txm_d3(q[2], q[4], q[5] + e);
    const txm_dvec3 b = txm_d3(q[6] - (q[0] * o.x + q[1] * o.y + q[2] * o.z),
                               q[7] - (q[1] * o.x + q[3] * o.y + q[4] * o.z),
                               q[8] - (q[2] * o.x + q[4] * o.y + q[5] * o.z));
    const double det = txm_d3_dot(x, txm_d3_cross(y, z));
    if (!(det > 0)) return o;
    const txm_dvec3 d = txm_d3(txm_d3_dot(b, txm_d3_cross(y, z)), txm_d3_dot(x, txm_d3_cross(b, z)),
                               txm_d3_dot(x, txm_d3_cross(y, b)));
    return txm_d3_mad(o, d, 1 / det);
}

/* Mark the faces of all strips. */
static txm_status tmr_mark_strips(tmr_ridges *r, size_t *found) {
    const tmr_surface *s = r->s;
    tmr_band band;
    *found = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        if (c % 65536 == 65535 && txm_progress(r->env, 0, "mend")) return TXM_CANCELLED;
        if (!tmr_band_at(s, c, r->sharp, r->spacing, &band)) continue;
        const double length =
            txm_d3_dist(s->point[s->vertex[tmr_next(c)]], s->point[s->vertex[tmr_prev(c)]]);
        const double turn = tmr_chord(s, c / 3, s->opposite[c] / 3);
        const double whole = txm_d3_dist(band.normal[0], band.normal[1]);
        r->seen[c / 3] |= (uint8_t)(1 << c % 3);
        for (int32_t i = 0; i < band.count; i++) r->strip[band.face[i]] = 1;
        r->length[band.face[0]] += txm_float(length * turn / whole);
        ++*found;
    }
    return TXM_OK;
}

/* Is the face part of a corner where strips meet? Walks do not cross all of those: it is small, lies
   beside a strip, and at two of its edges the surface turns. */
static int tmr_is_strip_corner(const tmr_ridges *r, const uint8_t *at_strip, int32_t f) {
    const tmr_surface *s = r->s;
    const int32_t *v = s->vertex + 3 * f;
    const double spacing = tmr_spacing_at(s, 3 * f, r->spacing), most = TMR_BAND_SHIFT * spacing;
    int turns = 0, fast = 0;
    const int beside = at_strip[v[0]] + at_strip[v[1]] + at_strip[v[2]];
    if (beside < 2) return 0;
    for (int k = 0; k < 3; k++) {
        if (txm_d3_dist2(s->point[v[k]], s->point[v[(k + 1) % 3]]) > most * most) return 0;
        const int32_t o = s->opposite[3 * f + k];
        turns += o >= 0 && tmr_chord(s, f, o / 3) > TMR_BAND_SAME;
        fast += tmr_turns_fast(s, 3 * f + k, r->sharp, spacing);
    }
    return turns >= 2 && fast >= 1;
}

/* Add the faces of corners to the strips that meet there, from the rim inwards. at_strip: scratch,
   1 per vertex. */
static void tmr_fill_strip_corners(tmr_ridges *r, uint8_t *at_strip) {
    const tmr_surface *s = r->s;
    memset(at_strip, 0, (size_t)s->vertex_count);
    for (int32_t c = 0; c < 3 * s->face_count; c++) at_strip[s->vertex[c]] |= r->strip[c / 3];
    for (int round = 0, found = 1; round < TMR_RIDGE_FILLS && found; round++) {
        found = 0;
        for (int32_t f = 0; f < s->face_count; f++) {
            if (r->strip[f] || !tmr_is_strip_corner(r, at_strip, f)) continue;
            r->strip[f] = 1;
            found = 1;
        }
        for (int32_t c = 0; c < 3 * s->face_count && found; c++)
            at_strip[s->vertex[c]] |= r->strip[c / 3];
    }
}

/* Number the connected strips; forget the short ones. queue: scratch, 1 per face. */
static void tmr_drop_short_strips(tmr_ridges *r, int32_t *queue) {
    const tmr_surface *s = r->s;
    const double least = fmax(TMR_RIDGE_LEAST * r->spacing, TMR_RIDGE_SHARE);
    for (int32_t f = 0; f < s->face_count; f++) r->component[f] = -1;
    for (int32_t f = 0; f < s->face_count; f++) {
        int32_t count = 0;
        double length = 0;
        if (!r->strip[f] || r->component[f] >= 0) continue;
        r->component[f] = f;
        queue[count++] = f;
        for (int32_t i = 0; i < count; i++) {
            length += r->length[queue[i]];
            for (int32_t c = 3 * queue[i]; c < 3 * queue[i] + 3; c++) {
                const int32_t g = s->opposite[c] < 0 ? -1 : s->opposite[c] / 3;
                if (g < 0 || !r->strip[g] || r->component[g] >= 0) continue;
                r->component[g] = f;
                queue[count++] = g;
            }
        }
        for (int32_t i = 0; i < count && length < least; i++) r->strip[queue[i]] = 0;
    }
}

/* Does the vertex lie near both flats? The far end of a long face may not. */
static int tmr_is_near_band(const tmr_ridge *r, const tmr_band *band) {
    for (int j = 0; j < 2; j++)
        if (fabs(txm_d3_dot(band->normal[j], txm_d3_sub(r->old, band->point[j]))) > r->reach) return 0;
    return 1;
}

/* Vertices of strips without planes, inside of corners, take those of their neighbours. */
static void tmr_spread_planes(tmr_ridges *r) {
    const tmr_surface *s = r->s;
    for (int round = 0, found = 1; round < TMR_RIDGE_FILLS && found; round++) {
        found = 0;
        for (int32_t c = 0; c < 3 * s->face_count; c++) {
            const int32_t a = r->number[s->vertex[c]], b = r->number[s->vertex[tmr_next(c)]];
            if (!r->strip[c / 3] || a < 0 || b < 0) continue;
            for (int side = 0; side < 2; side++) {
                tmr_ridge *to = r->ridge + (side ? b : a);
                const tmr_ridge *from = r->ridge + (side ? a : b);
                const int known = from->planes && from->planes <= round + 1;
                if (!known || (to->planes && to->planes <= round + 1)) continue;
                for (int k = 0; k < 10; k++) to->plane[k] += from->plane[k];
                to->planes = round + 2;
                found = 1;
            }
        }
    }
}

/* how far the vertices merged move, at most */
static double tmr_farthest(const tmr_ridge *r) {
    const txm_dvec3 a = txm_d3_sub(r->to, r->low), b = txm_d3_sub(r->high, r->to);
    return txm_d3_len(txm_d3(fmax(a.x, b.x), fmax(a.y, b.y), fmax(a.z, b.z)));
}

/* Where would the vertices a and b go, merged? Returns 0 if that is too far or off their planes. */
static int tmr_merge_ridges(const tmr_ridges *r, const tmr_ridge *a, const tmr_ridge *b,
                            tmr_ridge *sum) {
    const double off = TMR_RIDGE_OFF * r->spacing;
    *sum = *a;
    for (int k = 0; k < 10; k++) sum->plane[k] += b->plane[k];
    sum->merged += b->merged;
    sum->old = txm_d3_scale(txm_d3_add(txm_d3_scale(a->old, a->merged), txm_d3_scale(b->old, b->merged)),
                            1 / sum->merged);
    sum->low = txm_d3(fmin(a->low.x, b->low.x), fmin(a->low.y, b->low.y), fmin(a->low.z, b->low.z));
    sum->high = txm_d3(fmax(a->high.x, b->high.x), fmax(a->high.y, b->high.y), fmax(a->high.z, b->high.z));
    sum->reach = fmin(a->reach, b->reach);
    sum->to = tmr_ridge_place(sum);
    return tmr_plane_error(sum, sum->to) <= off * off &&
           tmr_farthest(sum) <= sum->reach;
}

/* The ridge that ridge k was merged into; shortens the way there. */
static int32_t tmr_ridge_root(const tmr_ridges *r, int32_t k) {
    while (r->ridge[k].into != k) k = r->ridge[k].into = r->ridge[r->ridge[k].into].into;
    return k;
}

/* Faces of strips that no walk along a cross-section has seen form corners: the vertices of each
   share all their planes, so that they go to one place. Corners that are too large stay as they are. */
static void tmr_join_corners(tmr_ridges *r) {
    const tmr_surface *s = r->s;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t a = r->number[s->vertex[c]], b = r->number[s->vertex[tmr_next(c)]];
        if (!r->strip[c / 3] || r->section[c / 3][1] > 0 || a < 0 || b < 0) continue;
        const int32_t x = tmr_ridge_root(r, a), y = tmr_ridge_root(r, b);
        if (x == y) continue;
        tmr_ridge sum;
        (void)tmr_merge_ridges(r, r->ridge + x, r->ridge + y, &sum);
        r->ridge[y].into = x; /* all of them count until the corner is known to be small */
        r->ridge[x].low = sum.low;
        r->ridge[x].high = sum.high;
    }
    for (int32_t k = 0; k < r->count; k++) {
        const int32_t x = tmr_ridge_root(r, k);
        const double most = TMR_RIDGE_CORNER * r->ridge[x].reach;
        if (x == k || txm_d3_dist2(r->ridge[x].low, r->ridge[x].high) > most * most) continue;
        for (int i = 0; i < 10; i++) r->ridge[x].plane[i] += r->ridge[k].plane[i];
        r->ridge[x].old = txm_d3_add(r->ridge[x].old, r->ridge[k].old);
        r->ridge[x].merged++;
    }
    for (int32_t k = 0; k < r->count; k++) {
        tmr_ridge *x = r->ridge + k;
        if (x->into != k || x->merged < 1.5) continue;
        x->old = txm_d3_scale(x->old, 1 / x->merged);
    }
    for (int32_t k = 0; k < r->count; k++) {
        const tmr_ridge *x = r->ridge + tmr_ridge_root(r, k);
        if (x != r->ridge + k && x->merged > 1.5) {
            memcpy(r->ridge[k].plane, x->plane, sizeof x->plane);
            r->ridge[k].low = r->ridge[k].high = r->ridge[k].old;
            r->ridge[k].old = x->old;
        }
    }
    for (int32_t k = 0; k < r->count; k++) r->ridge[k].merged = 1;
    for (int32_t v = 0; v < s->vertex_count; v++) {
        if (r->number[v] < 0) continue;
        tmr_ridge *x = r->ridge + r->number[v];
        x->into = r->number[v];
        x->low = x->high = s->point[v];
    }
}

/* Does the walk from the edge of corner c follow a cross-section, at right angles to the line where
   the flats meet? */
static int tmr_is_cross_section(const tmr_surface *s, int32_t c, const tmr_band *band) {
    const txm_dvec3 a = s->point[s->vertex[tmr_next(c)]], b = s->point[s->vertex[tmr_prev(c)]];
    const txm_dvec3 ridge = txm_d3_unit(txm_d3_cross(band->normal[0], band->normal[1]));
    return fabs(txm_d3_dot(txm_d3_unit(txm_d3_sub(b, a)), ridge)) > TMR_RIDGE_ALONG;
}

/* Number the vertices of strips, and collect their planes: those of the flats that walks from and
   to faces outside of strips see, and those of their own faces that belong to no strip. */
static txm_status tmr_collect_planes(tmr_ridges *r, txm_arena *scratch) {
    const tmr_surface *s = r->s;
    tmr_band band;
    r->count = 0;
    for (int32_t v = 0; v < s->vertex_count; v++) r->number[v] = -1;
    for (int32_t c = 0; c < 3 * s->face_count; c++)
        if (r->strip[c / 3] && r->number[s->vertex[c]] < 0) r->number[s->vertex[c]] = r->count++;
    r->ridge = (tmr_ridge *)txm_arena_zero(scratch, (size_t)r->count + 1, sizeof(tmr_ridge));
    if (!r->ridge) return TXM_OUT_OF_MEMORY;
    for (int32_t f = 0; f < s->face_count; f++) r->section[f][0] = r->section[f][1] = 0;
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t k = r->number[s->vertex[c]];
        if (k < 0) continue;
        r->ridge[k].old = r->ridge[k].low = r->ridge[k].high = s->point[s->vertex[c]];
        r->ridge[k].merged = 1;
        r->ridge[k].into = k;
        r->ridge[k].reach =
            TMR_RIDGE_REACH * r->spacing * (s->scale ? (double)s->scale[s->vertex[c]] : 1);
        if (!r->strip[c / 3]) tmr_add_plane(r->ridge + k, s->normal[c / 3], s->point[s->vertex[c]]);
    }
    for (int32_t c = 0; c < 3 * s->face_count; c++) {
        const int32_t o = s->opposite[c];
        if (!(r->seen[c / 3] >> c % 3 & 1) || (!r->strip[c / 3] && !r->strip[o / 3])) continue;
        if (!tmr_band_at(s, c, r->sharp, r->spacing, &band)) continue;
        if (r->strip[band.flat[0]] || r->strip[band.flat[1]]) continue;
        if (!tmr_is_cross_section(s, c, &band)) continue;
        for (int32_t i = 0; i < 3 * band.count; i++) {
            const int32_t k = r->number[s->vertex[3 * band.face[i / 3] + i % 3]];
            if (k >= 0 && tmr_is_near_band(r->ridge + k, &band))
                for (int j = 0; j < 2; j++) tmr_add_plane(r->ridge + k, band.normal[j], band.point[j]);
        }
        for (int32_t i = 0; i < band.count; i++) {
            r->section[band.face[i]][0] += txm_float(band.section);
            r->section[band.face[i]][1]++;
        }
    }
    for (int32_t i = 0; i < r->count; i++)
        r->ridge[i].planes = r->ridge[i].plane[0] + r->ridge[i].plane[3] + r->ridge[i].plane[5] > 0;
    tmr_spread_planes(r);
    tmr_join_corners(r);
    return TXM_OK;
}

/* Is the face sound with its vertices where they go? One beside a strip keeps its normal. */
static int tmr_ridge_face_is_sound(const tmr_ridges *r, const tmr_mesh *m, int32_t f) {
    const tmr_surface *s = r->s;
    const int32_t *v = m->vertex + 3 * f, *u = s->vertex + 3 * f;
    if (f >= s->face_count) return 1; /* of a ghost */
    const txm_dvec3 n = txm_d3_area2(m->p[v[0]], m->p[v[1]], m->p[v[2]]);
    const double before = txm_d3_len(txm_d3_area2(s->point[u[0]], s->point[u[1]], s->point[u[2]]));
    const double area = txm_d3_len(n), cosine = txm_d3_dot(n, s->normal[f]);
    if (r->strip[f]) return area >= 0.2 * before && cosine >= 0.5 * area;
    return area >= 0.02 * before && cosine >= TMR_RIDGE_AGREE * area;
}

/* May the edge opposite to c be merged? In the first passes only if its ends go to the same place,
   across a strip; then also if a face beside it is not sound otherwise, as in corners. */
static int tmr_wants_merge(const tmr_ridges *r, const tmr_mesh *m, int32_t c, int pass) {
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    if (tmr_is_ghost(m, a) || tmr_is_ghost(m, b) || r->number[a] < 0 || r->number[b] < 0) return 0;
    const tmr_ridge *x = r->ridge + r->number[a], *y = r->ridge + r->number[b];
    if (txm_d3_dist2(x->to, y->to) < 0.1 * txm_d3_dist2(x->old, y->old)) return 1;
    return pass >= TMR_RIDGE_PASSES / 2 && (!tmr_ridge_face_is_sound(r, m, c / 3) ||
                                            !tmr_ridge_face_is_sound(r, m, m->opposite[c] / 3));
}

/* List the edges to be merged, the shortest first. */
static size_t tmr_list_merges(const tmr_ridges *r, const tmr_mesh *m, int pass, size_t most,
                              txm_pair *pairs, txm_pair *room) {
    size_t count = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (m->vertex[c] < 0 || m->opposite[c] < c || !tmr_wants_merge(r, m, c, pass)) continue;
        const tmr_ridge *x = r->ridge + r->number[m->vertex[tmr_next(c)]];
        const tmr_ridge *y = r->ridge + r->number[m->vertex[tmr_prev(c)]];
        const double length = txm_d3_dist(x->old, y->old) / r->spacing * TMR_RIDGE_LEVELS;
        TRIMESH_ASSERT(count < most);
        pairs[count].key = length < 1e6 ? (uint32_t)length : 1000000;
        pairs[count++].value = (uint32_t)c;
    }
    txm_sort_pairs(pairs, room, count);
    return count;
}

/* Move the vertices of strips to their places in m, a copy of the surface, and merge them over edges
   between them. */
static txm_status tmr_merge_strips(tmr_ridges *r, tmr_mesh *m, txm_arena *scratch) {
    const size_t most = (size_t)m->face_count * 3 / 2 + 1; /* edges; faces only become fewer */
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < r->s->vertex_count; v++) {
        if (r->number[v] < 0) continue;
        tmr_ridge *x = r->ridge + r->number[v];
        x->to = tmr_ridge_place(x);
        if (txm_d3_dist2(x->to, x->old) > x->reach * x->reach) x->to = x->old;
        m->p[v] = x->to;
    }
    for (int pass = 0; pass < TMR_RIDGE_PASSES; pass++) {
        const size_t count = tmr_list_merges(r, m, pass, most, pairs, room);
        for (size_t i = 0; i < count; i++) {
            const int32_t c = (int32_t)pairs[i].value;
            tmr_ridge sum;
            if (m->vertex[c] < 0 || !tmr_wants_merge(r, m, c, pass)) continue;
            const int32_t a = m->vertex[tmr_next(c)];
            tmr_ridge *x = r->ridge + r->number[a], *y = r->ridge + r->number[m->vertex[tmr_prev(c)]];
            if (!tmr_merge_ridges(r, x, y, &sum) || !tmr_can_collapse(m, c)) continue;
            tmr_collapse(m, c);
            *x = sum;
            y->into = r->number[a];
            m->p[a] = sum.to;
        }
    }
    return TXM_OK;
}

/* Forget the strips that would fold the surface. Returns how many faces are not sound. */
static int32_t tmr_drop_folding_strips(tmr_ridges *r, const tmr_mesh *m) {
    const tmr_surface *s = r->s;
    int32_t count = 0;
    for (int32_t f = 0; f < s->face_count; f++) r->length[f] = 0; /* of a component's first face */
    for (int32_t f = 0; f < s->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0) continue;
        if (r->number[v[0]] < 0 && r->number[v[1]] < 0 && r->number[v[2]] < 0) continue;
        if (tmr_ridge_face_is_sound(r, m, f)) continue;
        count++;
        if (r->strip[f]) r->length[r->component[f]] = 1;
        for (int k = 0; k < 3; k++) { /* all strips at its vertices, as they were */
            const int32_t u = s->vertex[3 * f + k], first = s->corner[u];
            for (int32_t c = first; c >= 0;) {
                if (r->strip[c / 3]) r->length[r->component[c / 3]] = 1;
                c = tmr_ccw(s->opposite, c);
                if (c == first) break;
            }
        }
    }
    for (int32_t f = 0; f < s->face_count && count; f++)
        if (r->strip[f] && r->length[r->component[f]] > 0) r->strip[f] = 0;
    return count;
}

/* the ridge that a vertex of the surface was merged into */
static int32_t tmr_merged_ridge(const tmr_ridges *r, int32_t v) {
    return r->number[v] < 0 ? -1 : tmr_ridge_root(r, r->number[v]);
}

/* Each face of a strip that has become an edge adds its cross-section to that edge, for both corners
   of m at it: sums in section[][0], how many in section[][1]. vertex: scratch, 1 per ridge. */
static void tmr_section_edges(const tmr_ridges *r, const tmr_mesh *m, int32_t *vertex,
                              float (*section)[2]) {
    const tmr_surface *s = r->s;
    for (int32_t v = 0; v < s->vertex_count; v++)
        if (m->corner[v] >= 0 && r->number[v] >= 0) vertex[r->number[v]] = v;
    for (int32_t f = 0; f < s->face_count; f++) {
        if (!r->strip[f] || m->vertex[3 * f] >= 0 || !(r->section[f][1] > 0)) continue;
        int32_t end[3];
        for (int k = 0; k < 3; k++) end[k] = vertex[tmr_merged_ridge(r, s->vertex[3 * f + k])];
        const int32_t a = end[0], b = end[1] != a ? end[1] : end[2];
        const int32_t c = a == b ? -1 : tmr_find_edge(m, a, b);
        if (c < 0) continue;
        const int32_t two[2] = {tmr_prev(c), m->opposite[tmr_prev(c)]};
        for (int k = 0; k < 2; k++) {
            if (two[k] / 3 >= s->face_count) continue; /* of a ghost */
            section[two[k]][0] += r->section[f][0];
            section[two[k]][1] += r->section[f][1];
        }
    }
}

/* Make the merged mesh the surface. section: as tmr_section_edges has it. map: scratch, 1 per vertex
   and face. */
static void tmr_take_merged(tmr_ridges *r, const tmr_mesh *m, float (*section)[2], int32_t *map) {
    tmr_surface *s = r->s;
    int32_t *face = map + s->vertex_count;
    int32_t vertices = 0, faces = 0;
    for (int32_t v = 0; v < s->vertex_count; v++) map[v] = m->corner[v] < 0 ? -1 : vertices++;
    for (int32_t f = 0; f < s->face_count; f++) face[f] = m->vertex[3 * f] < 0 ? -1 : faces++;
    for (int32_t v = 0; v < s->vertex_count; v++) {
        const int32_t k = map[v];
        if (k < 0) continue;
        s->point[k] = m->p[v];
        if (s->scale) s->scale[k] = s->scale[v];
    }
    const int32_t old = s->face_count;
    s->border_count = 0;
    s->area = 0;
    for (int32_t f = 0; f < old; f++) {
        const int32_t g = face[f];
        if (g < 0) continue;
        for (int k = 0; k < 3; k++) {
            const int32_t o = m->opposite[3 * f + k];
            s->vertex[3 * g + k] = map[m->vertex[3 * f + k]];
            s->opposite[3 * g + k] = o / 3 >= old ? -1 : 3 * face[o / 3] + o % 3; /* ghosts */
            s->border_count += o / 3 >= old;
            const float *sum = section[3 * f + k];
            s->section[3 * g + k] = sum[1] > 0 ? sum[0] / sum[1] : 0;
            s->corner[s->vertex[3 * g + k]] = 3 * g + k;
        }
        const int32_t *v = s->vertex + 3 * g;
        const txm_dvec3 n = txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]);
        s->area += 0.5 * txm_d3_len(n);
        s->normal[g] = txm_d3_len2(n) > 0 ? txm_d3_unit(n) : s->normal[f];
        s->component[g] = s->component[f];
        s->origin[g] = s->origin[f];
        s->turn[g] = s->turn[f];
    }
    s->vertex_count = vertices;
    s->face_count = faces;
    for (int32_t c = 0; c < 3 * faces; c++) { /* on the border the first one counter-clockwise */
        if (s->opposite[tmr_prev(c)] < 0) s->corner[s->vertex[c]] = c;
    }
    tmr_vertex_normals(s);
}

/* One attempt: move and merge the vertices of strips. *again receives 1 if some of them fold the
   surface: they are forgotten, and the surface is as it was. */
static txm_status tmr_try_ridges(tmr_ridges *r, txm_arena *arena, int *again) {
    tmr_lines none;
    tmr_work w;
    txm_arena scratch;
    tmr_surface *s = r->s;
    memset(&none, 0, sizeof none);
    memset(&w, 0, sizeof w);
    txm_arena_init(&scratch, r->env);
    none.edge = (int32_t *)txm_arena_zero(&scratch, 3 * (size_t)s->face_count, sizeof(int32_t));
    none.kind = (uint8_t *)txm_arena_zero(&scratch, (size_t)s->vertex_count, 1);
    w.s = s;
    w.l = &none;
    w.env = r->env;
    *again = 0;
    txm_status status = tmr_check_memory(&scratch);
    if (status == TXM_OK) status = tmr_collect_planes(r, &scratch);
    if (status == TXM_OK) status = tmr_copy_surface(&w, 0, &scratch);
    if (status == TXM_OK) status = tmr_merge_strips(r, &w.m, &scratch);
    if (status == TXM_OK) {
        *again = tmr_drop_folding_strips(r, &w.m) > 0;
        if (!*again) {
            const size_t n = (size_t)s->vertex_count, corners = 3 * (size_t)s->face_count;
            int32_t *map = (int32_t *)txm_arena_alloc(&scratch, n + corners / 3, sizeof(int32_t));
            float(*section)[2] =
                (float(*)[2])txm_arena_zero(&scratch, corners, 2 * sizeof(float));
            s->section = (float *)txm_arena_alloc(arena, corners, sizeof(float));
            if (map && section && s->section) {
                tmr_section_edges(r, &w.m, map, section);
                tmr_take_merged(r, &w.m, section, map);
            } else {
                s->section = NULL;
                status = TXM_OUT_OF_MEMORY;
            }
        }
    }
    txm_arena_free(&scratch);
    return status;
}

/* Make lines of the strips that are narrower than an edge of the result. Changes the surface:
   points, faces, normals, area; fills in s->section if there are any.

   angle    of creases, in degrees
   spacing  the edge length of the result
   return   TXM_OK; TXM_OUT_OF_MEMORY; TXM_CANCELLED
   cost     one walk per edge at which the surface turns, O(n) otherwise                         */
static txm_status tmr_make_ridges(tmr_surface *s, double angle, double spacing, txm_env *env,
                                  txm_arena *arena, txm_arena *scratch) {
    const size_t faces = (size_t)s->face_count;
    tmr_ridges r;
    size_t found = 0;
    int again = 1;
    if (angle >= 180) return TXM_OK;
    memset(&r, 0, sizeof r);
    r.s = s;
    r.env = env;
    r.spacing = spacing;
    r.sharp = sqrt(2 - 2 * txm_cos(angle * (TXM_PI / 180)));
    r.strip = (uint8_t *)txm_arena_zero(scratch, faces, 1);
    r.seen = (uint8_t *)txm_arena_zero(scratch, faces, 1);
    r.length = (float *)txm_arena_zero(scratch, faces, sizeof(float));
    if (!r.strip || !r.seen || !r.length) return TXM_OUT_OF_MEMORY;
    txm_status status = tmr_mark_strips(&r, &found);
    if (status != TXM_OK || found == 0) return status;
    int32_t *queue = (int32_t *)txm_arena_alloc(scratch, faces, sizeof(int32_t));
    r.component = (int32_t *)txm_arena_alloc(scratch, faces, sizeof(int32_t));
    r.number = (int32_t *)txm_arena_alloc(scratch, (size_t)s->vertex_count, sizeof(int32_t));
    r.section = (float(*)[2])txm_arena_alloc(scratch, faces, 2 * sizeof(float));
    if ((status = tmr_check_memory(scratch)) != TXM_OK) return status;
    tmr_fill_strip_corners(&r, (uint8_t *)r.number);
    tmr_drop_short_strips(&r, queue);
    for (int k = 0; k < TMR_RIDGE_TRIES && again && status == TXM_OK; k++) {
        found = 0;
        for (size_t f = 0; f < faces; f++) found += r.strip[f];
        if (found == 0) break;
        status = tmr_try_ridges(&r, arena, &again);
    }
    return status;
}

/* ---- giving the volume back ------------------------------------------------------------------ */

/* the cross-section of the strip that segment k of the lines stands for */
static double tmr_segment_section(const tmr_work *w, int32_t k) {
    const int32_t *v = w->s->vertex + 3 * w->l->face[k];
    for (int i = 0; i < 3; i++)
        if (v[i] != w->l->a[k] && v[i] != w->l->b[k]) return w->s->section[3 * w->l->face[k] + i];
    return 0;
}

/* that of an edge of the mesh from a to b on line id */
static double tmr_edge_section(const tmr_work *w, int32_t id, int32_t a, int32_t b) {
    const int32_t end[2] = {a, b};
    double sum = 0;
    int count = 0;
    for (int k = 0; k < 2; k++) {
        if (tmr_kind_of(&w->m, end[k]) != TRIMESH_CREASE) continue;
        sum += tmr_segment_section(w, w->m.source[end[k]]);
        count++;
    }
    return count ? sum / count : tmr_segment_section(w, w->l->first[id]);
}

enum { TMR_RIDGE_SIDES = 24 }; /* faces beside the ridges of one vertex, at most                  */

/* What moves a vertex of ridges: the volume that it has to lose, and in which direction: along the
   flats beside its ridges, but within the other faces around it. */
typedef struct tmr_shrink {
    double volume;
    txm_dvec3 area; /* a sixth of the sum of the area vectors (times 2) around: volume per way   */
    txm_dvec3 side[TMR_RIDGE_SIDES]; /* normals of the faces beside its ridges                   */
    int sides;
} tmr_shrink;

static void tmr_measure_shrink(const tmr_work *w, int32_t v, tmr_shrink *r) {
    const tmr_mesh *m = &w->m;
    int32_t c = m->corner[v];
    const int32_t first = c;
    memset(r, 0, sizeof *r);
    do {
        const int32_t a = m->vertex[tmr_next(c)], edge = tmr_prev(c); /* from v to a */
        if (!tmr_is_ghost_face(m, c / 3)) {
            const int32_t b = m->vertex[edge];
            r->area = txm_d3_mad(r->area, txm_d3_area2(m->p[v], m->p[a], m->p[b]), 1.0 / 6);
        }
        const double section =
            m->edge[edge] && !w->l->border[m->edge[edge] - 1] ? tmr_edge_section(w, m->edge[edge] - 1, v, a) : 0;
        if (section < 0 || section > 0) {
            r->volume += 0.5 * section * txm_d3_dist(m->p[v], m->p[a]);
            for (int k = 0; k < 2; k++) {
                const int32_t *u = m->vertex + (k ? m->opposite[edge] : edge) / 3 * 3;
                if (r->sides < TMR_RIDGE_SIDES)
                    r->side[r->sides++] = txm_d3_unit(txm_d3_area2(m->p[u[0]], m->p[u[1]], m->p[u[2]]));
            }
        }
        c = tmr_swing(m, c);
    } while (c != first);
}

static txm_dvec3 tmr_shrink_direction(const tmr_work *w, int32_t v, const tmr_shrink *r) {
    const tmr_mesh *m = &w->m;
    txm_dvec3 d = txm_d3(0, 0, 0);
    for (int k = 0; k < r->sides; k++) d = txm_d3_add(d, r->side[k]);
    for (int round = 0; round < 4; round++) { /* more than one face: alternate */
        int32_t c = m->corner[v];
        const int32_t first = c;
        do {
            const int32_t *u = m->vertex + c / 3 * 3;
            const txm_dvec3 n = txm_d3_unit(txm_d3_area2(m->p[u[0]], m->p[u[1]], m->p[u[2]]));
            int beside = tmr_is_ghost_face(m, c / 3) != 0;
            for (int k = 0; k < r->sides && !beside; k++)
                beside = txm_d3_dot(r->side[k], n) > TMR_RIDGE_AGREE;
            if (!beside) d = txm_d3_mad(d, n, -txm_d3_dot(d, n));
            c = tmr_swing(m, c);
        } while (c != first);
    }
    return txm_d3_unit(d);
}

/* Find where the vertices of ridges go for share of the volume that they have to lose, into
   w->moved. Returns that volume. */
static double tmr_shrink_ridges(tmr_work *w, double share) {
    tmr_mesh *m = &w->m;
    double sum = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        const int kind = m->corner[v] < 0 || tmr_is_ghost(m, v) ? TRIMESH_FREE : tmr_kind_of(m, v);
        tmr_shrink r;
        tmr_keep_place(w, v);
        if (kind != TRIMESH_CREASE && kind != TRIMESH_CORNER) continue;
        tmr_measure_shrink(w, v, &r);
        if (r.sides == 0) continue;
        const txm_dvec3 d = tmr_shrink_direction(w, v, &r);
        const double rate = txm_d3_dot(r.area, d), most = TMR_BAND_SHIFT * w->length * w->size[v];
        sum += r.volume;
        if (!(rate > TMR_RIDGE_RATE * w->length * w->length)) continue;
        const double way = share * r.volume / rate;
        w->moved[v] = txm_d3_mad(m->p[v], d, way > most ? -most : way < -most ? most : -way);
    }
    return sum;
}

/* the volume between the origin and the triangles at these places */
static double tmr_mesh_volume(const tmr_mesh *m, const txm_dvec3 *p) {
    double sum = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] < 0 || tmr_is_ghost_face(m, f)) continue;
        sum += txm_d3_dot(p[v[0]], txm_d3_cross(p[v[1]], p[v[2]]));
    }
    return sum / 6;
}

/* Move the vertices of ridges inwards until the strips that they stand for have their volume again.
   What neighbours do to each other is measured once, and taken into account. */
static void tmr_return_volume(tmr_work *w) {
    tmr_mesh *m = &w->m;
    if (!w->s->section) return;
    const double volume = tmr_shrink_ridges(w, 1);
    const double lost = tmr_mesh_volume(m, m->p) - tmr_mesh_volume(m, w->moved);
    const double share = fabs(lost) > 0.5 * fabs(volume) ? volume / lost : 1;
    if (share > 0.5 && share < 2) tmr_shrink_ridges(w, share);
    for (int32_t v = 0; v < m->vertex_count; v++)
        if (m->corner[v] >= 0 && !tmr_is_ghost(m, v)) m->p[v] = w->moved[v];
}

#endif /* TRIMESH_RELAX_RIDGES_H */
