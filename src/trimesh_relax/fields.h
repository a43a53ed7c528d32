#ifndef TRIMESH_RELAX_FIELDS_H
#define TRIMESH_RELAX_FIELDS_H

#include "collapse.h"

/* ---- fields on a hierarchy ---------------------------------------------------------------- */

/* One level of the hierarchy: nodes with neighbours; level 0 are the vertices of the mesh, each
   further one joins pairs of nodes. Each node has a tangent plane with the axes x and n x x, in
   which it holds a direction with six equal arms (as the sixth power of a complex number) and a
   point of the triangular lattice that these arms span. */
typedef struct tmr_level {
    int32_t count, links;
    txm_dvec3 *p, *n, *x;
    float *area;
    float *scale;       /* lattice spacing                                                 */
    double (*z)[2];     /* direction to the sixth power                                    */
    txm_dvec3 *q;       /* a lattice point near p                                          */
    uint8_t *fixed;     /* 1: z and q are given (lines), 2: q is (corners)                 */
    int32_t *parent;    /* node of the next level                                          */
    int32_t *first, *to; /* neighbours of i: to[first[i]] .. to[first[i + 1] - 1]          */
    float *weight;      /* of each link                                                    */
    float (*turn)[2];   /* per link: takes the neighbour's z into this node's frame        */
} tmr_level;

enum { TMR_MAX_LEVELS = 40 };

typedef struct tmr_fields {
    tmr_level level[TMR_MAX_LEVELS];
    int count;
    int32_t *node;   /* of each vertex of the mesh, -1 = none */
    int32_t *vertex; /* of each node of level 0               */
} tmr_fields;

static txm_dvec3 tmr_any_axis(txm_dvec3 n) {
    const double x = fabs(n.x), y = fabs(n.y), z = fabs(n.z);
    const txm_dvec3 axis = x <= y && x <= z ? txm_d3(1, 0, 0)
                           : y <= z         ? txm_d3(0, 1, 0)
                                            : txm_d3(0, 0, 1);
    return txm_d3_unit(txm_d3_cross(n, axis));
}

static void tmr_complex_mul(const double a[2], const double b[2], double out[2]) {
    const double re = a[0] * b[0] - a[1] * b[1], im = a[0] * b[1] + a[1] * b[0];
    out[0] = re;
    out[1] = im;
}
static void tmr_sixth_power(const double a[2], double out[2]) {
    double square[2], fourth[2];
    tmr_complex_mul(a, a, square);
    tmr_complex_mul(square, square, fourth);
    tmr_complex_mul(fourth, square, out);
}
/* the square root of a unit complex number with half its angle, which lies in -pi..pi */
static void tmr_half_angle(const double a[2], double out[2]) {
    const double re = sqrt(fmax(0, 0.5 * (1 + a[0]))), im = sqrt(fmax(0, 0.5 * (1 - a[0])));
    out[0] = re;
    out[1] = a[1] < 0 ? -im : im;
}
/* A sixth root of a complex number, of unit length. A third of an angle is about 1/4 + 1/16 + 1/64
   of it; Newton's method does the rest. sqrt gives the same bits with every C library, atan2 and
   cos do not. */
static void tmr_sixth_root(const double z[2], double out[2]) {
    const double length = sqrt(z[0] * z[0] + z[1] * z[1]);
    double a[2] = {1, 0}, r[2], part[2];
    if (length > 1e-100) {
        a[0] = z[0] / length;
        a[1] = z[1] / length;
    }
    tmr_half_angle(a, a); /* now the cube root of this one */
    tmr_half_angle(a, part);
    tmr_half_angle(part, part);
    r[0] = part[0];
    r[1] = part[1];
    for (int k = 0; k < 2; k++) {
        tmr_half_angle(part, part);
        tmr_half_angle(part, part);
        tmr_complex_mul(r, part, r);
    }
    for (int k = 0; k < 3; k++) { /* r = (2 r + a / r^2) / 3; 1 / r^2 = conj(r)^2 for unit r */
        const double conjugate[2] = {r[0], -r[1]};
        double square[2], term[2];
        tmr_complex_mul(conjugate, conjugate, square);
        tmr_complex_mul(a, square, term);
        r[0] = (2 * r[0] + term[0]) / 3;
        r[1] = (2 * r[1] + term[1]) / 3;
        const double n = sqrt(r[0] * r[0] + r[1] * r[1]);
        r[0] /= n;
        r[1] /= n;
    }
    out[0] = r[0];
    out[1] = r[1];
}

