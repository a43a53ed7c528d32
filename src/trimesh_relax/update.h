#ifndef TRIMESH_RELAX_UPDATE_H
#define TRIMESH_RELAX_UPDATE_H

#include "job.h"

/* ---- after the surface has changed ---------------------------------------------------------- */

/* The new surface is retiled with points that come from three places: the old mesh, where it lies
   on the new surface; its lines, in the gaps between the old points there; and the rest of the
   surface that no triangle of the old mesh covers. Then as in TRIMESH_REPEL these are put into the
   mesh of the surface, whose own vertices are removed. Between old points the edges of the old mesh
   are restored, points far from anything new are pinned, and the others are relaxed. */

enum { TMR_LEAF = 4 }; /* triangles in a leaf of the tree */

/* Triangles in a tree of boxes: in the order of a space-filling curve, leaves of TMR_LEAF, a full
   binary tree over them. Node i has children 2 i + 1, 2 i + 2. */
typedef struct tmr_tree {
    const txm_dvec3 *point;
    const int32_t *vertex; /* 3 per triangle */
    txm_pair *order;       /* .value: triangle */
    int32_t count, leaves; /* leaves: a power of two */
    txm_dvec3 *low, *high; /* 1 per node */
} tmr_tree;

static void tmr_grow_box(txm_dvec3 *low, txm_dvec3 *high, txm_dvec3 p) {
    *low = txm_d3(fmin(low->x, p.x), fmin(low->y, p.y), fmin(low->z, p.z));
    *high = txm_d3(fmax(high->x, p.x), fmax(high->y, p.y), fmax(high->z, p.z));
}

static txm_status tmr_tree_build(tmr_tree *t, const txm_dvec3 *point, const int32_t *vertex,
                                 int32_t count, txm_arena *arena) {
    t->point = point;
    t->vertex = vertex;
    t->count = count;
    t->leaves = 1;
    while (t->leaves < (count + TMR_LEAF - 1) / TMR_LEAF) t->leaves *= 2;
    const size_t nodes = 2 * (size_t)t->leaves;
    t->order = (txm_pair *)txm_arena_alloc(arena, (size_t)count, sizeof(txm_pair));
    txm_pair *room = (txm_pair *)txm_arena_alloc(arena, (size_t)count, sizeof(txm_pair));
    t->low = (txm_dvec3 *)txm_arena_alloc(arena, nodes, sizeof(txm_dvec3));
    t->high = (txm_dvec3 *)txm_arena_alloc(arena, nodes, sizeof(txm_dvec3));
    const txm_status status = tmr_check_memory(arena);
    if (status != TXM_OK) return status;
    for (int32_t f = 0; f < count; f++) {
        const int32_t *v = vertex + 3 * f;
        t->order[f].value = (uint32_t)f;
        t->order[f].key = tmr_curve_key(
            txm_d3_scale(txm_d3_add(txm_d3_add(point[v[0]], point[v[1]]), point[v[2]]), 1.0 / 3));
    }
    txm_sort_pairs(t->order, room, (size_t)count);
    for (int32_t i = 2 * t->leaves - 2; i >= 0; i--) {
        txm_dvec3 low = txm_d3(1e300, 1e300, 1e300), high = txm_d3(-1e300, -1e300, -1e300);
        if (i < t->leaves - 1) {
            low = t->low[2 * i + 1];
            high = t->high[2 * i + 1];
            tmr_grow_box(&low, &high, t->low[2 * i + 2]);
            tmr_grow_box(&low, &high, t->high[2 * i + 2]);
            if (t->low[2 * i + 2].x > t->high[2 * i + 2].x) { /* nothing in it    */
                low = t->low[2 * i + 1];
                high = t->high[2 * i + 1];
            }
        }
        const int32_t first = (i - t->leaves + 1) * TMR_LEAF;
        for (int32_t k = 0; k < 3 * TMR_LEAF && i >= t->leaves - 1; k++)
            if (first + k / 3 < count)
                tmr_grow_box(&low, &high, point[vertex[3 * t->order[first + k / 3].value +
                                                       (uint32_t)(k % 3)]]);
        t->low[i] = low;
        t->high[i] = high;
    }
    return TXM_OK;
}

/* squared distance from p to the box of a node */
static double tmr_box_dist2(const tmr_tree *t, int32_t i, txm_dvec3 p) {
    const double x = fmax(fmax(t->low[i].x - p.x, p.x - t->high[i].x), 0);
    const double y = fmax(fmax(t->low[i].y - p.y, p.y - t->high[i].y), 0);
    const double z = fmax(fmax(t->low[i].z - p.z, p.z - t->high[i].z), 0);
    return x * x + y * y + z * z;
}

enum { TMR_TREE_DEPTH = 64 }; /* each level leaves one node on the stack: of 2^31 at most 31, and one */

/* The triangle nearest to p within reach whose normal agrees with n to the cosine `agree`; -1:
   none. *at: the place on it. */
