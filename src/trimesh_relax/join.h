#ifndef TRIMESH_RELAX_JOIN_H
#define TRIMESH_RELAX_JOIN_H

#include "count.h"

/* ---- points that repel each other [1, sections 3.1 to 3.3] --------------------------------- */

/* The thesis distributes points, lets them repel each other, then joins them to triangles. Here they
   are joined first and stay joined while they repel each other, with edges flipped as they move:

   - the neighbours of a point are those within the radius of influence that a walk over edges finds.
     Points of two sheets that are close together, of one piece or of two, do not affect each other,
     and no search in space is needed;
   - the triangulation cannot fail: it is a closed manifold of the right topology from the start;
   - vertices of the input that cannot be removed, since a handle needs them, become points like the
     others, and the number is exact before points find their places.

   Stages:  sample   points by area, evenly on lines       (tmr_sample)
            join     put each into the mesh of the input   (tmr_insert; mutual tessellation [2])
                     and remove the input's vertices       (tmr_remove_vertices)
            repel    equation 3.1                          (tmr_repel_round)                    */

enum {
    TMR_ROUNDS = 40,        /* of repulsion; k of Turk and of the thesis                          */
    TMR_NEAR = 48,          /* most points that repel one; a dozen is usual                       */
    TMR_REMOVE_PASSES = 60, /* ours: over the vertices of the input; 5 to 20 are usual           */
    TMR_WALK = 4096         /* steps within one face of the input                                 */
};

/* Radius of influence r = 2 sqrt(area / N), Turk's, here in lengths of the edge L = sqrt(2 /
   sqrt(3) area / N) of the triangular lattice with so many points. In the lattice the six
   neighbours are nearer than r, and the next six only just. */
#define TMR_REACH 1.86

/* f of equation 3.1: the thesis's 0.5 at first, then falling until the points come to rest. As all
   points move at once, 0.5 is too large for that: neighbours oscillate from f = 0.2 on. But the
   oscillation gets points out of poor arrangements, as heat does: lowering f slowly gives a mean
   quality of 0.981 instead of 0.976 in 40 rounds, and 0.985 in 120. */
#define TMR_FORCE 0.5
#define TMR_LAST_FORCE 0.15

typedef struct tmr_sampling {
    tmr_work *w;
    const trimesh_desc *desc;
    int32_t *inside;   /* 1 per triangle of the mesh: the face of the surface that contains it    */
    int32_t *fixed;    /* 1 per component: points on lines and corners                           */
    int32_t *wanted;   /* 1 per component: all points                                            */
    int32_t *spare;    /* 1 per component: how many of them are not required                     */
    double *weight;    /* 1 per component                                                        */
    double *piece; /* 1 per face: area / size^2, which its share of the points is proportional to */
    uint8_t *keep;     /* 1 per vertex of the mesh: is a point                                    */
    double *ways;      /* line_room + 1: places on the current line                              */
    int32_t line_room; /* the most edges that a line is cut into                                 */
    double length;     /* L, where the size is 1                                                  */
    int32_t hint;      /* triangle of the mesh where a search starts                             */
} tmr_sampling;

/* ---- sampling: how many where --------------------------------------------------------------- */

/* wanted edge length at a vertex of the surface, relative */
static double tmr_vertex_size(const tmr_surface *s, int32_t v) {
    return s->scale ? s->scale[v] : 1;
}

/* length of a segment in wanted edge lengths */
static double tmr_segment_weight(const tmr_surface *s, const tmr_lines *l, int32_t k) {
    return txm_d3_dist(s->point[l->a[k]], s->point[l->b[k]]) * 2 /
           (tmr_vertex_size(s, l->a[k]) + tmr_vertex_size(s, l->b[k]));
}

static double tmr_line_weight(const tmr_surface *s, const tmr_lines *l, int32_t line) {
    double sum = 0;
    for (int32_t k = l->first[line]; k < l->first[line + 1]; k++)
        sum += tmr_segment_weight(s, l, k);
    return sum;
}