/* The complex number that takes coordinates in the frame (n1, x1) to the frame (n0, x0), when n1 is
   rotated onto n0 by the shortest rotation. */
static void tmr_transport(txm_dvec3 n0, txm_dvec3 x0, txm_dvec3 n1, txm_dvec3 x1, double out[2]) {
    const txm_dvec3 axis = txm_d3_cross(n1, n0);
    const double cosine = txm_d3_dot(n0, n1);
    /* R x = x cos + axis x x + axis (axis . x) / (1 + cos) */
    const double k = txm_d3_dot(axis, x1) / (1 + fmax(cosine, -0.99));
    txm_dvec3 x = txm_d3_add(txm_d3_add(txm_d3_scale(x1, cosine), txm_d3_cross(axis, x1)),
                             txm_d3_scale(axis, k));
    const double re = txm_d3_dot(x, x0), im = txm_d3_dot(x, txm_d3_cross(n0, x0));
    const double length = sqrt(re * re + im * im);
    out[0] = length > 1e-12 ? re / length : 1;
    out[1] = length > 1e-12 ? im / length : 0;
}

static txm_status tmr_level_alloc(tmr_level *level, int32_t count, int32_t links,
                                  txm_arena *arena) {
    const size_t n = (size_t)count, k = (size_t)links;
    level->count = count;
    level->links = links;
    level->p = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->n = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->x = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->q = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    level->area = (float *)txm_arena_alloc(arena, n, sizeof(float));
    level->scale = (float *)txm_arena_alloc(arena, n, sizeof(float));
    level->z = (double(*)[2])txm_arena_zero(arena, n, 2 * sizeof(double));
    level->fixed = (uint8_t *)txm_arena_zero(arena, n, 1);
    level->parent = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    level->first = (int32_t *)txm_arena_alloc(arena, n + 1, sizeof(int32_t));
    level->to = (int32_t *)txm_arena_alloc(arena, k + 1, sizeof(int32_t));
    level->weight = (float *)txm_arena_alloc(arena, k + 1, sizeof(float));
    level->turn = (float(*)[2])txm_arena_alloc(arena, k + 1, 2 * sizeof(float));
    return tmr_check_memory(arena);
}

/* Level 0: the vertices. */
static txm_status tmr_level_zero(const tmr_work *w, tmr_fields *f, txm_arena *arena) {
    const tmr_mesh *m = &w->m;
    int32_t count = 0, links = 0;
    f->node = (int32_t *)txm_arena_alloc(arena, (size_t)m->vertex_count, sizeof(int32_t));
    f->vertex = (int32_t *)txm_arena_alloc(arena, (size_t)m->live, sizeof(int32_t));
    if (!f->node || !f->vertex) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        f->node[v] = -1;
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        f->vertex[count] = v;
        f->node[v] = count++;
        links += m->valence[v];
    }
    tmr_level *level = &f->level[0];
    const txm_status status = tmr_level_alloc(level, count, links, arena);
    if (status != TXM_OK) return status;
    int32_t k = 0;
    for (int32_t i = 0; i < count; i++) {
        const int32_t v = f->vertex[i], first = m->corner[v];
        int32_t c = first;
        level->p[i] = level->q[i] = m->p[v];
        level->n[i] = m->n[v];
        level->x[i] = tmr_any_axis(m->n[v]);
        level->area[i] = 1;
        level->scale[i] = txm_float(w->length * w->size[v]);
        level->first[i] = k;
        do {
            const int32_t to = m->vertex[tmr_next(c)];
            if (!tmr_is_ghost(m, to)) {
                TRIMESH_ASSERT(k < links); /* the valences count all neighbours, also ghosts */
                level->to[k] = f->node[to];
                level->weight[k++] = 1;
            }
            c = tmr_swing(m, c);
        } while (c != first);
        const int kind = tmr_kind_of(m, v);
        level->fixed[i] = kind == TRIMESH_FREE ? 0 : kind == TRIMESH_CORNER ? 2 : 1;
        int32_t two[2];
        if (level->fixed[i] == 1 && tmr_line_neighbors(m, v, two)) {
            const txm_dvec3 d = txm_d3_sub(m->p[two[1]], m->p[two[0]]);
            double a[2] = {txm_d3_dot(d, level->x[i]),
                           txm_d3_dot(d, txm_d3_cross(level->n[i], level->x[i]))};
            const double n = sqrt(a[0] * a[0] + a[1] * a[1]);
            a[0] = n > 0 ? a[0] / n : 1;
            a[1] = n > 0 ? a[1] / n : 0;
            tmr_sixth_power(a, level->z[i]);
        } else if (level->fixed[i] == 1) {
            level->fixed[i] = 2;
        }
    }
    level->first[count] = level->links = k;
    return TXM_OK;
}