static int32_t tmr_tree_nearest(const tmr_tree *t, txm_dvec3 p, txm_dvec3 n, double agree,
                                double reach, tmr_place *at) {
    int32_t stack[TMR_TREE_DEPTH], size = 0, best = -1;
    double least = reach * reach;
    stack[size++] = 0;
    while (size > 0) {
        const int32_t i = stack[--size];
        if (tmr_box_dist2(t, i, p) > least) continue;
        if (i < t->leaves - 1) { /* the nearer one first */
            const int distant = tmr_box_dist2(t, 2 * i + 1, p) < tmr_box_dist2(t, 2 * i + 2, p);
            TRIMESH_ASSERT(size + 2 <= TMR_TREE_DEPTH);
            stack[size++] = 2 * i + 1 + distant;
            stack[size++] = 2 * i + 2 - distant;
            continue;
        }
        const int32_t first = (i - t->leaves + 1) * TMR_LEAF;
        for (int32_t k = first; k < first + TMR_LEAF && k < t->count; k++) {
            tmr_place here;
            const int32_t f = (int32_t)t->order[k].value, *v = t->vertex + 3 * f;
            const txm_dvec3 a = t->point[v[0]], b = t->point[v[1]], c = t->point[v[2]];
            here.face = f;
            here.p = tmr_nearest(p, a, b, c, &here.u, &here.v, &here.part);
            here.d2 = txm_d3_dist2(p, here.p);
            if (here.d2 > least || (best >= 0 && here.d2 >= least)) continue;
            const txm_dvec3 across = txm_d3_area2(a, b, c);
            if (txm_d3_dot(across, n) < agree * txm_d3_len(across)) continue;
            least = here.d2;
            best = f;
            *at = here;
        }
    }
    return best;
}

/* ---- points in a grid ------------------------------------------------------------------------- */

typedef struct tmr_grid {
    double cell;
    int32_t mask;
    int32_t *head; /* 1 per slot: the last vertex put there, or -1 */
    int32_t *next; /* 1 per vertex of the mesh: the one before it */
} tmr_grid;

static int32_t tmr_grid_slot(const tmr_grid *g, double x, double y, double z) {
    const uint64_t h = txm_hash(txm_hash(txm_hash((uint64_t)(int64_t)x) ^ (uint64_t)(int64_t)y) ^
                                (uint64_t)(int64_t)z);
    return (int32_t)(h & (uint64_t)g->mask);
}

static txm_status tmr_grid_build(tmr_grid *g, double cell, int32_t points, int32_t vertices,
                                 txm_arena *arena) {
    int32_t size = 16;
    while (size < points && size < (1 << 28)) size *= 2;
    g->cell = cell;
    g->mask = size - 1;
    g->head = (int32_t *)txm_arena_alloc(arena, (size_t)size, sizeof(int32_t));
    g->next = (int32_t *)txm_arena_alloc(arena, (size_t)vertices, sizeof(int32_t));
    const txm_status status = tmr_check_memory(arena);
    if (status != TXM_OK) return status;
    for (int32_t i = 0; i < size; i++) g->head[i] = -1;
    return TXM_OK;
}

static void tmr_grid_add(tmr_grid *g, txm_dvec3 p, int32_t v) {
    int32_t *head = g->head + tmr_grid_slot(g, floor(p.x / g->cell), floor(p.y / g->cell),
                                            floor(p.z / g->cell));
    TRIMESH_ASSERT(*head != v); /* no point twice: it would be the one before itself */
    g->next[v] = *head;
    *head = v;
}

/* Is a point of the grid nearer to p than reach, on the same side of a sheet? was: NULL, or 1 per
   vertex: those with a number >= 0 do not count. */
static int tmr_is_crowded(const tmr_grid *g, const tmr_work *w, const int32_t *was, txm_dvec3 p,
                          txm_dvec3 n, double reach) {
    const int k = (int)fmin(ceil(reach / g->cell), 8);
    const double x = floor(p.x / g->cell), y = floor(p.y / g->cell), z = floor(p.z / g->cell);
    for (int i = -k; i <= k; i++) {
        for (int j = -k; j <= k; j++) {
            for (int l = -k; l <= k; l++) {
                int32_t v = g->head[tmr_grid_slot(g, x + i, y + j, z + l)];
                for (; v >= 0; v = g->next[v]) {
                    if (was && was[v] >= 0) continue;
                    if (txm_d3_dist2(w->m.p[v], p) < reach * reach &&
                        txm_d3_dot(w->m.n[v], n) > -0.1)
                        return 1;
                }
            }
        }
    }
    return 0;
}

/* ---- the update ------------------------------------------------------------------------------ */