static double tmr_face_weight(const tmr_surface *s, int32_t f) {
    const int32_t *v = s->vertex + 3 * f;
    const double size = (tmr_vertex_size(s, v[0]) + tmr_vertex_size(s, v[1]) +
                         tmr_vertex_size(s, v[2])) / 3;
    return 0.5 * txm_d3_len(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]])) /
           (size * size);
}

/* Edge length L for so many points: each has sqrt(3) / 2 L^2 of the weighted area, on the border
   half of that. */
static double tmr_sampling_length(const tmr_surface *s, const tmr_lines *l, double line_scale,
                                  double points) {
    double area = 0, border = 0;
    for (int32_t f = 0; f < s->face_count; f++) area += tmr_face_weight(s, f);
    for (int32_t i = 0; i < l->line_count; i++)
        if (l->border[i]) border += tmr_line_weight(s, l, i);
    double length = sqrt(1.1547005383792515 * area / points);
    for (int round = 0; round < 4; round++) {
        const double whole = points - 0.5 * border / (length * line_scale);
        length = sqrt(1.1547005383792515 * area / fmax(whole, 0.5 * points));
    }
    return length;
}

/* How many edges a line is cut into: by its length, and so many that no two edges coincide. */
static int32_t tmr_line_steps(const tmr_sampling *t, int32_t line) {
    const tmr_lines *l = t->w->l;
    const double spacing = t->length * t->w->line_scale;
    const double steps = floor(tmr_line_weight(t->w->s, l, line) / spacing + 0.5);
    const int32_t a = l->a[l->first[line]], b = l->b[l->first[line + 1] - 1];
    const int32_t least = a == b ? 3 : 1;
    return steps < least ? least : steps > t->w->m.vertex_limit ? t->w->m.vertex_limit
                                                                 : (int32_t)steps;
}

/* The smallest number of points for each component, from its Euler characteristic. Call it before
   anything is cut. */
static void tmr_least_points(tmr_sampling *t) {
    const tmr_surface *s = t->w->s;
    const tmr_mesh *m = &t->w->m;
    double *euler = t->weight; /* free until later */
    for (int32_t i = 0; i < s->component_count; i++) euler[i] = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        int32_t f = m->corner[v] / 3;
        if (f >= s->face_count) f = m->opposite[3 * f] / 3; /* (ghost, b, a): the face beside it */
        euler[s->component[f]]++;
    }
    for (int32_t f = 0; f < m->face_count; f++)
        euler[s->component[f < s->face_count ? f : m->opposite[3 * f] / 3]] -= 0.5;
    for (int32_t i = 0; i < s->component_count; i++) /* Heawood; sphere 4, torus 7 */
        t->wanted[i] = (int32_t)ceil((7 + sqrt(fmax(49 - 24 * euler[i], 1))) / 2);
}

/* Share the points among the components by weight, but give each at least what it needs. If that is
   too many in all, take points from those that have most to spare. */
static void tmr_share_points(tmr_sampling *t, int32_t total) {
    const tmr_surface *s = t->w->s;
    const int32_t n = s->component_count;
    double sum = 0, run = 0;
    int32_t given = 0, before = 0;
    for (int32_t i = 0; i < n; i++) t->weight[i] = 0;
    for (int32_t f = 0; f < s->face_count; f++) t->weight[s->component[f]] += t->piece[f];
    for (int32_t i = 0; i < n; i++) sum += t->weight[i];
    for (int32_t i = 0; i < n; i++) {
        run += t->weight[i];
        const int32_t to = (int32_t)floor(run / sum * total + 0.5);
        const int32_t least = t->wanted[i] > t->fixed[i] ? t->wanted[i] : t->fixed[i];
        t->wanted[i] = to - before > least ? to - before : least;
        t->spare[i] = t->wanted[i] - least;
        given += t->wanted[i];
        before = to;
    }
    while (given > total) { /* at most once per component */
        int32_t most = 0;
        for (int32_t i = 1; i < n; i++)
            if (t->spare[i] > t->spare[most]) most = i;
        if (t->spare[most] == 0) break;
        const int32_t over = given - total, take = over < t->spare[most] ? over : t->spare[most];
        t->wanted[most] -= take;
        t->spare[most] -= take;
        given -= take;
    }
}