/* The next level: each node merged with the most similar neighbour. */
static txm_status tmr_level_up(const tmr_level *a, tmr_level *b, txm_arena *arena,
                               txm_arena *scratch) {
    int32_t count = 0;
    int32_t *child = (int32_t *)txm_arena_alloc(scratch, 2 * (size_t)a->count, sizeof(int32_t));
    int32_t *seen = (int32_t *)txm_arena_alloc(scratch, (size_t)a->count, sizeof(int32_t));
    if (!child || !seen) return TXM_OUT_OF_MEMORY;
    for (int32_t i = 0; i < a->count; i++) a->parent[i] = -1;
    for (int32_t i = 0; i < a->count; i++) {
        double best_score = -2;
        int32_t best = -1;
        if (a->parent[i] >= 0) continue;
        for (int32_t k = a->first[i]; k < a->first[i + 1]; k++) {
            const int32_t j = a->to[k];
            if (a->parent[j] >= 0) continue;
            const double x = a->area[i], y = a->area[j];
            const double score = txm_d3_dot(a->n[i], a->n[j]) * (x < y ? x / y : y / x);
            if (score > best_score) {
                best_score = score;
                best = j;
            }
        }
        a->parent[i] = count;
        if (best >= 0) a->parent[best] = count;
        child[2 * count] = i;
        child[2 * count + 1] = best;
        count++;
    }
    const txm_status status = tmr_level_alloc(b, count, a->links, arena);
    if (status != TXM_OK) return status;
    int32_t k = 0;
    for (int32_t i = 0; i < count; i++) seen[i] = -1;
    for (int32_t i = 0; i < count; i++) {
        txm_dvec3 p = txm_d3(0, 0, 0), n = p;
        double area = 0, scale = 0;
        int fixed = 0, only = 1;
        const int32_t first = k;
        b->first[i] = k;
        b->z[i][0] = b->z[i][1] = 0;
        for (int side = 0; side < 2; side++) {
            const int32_t c = child[2 * i + side];
            if (c < 0) continue;
            p = txm_d3_mad(p, a->p[c], a->area[c]);
            n = txm_d3_mad(n, a->n[c], a->area[c]);
            scale += (double)a->scale[c] * a->area[c];
            area += a->area[c];
            fixed |= a->fixed[c] == 1;
            only = only && a->fixed[c];
            for (int32_t j = a->first[c]; j < a->first[c + 1]; j++) {
                const int32_t to = a->parent[a->to[j]];
                if (to == i) continue;
                if (seen[to] < first) {
                    TRIMESH_ASSERT(k < a->links); /* each comes from a link of its own below */
                    seen[to] = k;
                    b->to[k] = to;
                    b->weight[k++] = 0;
                }
                b->weight[seen[to]] += a->weight[j];
            }
        }
        b->p[i] = b->q[i] = txm_d3_scale(p, 1 / area);
        b->n[i] = txm_d3_len2(n) > 1e-12 ? txm_d3_unit(n) : a->n[child[2 * i]];
        b->x[i] = tmr_any_axis(b->n[i]);
        b->area[i] = txm_float(area);
        b->scale[i] = txm_float(scale / area);
        b->fixed[i] = (uint8_t)fixed;
        for (int side = 0; side < 2 && fixed; side++) {
            const int32_t c = child[2 * i + side];
            double t[2], six[2], z[2];
            if (c < 0 || a->fixed[c] != 1) continue;
            tmr_transport(b->n[i], b->x[i], a->n[c], a->x[c], t);
            tmr_sixth_power(t, six);
            tmr_complex_mul(a->z[c], six, z);
            b->z[i][0] += z[0];
            b->z[i][1] += z[1];
            b->q[i] = a->q[c];
        }
    }
    b->first[count] = b->links = k;
    return TXM_OK;
}