typedef struct tmr_update {
    const trimesh_mesh *old;
    txm_env env; /* the caller's hooks; progress goes through rising */
    tmr_rising rising;
    trimesh_desc desc;
    double radius, tolerance; /* in edge lengths */
    tmr_surface s;
    tmr_lines l;
    tmr_work w;
    tmr_sampling t;
    tmr_tree tree;       /* of the surface                                                       */
    tmr_tree old_tree;
    tmr_grid grid;
    txm_dvec3
        *old_point;      /* 1 per vertex of the old mesh, scaled                                  */
    int32_t *old_vertex; /* 3 per triangle of the old mesh                                       */
    int32_t *now;        /* 1 per vertex of the old mesh: its vertex in the new one, -1            */
    int32_t *was;        /* 1 per vertex of the new one: its vertex in the old one, -1            */
    int32_t *face;       /* 1 per vertex of the old mesh: the face it lies in, -1                 */
    txm_dvec3 *place;    /* 1 per vertex of the old mesh: where                                  */
    int32_t *segment; /* 1 per corner of the surface: the segment on its edge, -1               */
    double *way;         /* 1 per vertex of the old mesh on a line: distance from its beginning  */
    int32_t *level;      /* 1 per vertex of the mesh: edges to the nearest new one                 */
    txm_arena input, first, scratch;
} tmr_update;

/* a vertex of the old mesh: its normal */
static txm_dvec3 tmr_old_normal(const tmr_update *u, int32_t i) {
    const float *n = u->old->normals + 3 * (size_t)i;
    return txm_d3(n[0], n[1], n[2]);
}

/* Segments by the corners opposite to them. */
static void tmr_map_segments(tmr_update *u) {
    const tmr_surface *s = &u->s;
    for (int32_t c = 0; c < 3 * s->face_count; c++) u->segment[c] = -1;
    for (int32_t k = 0; k < u->l.segment_count; k++) {
        for (int32_t c = 3 * u->l.face[k]; c < 3 * u->l.face[k] + 3; c++) {
            const int32_t a = s->vertex[tmr_next(c)], b = s->vertex[tmr_prev(c)];
            if ((a != u->l.a[k] || b != u->l.b[k]) && (a != u->l.b[k] || b != u->l.a[k])) continue;
            u->segment[c] = k;
            if (s->opposite[c] >= 0) u->segment[s->opposite[c]] = k;
        }
    }
}

/* Take segment k for old vertex i if it is nearer than *least and of the right kind. */
static void tmr_try_segment(tmr_update *u, int32_t i, int32_t k, double *least) {
    if (k < 0 || (u->l.border[u->l.line[k]] != 0) != (u->old->kinds[i] == TRIMESH_BORDER)) return;
    const txm_dvec3 a = u->s.point[u->l.a[k]], b = u->s.point[u->l.b[k]], ab = txm_d3_sub(b, a);
    double t = txm_d3_dot(txm_d3_sub(u->old_point[i], a), ab) / (txm_d3_len2(ab) + 1e-300);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    const double d2 = txm_d3_dist2(u->old_point[i], txm_d3_mad(a, ab, t));
    if (d2 > *least) return;
    *least = d2;
    u->face[i] = k;
    double way = 0; /* in wanted edge lengths */
    for (int32_t j = u->l.first[u->l.line[k]]; j < k; j++) way += tmr_segment_weight(&u->s, &u->l, j);
    u->way[i] = way + t * tmr_segment_weight(&u->s, &u->l, k);
}

/* The segment that an old vertex on a line lies on now, among those of a face and around its
   corners; -1: none. */
static void tmr_find_segment(tmr_update *u, int32_t i, int32_t face) {
    const double reach = u->tolerance * u->t.length;
    double least = reach * reach;
    u->face[i] = -1;
    for (int k = 0; k < 3; k++) {
        const int32_t first = u->s.corner[u->s.vertex[3 * face + k]];
        int32_t c = first;
        for (int guard = 0; c >= 0 && guard < 256; guard++) {
            tmr_try_segment(u, i, u->segment[tmr_next(c)], &least);
            tmr_try_segment(u, i, u->segment[tmr_prev(c)], &least);
            c = tmr_ccw(u->s.opposite, c);
            if (c == first) break;
        }
    }
}

/* If old vertex i, a corner, lies at a corner of the new surface, map it there. */
static void tmr_find_corner(tmr_update *u, int32_t i, int32_t face) {
    const double reach = u->tolerance * u->t.length;
    for (int k = 0; k < 3; k++) {
        const int32_t v = u->s.vertex[3 * face + k];
        if (u->l.kind[v] != TRIMESH_CORNER || u->was[v] >= 0) continue;
        if (txm_d3_dist2(u->s.point[v], u->old_point[i]) > reach * reach) continue;
        u->now[i] = v;
        u->was[v] = i;
    }
}

/* Where do the old vertices lie on the new surface? For those on lines `face` is the segment. */
static void tmr_find_old(tmr_update *u) {
    for (int32_t i = 0; i < (int32_t)u->old->vertex_count; i++) {
        tmr_place at;
        const int kind = u->old->kinds[i];
        const int sharp = kind != TRIMESH_FREE; /* there are two normals there    */
        u->now[i] = u->face[i] = -1;
        const int32_t f = tmr_tree_nearest(&u->tree, u->old_point[i], tmr_old_normal(u, i),
                                           sharp ? -2 : 0.7, u->tolerance * u->t.length, &at);
        if (f < 0) continue;
        if (kind == TRIMESH_CORNER) tmr_find_corner(u, i, f);
        else if (kind != TRIMESH_FREE) tmr_find_segment(u, i, f);
        else {
            u->face[i] = f;
            u->place[i] = at.p;
        }
    }
}