/* ---- joining: putting a point into the mesh ------------------------------------------------ */

/* Flip edges around the new vertex v until they are Delaunay, only within faces of the surface, so
   that triangles stay parts of faces. */
static void tmr_legalize(tmr_sampling *t, int32_t v) {
    tmr_mesh *m = &t->w->m;
    int32_t stack[64], count = 0, c = m->corner[v];
    const int32_t first = c;
    do {
        if (count < 64) stack[count++] = c;
        c = tmr_swing(m, c);
    } while (c != first);
    for (int guard = 0; count > 0 && guard < 1000; guard++) {
        c = stack[--count];
        const int32_t o = m->opposite[c];
        if (m->vertex[c] != v || m->edge[c] || t->inside[c / 3] != t->inside[o / 3]) continue;
        if (!tmr_is_wide(m, c) || !tmr_can_flip(m, c)) continue;
        const int32_t other = tmr_prev(o); /* will be v's corner in the second triangle */
        tmr_flip(m, c);
        if (count < 62) {
            stack[count++] = other;
            stack[count++] = c;
        }
    }
}

/* The part of the face in which p lies, and the weights of its corners there. */
static int32_t tmr_find_part(const tmr_sampling *t, int32_t face, txm_dvec3 p, double weight[3]) {
    const tmr_mesh *m = &t->w->m;
    const txm_dvec3 n = t->w->s->normal[face];
    int32_t part = t->inside[t->hint] == face ? t->hint : face;
    for (int guard = 0; guard < TMR_WALK; guard++) {
        const int32_t *v = m->vertex + 3 * part;
        double sum = 0;
        int least = 0;
        for (int k = 0; k < 3; k++) {
            const txm_dvec3 a = m->p[v[(k + 1) % 3]], b = m->p[v[(k + 2) % 3]];
            weight[k] = txm_d3_dot(txm_d3_area2(p, a, b), n);
            sum += weight[k];
            if (weight[k] < weight[least]) least = k;
        }
        for (int k = 0; k < 3; k++) weight[k] = sum > 0 ? weight[k] / sum : 1.0 / 3;
        const int32_t o = m->opposite[3 * part + least] / 3;
        if (weight[least] >= 0 || t->inside[o] != face) break;
        part = o;
    }
    return part;
}

/* Cut the edge opposite to c at a new vertex; -1 without room. */
static int32_t tmr_cut_edge(tmr_sampling *t, int32_t c) {
    tmr_mesh *m = &t->w->m;
    const int32_t a = t->inside[c / 3], b = t->inside[m->opposite[c] / 3];
    const int32_t v = tmr_split(m, c);
    if (v < 0) return v;
    t->inside[m->face_count - 2] = a;
    t->inside[m->face_count - 1] = b;
    t->keep[v] = 1;
    return v;
}

/* Put a point that lies in a face of the surface into the mesh: into the triangle that holds it, on
   an edge if it lies there. Returns its vertex, or -1 if there is no room, or if it lies on a line
   or on a vertex that is a point already. exact: do not move the point; else it keeps a margin from
   the edges. */
static int32_t tmr_insert(tmr_sampling *t, int32_t face, txm_dvec3 p, int exact) {
    tmr_work *w = t->w;
    tmr_mesh *m = &w->m;
    double weight[3];
    int32_t part = tmr_find_part(t, face, p, weight), v;
    int least = 0, most = 0;
    for (int k = 1; k < 3; k++) {
        if (weight[k] < weight[least]) least = k;
        if (weight[k] > weight[most]) most = k;
    }
    const double margin = exact ? 1e-9 : 0.02;
    const int32_t *corner = m->vertex + 3 * part;
    if (exact && weight[most] > 1 - 1e-6) { /* on a vertex */
        v = corner[most];
        if (t->keep[v] || tmr_is_ghost(m, v) || tmr_kind_of(m, v) != TRIMESH_FREE) return -1;
        t->keep[v] = 1;
        return v;
    }
    if (exact && weight[least] < margin) {
        if (m->edge[3 * part + least]) return -1;
        v = tmr_cut_edge(t, 3 * part + least);
    } else {
        if (weight[least] < margin) { /* keep the margin        */
            double sum = 0;
            for (int k = 0; k < 3; k++) sum += weight[k] = fmax(weight[k], margin);
            p = txm_d3(0, 0, 0);
            for (int k = 0; k < 3; k++) p = txm_d3_mad(p, m->p[corner[k]], weight[k] / sum);
        }
        v = tmr_split_face(m, part);
        if (v < 0) return v;
        t->inside[m->face_count - 2] = t->inside[m->face_count - 1] = face;
    }
    if (v < 0) return v;
    t->keep[v] = 1;
    t->hint = part;
    const tmr_place at = tmr_on_face(w->s, face, p);
    tmr_put(w, v, &at);
    if (exact) m->p[v] = p;
    tmr_legalize(t, v);
    return v;
}