static void tmr_level_turns(tmr_level *level) {
    for (int32_t i = 0; i < level->count; i++) {
        for (int32_t k = level->first[i]; k < level->first[i + 1]; k++) {
            const int32_t j = level->to[k];
            double t[2], six[2];
            tmr_transport(level->n[i], level->x[i], level->n[j], level->x[j], t);
            tmr_sixth_power(t, six);
            level->turn[k][0] = txm_float(six[0]);
            level->turn[k][1] = txm_float(six[1]);
        }
    }
}

/* Directions: each node takes the mean of its neighbours (Gauss and Seidel), which makes the field
   as smooth as it can be, with its magnitude going to 0 where arms do not fit. */
static txm_status tmr_smooth_directions(tmr_work *work, tmr_level *level, int sweeps) {
    for (int sweep = 0; sweep < sweeps; sweep++) {
        double most = 0;
        if (tmr_tick(work, level->count)) return TXM_CANCELLED;
        for (int32_t i = 0; i < level->count; i++) {
            double re = 0, im = 0, sum = 0;
            if (level->fixed[i] == 1) continue;
            for (int32_t k = level->first[i]; k < level->first[i + 1]; k++) {
                const double *z = level->z[level->to[k]];
                const double c = level->turn[k][0], s = level->turn[k][1], w = level->weight[k];
                re += w * (z[0] * c - z[1] * s);
                im += w * (z[0] * s + z[1] * c);
                sum += w;
            }
            if (sum <= 0) continue;
            level->z[i][0] = re / sum;
            level->z[i][1] = im / sum;
            most = fmax(most, fmax(fabs(re), fabs(im)) / sum);
        }
        if (most > 0 && most < 1e-3) { /* avoids underflow; fixed nodes do not matter then */
            for (int32_t i = 0; i < level->count; i++) {
                if (level->fixed[i] == 1) continue;
                level->z[i][0] /= most;
                level->z[i][1] /= most;
            }
        }
    }
    return TXM_OK;
}

static txm_status tmr_solve_directions(tmr_work *w, tmr_fields *f, uint64_t seed) {
    tmr_level *top = &f->level[f->count - 1];
    txm_rng rng = txm_rng_make(seed, 1);
    for (int32_t i = 0; i < top->count; i++) {
        const double re = txm_rng_double(&rng) - 0.5, im = txm_rng_double(&rng) - 0.5;
        if (top->fixed[i] == 1) continue;
        top->z[i][0] = re;
        top->z[i][1] = im;
    }
    for (int l = f->count - 1; l >= 0; l--) {
        tmr_level *level = &f->level[l];
        if (tmr_tick(w, level->count)) return TXM_CANCELLED;
        tmr_level_turns(level);
        if (l < f->count - 1) {
            const tmr_level *up = &f->level[l + 1];
            for (int32_t i = 0; i < level->count; i++) {
                const int32_t j = level->parent[i];
                double t[2], six[2];
                if (level->fixed[i] == 1) continue;
                tmr_transport(level->n[i], level->x[i], up->n[j], up->x[j], t);
                tmr_sixth_power(t, six);
                tmr_complex_mul(up->z[j], six, level->z[i]);
            }
        }
        const txm_status status =
            tmr_smooth_directions(w, level, l == f->count - 1 ? 100 : l == 0 ? 5 : 10);
        if (status != TXM_OK) return status;
    }
    for (int l = 0; l < f->count; l++) { /* x becomes one of the arms */
        tmr_level *level = &f->level[l];
        for (int32_t i = 0; i < level->count; i++) {
            double r[2];
            const txm_dvec3 y = txm_d3_cross(level->n[i], level->x[i]);
            tmr_sixth_root(level->z[i], r);
            level->x[i] = txm_d3_add(txm_d3_scale(level->x[i], r[0]), txm_d3_scale(y, r[1]));
        }
    }
    return TXM_OK;
}

/* ---- lattice points ----------------------------------------------------------------------- */

/* the second arm of a lattice: x turned by 60 degrees about n */
static txm_dvec3 tmr_arm(txm_dvec3 n, txm_dvec3 x) {
    return txm_d3_add(txm_d3_scale(x, 0.5), txm_d3_scale(txm_d3_cross(n, x), 0.86602540378443865));
}