/* ---- the update: lines ----------------------------------------------------------------------- */

/* List the old vertices on lines in their order along them in pairs[].value. Returns how many. */
static size_t tmr_order_on_lines(const tmr_update *u, txm_pair *pairs, txm_pair *room) {
    size_t n = 0;
    for (size_t i = 0; i < u->old->vertex_count; i++) {
        const int kind = u->old->kinds[i];
        if ((kind != TRIMESH_BORDER && kind != TRIMESH_CREASE) || u->face[i] < 0) continue;
        pairs[n].key = txm_sort_key(txm_float(u->way[i]));
        pairs[n++].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, room, n);
    for (size_t k = 0; k < n; k++) pairs[k].key = (uint32_t)u->l.line[u->face[pairs[k].value]];
    txm_sort_pairs(pairs, room, n);
    return n;
}

/* Fill the gap between two places on a line with evenly spaced new ones. */
static int32_t tmr_fill_gap(tmr_update *u, double from, double to, double spacing, int32_t count,
                            int32_t room, int32_t *olds) {
    const double steps = floor((to - from) / spacing + 0.5);
    for (double k = 1; k < steps && count < room; k++) {
        u->t.ways[count] = from + (to - from) * k / steps;
        olds[count++] = -1;
    }
    return count;
}

/* Points on a line: the old ones that are far enough apart, and new ones in the gaps. */
static txm_status tmr_update_line(tmr_update *u, int32_t line, const txm_pair *pairs, size_t count,
                                  int32_t *olds, int32_t *vertices, int32_t room) {
    const double length = tmr_line_weight(&u->s, &u->l, line);
    const double scale = u->desc.line_spacing > 0 ? u->desc.line_spacing : 1;
    const double spacing = u->t.length * scale;
    const int closed = u->l.closed[line];
    double last = 0, begin = 0;
    int32_t n = 0;
    size_t kept = 0;
    for (size_t k = 0; k < count && n < room; k++) {
        const int32_t i = (int32_t)pairs[k].value;
        const double way = u->way[i], end = closed && kept ? begin + length : length;
        const int first = closed && kept == 0;
        if (!first && way - last < 0.5 * spacing) continue;
        if ((!closed || kept) && end - way < 0.5 * spacing) continue;
        if (first) begin = way;
        else n = tmr_fill_gap(u, last, way, spacing, n, room, olds);
        if (n >= room) break;
        u->t.ways[n] = way;
        olds[n++] = i;
        last = way;
        kept++;
    }
    if (kept == 0 || !closed) { /* the rest, or all */
        const int32_t steps = kept ? 0 : tmr_line_steps(&u->t, line);
        if (closed && room > 0) {
            u->t.ways[n] = 0;
            olds[n++] = -1;
        }
        n = tmr_fill_gap(u, last, length, steps ? length / steps : spacing, n, room, olds);
    } else { /* across the end of the loop to the first one; those beyond the end move to the front */
        n = tmr_fill_gap(u, last, begin + length, spacing, n, room, olds);
        int32_t over = 0;
        while (over < n && u->t.ways[n - 1 - over] >= length) over++;
        for (int32_t turn = 0; turn < over; turn++) {
            const double way = u->t.ways[n - 1] - length;
            memmove(u->t.ways + 1, u->t.ways, ((size_t)n - 1) * sizeof(double));
            memmove(olds + 1, olds, ((size_t)n - 1) * sizeof(int32_t));
            u->t.ways[0] = way;
            olds[0] = -1;
        }
    }
    const txm_status status = tmr_cut_line(&u->t, line, u->t.ways, n, vertices);
    if (status != TXM_OK) return status;
    for (int32_t k = 0; k < n; k++) {
        if (olds[k] < 0 || vertices[k] < 0 || u->was[vertices[k]] >= 0) continue;
        u->was[vertices[k]] = olds[k];
        u->now[olds[k]] = vertices[k];
    }
    return TXM_OK;
}

static txm_status tmr_update_lines(tmr_update *u) {
    const size_t n = u->old->vertex_count;
    const int32_t room = 3 * u->t.line_room + 16;
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&u->scratch, 2 * n, sizeof(txm_pair));
    int32_t *olds = (int32_t *)txm_arena_alloc(&u->scratch, 2 * (size_t)room, sizeof(int32_t));
    u->t.ways = (double *)txm_arena_alloc(&u->scratch, (size_t)room, sizeof(double));
    txm_status status = tmr_check_memory(&u->scratch);
    if (status != TXM_OK) return status;
    for (int32_t v = 0; v < u->s.vertex_count; v++) u->t.keep[v] = u->l.kind[v] == TRIMESH_CORNER;
    const size_t count = tmr_order_on_lines(u, pairs, pairs + n);
    size_t k = 0;
    for (int32_t line = 0; line < u->l.line_count && status == TXM_OK; line++) {
        const size_t first = k;
        while (k < count && pairs[k].key == (uint32_t)line) k++;
        status = tmr_update_line(u, line, pairs + first, k - first, olds, olds + room, room);
    }
    if (status == TXM_TOO_SMALL)
        txm_fail(u->w.env, status,
                 "creases and borders take more vertices than there is room for; "
                 "give more, or a larger line_spacing");
    return status;
}

