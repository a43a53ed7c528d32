#ifndef TRIMESH_COVER_SEAMS_H
#define TRIMESH_COVER_SEAMS_H

#include "attributes.h"

/* ---- attributes: paths on the input ---------------------------------------------------------- */

/* The input, prepared for paths. */
typedef struct tmc_paths {
    txm_mesh input;
    tmc_values values;
    const txm_mesh *mesh;
    const txm_mesh_place *sources;
    uint32_t *welded; /* 1 per vertex: the first vertex in the same place                  */
    uint32_t *vertex; /* 1 per corner: its welded vertex                                   */
    uint32_t *next;   /* 1 per side, see txm_mesh_link                                     */
    uint8_t *seam;    /* 1 per side: 0 = none, 1 = seam, 2 = none or several on the other side */
    uint32_t *chart;  /* 1 per triangle: a triangle of its chart, the same for all of a chart  */
    float *out;
} tmc_paths;

/* A place on the input: (1 - u - v) a + u b + v c of a triangle. */
typedef struct tmc_place {
    size_t triangle;
    double u, v;
} tmc_place;

static txm_dvec3 tmc_point(const txm_mesh *input, tmc_place at) {
    txm_dvec3 p[3];
    txm_mesh_triangle(input, at.triangle, p);
    return txm_d3_mad(txm_d3_mad(p[0], txm_d3_sub(p[1], p[0]), at.u), txm_d3_sub(p[2], p[0]), at.v);
}

/* Give vertices in equal places the same number. pairs: room for 2 per vertex. */
static void tmc_weld(const txm_mesh *input, txm_pair *pairs, uint32_t *welded) {
    const size_t n = input->vertex_count;
    for (size_t i = 0; i < n; i++) pairs[i].value = (uint32_t)i;
    for (size_t axis = 3; axis-- > 0;) {
        for (size_t i = 0; i < n; i++) /* + 0: -0 becomes 0      */
            pairs[i].key = txm_sort_key(input->positions[3 * (size_t)pairs[i].value + axis] + 0.0f);
        txm_sort_pairs(pairs, pairs + n, n);
    }
    for (size_t i = 0; i < n; i++) {
        const size_t v = pairs[i].value, before = i ? pairs[i - 1].value : v;
        const float *p = input->positions + 3 * v, *q = input->positions + 3 * before;
        int equal = 1;
        for (int k = 0; k < 3; k++) equal &= p[k] >= q[k] && p[k] <= q[k];
        welded[v] = i && equal ? welded[before] : (uint32_t)v;
    }
}

static int tmc_equal_values(const tmc_values *x, size_t corner, size_t other) {
    const float *a = x->values + x->channels * x->entry[corner];
    const float *b = x->values + x->channels * x->entry[other];
    for (size_t i = 0; i < x->channels; i++) {
        if (!(a[i] >= b[i] && a[i] <= b[i])) return 0;
    }
    return 1;
}

static uint8_t tmc_seam(const tmc_paths *p, size_t side) {
    const size_t other = p->next[side];
    if (other == side || p->next[other] != side) return 2;
    size_t a = other, b = txm_mesh_next(&p->input, other); /* the same ends, in either order     */
    if (p->vertex[a] != p->vertex[side]) {
        a = b;
        b = other;
    }
    return !(tmc_equal_values(&p->values, side, a) &&
             tmc_equal_values(&p->values, txm_mesh_next(&p->input, side), b));
}

/* The first triangle of the chart that t is in so far; shortens the way there. */
static uint32_t tmc_chart(uint32_t *chart, uint32_t t) {
    while (chart[t] != t) t = chart[t] = chart[chart[t]];
    return t;
}

/* Charts: triangles that are joined by sides without seams. */
static void tmc_find_charts(tmc_paths *p) {
    const size_t n = p->input.face_count;
    for (size_t t = 0; t < n; t++) p->chart[t] = (uint32_t)t;
    for (size_t side = 0; side < 3 * n; side++) {
        if (p->seam[side]) continue;
        const uint32_t a = tmc_chart(p->chart, (uint32_t)(side / 3));
        const uint32_t b = tmc_chart(p->chart, p->next[side] / 3);
        p->chart[a > b ? a : b] = a > b ? b : a;
    }
    for (size_t t = 0; t < n; t++) p->chart[t] = tmc_chart(p->chart, (uint32_t)t);
}