/* lattice coordinates of d: d = a x + b y with the arms x and y, in units of the spacing */
static void tmr_lattice_at(txm_dvec3 d, txm_dvec3 x, txm_dvec3 y, double inverse, double *a,
                           double *b) {
    const double dx = txm_d3_dot(d, x) * inverse, dy = txm_d3_dot(d, y) * inverse;
    *a = (dx - 0.5 * dy) * (4.0 / 3);
    *b = (dy - 0.5 * dx) * (4.0 / 3);
}

/* the point of the lattice through q that lies nearest to p (in the tangent plane) */
static txm_dvec3 tmr_lattice_round(txm_dvec3 q, txm_dvec3 x, txm_dvec3 y, double spacing,
                                   txm_dvec3 p) {
    double a, b, least = 0;
    txm_dvec3 best = q;
    tmr_lattice_at(txm_d3_sub(p, q), x, y, 1 / spacing, &a, &b);
    const double a0 = floor(a), b0 = floor(b);
    for (int k = 0; k < 4; k++) {
        const txm_dvec3 to =
            txm_d3_mad(txm_d3_mad(q, x, (a0 + (k & 1)) * spacing), y, (b0 + (k >> 1)) * spacing);
        const double d = txm_d3_dist2(to, p);
        if (k == 0 || d < least) {
            least = d;
            best = to;
        }
    }
    return best;
}

/* a point about half-way between two tangent planes: where they cross, or else the middle */
static txm_dvec3 tmr_between(txm_dvec3 p0, txm_dvec3 n0, txm_dvec3 p1, txm_dvec3 n1) {
    const double n00 = txm_d3_dot(n0, p0), n01 = txm_d3_dot(n0, p1), n10 = txm_d3_dot(n1, p0);
    const double n11 = txm_d3_dot(n1, p1), c = txm_d3_dot(n0, n1);
    const double d = 1 / (1 - c * c + 1e-4);
    const double l0 = 2 * (n01 - n00 - c * (n10 - n11)) * d;
    const double l1 = 2 * (n10 - n11 - c * (n01 - n00)) * d;
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(p0, p1), 0.5);
    return txm_d3_sub(middle,
                      txm_d3_scale(txm_d3_add(txm_d3_scale(n0, -l0), txm_d3_scale(n1, -l1)), 0.25));
}

/* Of the lattice points of two nodes about half-way between them, the closest pair: the place on
   which both should agree. */
static void tmr_closest_pair(const tmr_level *level, int32_t i, txm_dvec3 qi, int32_t j,
                             txm_dvec3 *a, txm_dvec3 *b) {
    const double spacing = 0.5 * (level->scale[i] + (double)level->scale[j]);
    const txm_dvec3 middle = tmr_between(level->p[i], level->n[i], level->p[j], level->n[j]);
    txm_dvec3 from[2], x[2], y[2]; /* each has four lattice points around the middle: a rhombus */
    for (int side = 0; side < 2; side++) {
        const int32_t v = side ? j : i;
        const txm_dvec3 q = side ? level->q[j] : qi, arm = tmr_arm(level->n[v], level->x[v]);
        double s, t;
        tmr_lattice_at(txm_d3_sub(middle, q), level->x[v], arm, 1 / spacing, &s, &t);
        x[side] = txm_d3_scale(level->x[v], spacing);
        y[side] = txm_d3_scale(arm, spacing);
        from[side] = txm_d3_mad(txm_d3_mad(q, x[side], floor(s)), y[side], floor(t));
    }
    /* squared distances, less that of the first pair: |d + p - r|^2 - |d|^2 = (p + 2 d) p + (r - 2 d) r
       - 2 p r, where p and r are 0, x, y or x + y of either side */
    const txm_dvec3 d = txm_d3_sub(from[0], from[1]);
    const double unit = spacing * spacing;
    const double dx[2] = {2 * txm_d3_dot(d, x[0]), -2 * txm_d3_dot(d, x[1])};
    const double dy[2] = {2 * txm_d3_dot(d, y[0]), -2 * txm_d3_dot(d, y[1])};
    const double xx = 2 * txm_d3_dot(x[0], x[1]), xy = 2 * txm_d3_dot(x[0], y[1]);
    const double yx = 2 * txm_d3_dot(y[0], x[1]), yy = 2 * txm_d3_dot(y[0], y[1]);
    const double one[4] = {0, unit + dx[0], unit + dy[0], 3 * unit + dx[0] + dy[0]};
    const double two[4] = {0, unit + dx[1], unit + dy[1], 3 * unit + dx[1] + dy[1]};
    const double both[4][4] = {{0, 0, 0, 0},
                               {0, xx, xy, xx + xy},
                               {0, yx, yy, yx + yy},
                               {0, xx + yx, xy + yy, xx + xy + yx + yy}};
    double least = 0;
    int best = 0;
    for (int k = 1; k < 16; k++) {
        const double distance = one[k & 3] + two[k >> 2] - both[k & 3][k >> 2];
        best = distance < least ? k : best;
        least = distance < least ? distance : least;
    }
    *a = txm_d3_mad(txm_d3_mad(from[0], x[0], best & 1), y[0], best >> 1 & 1);
    *b = txm_d3_mad(txm_d3_mad(from[1], x[1], best >> 2 & 1), y[1], best >> 3);
}

