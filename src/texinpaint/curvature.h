#ifndef TEXINPAINT_CURVATURE_H
#define TEXINPAINT_CURVATURE_H

#include "surface.h"

/* ---- curvature ------------------------------------------------------------------------------
   Principal curvatures, their directions, and their derivatives along these, at the vertices of a
   mesh, from a local cubic [2, section 2]. In the frame (T, B, N) of a vertex, N its normal, the
   surface is the graph of a height below the tangent plane,

       h(x, y) = (b0 x^2 + 2 b1 x y + b2 y^2) / 2 + (c0 x^3 + 3 c1 x^2 y + 3 c2 x y^2 + c3 y^3) / 6

   fitted by least squares to the places and the normals of the neighbours (the normals give dh/dx
   and dh/dy). Not in [2]: the normals come from a fit of their own, of places alone and with linear
   terms. Mean normals of faces are off by so much where triangles are irregular that e gets a wrong
   sign. The eigenvalues and eigenvectors of (b0 b1; b1 b2) are the curvatures k and directions t,
   convex surfaces having positive k, and the derivative of k along its own t is

       e = dk/dt = c0 t1^3 + 3 c1 t1^2 t2 + 3 c2 t1 t2^2 + c3 t2^3                              */

enum {
    TXI_FIT_TERMS = 9,       /* coefficients of a cubic: b0 b1 b2 c0 c1 c2 c3, and linear ones  */
    TXI_FIT_CURVED = 7,      /* the same without linear ones                                   */
    TXI_FIT_RINGS = 2,       /* rings of neighbours in a fit; as in [2]                        */
    TXI_FIT_MOST_RINGS = 8,
    TXI_FIT_MOST = 96,       /* vertices in a fit; ours: bounds the time where many edges meet */
    TXI_FIT_STAR = 48,       /* edges of a vertex that are followed, evenly chosen; ours       */
    TXI_FIT_LEAST = 5,       /* vertices in a fit, each gives up to three equations; ours      */
    TXI_FIT_CHUNK = 512,     /* vertices per task                                              */
    TXI_FIT_BATCH = 32       /* tasks between two progress reports                             */
};

/* Of one vertex; [0] the larger, [1] the smaller curvature. */
typedef struct txi_curvature {
    double k[2], e[2]; /* in 1 / unit of the mesh, and 1 / unit^2                              */
    txm_dvec3 t[2];    /* unit                                                                 */
    int is_valid;      /* 0: too few neighbours, all else is 0                                 */
} txi_curvature;

/* A welded mesh with its edges. */
typedef struct txi_shape {
    txm_mesh mesh;
    size_t edge_count;
    uint32_t *ends;       /* 2 per edge: its vertices, the lower first                         */
    uint32_t *edge;       /* 1 per side of a face                                              */
    uint32_t *star_first; /* vertex_count + 1: where the neighbours of a vertex begin          */
    uint32_t *star;       /* 2 per edge: neighbours                                            */
    txm_dvec3 *normal;    /* 1 per vertex: unit, outwards; 0 where there is none               */
    txm_dvec3 *fitted;    /* 1 per vertex: the better normal                                   */
    txi_curvature *curvature; /* 1 per vertex                                                  */
    int rings;
} txi_shape;

/* A mesh of triangles as one whose vertices in equal places are one (files repeat them for each
   chart), without the faces of which two corners are in one place. The input is checked. */
static txm_status txi_welded_make(const txm_mesh *input, txm_arena *arena, txm_env *env,
                                  txm_mesh *welded) {
    txi_surface points;
    size_t count = 0;
    memset(&points, 0, sizeof points);
    memset(welded, 0, sizeof *welded);
    if (input->face_count == 0) return TXM_OK;
    uint32_t *number = (uint32_t *)txm_arena_alloc(arena, input->vertex_count, sizeof(uint32_t));
    uint32_t *indices = (uint32_t *)txm_arena_alloc(arena, input->face_count, 3 * sizeof(uint32_t));
    float *place = (float *)txm_arena_alloc(arena, input->vertex_count, 3 * sizeof(float));
    if (arena->failed) return txi_no_memory(env);
    const txm_status status = txi_weld(input, &points, number, arena, env);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < input->vertex_count; v++)
        memcpy(place + 3 * (size_t)number[v], input->positions + 3 * v, 3 * sizeof(float));
    for (size_t f = 0; f < input->face_count; f++) {
        uint32_t *t = indices + 3 * count;
        for (size_t k = 0; k < 3; k++) t[k] = number[input->indices[3 * f + k]];
        count += t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    }
    welded->positions = place;
    welded->indices = indices;
    welded->vertex_count = points.vertex_count;
    welded->face_count = count;
    return TXM_OK;
}