static txm_status tmc_paths_build(tmc_paths *p, txm_arena *arena, txm_env *env) {
    const size_t n = p->input.vertex_count, sides = 3 * p->input.face_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    p->welded = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    p->vertex = (uint32_t *)txm_arena_alloc(arena, sides, sizeof(uint32_t));
    p->next = (uint32_t *)txm_arena_alloc(arena, sides, sizeof(uint32_t));
    p->seam = (uint8_t *)txm_arena_alloc(arena, sides, 1);
    p->chart = (uint32_t *)txm_arena_alloc(arena, p->input.face_count, sizeof(uint32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&scratch, n, 2 * sizeof(txm_pair));
    txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) status = tmc_check_memory(&scratch, env);
    if (status == TXM_OK) tmc_weld(&p->input, pairs, p->welded);
    txm_arena_free(&scratch);
    if (status != TXM_OK) return status;
    for (size_t i = 0; i < sides; i++) p->vertex[i] = p->welded[p->input.indices[i]];
    txm_mesh whole = p->input;
    whole.indices = p->vertex;
    if ((status = tmc_link(&whole, env, p->next)) != TXM_OK) return status;
    for (size_t i = 0; i < sides; i++) p->seam[i] = tmc_seam(p, i);
    tmc_find_charts(p);
    return TXM_OK;
}

/* ---- attributes: places on seams ------------------------------------------------------------- */

enum { TMC_MOST_SPOTS = 64 }; /* ours: triangles around a vertex that are looked at          */

/* A place on the input as all triangles there have it: one inside a triangle, two on a side, those
   around a vertex. The first is the place that was given. */
typedef struct tmc_spots {
    tmc_place at[TMC_MOST_SPOTS];
    size_t count;
    int on_seam; /* is there a seam between two of them? */
} tmc_spots;

/* the place at corner k of a triangle */
static tmc_place tmc_at_corner(size_t corner) {
    tmc_place at;
    at.triangle = corner / 3;
    at.u = corner % 3 == 1 ? 1 : 0;
    at.v = corner % 3 == 2 ? 1 : 0;
    return at;
}

/* the corner at this vertex of the triangle that a side belongs to */
static size_t tmc_corner_of(const tmc_paths *p, size_t side, uint32_t vertex) {
    const size_t next = txm_mesh_next(&p->input, side);
    return p->vertex[side] == vertex ? side : p->vertex[next] == vertex ? next
                                                                       : txm_mesh_next(&p->input, next);
}

/* Add the triangles around the vertex of a corner, first counter-clockwise, then the other way. */
static void tmc_spots_around(const tmc_paths *p, size_t corner, tmc_spots *s) {
    const uint32_t vertex = p->vertex[corner];
    for (int back = 0; back < 2; back++) {
        size_t c = corner, side = back ? corner : txm_mesh_next(&p->input, txm_mesh_next(&p->input, corner));
        while (p->seam[side] != 2 && s->count < TMC_MOST_SPOTS) {
            s->on_seam |= p->seam[side];
            const size_t other = p->next[side];
            c = tmc_corner_of(p, other, vertex);
            if (c / 3 == corner / 3) return; /* all around */
            s->at[s->count++] = tmc_at_corner(c);
            /* leave by the other one of the two sides at the vertex */
            side = other == c ? txm_mesh_next(&p->input, txm_mesh_next(&p->input, c)) : c;
        }
    }
}

/* All triangles at a place. */
static void tmc_find_spots(const tmc_paths *p, tmc_place at, tmc_spots *s) {
    const double w[3] = {1 - at.u - at.v, at.u, at.v};
    size_t zeros = 0, zero = 0, whole = 0;
    s->at[0] = at;
    s->count = 1;
    s->on_seam = 0;
    for (size_t k = 0; k < 3; k++) {
        if (w[k] <= TMC_SNAP) {
            zeros++;
            zero = k;
        } else whole = k;
    }
    if (zeros == 2) tmc_spots_around(p, 3 * at.triangle + whole, s);
    if (zeros != 1) return;
    const size_t side = 3 * at.triangle + (zero + 1) % 3; /* from corner k + 1 to k + 2 */
    if (p->seam[side] == 2) return;
    const size_t other = p->next[side], next = txm_mesh_next(&p->input, other);
    double weight[3] = {0, 0, 0};
    const int alike = p->vertex[other] == p->vertex[side];
    weight[(alike ? other : next) % 3] = w[(zero + 1) % 3];
    weight[(alike ? next : other) % 3] = w[(zero + 2) % 3];
    s->at[1].triangle = other / 3;
    s->at[1].u = weight[1];
    s->at[1].v = weight[2];
    s->count = 2;
    s->on_seam = p->seam[side];
}