static txm_status tmr_smooth_points(tmr_work *w, tmr_level *level, int sweeps) {
    for (int sweep = 0; sweep < sweeps; sweep++) {
        for (int32_t i = 0; i < level->count; i++) {
            if (tmr_tick(w, 1)) return TXM_CANCELLED;
            txm_dvec3 q = level->q[i];
            double sum = 0;
            if (level->fixed[i]) continue;
            for (int32_t k = level->first[i]; k < level->first[i + 1]; k++) {
                const double weight = level->weight[k];
                txm_dvec3 a = q, b = q;
                tmr_closest_pair(level, i, q, level->to[k], &a, &b);
                q = txm_d3_add(txm_d3_scale(a, sum), txm_d3_scale(b, weight));
                sum += weight;
                q = txm_d3_scale(q, 1 / sum);
                q = txm_d3_mad(q, level->n[i],
                               -txm_d3_dot(level->n[i], txm_d3_sub(q, level->p[i])));
            }
            if (sum > 0)
                level->q[i] = tmr_lattice_round(q, level->x[i], tmr_arm(level->n[i], level->x[i]),
                                                level->scale[i], level->p[i]);
        }
    }
    return TXM_OK;
}

static txm_status tmr_solve_points(tmr_work *w, tmr_fields *f) {
    for (int l = f->count - 1; l >= 0; l--) {
        tmr_level *level = &f->level[l];
        if (l < f->count - 1) {
            const tmr_level *up = &f->level[l + 1];
            for (int32_t i = 0; i < level->count; i++) {
                if (level->fixed[i]) continue;
                txm_dvec3 q = up->q[level->parent[i]];
                q = txm_d3_mad(q, level->n[i],
                               -txm_d3_dot(level->n[i], txm_d3_sub(q, level->p[i])));
                level->q[i] = tmr_lattice_round(q, level->x[i], tmr_arm(level->n[i], level->x[i]),
                                                level->scale[i], level->p[i]);
            }
        }
        const txm_status status = tmr_smooth_points(w, level, l == 0 ? 3 : 6);
        if (status != TXM_OK) return status;
    }
    return TXM_OK;
}

static txm_status tmr_fields_build(const tmr_work *w, tmr_fields *f, txm_arena *arena) {
    txm_arena scratch;
    txm_status status = tmr_level_zero(w, f, arena);
    f->count = 1;
    while (status == TXM_OK && f->count < TMR_MAX_LEVELS && f->level[f->count - 1].count > 8) {
        txm_arena_init(&scratch, w->env);
        status = tmr_level_up(&f->level[f->count - 1], &f->level[f->count], arena, &scratch);
        txm_arena_free(&scratch);
        if (status != TXM_OK ||
            f->level[f->count].count * 20.0 > f->level[f->count - 1].count * 19.0)
            break;
        f->count++;
    }
    return status;
}

/* ---- from the lattice to a mesh ----------------------------------------------------------- */

/* Merge b = vertex[prev(c)] into a, or a into b, or both at their lattice point: the first of these
   that keeps the triangles around fair. Their lattice point becomes the mean of the two. */