/* ---- the update: points on faces -------------------------------------------------------------- */

/* Put the old vertices on faces into the mesh, face by face, except those too near to lines. */
static txm_status tmr_update_old(tmr_update *u) {
    const size_t n = u->old->vertex_count;
    size_t count = 0;
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&u->scratch, 2 * n, sizeof(txm_pair));
    if (!pairs) return TXM_OUT_OF_MEMORY;
    for (int32_t v = 0; v < u->w.m.vertex_count; v++)
        if (u->t.keep[v]) tmr_grid_add(&u->grid, u->w.m.p[v], v);
    for (size_t i = 0; i < n; i++) {
        if (u->old->kinds[i] != TRIMESH_FREE || u->face[i] < 0) continue;
        const tmr_place at = tmr_on_face(&u->s, u->face[i], u->place[i]);
        const double reach = 0.6 * u->t.length * tmr_scale_at(&u->s, &at);
        const txm_dvec3 normal = u->s.normal[u->face[i]];
        if (tmr_is_crowded(&u->grid, &u->w, u->was, u->place[i], normal, reach)) continue;
        pairs[count].key = (uint32_t)u->face[i];
        pairs[count++].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, pairs + n, count);
    for (size_t k = 0; k < count; k++) {
        const int32_t i = (int32_t)pairs[k].value;
        const int32_t v = tmr_insert(&u->t, u->face[i], u->place[i], 1);
        if (v < 0) continue;
        u->now[i] = v;
        u->was[v] = i;
        tmr_grid_add(&u->grid, u->w.m.p[v], v);
    }
    return TXM_OK;
}

/* Is a place of the new surface covered by a triangle of the old mesh all of whose corners are
   still there? */
static int tmr_is_covered(const tmr_update *u, txm_dvec3 p, txm_dvec3 n, double length) {
    tmr_place at;
    const int32_t f = tmr_tree_nearest(&u->old_tree, p, n, 0.5, 0.5 * length, &at);
    if (f < 0) return 0;
    for (int k = 0; k < 3; k++)
        if (u->now[u->old_vertex[3 * f + k]] < 0) return 0;
    return 1;
}

/* Put new points where there are none: try many places, along the faces, and take those that keep
   the distance from all others and that the old mesh does not cover. limit: most points in all. */
static txm_status tmr_update_new(tmr_update *u, const txm_pair *order, double distance,
                                 int32_t *live, int32_t limit, uint64_t stream) {
    const double area = 0.86602540378443865 * u->t.length * u->t.length; /* of one point */
    txm_rng rng = txm_rng_make(u->desc.seed, stream);
    double run = 0;
    for (int32_t i = 0; i < u->s.face_count && *live < limit; i++) {
        const int32_t f = (int32_t)order[i].value;
        run += 6 * u->t.piece[f] / area;
        const int32_t tries = run < 1 ? 0 : run > 1e8 ? 100000000 : (int32_t)run;
        run -= tries;
        if (tmr_tick(&u->w, 1)) return TXM_CANCELLED;
        for (int32_t k = 0; k < tries && *live < limit; k++) {
            if (tmr_tick(&u->w, 1)) return TXM_CANCELLED;
            const txm_dvec3 p = tmr_sample_place(&u->s, f, k, tries, &rng), n = u->s.normal[f];
            const tmr_place at = tmr_on_face(&u->s, f, p);
            const double length = u->t.length * tmr_scale_at(&u->s, &at);
            if (tmr_is_crowded(&u->grid, &u->w, NULL, p, n, distance * length)) continue;
            if (tmr_is_covered(u, p, n, length)) continue;
            const int32_t v = tmr_insert(&u->t, f, p, 0);
            if (v < 0) continue;
            tmr_grid_add(&u->grid, u->w.m.p[v], v);
            ++*live;
        }
    }
    return TXM_OK;
}

static txm_status tmr_update_sample(tmr_update *u) {
    /* in falling distance: a random packing at 0.78 is as dense as the lattice at 1 */
    static const double distance[] = {0.85, 0.75, 0.65, 0.55};
    const size_t n = (size_t)u->s.face_count;
    const int exact = u->desc.vertices > 0;
    int32_t live = 0;
    txm_status status = tmr_update_lines(u);
    if (status == TXM_OK) status = tmr_update_old(u);
    if (status != TXM_OK) return status;
    txm_pair *order = (txm_pair *)txm_arena_alloc(&u->scratch, 2 * n, sizeof(txm_pair));
    if (!order) return TXM_OUT_OF_MEMORY;
    tmr_order_faces(&u->s, order, order + n);
    for (int32_t v = 0; v < u->w.m.vertex_count; v++) live += u->t.keep[v];
    for (int pass = 0; pass < (exact ? 4 : 2) && status == TXM_OK; pass++)
        status = tmr_update_new(u, order, distance[pass], &live,
                                exact ? (int32_t)u->desc.vertices : TMR_MOST,
                                77 + (uint64_t)pass);
    return status;
}

