#ifndef TEXINPAINT_GEODESIC_H
#define TEXINPAINT_GEODESIC_H

#include "surface.h"

/* ---- geodesic: distances along the surface --------------------------------------------------- */

#define TXI_UNREACHED 1e300 /* the distance of what has not been reached */

/* A vertex waits with the distance that it had when it was put in; the heap has the least on
   top. */
typedef struct txi_wait {
    double distance;
    uint32_t vertex;
} txi_wait;

typedef struct txi_heap {
    txi_wait *items;
    size_t count, room;
} txi_heap;

static int txi_wait_before(txi_wait a, txi_wait b) {
    if (a.distance < b.distance || b.distance < a.distance) return a.distance < b.distance;
    return a.vertex < b.vertex;
}

/* 0: no memory. */
static int txi_heap_push(txi_heap *heap, txm_arena *arena, double distance, uint32_t vertex) {
    const txi_wait item = {distance, vertex};
    size_t at = heap->count;
    if (heap->count == heap->room) {
        const size_t room = heap->room ? 2 * heap->room : 256;
        txi_wait *items = (txi_wait *)txm_arena_alloc(arena, room, sizeof(txi_wait));
        if (!items) return 0;
        if (heap->count) memcpy(items, heap->items, heap->count * sizeof(txi_wait));
        heap->items = items;
        heap->room = room;
    }
    for (heap->count++; at > 0; at = (at - 1) / 2) {
        const txi_wait parent = heap->items[(at - 1) / 2];
        if (!txi_wait_before(item, parent)) break;
        heap->items[at] = parent;
    }
    heap->items[at] = item;
    return 1;
}

static txi_wait txi_heap_pop(txi_heap *heap) {
    const txi_wait top = heap->items[0], last = heap->items[--heap->count];
    size_t at = 0;
    for (size_t child = 1; child < heap->count; child = 2 * at + 1) {
        if (child + 1 < heap->count && txi_wait_before(heap->items[child + 1], heap->items[child]))
            child++;
        if (!txi_wait_before(heap->items[child], last)) break;
        heap->items[at] = heap->items[child];
        at = child;
    }
    heap->items[at] = last;
    return top;
}

/* The distance of c from a source whose distances from a and b are known, along straight lines
   through the triangle a b c: unfolded into its plane, the source is where the circles about a and
   b with these radii meet beyond a b.

                c            With a at 0 and b at (l, 0), the source is at (x, -y):
               / \               x = (l^2 + da^2 - db^2) / 2l,  y^2 = da^2 - x^2.
              a---b          If its line to c misses a b, the way leads through a or b.
               \ ' |
                 ' s                                                                        */
static double txi_unfold_distance(txm_dvec3 a, txm_dvec3 b, txm_dvec3 c, double da, double db) {
    const txm_dvec3 ab = txm_d3_sub(b, a), ac = txm_d3_sub(c, a);
    const double l = txm_d3_len(ab), around = fmin(da + txm_d3_len(ac), db + txm_d3_dist(b, c));
    if (!(l > 0)) return around;
    const double cx = txm_d3_dot(ac, ab) / l;
    const double cy = sqrt(fmax(0, txm_d3_len2(ac) - cx * cx));
    if (da <= 0 && db <= 0) return cx >= 0 && cx <= l ? cy : around; /* the edge is the source */
    const double x = (l * l + da * da - db * db) / (2 * l), yy = da * da - x * x;
    if (!(yy >= 0)) return around;
    const double y = sqrt(yy), cross = y + cy > 0 ? x + (cx - x) * (y / (y + cy)) : x;
    if (!(cross >= 0 && cross <= l)) return around;
    return fmin(around, sqrt((cx - x) * (cx - x) + (cy + y) * (cy + y)));
}

/* Lower the distance of the third corner of the triangle after those of corners i and j. */
static int txi_geodesic_update(const txi_surface *s, txi_heap *heap, txm_arena *arena, double limit,
                               uint32_t i, uint32_t j, uint32_t k, double *distance) {
    const uint32_t a = s->vertex[i], b = s->vertex[j], c = s->vertex[k];
    const double da = distance[a], db = distance[b];
    const double d = db < TXI_UNREACHED
                         ? txi_unfold_distance(s->point[a], s->point[b], s->point[c], da, db)
                         : da + txm_d3_dist(s->point[a], s->point[c]);
    /* by more than rounding, or it might go on for ever */
    if (d > limit || d >= distance[c] * (1 - 1e-9)) return 1;
    distance[c] = d;
    return txi_heap_push(heap, arena, d, c);
}

/* Distances along the surface from sources, by label correcting in the order of a heap; each
   triangle unfolds the source that lies behind two of its corners into its plane, which is exact as
   long as the unfolded triangles are: on planes, however the triangles are shaped. Elsewhere
   distances are too long by a fraction of a percent. (Exact algorithms keep intervals of edges
   instead, which costs ten times as much.)

   This holds for distances from one place. Several sources are not told apart: a triangle whose two
   corners were reached from different ones unfolds them as if they were one. Distances from a line
   come out too short by up to 2 %.

   sources   vertices, start their distances (NULL = 0). For a place inside a triangle: its corners,
             with their distances from it. Two corners at 0 make their whole edge a source
   limit     vertices farther away are not reached
   distance  receives one for each vertex of the surface, TXI_UNREACHED beyond limit
   cost      O(n log n) for n vertices within limit                                       */
static txm_status txi_geodesic(const txi_surface *s, const uint32_t *sources, const double *start,
                               size_t source_count, double limit, txm_env *env, double *distance) {
    txm_arena scratch;
    txi_heap heap;
    int good = 1;
    memset(&heap, 0, sizeof heap);
    txm_arena_init(&scratch, env);
    for (size_t v = 0; v < s->vertex_count; v++) distance[v] = TXI_UNREACHED;
    for (size_t i = 0; i < source_count && good; i++) {
        const double d = start ? start[i] : 0;
        if (d > limit || d >= distance[sources[i]]) continue;
        distance[sources[i]] = d;
        good = txi_heap_push(&heap, &scratch, d, sources[i]);
    }
    while (heap.count && good) {
        const txi_wait next = txi_heap_pop(&heap);
        if (next.distance > distance[next.vertex]) continue;
        for (uint32_t i = s->first[next.vertex]; i < s->first[next.vertex + 1] && good; i++) {
            const uint32_t c = s->corners[i], p = txi_next_corner(c), q = txi_next_corner(p);
            if (txi_is_flat_face(s, c / 3)) continue;
            good = txi_geodesic_update(s, &heap, &scratch, limit, c, p, q, distance) &&
                   txi_geodesic_update(s, &heap, &scratch, limit, c, q, p, distance);
        }
    }
    txm_arena_free(&scratch);
    return good ? TXM_OK : txi_no_memory(env);
}

#endif /* TEXINPAINT_GEODESIC_H */