/* Which of the spots lies in the chart? -1: none. */
static int tmc_spot_in_chart(const tmc_paths *p, const tmc_spots *s, uint32_t chart) {
    for (size_t i = 0; i < s->count; i++) {
        if (p->chart[s->at[i].triangle] == chart) return (int)i;
    }
    return -1;
}

/* Of the spots that lie in the chart of `at`, the one whose values are nearest to those there: where a
   chart is cut, both sides of the cut lie in it. 0: none lies in it. */
static int tmc_nearest_spot(const tmc_paths *p, const tmc_spots *s, tmc_place at, tmc_place *spot) {
    float here[TRIMESH_MAX_CHANNELS], there[TRIMESH_MAX_CHANNELS];
    double least = -1;
    tmc_interpolate(&p->values, at.triangle, at.u, at.v, here);
    for (size_t i = 0; i < s->count; i++) {
        double sum = 0;
        if (p->chart[s->at[i].triangle] != p->chart[at.triangle]) continue;
        tmc_interpolate(&p->values, s->at[i].triangle, s->at[i].u, s->at[i].v, there);
        for (size_t k = 0; k < p->values.channels; k++)
            sum += ((double)here[k] - there[k]) * ((double)here[k] - there[k]);
        if (least >= 0 && sum >= least) continue;
        least = sum;
        *spot = s->at[i];
    }
    return least >= 0;
}

/* A path: from `start` towards `end` in the plane through both along `up`. */
typedef struct tmc_path {
    txm_dvec3 start, ahead, across; /* ahead: to the end; across: normal of the plane           */
    double reach;                 /* |ahead|^2                                                */
    size_t goal;                  /* the triangle of the end; SIZE_MAX = not known            */
    int through;                  /* cross seams                                              */
} tmc_path;

/* Where the plane meets a side, as a fraction of it. The values on both sides of the plane are
   computed from the vertex alone, so that all triangles there give the same result. */
static double tmc_cut(const tmc_path *w, const txm_dvec3 c[3], size_t k) {
    const double f = txm_d3_dot(txm_d3_sub(c[k], w->start), w->across);
    const double g = txm_d3_dot(txm_d3_sub(c[(k + 1) % 3], w->start), w->across);
    return f / (f - g);
}

/* the place at share s of side k of a triangle */
static tmc_place tmc_on_side(size_t triangle, size_t k, double s) {
    tmc_place at;
    at.triangle = triangle;
    s = s >= 0 ? s <= 1 ? s : 1 : 0;
    at.u = k == 0 ? s : k == 1 ? 1 - s : 0;
    at.v = k == 1 ? s : k == 2 ? 1 - s : 0;
    return at;
}

static double tmc_along(const tmc_path *w, txm_dvec3 x) {
    return txm_d3_dot(txm_d3_sub(x, w->start), w->ahead);
}

/* The side by which the path leaves a triangle: a side that the plane meets, not the side `from`
   (0..2); at the start from is 3, then the one further ahead. Returns 3 if there is none. */
static size_t tmc_exit(const tmc_path *w, const txm_dvec3 c[3], size_t from) {
    int above[3];
    size_t best = 3;
    double furthest = 0;
    for (size_t k = 0; k < 3; k++)
        above[k] = txm_d3_dot(txm_d3_sub(c[k], w->start), w->across) >= 0;
    for (size_t k = 0; k < 3; k++) {
        const size_t n = (k + 1) % 3;
        if (above[k] == above[n] || k == from) continue;
        const double s = tmc_cut(w, c, k);
        const double along = tmc_along(w, txm_d3_mad(c[k], txm_d3_sub(c[n], c[k]), s));
        if (best != 3 && along <= furthest) continue;
        best = k;
        furthest = along;
    }
    return best;
}

/* Follow a path. *at is its start and receives its end: where it meets a seam, or the place at the
   distance of the end. Returns 1 if it came to the goal triangle. */