/* Cut a line at places given by their distance from its beginning, in wanted edge lengths, in
   rising order. A vertex of the surface very near to one of them is used instead. vertices: NULL,
   or receives the vertex for each place. TXM_TOO_SMALL: there is no room for so many vertices. */
static txm_status tmr_cut_line(tmr_sampling *t, int32_t line, const double *ways, int32_t count,
                               int32_t *vertices) {
    tmr_work *w = t->w;
    const tmr_surface *s = w->s;
    const tmr_lines *l = w->l;
    const double nearby = 0.02 * t->length;
    double way = 0;
    int32_t done = 0;
    for (int32_t k = l->first[line]; k < l->first[line + 1]; k++) {
        const int32_t a = l->a[k], b = l->b[k];
        const double weight = tmr_segment_weight(s, l, k);
        int32_t left = a;
        for (; done < count && ways[done] < way + weight + nearby; done++) {
            const double u = weight > 0 ? (ways[done] - way) / weight : 0;
            int32_t v = u < 0.5 ? a : b;
            if (u * weight >= nearby && (1 - u) * weight >= nearby) {
                const int32_t c = tmr_find_edge(&w->m, left, b);
                v = c < 0 ? -1 : tmr_cut_edge(t, tmr_prev(c));
                if (v < 0) return TXM_TOO_SMALL;
                w->m.flags[v] = l->border[line] ? TRIMESH_BORDER : TRIMESH_CREASE;
                tmr_put_on_line(
                    w, v, txm_d3_mad(s->point[a], txm_d3_sub(s->point[b], s->point[a]), u), k);
                tmr_legalize(t, v);
                left = v;
            }
            t->keep[v] = 1;
            if (vertices) vertices[done] = v;
        }
        way += weight;
    }
    for (; done < count && vertices; done++) vertices[done] = -1;
    return TXM_OK;
}

/* spread the lower ten bits to every third */
static uint32_t tmr_spread_bits(uint32_t x) {
    x &= 0x3ff;
    x = (x | x << 16) & 0x30000ff;
    x = (x | x << 8) & 0x300f00f;
    x = (x | x << 4) & 0x30c30c3;
    return (x | x << 2) & 0x9249249;
}

/* The order of a place on a curve that fills the box of -1/2..1/2 (Morton). */
static uint32_t tmr_curve_key(txm_dvec3 p) {
    const double x[3] = {p.x, p.y, p.z};
    uint32_t key = 0;
    for (int k = 0; k < 3; k++)
        key |= tmr_spread_bits((uint32_t)txm_clampi((int)((x[k] + 0.5) * 1023), 0, 1023)) << k;
    return key;
}

static txm_dvec3 tmr_face_centre(const tmr_surface *s, int32_t f) {
    const int32_t *v = s->vertex + 3 * f;
    return txm_d3_scale(txm_d3_add(txm_d3_add(s->point[v[0]], s->point[v[1]]), s->point[v[2]]),
                        1.0 / 3);
}

/* Faces in the order of a space-filling curve, component by component, in pairs[].value. */
static void tmr_order_faces(const tmr_surface *s, txm_pair *pairs, txm_pair *room) {
    for (int32_t f = 0; f < s->face_count; f++) {
        pairs[f].key = tmr_curve_key(tmr_face_centre(s, f));
        pairs[f].value = (uint32_t)f;
    }
    txm_sort_pairs(pairs, room, (size_t)s->face_count);
    for (int32_t f = 0; f < s->face_count; f++)
        pairs[f].key = (uint32_t)s->component[pairs[f].value];
    txm_sort_pairs(pairs, room, (size_t)s->face_count); /* keeps the order of equal ones */
}