/* ---- the update: what stays as it was ----------------------------------------------------------- */

static uint64_t tmr_edge_key(int32_t a, int32_t b) {
    const uint64_t x = (uint64_t)(a < b ? a : b), y = (uint64_t)(a < b ? b : a);
    return (x << 32 | y) + 1; /* 0 = free */
}

static int tmr_has_edge(const uint64_t *table, size_t mask, int32_t a, int32_t b) {
    const uint64_t key = tmr_edge_key(a, b);
    for (size_t i = (size_t)txm_hash(key) & mask; table[i]; i = (i + 1) & mask)
        if (table[i] == key) return 1;
    return 0;
}

/* Flip edges between old vertices to restore those of the old mesh. */
static txm_status tmr_restore_edges(tmr_update *u) {
    tmr_mesh *m = &u->w.m;
    const size_t n = 3 * u->old->triangle_count;
    size_t size = 16;
    while (size < 2 * n) size *= 2; /* an edge has a triangle or two: at most half of it is used */
    uint64_t *table = (uint64_t *)txm_arena_zero(&u->scratch, size, sizeof(uint64_t));
    if (!table) return TXM_OUT_OF_MEMORY;
    for (size_t c = 0; c < n; c++) {
        const int32_t a = u->now[u->old->indices[c]];
        const int32_t b = u->now[u->old->indices[c % 3 == 2 ? c - 2 : c + 1]];
        if (a < 0 || b < 0 || tmr_has_edge(table, size - 1, a, b)) continue;
        size_t i = (size_t)txm_hash(tmr_edge_key(a, b)) & (size - 1);
        while (table[i]) i = (i + 1) & (size - 1);
        table[i] = tmr_edge_key(a, b);
    }
    for (int round = 0; round < 20; round++) {
        int32_t turned = 0;
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (m->vertex[c] < 0 || m->opposite[c] < c || m->edge[c]) continue;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            const int32_t d = m->vertex[c], e = m->vertex[m->opposite[c]];
            tmr_quad q;
            if (u->was[d] < 0 || u->was[e] < 0 || !tmr_has_edge(table, size - 1, d, e)) continue;
            if (tmr_has_edge(table, size - 1, a, b) || !tmr_measure_flip(&u->w, c, &q)) continue;
            if (q.after <= 0 && q.after <= q.before) continue;
            tmr_flip(m, c);
            turned++;
        }
        if (turned == 0) break;
    }
    return TXM_OK;
}

/* Pin the old vertices that are farther than the radius, in edges, from every new vertex and from
   every place where an old one is gone. */
static void tmr_pin(tmr_update *u) {
    tmr_mesh *m = &u->w.m;
    const int32_t most = (int32_t)ceil(u->radius);
    for (int32_t v = 0; v < m->vertex_count; v++) u->level[v] = u->was[v] < 0 ? 0 : most + 1;
    for (size_t c = 0; c < 3 * u->old->triangle_count; c++) {
        const uint32_t i = u->old->indices[c], j = u->old->indices[c % 3 == 2 ? c - 2 : c + 1];
        if (u->now[i] < 0 && u->now[j] >= 0) u->level[u->now[j]] = 1;
        if (u->now[j] < 0 && u->now[i] >= 0) u->level[u->now[i]] = 1;
    }
    for (int32_t round = 0; round < most; round++) {
        for (int32_t c = 0; c < 3 * m->face_count; c++) {
            if (m->vertex[c] < 0 || tmr_is_ghost_face(m, c / 3)) continue;
            const int32_t a = m->vertex[tmr_next(c)], b = m->vertex[tmr_prev(c)];
            if (u->level[a] == round && u->level[b] > round + 1) u->level[b] = round + 1;
            if (u->level[b] == round && u->level[a] > round + 1) u->level[a] = round + 1;
        }
    }
    for (int32_t v = 0; v < m->vertex_count; v++)
        if (m->corner[v] >= 0 && !tmr_is_ghost(m, v) && u->level[v] > most)
            m->flags[v] |= TMR_PINNED;
}

/* ---- the update: the whole ---------------------------------------------------------------------- */

static txm_status tmr_update_alloc(tmr_update *u) {
    const size_t n = u->old->vertex_count, t = u->old->triangle_count;
    const size_t room = (size_t)u->w.m.vertex_limit;
    txm_arena *arena = &u->first;
    u->old_point = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    u->place = (txm_dvec3 *)txm_arena_alloc(arena, n, sizeof(txm_dvec3));
    u->now = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    u->face = (int32_t *)txm_arena_alloc(arena, n, sizeof(int32_t));
    u->way = (double *)txm_arena_zero(arena, n, sizeof(double));
    u->old_vertex = (int32_t *)txm_arena_alloc(arena, 3 * t, sizeof(int32_t));
    u->was = (int32_t *)txm_arena_alloc(arena, room, sizeof(int32_t));
    u->level = (int32_t *)txm_arena_zero(arena, room, sizeof(int32_t));
    u->segment = (int32_t *)txm_arena_alloc(arena, 3 * (size_t)u->s.face_count, sizeof(int32_t));
    txm_status status = tmr_check_memory(arena);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < n; i++) {
        const float *p = u->old->positions + 3 * i;
        u->old_point[i] =
            txm_d3_scale(txm_d3_sub(txm_d3(p[0], p[1], p[2]), u->s.centre), 1 / u->s.diagonal);
    }
    for (size_t c = 0; c < 3 * t; c++) u->old_vertex[c] = (int32_t)u->old->indices[c];
    for (size_t v = 0; v < room; v++) u->was[v] = -1;
    status = tmr_tree_build(&u->tree, u->s.point, u->s.vertex, u->s.face_count, arena);
    if (status == TXM_OK)
        status = tmr_tree_build(&u->old_tree, u->old_point, u->old_vertex, (int32_t)t, arena);
    return status;
}