/* Number the edges and collect the neighbours. sorted: room for 2 per side. */
static void txi_shape_edges(txi_shape *s, uint32_t *sorted) {
    const txm_mesh *mesh = &s->mesh;
    const size_t sides = txm_mesh_sides(mesh), n = mesh->vertex_count;
    txm_mesh_sort_sides(mesh, sorted);
    s->edge_count = 0;
    memset(s->star_first, 0, (n + 1) * sizeof *s->star_first);
    for (size_t i = 0, end; i < sides; i = end) {
        uint32_t *ends = s->ends + 2 * s->edge_count;
        end = txm_mesh_edge_end(mesh, sorted, i);
        ends[0] = txm_mesh_low(mesh, sorted[i]);
        ends[1] = txm_mesh_high(mesh, sorted[i]);
        for (size_t k = i; k < end; k++) s->edge[sorted[k]] = (uint32_t)s->edge_count;
        for (int k = 0; k < 2; k++) s->star_first[ends[k] + 1]++;
        s->edge_count++;
    }
    for (size_t v = 0; v < n; v++) s->star_first[v + 1] += s->star_first[v];
    for (size_t e = s->edge_count; e-- > 0;) { /* from the last place of each star to its first */
        const uint32_t a = s->ends[2 * e], b = s->ends[2 * e + 1];
        s->star[--s->star_first[a + 1]] = b;
        s->star[--s->star_first[b + 1]] = a;
    }
    for (size_t v = 0; v < n; v++) s->star_first[v] = s->star_first[v + 1];
    s->star_first[n] = (uint32_t)(2 * s->edge_count);
}

/* Which faces are to be turned over so that those of each connected part agree, as few as possible:
   flip receives 0 or 1 for each. Edges of other than two faces connect nothing; on surfaces that
   cannot be oriented some edge stays between faces that disagree.
   next    the rings of sides at an edge (txm_mesh_link)
   queue   room for 1 per face                                                              */
static void txi_shape_orient(const txm_mesh *mesh, const uint32_t *next, uint32_t *queue,
                             uint8_t *flip) {
    enum { UNSEEN = 2 };
    memset(flip, UNSEEN, mesh->face_count);
    for (size_t f = 0; f < mesh->face_count; f++) {
        size_t count = 0, turned = 0;
        if (flip[f] != UNSEEN) continue;
        flip[f] = 0;
        queue[count++] = (uint32_t)f;
        for (size_t i = 0; i < count; i++) {
            for (size_t side = 3 * (size_t)queue[i]; side < 3 * (size_t)queue[i] + 3; side++) {
                const size_t other = next[side], g = other / 3;
                if (other == side || next[other] != side || flip[g] != UNSEEN) continue;
                flip[g] = (uint8_t)(flip[queue[i]] ^ (txm_mesh_runs_down(mesh, side) ==
                                                      txm_mesh_runs_down(mesh, other)));
                turned += flip[g];
                TXM_ASSERT(count < mesh->face_count);
                queue[count++] = (uint32_t)g;
            }
        }
        for (size_t i = 0; i < count && 2 * turned > count; i++) flip[queue[i]] ^= 1;
    }
}

/* Normals of the vertices: the sum over their corners of a x b / (|a|^2 |b|^2), a and b the two
   sides there. It is exact on a sphere, whatever the triangles (N. Max, 1999). */
static void txi_shape_normals(txi_shape *s, const uint8_t *flip) {
    const size_t n = s->mesh.vertex_count;
    for (size_t v = 0; v < n; v++) s->normal[v] = txm_d3(0, 0, 0);
    for (size_t f = 0; f < s->mesh.face_count; f++) {
        txm_dvec3 p[3];
        txm_mesh_triangle(&s->mesh, f, p);
        for (size_t k = 0; k < 3; k++) {
            const txm_dvec3 a = txm_d3_sub(p[(k + 1) % 3], p[k]),
                            b = txm_d3_sub(p[(k + 2) % 3], p[k]);
            const double size = txm_d3_len2(a) * txm_d3_len2(b);
            txm_dvec3 *sum = &s->normal[s->mesh.indices[3 * f + k]];
            if (size > 0) *sum = txm_d3_mad(*sum, txm_d3_cross(a, b), (flip[f] ? -1 : 1) / size);
        }
    }
    for (size_t v = 0; v < n; v++) s->normal[v] = txm_d3_unit(s->normal[v]);
}