static int tmc_walk(const tmc_paths *p, const tmc_path *w, tmc_place *at) {
    size_t triangle = at->triangle, from = 3;
    int reached = 0;
    for (int step = 0; step < 1 << 16; step++) {
        txm_dvec3 c[3];
        if (triangle == w->goal) return 1;
        txm_mesh_triangle(&p->input, triangle, c);
        const size_t k = tmc_exit(w, c, from);
        if (k == 3) return 0;
        const double s = tmc_cut(w, c, k);
        const txm_dvec3 x = txm_d3_mad(c[k], txm_d3_sub(c[(k + 1) % 3], c[k]), s);
        const double along = tmc_along(w, x), least = -0.5 * w->reach;
        const tmc_place out = tmc_on_side(triangle, k, s);
        if (!reached && along >= w->reach) {
            /* between the entry and the exit; the end may also lie in a triangle nearby */
            tmc_place in = *at;
            if (from < 3) in = tmc_on_side(triangle, from, tmc_cut(w, c, from));
            const double before = tmc_along(w, tmc_point(&p->input, in));
            const double share = along > before ? (w->reach - before) / (along - before) : 1;
            const double t = share >= 0 ? share <= 1 ? share : 1 : 0;
            at->triangle = triangle;
            at->u = in.u + t * (out.u - in.u);
            at->v = in.v + t * (out.v - in.v);
            const txm_dvec3 gap =
                txm_d3_sub(tmc_point(&p->input, *at), txm_d3_add(w->start, w->ahead));
            if (w->goal == SIZE_MAX || txm_d3_len2(gap) <= 1e-12 * w->reach) return 0;
            reached = 1;
        }
        if (!reached) *at = out;
        const size_t side = 3 * triangle + k;
        if (along > 2 * w->reach || along < least) return 0;
        if (p->seam[side] == 2 || (p->seam[side] && !w->through)) return 0;
        triangle = p->next[side] / 3;
        from = p->next[side] % 3;
    }
    return 0;
}

/* A path from a place, which is first moved a little into its triangle: so the plane surely cuts
   two sides of it, and a start in a corner needs no search around the corner. */
static tmc_path tmc_path_make(const tmc_paths *p, tmc_place *at, txm_dvec3 end, txm_dvec3 up,
                              size_t goal, int through) {
    tmc_path w;
    at->u += 1e-3 * (1.0 / 3 - at->u);
    at->v += 1e-3 * (1.0 / 3 - at->v);
    w.start = tmc_point(&p->input, *at);
    w.ahead = txm_d3_sub(end, w.start);
    w.across = txm_d3_cross(up, w.ahead);
    w.reach = txm_d3_len2(w.ahead);
    w.goal = goal;
    w.through = through;
    return w;
}

/* If the chart of the middle is not one that all three corners have, but another is, as where a seam
   bends between two corners on it, take that one: its place at the first corner, moved inwards by the
   path to the middle. */
static void tmc_choose_chart(const tmc_paths *p, const tmc_spots spots[3], tmc_place *middle) {
    size_t first = 0;
    for (size_t k = 1; k < 3; k++)
        if (spots[k].count < spots[first].count) first = k;
    const tmc_spots *s = &spots[first];
    int found = -1;
    for (size_t i = 0; i < s->count; i++) {
        const uint32_t chart = p->chart[s->at[i].triangle];
        if (tmc_spot_in_chart(p, &spots[(first + 1) % 3], chart) < 0 ||
            tmc_spot_in_chart(p, &spots[(first + 2) % 3], chart) < 0)
            continue;
        if (chart == p->chart[middle->triangle]) return;
        if (found < 0) found = (int)i;
    }
    if (found >= 0) *middle = s->at[found];
}

/* The values at the corners of one triangle of the mesh. */
static void tmc_transfer_face(const tmc_paths *p, size_t t) {
    tmc_place from[3];
    tmc_spots spots[3];
    txm_dvec3 c[3];
    for (size_t k = 0; k < 3; k++) {
        const txm_mesh_place *s = &p->sources[p->mesh->indices[3 * t + k]];
        from[k].triangle = s->triangle;
        from[k].u = s->u;
        from[k].v = s->v;
        c[k] = tmc_point(&p->input, from[k]);
        tmc_find_spots(p, from[k], &spots[k]);
    }
    const txm_dvec3 up = txm_d3_unit(txm_d3_area2(c[0], c[1], c[2]));
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(txm_d3_add(c[0], c[1]), c[2]), 1.0 / 3);
    tmc_place centre = from[0];
    const tmc_path way = tmc_path_make(p, &centre, middle, up, SIZE_MAX, 1);
    if (way.reach > 0) tmc_walk(p, &way, &centre);
    tmc_choose_chart(p, spots, &centre);
    for (size_t k = 0; k < 3; k++) {
        tmc_place at = centre;
        const tmc_path w = tmc_path_make(p, &at, c[k], up, from[k].triangle, 0);
        if (tmc_walk(p, &w, &at)) at = from[k];
        else if (spots[k].on_seam) tmc_nearest_spot(p, &spots[k], at, &at);
        tmc_interpolate(&p->values, at.triangle, at.u, at.v,
                        p->out + p->values.channels * (3 * t + k));
    }
}