/* The place of point i of count in a face: in one of the m^2 parts that lines at 1/m of its sides
   cut it into, m^2 >= count, row by row, at random within.

       m = 3, row 0 at the corner 0:   /\       row j has 2 j + 1 parts, up and down in turn
                                      /\/\
                                     /\/\/\                                                    */
static txm_dvec3 tmr_sample_place(const tmr_surface *s, int32_t face, int32_t i, int32_t count,
                                  txm_rng *rng) {
    const int32_t *v = s->vertex + 3 * face;
    int32_t m = (int32_t)floor(sqrt((double)count));
    if (m < 1) m = 1;
    while ((double)m * m < count) m++;
    const double cell = floor((double)i * m * m / count);
    int32_t row = (int32_t)floor(sqrt(cell));
    while ((double)row * row > cell) row--;
    while ((row + 1.0) * (row + 1) <= cell) row++;
    int32_t k = (int32_t)(cell - (double)row * row);
    if (row & 1) k = 2 * row - k; /* back and forth, so that consecutive points are close */
    double x = txm_rng_double(rng), y = txm_rng_double(rng);
    if (x + y > 1) {
        x = 1 - x;
        y = 1 - y;
    }
    const int32_t column = k / 2;
    double down, across; /* from corner 0 towards corner 1, from 1 towards 2, in cells */
    if (k & 1) {
        down = row + 1 - x - y;
        across = column + 1 - x;
    } else {
        down = row + x + y;
        across = column + y;
    }
    const double u = (down - across) / m, w = across / m;
    return txm_d3_add(s->point[v[0]],
                      txm_d3_add(txm_d3_scale(txm_d3_sub(s->point[v[1]], s->point[v[0]]), u),
                                 txm_d3_scale(txm_d3_sub(s->point[v[2]], s->point[v[0]]), w)));
}

/* Strew the points that are on no line: each component is cut into as many runs of equal weight
   along the order of its faces, and each run gets one. */