/* How many points the surface has at edge length u->t.length. */
static double tmr_points_for(const tmr_update *u) {
    const double scale = u->desc.line_spacing > 0 ? u->desc.line_spacing : 1;
    double area = 0, border = 0;
    for (int32_t f = 0; f < u->s.face_count; f++) area += tmr_face_weight(&u->s, f);
    for (int32_t i = 0; i < u->l.line_count; i++)
        if (u->l.border[i]) border += tmr_line_weight(&u->s, &u->l, i);
    return area / (0.86602540378443865 * u->t.length * u->t.length) +
           0.5 * border / (u->t.length * scale);
}

static txm_status tmr_update_begin(tmr_update *u, trimesh_report *report) {
    txm_env *env = u->w.env;
    const float angle = u->desc.crease_angle > 0 ? u->desc.crease_angle : TMR_CREASE_ANGLE;
    trimesh_desc desc = u->desc;
    double least = 0; /* not checked: the old mesh says how many there are */
    if (desc.vertices == 0) desc.vertices = u->old->vertex_count;
    txm_status status = tmr_surface_build(&desc, env, &u->input, report, &u->s);
    if (status != TXM_OK) return status;
    const double length = u->old->edge_length / u->s.diagonal;
    if (u->desc.adapt > 0)
        status = tmr_adapt_scale(&u->s, length, u->desc.adapt, &u->input, &u->scratch);
    if (status == TXM_OK)
        status = tmr_settle_lines(&u->s, &u->desc, (double)desc.vertices, angle, length, &u->input,
                                  &u->scratch, report, &u->l, &least);
    if (status == TXM_OK) status = tmr_find_fans(&u->s, &u->input, &u->scratch);
    if (status != TXM_OK) return status;
    u->w.desc = &u->desc;
    u->w.s = &u->s;
    u->w.l = &u->l;
    u->t.w = &u->w;
    u->t.desc = &u->desc;
    u->t.length = length;
    if (u->desc.vertices > 0)
        u->t.length =
            tmr_sampling_length(&u->s, &u->l, u->desc.line_spacing > 0 ? u->desc.line_spacing : 1,
                                (double)u->desc.vertices);
    u->w.length = u->t.length;
    u->w.line_scale = u->desc.line_spacing > 0 ? u->desc.line_spacing : 1;
    const double points = fmax(tmr_points_for(u), (double)u->old->vertex_count);
    if (points > (double)TRIMESH_MAX_VERTICES || 4 * points > (double)TMR_MOST)
        return txm_fail(env, TXM_TOO_LARGE,
                        "the new surface takes too many vertices at the density of the old mesh; say how many");
    status = tmr_copy_surface(&u->w, tmr_sampling_room(floor(2 * points)), &u->first);
    if (status == TXM_OK) status = tmr_sampling_alloc(&u->t, &u->scratch);
    if (status == TXM_OK) status = tmr_update_alloc(u);
    if (status == TXM_OK)
        status =
            tmr_grid_build(&u->grid, u->t.length, (int32_t)points, u->w.m.vertex_limit, &u->first);
    if (status != TXM_OK) return status;
    tmr_map_segments(u);
    tmr_find_old(u);
    return TXM_OK;
}

static txm_status tmr_update_relax(tmr_update *u) {
    tmr_work *w = &u->w;
    int32_t missing = 0;
    w->pull = 0.5;
    w->step = 1;
    for (int round = 0; round < 12; round++) {
        for (int k = 0; k < 2; k++) tmr_relax(w);
        tmr_flip_delaunay(w, 3);
        tmr_flip_valences(w, 3, 0.4);
        if (round == 4 && u->desc.vertices > 0) {
            const txm_status status =
                tmr_fix_count(w, (int32_t)u->desc.vertices, 2, &u->scratch, &missing);
            if (status != TXM_OK) return status;
        }
        if (txm_progress(w->env, 0.6f + 0.03f * (float)round, "relax")) return TXM_CANCELLED;
    }
    if (missing != 0)
        return txm_fail(w->env, TXM_TOO_SMALL,
                        "the vertices asked for do not fit into what has changed; ask for 0");
    long faults;
    const txm_status status = tmr_mend_spots(w, &faults);
    if (status != TXM_OK) return status;
    if (faults > 0)
        return txm_fail(w->env, TXM_TOO_SMALL, "the changed part is too thin or too fine for "
                        "edges of this length; retile the whole with more vertices");
    return TXM_OK;
}