static int tmr_collapse_onto(tmr_work *w, int32_t c) {
    tmr_mesh *m = &w->m;
    const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
    const int free = tmr_kind_of(m, a) == TRIMESH_FREE;
    const double x = w->bad[a], y = w->bad[b];
    const txm_dvec3 mean = txm_d3_scale(
        txm_d3_add(txm_d3_scale(w->moved[a], x), txm_d3_scale(w->moved[b], y)), 1 / (x + y));
    int32_t keep = a;
    if (tmr_can_collapse(m, c) && tmr_collapse_is_fair(w, c, m->p[a], 0)) {
        tmr_collapse(m, c);
    } else if (free && tmr_can_collapse(m, m->opposite[c]) &&
               tmr_collapse_is_fair(w, m->opposite[c], m->p[b], 0)) {
        tmr_collapse(m, m->opposite[c]);
        keep = b;
    } else if (free && tmr_can_collapse(m, c)) {
        const tmr_place at = tmr_project(w->s, mean, m->source[a]);
        if (!tmr_collapse_is_fair(w, c, at.p, 0)) return 0;
        tmr_collapse(m, c);
        tmr_put(w, a, &at);
    } else {
        return 0;
    }
    if (!free) return 1;
    w->moved[keep] = mean;
    w->bad[keep] = (uint8_t)fmin(255, x + y);
    return 1;
}

/* Collapse the edges whose ends share a lattice point, the shortest first. moved[v] holds the
   lattice point of v, and bad[v] how many vertices were merged into v. */
static txm_status tmr_collapse_lattice(tmr_work *w, const tmr_fields *f, txm_arena *scratch) {
    tmr_mesh *m = &w->m;
    const size_t most = (size_t)m->live_faces * 3 / 2 + 1; /* edges of a closed mesh */
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(scratch, most, sizeof(txm_pair));
    if (!pairs || !room) return TXM_OUT_OF_MEMORY;
    if (tmr_tick(w, m->live)) return TXM_CANCELLED;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        w->bad[v] = 1;
        w->moved[v] = f->node[v] >= 0 ? f->level[0].q[f->node[v]] : m->p[v];
        if (f->node[v] >= 0 && f->level[0].fixed[f->node[v]]) w->moved[v] = m->p[v];
    }
    for (int pass = 0; pass < 8; pass++) {
        size_t count = 0;
        int32_t done = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (!tmr_is_real_edge(m, c)) continue;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            const double spacing = 0.5 * w->length * (w->size[a] + (double)w->size[b]);
            const double apart = txm_d3_dist(w->moved[a], w->moved[b]);
            if (apart > 0.5 * spacing) continue;
            if (tmr_kind_of(m, a) != TRIMESH_FREE && tmr_kind_of(m, b) != TRIMESH_FREE) continue;
            TRIMESH_ASSERT(count < most);
            pairs[count].key =
                txm_sort_key(txm_float(apart + 0.05 * txm_d3_dist(m->p[a], m->p[b])));
            pairs[count++].value = (uint32_t)c;
        }
        txm_sort_pairs(pairs, room, count);
        for (size_t i = 0; i < count; i++) {
            int32_t c = (int32_t)pairs[i].value;
            if (m->vertex[c] < 0) continue;
            if (tmr_tick(w, 1)) return TXM_CANCELLED;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            if (tmr_is_ghost(m, a) || tmr_is_ghost(m, b)) continue;
            const double spacing = 0.5 * w->length * (w->size[a] + (double)w->size[b]);
            if (txm_d3_dist(w->moved[a], w->moved[b]) > 0.5 * spacing) continue;
            if (tmr_kind_of(m, b) != TRIMESH_FREE) {
                if (tmr_kind_of(m, a) != TRIMESH_FREE) continue;
                c = m->opposite[c];
            }
            if (!tmr_collapse_onto(w, c)) continue;
            done++;
        }
        if (done == 0) break;
    }
    for (int32_t v = 0; v < m->vertex_count; v++) { /* onto the surface */
        w->landed[v] = m->source[v];
        if (m->corner[v] < 0 || tmr_kind_of(m, v) != TRIMESH_FREE || tmr_is_ghost(m, v)) {
            w->moved[v] = m->p[v];
            continue;
        }
        const tmr_place at = tmr_project(w->s, w->moved[v], m->source[v]);
        w->moved[v] = at.p;
        w->landed[v] = at.face;
    }
    tmr_settle(w);
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_FIELDS_H */