static txm_status tmr_sample_faces(tmr_sampling *t, txm_arena *scratch) {
    const tmr_surface *s = t->w->s;
    const size_t n = (size_t)s->face_count;
    txm_rng rng = txm_rng_make(t->desc->seed, 66);
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(scratch, n, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(scratch, n, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    tmr_order_faces(s, pairs, room);
    int32_t component = -1, placed = 0, count = 0;
    double run = 0, next = 0, step = 0;
    for (size_t i = 0; i < n; i++) {
        const int32_t f = (int32_t)pairs[i].value;
        if (s->component[f] != component) {
            component = s->component[f];
            count = t->wanted[component] - t->fixed[component];
            placed = 0;
            run = 0;
            step = count > 0 ? t->weight[component] / count : 0;
            next = step * txm_rng_double(&rng);
        }
        run += t->piece[f];
        int32_t here = 0;
        const int last = i + 1 == n || s->component[pairs[i + 1].value] != component;
        while (placed < count && (next < run || last)) {
            here++;
            placed++;
            next = step * (placed + txm_rng_double(&rng));
        }
        for (int32_t k = 0; k < here; k++) {
            tmr_insert(t, f, tmr_sample_place(s, f, k, here, &rng), 0);
            if (tmr_tick(t->w, 1)) return TXM_CANCELLED;
        }
        if (tmr_tick(t->w, 1)) return TXM_CANCELLED;
    }
    return TXM_OK;
}

/* ---- joining: removing the vertices of the surface ------------------------------------------ */

/* the worst quality of b's triangles after b is merged into the other end of c's edge; -1: not
   allowed */
static double tmr_remove_quality(const tmr_work *w, int32_t c) {
    const tmr_mesh *m = &w->m;
    const int32_t o = m->opposite[c], first = tmr_prev(c), a = m->vertex[tmr_next(c)];
    double worst = 1;
    int32_t i = first;
    do {
        const int32_t x = m->vertex[tmr_next(i)], y = m->vertex[tmr_prev(i)];
        if (i / 3 != c / 3 && i / 3 != o / 3 && !tmr_is_ghost(m, x) && !tmr_is_ghost(m, y)) {
            const double q = tmr_quality(m->p[a], m->p[x], m->p[y], tmr_expected_normal(w, a, x, y));
            if (q < worst) worst = q;
        }
        i = tmr_swing(m, i);
    } while (i != first);
    return worst;
}

/* Flip edges of v where possible, the best result first: with fewer neighbours it is easier to
   remove. */
static void tmr_lower_valence(tmr_work *w, int32_t v) {
    tmr_mesh *m = &w->m;
    for (int guard = 0; guard < TMR_VALENCE && m->valence[v] > 3; guard++) {
        tmr_quad q;
        double best = 0.02;
        int32_t turn = -1, c = m->corner[v];
        const int32_t first = c;
        do { /* the edge from v to next(c) */
            if (tmr_measure_flip(w, tmr_prev(c), &q) && q.after > best) {
                best = q.after;
                turn = tmr_prev(c);
            }
            c = tmr_swing(m, c);
        } while (c != first);
        if (turn < 0) break;
        tmr_flip(m, turn);
    }
}

/* Merge vertex v into the neighbour for which the triangles stay best. Returns 0 if no neighbour
   will do. force: accept a triangle that is inverted if it was so before. */
static int tmr_remove_vertex(tmr_work *w, int32_t v, int force) {
    tmr_mesh *m = &w->m;
    double best = -2;
    int32_t into = -1, c = m->corner[v];
    const int32_t first = c;
    do { /* the edge from v to next(c) = a is opposite to k with v = next(k); its opposite o has
            v = prev(o), as the collapse wants it */
        const int32_t o = m->opposite[tmr_prev(c)];
        if (m->vertex[tmr_prev(o)] == v && tmr_can_collapse(m, o)) {
            const double q = tmr_remove_quality(w, o);
            const int fair = q > 0 || (force && tmr_collapse_is_fair(
                                                    w, o, m->p[m->vertex[tmr_next(o)]], 0));
            if (q > best && fair) {
                best = q;
                into = o;
            }
        }
        c = tmr_swing(m, c);
    } while (c != first);
    if (into < 0) return 0;
    tmr_collapse(m, into);
    return 1;
}

/* One pass over the vertices that are no points: removes those without a neighbour that was touched
   in this pass, so that the mesh becomes coarser evenly. Returns how many are left. */
static int32_t tmr_remove_pass(tmr_work *w, const uint8_t *keep, int effort, int32_t *taken) {
    tmr_mesh *m = &w->m;
    int32_t left = 0;
    memset(w->bad, 0, (size_t)m->vertex_count);
    *taken = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (keep[v] || m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        left++;
        if (w->bad[v]) continue;
        int32_t c = m->corner[v];
        const int32_t first = c;
        do {
            w->bad[m->vertex[tmr_next(c)]] = 1;
            c = tmr_swing(m, c);
        } while (c != first);
        if (effort > 0) tmr_lower_valence(w, v);
        if (!tmr_remove_vertex(w, v, effort > 2)) continue;
        left--;
        ++*taken;
    }
    return left;
}

/* Remove all vertices that are no points where possible; those that must stay are points like the
   others from now on. fraction: for the progress. */
static txm_status tmr_remove_vertices(tmr_work *w, const uint8_t *keep, float fraction) {
    int idle = 0;
    for (int pass = 0; pass < TMR_REMOVE_PASSES; pass++) {
        int32_t taken;
        const int32_t left = tmr_remove_pass(w, keep, idle, &taken);
        if (left == 0) break;
        tmr_flip_delaunay(w, 2);
        idle = taken * 50 < left ? idle + 1 : 0;
        if (idle > 6) break;
        if (txm_progress(w->env, fraction, "join")) return TXM_CANCELLED;
    }
    tmr_flip_delaunay(w, 8);
    return TXM_OK;
}

/* ---- sampling and joining: the whole -------------------------------------------------------- */

/* Vertices to make room for so that a mesh of the surface takes so many points (ours: a quarter more,
   for the vertices of lines). */
static double tmr_sampling_room(double points) {
    return points + floor(points / 4) + 1000;
}

static txm_status tmr_sampling_alloc(tmr_sampling *t, txm_arena *scratch) {
    const tmr_surface *s = t->w->s;
    const tmr_mesh *m = &t->w->m;
    const size_t n = (size_t)s->component_count;
    t->inside = (int32_t *)txm_arena_alloc(scratch, (size_t)m->face_limit, sizeof(int32_t));
    t->keep = (uint8_t *)txm_arena_zero(scratch, (size_t)m->vertex_limit, 1);
    t->fixed = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    t->wanted = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    t->spare = (int32_t *)txm_arena_zero(scratch, n, sizeof(int32_t));
    t->weight = (double *)txm_arena_zero(scratch, n, sizeof(double));
    t->piece = (double *)txm_arena_alloc(scratch, (size_t)s->face_count, sizeof(double));
    t->line_room = 0;
    for (int32_t i = 0; i < t->w->l->line_count; i++) {
        const int32_t steps = tmr_line_steps(t, i);
        if (steps > t->line_room) t->line_room = steps;
    }
    t->ways = (double *)txm_arena_alloc(scratch, (size_t)t->line_room + 1, sizeof(double));
    const txm_status status = tmr_check_memory(scratch);
    if (status != TXM_OK) return status;
    for (int32_t f = 0; f < m->face_count; f++) t->inside[f] = f < s->face_count ? f : -1;
    for (int32_t f = 0; f < s->face_count; f++) t->piece[f] = tmr_face_weight(s, f);
    return TXM_OK;
}

/* Corners and the points on lines. TXM_TOO_SMALL: there is no room for so many. */
static txm_status tmr_sample_lines(tmr_sampling *t) {
    const tmr_surface *s = t->w->s;
    const tmr_lines *l = t->w->l;
    const tmr_mesh *m = &t->w->m;
    for (int32_t v = 0; v < s->vertex_count; v++) t->keep[v] = l->kind[v] == TRIMESH_CORNER;
    for (int32_t i = 0; i < l->line_count; i++) {
        const int32_t steps = tmr_line_steps(t, i), first = l->closed[i] ? 0 : 1;
        const double step = tmr_line_weight(s, l, i) / steps;
        for (int32_t k = first; k < steps; k++) t->ways[k - first] = k * step;
        const txm_status status = tmr_cut_line(t, i, t->ways, steps - first, NULL);
        if (status != TXM_OK) return status;
    }
    for (int32_t v = 0; v < m->vertex_count; v++)
        if (t->keep[v]) t->fixed[s->component[tmr_face_of(t->w, v)]]++;
    return TXM_OK;
}

/* Strew desc->vertices points over a mesh that is a copy of the surface, with room as
   tmr_sampling_room has it. */
static txm_status tmr_sample(tmr_sampling *t, tmr_work *w, const trimesh_desc *desc,
                             txm_arena *scratch) {
    const int32_t total = (int32_t)desc->vertices;
    memset(t, 0, sizeof *t);
    t->w = w;
    t->desc = desc;
    t->length = w->length =
        tmr_sampling_length(w->s, w->l, w->line_scale, total);
    txm_status status = tmr_sampling_alloc(t, scratch);
    if (status != TXM_OK) return status;
    tmr_least_points(t);
    if ((status = tmr_sample_lines(t)) != TXM_OK) return status;
    tmr_share_points(t, total);
    return tmr_sample_faces(t, scratch);
}

/* Make the mesh one of these points only, as many as are wanted. */
static txm_status tmr_join_points(tmr_sampling *t, txm_arena *scratch) {
    int32_t missing;
    const txm_status status = tmr_remove_vertices(t->w, t->keep, 0.15f);
    if (status != TXM_OK) return status;
    return tmr_fix_count(t->w, (int32_t)t->desc->vertices, 1, scratch, &missing);
}

#endif /* TRIMESH_RELAX_JOIN_H */