/* The vertices of up to so many rings around v, v first; returns their number. */
static int txi_fit_gather(const txi_shape *s, uint32_t v, uint32_t list[TXI_FIT_MOST]) {
    enum { SLOTS = 256 };
    uint32_t table[SLOTS]; /* vertex + 1; 0 = free */
    int count = 1, from = 0;
    memset(table, 0, sizeof table);
    table[txm_hash(v) % SLOTS] = v + 1;
    list[0] = v;
    for (int ring = 0; ring < s->rings; ring++) {
        const int end = count;
        for (; from < end; from++) {
            const uint32_t first = s->star_first[list[from]], last = s->star_first[list[from] + 1];
            const uint32_t step = 1 + (last - first - 1) / TXI_FIT_STAR;
            for (uint32_t i = first; i < last; i += step) {
                size_t slot = txm_hash(s->star[i]) % SLOTS;
                while (table[slot] && table[slot] != s->star[i] + 1) slot = (slot + 1) % SLOTS;
                if (table[slot]) continue;
                if (count == TXI_FIT_MOST) return count;
                table[slot] = s->star[i] + 1;
                list[count++] = s->star[i];
            }
        }
    }
    return count;
}

/* The normal equations of a least-squares fit: the lower half of A, and b. */
typedef struct txi_fit {
    double a[TXI_FIT_TERMS][TXI_FIT_TERMS], b[TXI_FIT_TERMS];
    int terms;
} txi_fit;

static void txi_fit_add(txi_fit *fit, const double row[TXI_FIT_TERMS], double value) {
    for (int i = 0; i < fit->terms; i++) {
        for (int j = 0; j <= i; j++) fit->a[i][j] += row[i] * row[j];
        fit->b[i] += row[i] * value;
    }
}

/* Solve by Cholesky factors, in place; b receives the solution; 0 if the equations do not determine
   it. */