static void tmc_transfer_faces(const void *job, size_t first, size_t end) {
    for (size_t t = first; t < end; t++) tmc_transfer_face((const tmc_paths *)job, t);
}

TRIMESH_COVER_API txm_status trimesh_transfer_corners(const txm_mesh *input, const trimesh_values *values,
                                                const txm_mesh *mesh, const txm_mesh_place *sources,
                                                txm_env *env, float *out) {
    tmc_paths p;
    txm_arena arena;
    memset(&p, 0, sizeof p);
    txm_status status = txm_mesh_check(input, "input", 3, 1, TRIMESH_MAX_VERTICES, env);
    if (status == TXM_OK) status = tmc_check_values(input, values, env, &p.values);
    if (status == TXM_OK) status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status == TXM_OK) status = tmc_check_sources(input, sources, mesh->vertex_count, env);
    if (status != TXM_OK || mesh->face_count == 0) return status;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    if (tmc_report(env, 0, "seams") != TXM_OK) return TXM_CANCELLED;
    p.input = *input;
    p.mesh = mesh;
    p.sources = sources;
    p.out = out;
    txm_arena_init(&arena, env);
    status = tmc_paths_build(&p, &arena, env);
    if (status == TXM_OK)
        status = tmc_run_blocks(tmc_transfer_faces, &p, mesh->face_count, 0.3, 1, "values", env);
    txm_arena_free(&arena);
    return status;
}

/* ---- attributes: doubled vertices ------------------------------------------------------------ */

/* the bits of a float, the same for 0 and -0 */
static uint32_t tmc_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits == 0x80000000u ? 0 : bits;
}

static int tmc_equal_bits(const float *a, const float *b, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (tmc_bits(a[i]) != tmc_bits(b[i])) return 0;
    }
    return 1;
}

/* Sort the corners by vertex, and those of one vertex by a hash of their values. */
static void tmc_sort_corners(const txm_mesh *mesh, const float *values, size_t channels,
                             txm_pair *pairs) {
    const size_t n = 3 * mesh->face_count;
    for (size_t c = 0; c < n; c++) {
        uint64_t hash = 0;
        for (size_t i = 0; i < channels; i++)
            hash = txm_hash(hash + tmc_bits(values[channels * c + i]) + 1);
        pairs[c].key = (uint32_t)(hash >> 32);
        pairs[c].value = (uint32_t)c;
    }
    txm_sort_pairs(pairs, pairs + n, n);
    for (size_t i = 0; i < n; i++) pairs[i].key = mesh->indices[pairs[i].value];
    txm_sort_pairs(pairs, pairs + n, n);
}

TRIMESH_COVER_API txm_status trimesh_split_corners(const txm_mesh *mesh, const float *values,
                                             int channels, txm_env *env, uint32_t *new_indices,
                                             uint32_t *corners, size_t *count) {
    txm_arena arena;
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (channels < 1 || channels > TRIMESH_MAX_CHANNELS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "channels must be 1 to TRIMESH_MAX_CHANNELS");
    if (!count || (mesh->face_count && !values))
        return txm_fail(env, TXM_BAD_ARGUMENT, "values or count is NULL");
    const size_t n = 3 * mesh->face_count, width = (size_t)channels;
    if (tmc_report(env, 0, "corners") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&arena, n, 2 * sizeof(txm_pair));
    size_t made = 0;
    if ((status = tmc_check_memory(&arena, env)) != TXM_OK) goto done;
    tmc_sort_corners(mesh, values, width, pairs);
    /* Equal corners now follow each other, except where different values have the same hash, which
       is rare: then there is an extra vertex, which does no harm. */
    for (size_t i = 0; i < n; i++) {
        const size_t c = pairs[i].value, before = pairs[i ? i - 1 : 0].value;
        const int fresh = i == 0 || mesh->indices[c] != mesh->indices[before] ||
                          !tmc_equal_bits(values + width * c, values + width * before, width);
        if (fresh && corners) corners[made] = (uint32_t)c;
        made += (size_t)fresh;
        if (new_indices) new_indices[c] = (uint32_t)(made - 1);
    }
    *count = made;
done:
    txm_arena_free(&arena);
    return status;
}

#endif /* TRIMESH_COVER_SEAMS_H */