/* Make the result; pinned vertices keep their positions bit for bit. */
static txm_status tmr_update_write(tmr_update *u, trimesh_mesh **out) {
    const tmr_mesh *m = &u->w.m;
    trimesh_mesh *mesh = NULL;
    const txm_status status = tmr_write(&u->w, &mesh);
    if (status != TXM_OK) return status;
    int32_t *which = (int32_t *)txm_arena_alloc(&mesh->memory, mesh->vertex_count, sizeof(int32_t));
    if (!which) {
        trimesh_mesh_free(mesh);
        return TXM_OUT_OF_MEMORY;
    }
    size_t k = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (m->corner[v] < 0 || tmr_is_ghost(m, v)) continue;
        which[k] = u->was[v];
        if (m->flags[v] & TMR_PINNED)
            memcpy(mesh->positions + 3 * k, u->old->positions + 3 * (size_t)u->was[v],
                   3 * sizeof(float));
        k++;
    }
    mesh->edge_length = u->t.length * u->s.diagonal;
    mesh->old_vertices = which;
    *out = mesh;
    return TXM_OK;
}

static txm_status tmr_update_run(tmr_update *u, trimesh_report *report, trimesh_mesh **out) {
    txm_status status = tmr_update_begin(u, report);
    if (status != TXM_OK) return status;
    if (txm_progress(u->w.env, 0.2f, "sample")) return TXM_CANCELLED;
    if ((status = tmr_update_sample(u)) != TXM_OK) return status;
    if (txm_progress(u->w.env, 0.4f, "join")) return TXM_CANCELLED;
    if ((status = tmr_remove_vertices(&u->w, u->t.keep, 0.4f)) != TXM_OK) return status;
    if ((status = tmr_restore_edges(u)) != TXM_OK) return status;
    tmr_pin(u);
    if ((status = tmr_update_relax(u)) != TXM_OK) return status;
    return tmr_update_write(u, out);
}

static txm_status tmr_check_update(const trimesh_mesh *old, const trimesh_update_desc *desc,
                                   txm_env *env) {
    if (!old || !desc) return txm_fail(env, TXM_BAD_ARGUMENT, "old or desc is NULL");
    trimesh_desc check = desc->desc;
    if (check.vertices == 0) check.vertices = 4;
    if (!(desc->radius >= 1 && desc->radius <= 1000) && !(desc->radius >= 0 && desc->radius <= 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "radius must be 1 to 1000, or 0");
    if (!(desc->tolerance >= 0 && desc->tolerance <= 0.5f))
        return txm_fail(env, TXM_BAD_ARGUMENT, "tolerance must be 0 to 0.5");
    const txm_mesh view = trimesh_as_view(old);
    const txm_status status = txm_mesh_check(&view, "old", 3, 1, TMR_MOST, env);
    if (status != TXM_OK) return status;
    if (old->triangle_count == 0 || !(old->edge_length > 0) || !old->normals || !old->kinds)
        return txm_fail(env, TXM_BAD_ARGUMENT, "old is no result of trimesh_retile");
    return tmr_check_desc(&check, env);
}

TRIMESH_API txm_status trimesh_update(const trimesh_mesh *old, const trimesh_update_desc *desc,
                                      txm_env *env, trimesh_mesh **mesh) {
    trimesh_report own, *report = &own;
    if (desc && desc->desc.report) report = desc->desc.report;
    memset(report, 0, sizeof *report);
    if (!mesh) return txm_fail(env, TXM_BAD_ARGUMENT, "mesh is NULL");
    *mesh = NULL;
    txm_status status = tmr_check_update(old, desc, env);
    if (status != TXM_OK) return status;
    tmr_update *u = (tmr_update *)txm_alloc(env, sizeof *u);
    if (!u) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for an update");
    memset(u, 0, sizeof *u);
    u->old = old;
    u->desc = desc->desc;
    u->radius = desc->radius > 0 ? desc->radius : 4;
    u->tolerance = desc->tolerance > 0 ? desc->tolerance : 0.2;
    if (env) u->env = *env;
    u->env.message[0] = 0;
    u->w.env = &u->env;
    tmr_rise_in(&u->rising, &u->env);
    txm_arena_init(&u->input, &u->env);
    txm_arena_init(&u->first, &u->env);
    txm_arena_init(&u->scratch, &u->env);
    status = tmr_update_run(u, report, mesh);
    if (status == TXM_OUT_OF_MEMORY) txm_fail(env, status, "no memory to update the mesh");
    else if (status == TXM_CANCELLED) txm_fail(env, status, "cancelled while updating the mesh");
    else if (status != TXM_OK) txm_fail(env, status, u->env.message);
    txm_arena_free(&u->input);
    txm_arena_free(&u->first);
    txm_arena_free(&u->scratch);
    txm_free(env, u);
    return status;
}

#endif /* TRIMESH_RELAX_UPDATE_H */