static int txi_fit_solve(txi_fit *fit) {
    double(*a)[TXI_FIT_TERMS] = fit->a, *b = fit->b;
    for (int i = 0; i < fit->terms; i++) {
        const double whole = a[i][i];
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) sum -= a[i][k] * a[j][k];
            if (j < i) a[i][j] = sum / a[j][j];
            else if (sum > 1e-9 * whole) a[i][i] = sqrt(sum);
            else return 0;
        }
    }
    for (int i = 0; i < fit->terms; i++) {
        for (int k = 0; k < i; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    for (int i = fit->terms; i-- > 0;) {
        for (int k = i + 1; k < fit->terms; k++) b[i] -= a[k][i] * b[k];
        b[i] /= a[i][i];
    }
    return 1;
}

/* Curvatures from the coefficients b0 b1 b2 c0 c1 c2 c3, in a frame whose unit is `unit`. */
static void txi_curvature_set(txi_curvature *out, const double *c, txm_dvec3 frame[2],
                              double unit) {
    const double mean = (c[0] + c[2]) / 2, half = (c[0] - c[2]) / 2;
    const double root = sqrt(half * half + c[1] * c[1]);
    /* the eigenvector of the larger value, by the longer of two formulas */
    double x = half >= 0 ? half + root : c[1], y = half >= 0 ? c[1] : root - half;
    const double length = sqrt(x * x + y * y);
    x = length > 0 ? x / length : 1;
    y = length > 0 ? y / length : 0;
    for (int i = 0; i < 2; i++) {
        const double u = i ? -y : x, v = i ? x : y;
        out->k[i] = (i ? mean - root : mean + root) / unit;
        out->e[i] = (c[3] * u * u * u + 3 * c[4] * u * u * v + 3 * c[5] * u * v * v +
                     c[6] * v * v * v) / (unit * unit);
        out->t[i] = txm_d3_add(txm_d3_scale(frame[0], u), txm_d3_scale(frame[1], v));
    }
    out->is_valid = 1;
}

/* The neighbours of a vertex in its own frame: unit is their mean distance. */
typedef struct txi_patch {
    uint32_t list[TXI_FIT_MOST]; /* the vertex itself first                                    */
    int count;
    txm_dvec3 normal, frame[2];
    double unit;
} txi_patch;

/* 0 if there are too few neighbours. */
static int txi_patch_make(const txi_shape *s, uint32_t v, txi_patch *patch) {
    const txm_dvec3 n = s->normal[v], place = txm_d3_load(s->mesh.positions + 3 * (size_t)v);
    patch->count = txi_fit_gather(s, v, patch->list);
    if (!(txm_d3_len2(n) > 0) || patch->count <= TXI_FIT_LEAST) return 0;
    const txm_dvec3 axis = fabs(n.x) <= 0.6 ? txm_d3(1, 0, 0) : txm_d3(0, 1, 0);
    patch->normal = n;
    patch->frame[0] = txm_d3_unit(txm_d3_cross(n, axis));
    patch->frame[1] = txm_d3_cross(n, patch->frame[0]);
    patch->unit = 0;
    for (int i = 1; i < patch->count; i++) {
        const txm_dvec3 p = txm_d3_load(s->mesh.positions + 3 * (size_t)patch->list[i]);
        patch->unit += txm_d3_dist(place, p) / (patch->count - 1);
    }
    return 1;
}

/* Neighbour i in the frame: x, y and depth below the tangent plane; 0 where the surface is
   folded over or another sheet, so that it is no graph over the plane. */
static int txi_patch_place(const txi_shape *s, const txi_patch *patch, int i, double *x, double *y,
                           double *depth) {
    const float *p = s->mesh.positions;
    const txm_dvec3 d = txm_d3_scale(txm_d3_sub(txm_d3_load(p + 3 * (size_t)patch->list[i]),
                                                txm_d3_load(p + 3 * (size_t)patch->list[0])),
                                     1 / patch->unit);
    *x = txm_d3_dot(d, patch->frame[0]);
    *y = txm_d3_dot(d, patch->frame[1]);
    *depth = -txm_d3_dot(d, patch->normal);
    return txm_d3_dot(s->normal[patch->list[i]], patch->normal) > 0.1;
}

/* The normal of one vertex, from places. */
static void txi_fit_normal(const txi_shape *s, uint32_t v) {
    txi_patch patch;
    txi_fit fit;
    int used = 0;
    memset(&fit, 0, sizeof fit);
    fit.terms = TXI_FIT_TERMS;
    s->fitted[v] = s->normal[v];
    if (!txi_patch_make(s, v, &patch)) return;
    for (int i = 1; i < patch.count; i++) {
        double x, y, depth;
        if (!txi_patch_place(s, &patch, i, &x, &y, &depth)) continue;
        const double row[TXI_FIT_TERMS] = {x * x / 2,     x * y,         y * y / 2,
                                           x * x * x / 6, x * x * y / 2, x * y * y / 2,
                                           y * y * y / 6, x,             y};
        txi_fit_add(&fit, row, depth);
        used++;
    }
    if (used <= TXI_FIT_TERMS || !txi_fit_solve(&fit)) return;
    const txm_dvec3 better =
        txm_d3_unit(txm_d3_add(patch.normal, txm_d3_add(txm_d3_scale(patch.frame[0], fit.b[7]),
                                                        txm_d3_scale(patch.frame[1], fit.b[8]))));
    /* at sharp edges a cubic is no description, and the mean of the faces is */
    if (txm_d3_dot(better, patch.normal) > 0.9) s->fitted[v] = better;
}

/* The curvature of one vertex, from places and normals. */
static void txi_fit_curvature(const txi_shape *s, uint32_t v) {
    txi_patch patch;
    txi_fit fit;
    int used = 0;
    memset(&s->curvature[v], 0, sizeof s->curvature[v]);
    memset(&fit, 0, sizeof fit);
    fit.terms = TXI_FIT_CURVED;
    if (!txi_patch_make(s, v, &patch)) return;
    for (int i = 1; i < patch.count; i++) {
        const txm_dvec3 m = s->normal[patch.list[i]];
        const double up = txm_d3_dot(m, patch.normal);
        double x, y, depth;
        if (!txi_patch_place(s, &patch, i, &x, &y, &depth)) continue;
        const double row[3][TXI_FIT_TERMS] = {
            {x * x / 2, x * y, y * y / 2, x * x * x / 6, x * x * y / 2, x * y * y / 2,
             y * y * y / 6, 0, 0},
            {x, y, 0, x * x / 2, x * y, y * y / 2, 0, 0, 0},
            {0, x, y, 0, x * x / 2, x * y, y * y / 2, 0, 0}};
        txi_fit_add(&fit, row[0], depth);
        txi_fit_add(&fit, row[1], txm_d3_dot(m, patch.frame[0]) / up);
        txi_fit_add(&fit, row[2], txm_d3_dot(m, patch.frame[1]) / up);
        used++;
    }
    if (used >= TXI_FIT_LEAST && txi_fit_solve(&fit))
        txi_curvature_set(&s->curvature[v], fit.b, patch.frame, patch.unit);
}

/* One batch of fits, shared out in chunks. */
typedef struct txi_fit_batch {
    const txi_shape *shape;
    size_t first;
    void (*fit)(const txi_shape *s, uint32_t v);
} txi_fit_batch;

static void txi_fit_chunk(void *context, int index) {
    const txi_fit_batch *batch = (const txi_fit_batch *)context;
    const size_t from = batch->first + (size_t)index * TXI_FIT_CHUNK;
    for (size_t i = from; i < from + TXI_FIT_CHUNK && i < batch->shape->mesh.vertex_count; i++)
        batch->fit(batch->shape, (uint32_t)i);
}

/* Fit at all vertices; progress from..to. */
static txm_status txi_fit_all(const txi_shape *s, void (*fit)(const txi_shape *s, uint32_t v),
                              double from, double to, txm_env *env) {
    const size_t n = s->mesh.vertex_count;
    txi_fit_batch batch = {s, 0, fit};
    for (; batch.first < n; batch.first += (size_t)TXI_FIT_CHUNK * TXI_FIT_BATCH) {
        const size_t rest = (n - batch.first + TXI_FIT_CHUNK - 1) / TXI_FIT_CHUNK;
        const double part = (double)batch.first / (double)n;
        if (txm_progress(env, txm_float(from + (to - from) * part), "curvature"))
            return txi_stopped(env);
        txm_parallel_for(env, rest < TXI_FIT_BATCH ? (int)rest : TXI_FIT_BATCH, txi_fit_chunk,
                         &batch);
    }
    return TXM_OK;
}

/* Edges, normals and curvatures of a welded mesh. rings: 1 or more, 0 = TXI_FIT_RINGS.
   return  TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost    about 5 us per vertex with 2 rings                                               */
static txm_status txi_shape_make(const txm_mesh *welded, int rings, txm_arena *arena, txm_env *env,
                                 txi_shape *s) {
    const size_t faces = welded->face_count, n = welded->vertex_count;
    txm_arena scratch;
    memset(s, 0, sizeof *s);
    s->mesh = *welded;
    s->rings = rings ? rings : TXI_FIT_RINGS;
    if (faces == 0) return TXM_OK;
    txm_arena_init(&scratch, env);
    s->ends = (uint32_t *)txm_arena_alloc(arena, 3 * faces, 2 * sizeof(uint32_t));
    s->edge = (uint32_t *)txm_arena_alloc(arena, 3 * faces, sizeof(uint32_t));
    s->star_first = (uint32_t *)txm_arena_alloc(arena, n + 1, sizeof(uint32_t));
    s->star = (uint32_t *)txm_arena_alloc(arena, 3 * faces, 2 * sizeof(uint32_t));
    s->normal = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    s->fitted = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    s->curvature = (txi_curvature *)txm_arena_alloc(arena, n, sizeof(txi_curvature));
    uint32_t *sorted = (uint32_t *)txm_arena_alloc(&scratch, 3 * faces, 2 * sizeof(uint32_t));
    uint32_t *queue = (uint32_t *)txm_arena_alloc(&scratch, faces, sizeof(uint32_t));
    uint8_t *flip = (uint8_t *)txm_arena_alloc(&scratch, faces, 1);
    if (arena->failed || scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    txi_shape_edges(s, sorted);
    txm_mesh_link(welded, sorted, 0, sorted + 3 * faces);
    txi_shape_orient(welded, sorted + 3 * faces, queue, flip);
    txi_shape_normals(s, flip);
    txm_arena_free(&scratch);
    txm_status status = txi_fit_all(s, txi_fit_normal, 0, 0.4, env);
    if (status != TXM_OK) return status;
    s->normal = s->fitted;
    return txi_fit_all(s, txi_fit_curvature, 0.4, 0.9, env);
}

#endif /* TEXINPAINT_CURVATURE_H */
