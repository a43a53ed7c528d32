/* mesh_polygon.c - polygons become triangles
   SPDX-License-Identifier: MIT OR Unlicense

   Ears are cut off: corners whose triangle holds no other corner. Of all ears the next one is that
   with the shortest cut and the roundest triangle, so that long polygons are halved again and again
   instead of becoming fans of slivers. Only corners that are not convex can lie in an ear; a tree of
   boxes over them, and lists of the ears that each of them holds up, make it O(n log n) steps for
   the polygons that there are.                                                                  */
#include "mesh_file.h"

#include <assert.h>

enum {
    LEAF = 8,         /* corners in a box of the lowest level                                 */
    MOST_LEVELS = 32, /* of boxes                                                             */
    MOST_FORCED = 32  /* ears that are none and are cut while others may become free          */
};

static const uint32_t NONE = 0xffffffffu;

/* Corners that bend less, and that lie nearer to a cut, count as lying on it, as those along a line
   that does not run along an axis do, though rounding has moved them. Relative to lengths. */
static const double NEARLY = 1e-5;

/* Corners that lie farther from their plane, relative to the polygon's size, are seen along the
   plane's normal; others along an axis, where rounding changes nothing. */
static const double MOST_BEND = 1e-3;

static const double COST_OF_REFLEX = 1e200; /* above those of all ears */

/* A corner of the polygon that is left. */
typedef struct bend {
    double at[2];    /* where it is seen, counter-clockwise                                    */
    double space[3]; /* where it is, in units of about the polygon's size                      */
    double cost;
    uint32_t previous, next;
    uint32_t in_heap; /* its place in the heap, or NONE                                        */
    uint32_t in_tree; /* its place in the order of the tree, or NONE: it cannot be in any ear  */
    uint32_t first_waiting;                        /* of the ears that it holds up             */
    uint32_t waits_for, next_waiting, last_waiting; /* as one of those                         */
} bend;

/* A box of corners that are not convex, count of which are left. */
typedef struct box {
    double low[2], high[2];
    uint32_t count;
} box;

typedef struct order {
    uint64_t key;
    uint32_t corner;
} order;

typedef enum ear_rule { EAR_CLEAR, EAR_EXACT, EAR_ANY } ear_rule;

typedef struct ears {
    bend *corners;
    uint32_t *heap;  /* convex corners, least cost first; room for all                         */
    order *sorted;   /* what the tree holds; room for all                                      */
    box *boxes;      /* 1 is the root, those of i are 2 i and 2 i + 1; leaves from leaf_start  */
    uint32_t count, left, first, heap_count, leaf_start, box_room;
    ear_rule rule;
    double nearly; /* NEARLY, or 0 */
} ears;

/* ---- geometry ---------------------------------------------------------------------------- */

/* Twice the area of a triangle in the plane, positive if counter-clockwise. */
static double area2(const double *a, const double *b, const double *c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static double distance2(const double *a, const double *b, int dimensions) {
    double sum = 0;
    for (int k = 0; k < dimensions; k++) sum += (a[k] - b[k]) * (a[k] - b[k]);
    return sum;
}

static int same_point(const double *a, const double *b) {
    return a[0] == b[0] && a[1] == b[1];
}

/* Four times the squared area of a triangle in space. */
static double area2_squared(const double *a, const double *b, const double *c) {
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const int y = (k + 1) % 3, z = (k + 2) % 3;
        const double n = (b[y] - a[y]) * (c[z] - a[z]) - (b[z] - a[z]) * (c[y] - a[y]);
        sum += n * n;
    }
    return sum;
}

/* Positions relative to the first one, in units of a power of two near the polygon's size. */
static void measure(const double *positions, const corner *p, bend *to, size_t n) {
    const double *origin = positions + 3 * (size_t)p[0].vertex;
    double most = 0;
    int exponent = 0;
    for (size_t i = 0; i < n; i++) {
        const double *a = positions + 3 * (size_t)p[i].vertex;
        for (int k = 0; k < 3; k++) {
            to[i].space[k] = a[k] - origin[k];
            most = fmax(most, fabs(to[i].space[k]));
        }
    }
    if (!(most > 0)) return;
    frexp(most, &exponent);
    if (exponent < -1000) exponent = -1000;
    const double unit = ldexp(1, -exponent);
    for (size_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) to[i].space[k] *= unit;
    }
}

/* Newell's sum: twice the area, along the normal, of any polygon, flat or not. */
static void sum_normal(const bend *c, size_t n, double normal[3]) {
    normal[0] = normal[1] = normal[2] = 0;
    for (size_t i = 0; i < n; i++) {
        const double *a = c[i].space, *b = c[i + 1 < n ? i + 1 : 0].space;
        for (int k = 0; k < 3; k++) {
            const int y = (k + 1) % 3, z = (k + 2) % 3;
            normal[k] += (a[y] - b[y]) * (a[z] + b[z]);
        }
    }
}

/* How far the corners lie from a plane with this normal, at most. */
static double bend_of(const bend *c, size_t n, const double normal[3]) {
    const double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    double low = 0, high = 0;
    for (size_t i = 0; i < n && length > 0; i++) {
        double height = 0;
        for (int k = 0; k < 3; k++) height += normal[k] / length * c[i].space[k];
        low = fmin(low, height);
        high = fmax(high, height);
    }
    return high - low;
}

/* The corners as they are seen, so that they run counter-clockwise: along the axis that the polygon
   faces most, or if it is bent, along its normal. */
static void flatten(bend *c, size_t n) {
    double normal[3], u[3] = {0, 0, 0}, v[3] = {0, 0, 0};
    int axis = 0;
    sum_normal(c, n, normal);
    for (int k = 1; k < 3; k++) {
        if (fabs(normal[k]) > fabs(normal[axis])) axis = k;
    }
    const int x = (axis + 1) % 3, y = (axis + 2) % 3, is_turned = normal[axis] < 0;
    u[is_turned ? y : x] = v[is_turned ? x : y] = 1;
    if (bend_of(c, n, normal) > MOST_BEND) { /* v = normal x u, both across the normal */
        const double ratio = u[x] != 0 ? normal[x] / normal[axis] : normal[y] / normal[axis];
        u[axis] = -ratio;
        const double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
        const double unit = sqrt(1 + ratio * ratio);
        for (int k = 0; k < 3; k++) u[k] /= unit;
        for (int k = 0; k < 3; k++) {
            const int a = (k + 1) % 3, b = (k + 2) % 3;
            v[k] = (normal[a] * u[b] - normal[b] * u[a]) / length;
        }
    }
    for (size_t i = 0; i < n; i++) {
        const double *p = c[i].space;
        c[i].at[0] = p[0] * u[0] + p[1] * u[1] + p[2] * u[2];
        c[i].at[1] = p[0] * v[0] + p[1] * v[1] + p[2] * v[2];
    }
}

/* ---- the heap of ears -------------------------------------------------------------------- */

static int is_before(const ears *e, uint32_t a, uint32_t b) {
    const double x = e->corners[a].cost, y = e->corners[b].cost;
    return x < y || (x == y && a < b);
}

static void put_in_heap(ears *e, uint32_t at, uint32_t corner_at) {
    assert(at < e->count);
    e->heap[at] = corner_at;
    e->corners[corner_at].in_heap = at;
}

/* Move what stands at this place up or down to where it belongs. */
static void settle(ears *e, uint32_t at) {
    const uint32_t moved = e->heap[at];
    while (at > 0 && is_before(e, moved, e->heap[(at - 1) / 2])) {
        put_in_heap(e, at, e->heap[(at - 1) / 2]);
        at = (at - 1) / 2;
    }
    for (;;) {
        uint32_t child = 2 * at + 1;
        if (child >= e->heap_count) break;
        if (child + 1 < e->heap_count && is_before(e, e->heap[child + 1], e->heap[child])) child++;
        if (!is_before(e, e->heap[child], moved)) break;
        put_in_heap(e, at, e->heap[child]);
        at = child;
    }
    put_in_heap(e, at, moved);
}

static void heap_remove(ears *e, uint32_t c) {
    const uint32_t at = e->corners[c].in_heap;
    if (at == NONE) return;
    e->corners[c].in_heap = NONE;
    const uint32_t last = e->heap[--e->heap_count];
    if (last == c) return;
    put_in_heap(e, at, last);
    settle(e, at);
}

static void heap_add(ears *e, uint32_t c) {
    if (e->corners[c].in_heap != NONE) {
        settle(e, e->corners[c].in_heap);
        return;
    }
    put_in_heap(e, e->heap_count++, c);
    settle(e, e->heap_count - 1);
}

/* ---- ears that are held up --------------------------------------------------------------- */

static void stop_waiting(ears *e, uint32_t c) {
    bend *b = &e->corners[c];
    if (b->waits_for == NONE) return;
    if (b->last_waiting != NONE) e->corners[b->last_waiting].next_waiting = b->next_waiting;
    else e->corners[b->waits_for].first_waiting = b->next_waiting;
    if (b->next_waiting != NONE) e->corners[b->next_waiting].last_waiting = b->last_waiting;
    b->waits_for = NONE;
}

static void wait_for(ears *e, uint32_t c, uint32_t other) {
    bend *b = &e->corners[c];
    b->waits_for = other;
    b->last_waiting = NONE;
    b->next_waiting = e->corners[other].first_waiting;
    if (b->next_waiting != NONE) e->corners[b->next_waiting].last_waiting = c;
    e->corners[other].first_waiting = c;
}

/* ---- the tree of corners that may lie in ears -------------------------------------------- */

/* Every second bit of the result is one of the 21 of x. */
static uint64_t spread_bits(uint64_t x) {
    x = (x | x << 16) & 0x0000ffff0000ffffu;
    x = (x | x << 8) & 0x00ff00ff00ff00ffu;
    x = (x | x << 4) & 0x0f0f0f0f0f0f0f0fu;
    x = (x | x << 2) & 0x3333333333333333u;
    return (x | x << 1) & 0x5555555555555555u;
}

static int compare_orders(const void *a, const void *b) {
    const order *x = (const order *)a, *y = (const order *)b;
    if (x->key != y->key) return x->key < y->key ? -1 : 1;
    return x->corner < y->corner ? -1 : x->corner > y->corner;
}

static void widen(box *to, const double *low, const double *high) {
    for (int k = 0; k < 2; k++) {
        if (to->count == 0 || low[k] < to->low[k]) to->low[k] = low[k];
        if (to->count == 0 || high[k] > to->high[k]) to->high[k] = high[k];
    }
}

/* Those of so many corners in sorted, along a curve that keeps neighbours together. */
static void build_tree(ears *e, uint32_t count) {
    const double steps = 2097151; /* 2^21 - 1; coordinates are within about -2 and 2 */
    for (uint32_t i = 0; i < count; i++) {
        const double *at = e->corners[e->sorted[i].corner].at;
        const uint64_t x = (uint64_t)(fmin(fmax((at[0] + 2) / 4, 0), 1) * steps);
        const uint64_t y = (uint64_t)(fmin(fmax((at[1] + 2) / 4, 0), 1) * steps);
        e->sorted[i].key = spread_bits(x) | spread_bits(y) << 1;
    }
    qsort(e->sorted, count, sizeof *e->sorted, compare_orders);
    e->leaf_start = 1;
    while (e->leaf_start * LEAF < count) e->leaf_start *= 2;
    assert(2 * e->leaf_start <= e->box_room);
    memset(e->boxes, 0, 2 * e->leaf_start * sizeof *e->boxes);
    for (uint32_t i = 0; i < count; i++) {
        bend *c = &e->corners[e->sorted[i].corner];
        box *leaf = &e->boxes[e->leaf_start + i / LEAF];
        c->in_tree = i;
        widen(leaf, c->at, c->at);
        leaf->count++;
    }
    for (uint32_t i = e->leaf_start; --i > 0;) {
        for (uint32_t k = 2 * i; k < 2 * i + 2; k++) {
            if (!e->boxes[k].count) continue;
            widen(&e->boxes[i], e->boxes[k].low, e->boxes[k].high);
            e->boxes[i].count += e->boxes[k].count;
        }
    }
}

/* This corner lies in no ear any more: those that it held up may be some. */
static void tree_remove(ears *e, uint32_t c) {
    bend *b = &e->corners[c];
    if (b->in_tree == NONE) return;
    for (uint32_t i = e->leaf_start + b->in_tree / LEAF; i > 0; i /= 2) e->boxes[i].count--;
    b->in_tree = NONE;
    while (b->first_waiting != NONE) {
        const uint32_t waiting = b->first_waiting;
        stop_waiting(e, waiting);
        heap_add(e, waiting);
    }
}

/* The triangle of an ear: its corners and the box around it. */
typedef struct ear {
    const double *a, *b, *c;
    double low[2], high[2], slack; /* slack: twice the area by which the cut is widened */
} ear;

static ear ear_of(const ears *e, uint32_t c) {
    const bend *corners = e->corners;
    ear t;
    t.a = corners[corners[c].previous].at;
    t.b = corners[c].at;
    t.c = corners[corners[c].next].at;
    t.slack = e->nearly * distance2(t.a, t.c, 2);
    const double margin = e->nearly * sqrt(distance2(t.a, t.c, 2));
    for (int k = 0; k < 2; k++) {
        t.low[k] = fmin(fmin(t.a[k], t.b[k]), t.c[k]) - margin;
        t.high[k] = fmax(fmax(t.a[k], t.b[k]), t.c[k]) + margin;
    }
    return t;
}

/* Does a box lie beside the line from p to q, farther than the slack? */
static int is_beside(const box *b, const double *p, const double *q, double slack) {
    const double dx = q[0] - p[0], dy = q[1] - p[1];
    const double far_most[2] = {dy > 0 ? b->low[0] : b->high[0], dx > 0 ? b->high[1] : b->low[1]};
    return area2(p, q, far_most) < -slack;
}

static int misses(const ear *t, const box *b) {
    for (int k = 0; k < 2; k++) {
        if (b->low[k] > t->high[k] || b->high[k] < t->low[k]) return 1;
    }
    return is_beside(b, t->a, t->b, 0) || is_beside(b, t->b, t->c, 0) ||
           is_beside(b, t->c, t->a, t->slack);
}

static int holds(const ear *t, const double *p) {
    return area2(t->a, t->b, p) >= 0 && area2(t->b, t->c, p) >= 0 &&
           area2(t->c, t->a, p) >= -t->slack && p[0] >= t->low[0] && p[0] <= t->high[0] &&
           p[1] >= t->low[1] && p[1] <= t->high[1] && !same_point(p, t->a) &&
           !same_point(p, t->b) && !same_point(p, t->c);
}

/* A corner of a leaf that the triangle holds, or NONE. */
static uint32_t find_in_leaf(const ears *e, uint32_t leaf, const ear *t) {
    const uint32_t first = (leaf - e->leaf_start) * LEAF;
    for (uint32_t i = first; i < first + LEAF && i < e->count; i++) {
        const uint32_t c = e->sorted[i].corner;
        if (c < e->count && e->corners[c].in_tree == i && holds(t, e->corners[c].at)) return c;
    }
    return NONE;
}

/* A corner in the triangle of this one, or NONE. */
static uint32_t find_in_ear(const ears *e, uint32_t c) {
    const ear t = ear_of(e, c);
    uint32_t stack[MOST_LEVELS], depth = 0;
    if (e->boxes[1].count) stack[depth++] = 1;
    while (depth > 0) {
        const uint32_t i = stack[--depth];
        if (misses(&t, &e->boxes[i])) continue;
        if (i >= e->leaf_start) {
            const uint32_t found = find_in_leaf(e, i, &t);
            if (found != NONE) return found;
            continue;
        }
        for (uint32_t k = 2 * i; k < 2 * i + 2; k++) { /* one more than before at each level */
            assert(depth < MOST_LEVELS);
            if (e->boxes[k].count) stack[depth++] = k;
        }
    }
    return NONE;
}

/* ---- cutting ----------------------------------------------------------------------------- */

static int is_convex(const ears *e, uint32_t c) {
    const bend *b = &e->corners[c];
    const double *p = e->corners[b->previous].at, *q = e->corners[b->next].at;
    const double area = area2(p, b->at, q), nearly = e->nearly;
    if (!(area > 0)) return 0;
    return area * area > nearly * nearly * distance2(p, b->at, 2) * distance2(b->at, q, 2);
}

/* A corner at the end of an edge there and back, or on top of a neighbour, as remain where polygons
   touch themselves: a triangle without area, which is cut off before all else. */
static int is_spike(const ears *e, uint32_t c) {
    const bend *b = &e->corners[c];
    const double *p = e->corners[b->previous].at, *q = e->corners[b->next].at;
    return same_point(p, q) || same_point(p, b->at) || same_point(b->at, q);
}

/* May its triangle be cut off? */
static int is_candidate(const ears *e, uint32_t c) {
    return e->rule == EAR_ANY || is_convex(e, c) || is_spike(e, c);
}

/* The shorter the cut and the smaller the circle around the triangle, the better; the latter is the
   product of the sides over the area. All squared. */
static double cost_of(const ears *e, uint32_t c) {
    const bend *b = &e->corners[c], *p = &e->corners[b->previous], *q = &e->corners[b->next];
    const double cut = distance2(p->space, q->space, 3);
    const double area = area2_squared(p->space, b->space, q->space);
    const double sides = cut * distance2(p->space, b->space, 3) * distance2(b->space, q->space, 3);
    if (is_spike(e, c)) return -1;
    if (!is_convex(e, c) || !(area * COST_OF_REFLEX > cut * cut * sides))
        return COST_OF_REFLEX * (1 + cut);
    return cut * cut * sides / area;
}

/* The neighbours of a corner have changed. */
static void update(ears *e, uint32_t c) {
    bend *b = &e->corners[c];
    stop_waiting(e, c);
    if (!is_candidate(e, c)) {
        heap_remove(e, c);
        return;
    }
    tree_remove(e, c);
    b->cost = cost_of(e, c);
    heap_add(e, c);
}

/* Look at all corners that are left anew: by this rule. */
static void start(ears *e, ear_rule rule) {
    uint32_t count = 0, c = e->first;
    e->rule = rule;
    e->nearly = rule == EAR_CLEAR ? NEARLY : 0;
    e->heap_count = 0;
    for (uint32_t i = 0; i < e->left; i++, c = e->corners[c].next) {
        bend *b = &e->corners[c];
        b->in_heap = b->in_tree = b->first_waiting = b->waits_for = NONE;
        if (is_candidate(e, c)) continue;
        assert(count < e->count);
        e->sorted[count++].corner = c;
    }
    for (uint32_t i = count; i < e->count; i++) e->sorted[i].corner = NONE;
    build_tree(e, count);
    for (uint32_t i = 0; i < e->left; i++, c = e->corners[c].next) {
        if (e->corners[c].in_tree == NONE) update(e, c);
    }
}

static int add_triangle(builder *b, const corner *x, const corner *y, const corner *z) {
    corner *t = (corner *)list_add(&b->triangles, 1);
    if (!t) return builder_fail_memory(b);
    t[0] = *x;
    t[1] = *y;
    t[2] = *z;
    return 1;
}

/* Its triangle, with the corners in their order of the file. */
static int add_ear(builder *b, const ears *e, const corner *p, uint32_t c) {
    uint32_t i[3] = {e->corners[c].previous, c, e->corners[c].next};
    const int first = i[0] < i[1] ? (i[0] < i[2] ? 0 : 2) : i[1] < i[2] ? 1 : 2;
    return add_triangle(b, &p[i[first]], &p[i[(first + 1) % 3]], &p[i[(first + 2) % 3]]);
}

static int cut_off(builder *b, ears *e, const corner *p, uint32_t c) {
    bend *corners = e->corners;
    const uint32_t previous = corners[c].previous, next = corners[c].next;
    if (!add_ear(b, e, p, c)) return 0;
    heap_remove(e, c);
    stop_waiting(e, c);
    tree_remove(e, c);
    corners[previous].next = next;
    corners[next].previous = previous;
    e->first = previous;
    e->left--;
    update(e, previous);
    update(e, next);
    return 1;
}

/* The cheapest corner of all, whatever its triangle holds. */
static uint32_t cheapest(const ears *e) {
    uint32_t best = e->first;
    double least = cost_of(e, best);
    for (uint32_t i = 1, c = e->corners[best].next; i < e->left; i++, c = e->corners[c].next) {
        const double cost = cost_of(e, c);
        if (cost > least || (cost == least && c > best)) continue;
        least = cost;
        best = c;
    }
    return best;
}

/* All ears until a triangle is left. A polygon that is thin all over has none while what is nearly
   straight counts as straight; one that crosses itself has none at all. */
static int cut_ears(builder *b, ears *e, const corner *p) {
    int forced = 0;
    start(e, EAR_CLEAR);
    while (e->left > 3) {
        if (e->heap_count == 0) {
            if (e->rule == EAR_CLEAR) {
                start(e, EAR_EXACT);
            } else if (forced++ < MOST_FORCED) {
                if (!cut_off(b, e, p, cheapest(e))) return 0;
            } else {
                start(e, EAR_ANY);
            }
            continue;
        }
        const uint32_t c = e->heap[0];
        const int is_clear = e->rule == EAR_ANY || e->corners[c].cost < 0;
        const uint32_t other = is_clear ? NONE : find_in_ear(e, c);
        if (other != NONE) {
            heap_remove(e, c);
            wait_for(e, c, other);
        } else if (!cut_off(b, e, p, c)) {
            return 0;
        }
    }
    return add_ear(b, e, p, e->first);
}

/* ---- polygons ---------------------------------------------------------------------------- */

/* Room for a polygon of n corners, from lists that keep it. */
static int make_room(builder *b, size_t n, ears *e) {
    size_t leaves = 1;
    memset(e, 0, sizeof *e);
    while (leaves * LEAF < n) leaves *= 2;
    b->bends.count = b->heap.count = b->sorted.count = b->boxes.count = 0;
    b->bends.size = sizeof(bend);
    b->heap.size = sizeof(uint32_t);
    b->sorted.size = sizeof(order);
    b->boxes.size = sizeof(box);
    e->corners = (bend *)list_add(&b->bends, n);
    e->heap = (uint32_t *)list_add(&b->heap, n);
    e->sorted = (order *)list_add(&b->sorted, n);
    e->boxes = (box *)list_add(&b->boxes, 2 * leaves);
    e->count = e->left = (uint32_t)n;
    e->box_room = (uint32_t)(2 * leaves);
    return e->corners && e->heap && e->sorted && e->boxes;
}

/* Twice the area over the square of the longest side, in the plane; 0 or less: not convex. */
static double shape_of(const bend *a, const bend *b, const bend *c) {
    const double longest = fmax(fmax(distance2(a->at, b->at, 2), distance2(b->at, c->at, 2)),
                                distance2(c->at, a->at, 2));
    return longest > 0 ? area2(a->at, b->at, c->at) / longest : 0;
}

/* A quad is cut from its first corner, unless that is much the worse of the two ways. */
static int cut_quad(builder *b, const bend *q, const corner *p) {
    const double own = fmin(shape_of(&q[0], &q[1], &q[2]), shape_of(&q[0], &q[2], &q[3]));
    const double other = fmin(shape_of(&q[0], &q[1], &q[3]), shape_of(&q[1], &q[2], &q[3]));
    if (other > 2 * own && other > 0)
        return add_triangle(b, &p[0], &p[1], &p[3]) && add_triangle(b, &p[1], &p[2], &p[3]);
    return add_triangle(b, &p[0], &p[1], &p[2]) && add_triangle(b, &p[0], &p[2], &p[3]);
}

int polygon_triangulate(builder *b, const corner *p, size_t n) {
    ears e;
    if (n == 3) return add_triangle(b, &p[0], &p[1], &p[2]);
    if (n > 0x3fffffff || !make_room(b, n, &e)) return builder_fail_memory(b);
    measure((const double *)b->positions.items, p, e.corners, n);
    flatten(e.corners, n);
    if (n == 4) return cut_quad(b, e.corners, p);
    for (uint32_t i = 0; i < e.count; i++) {
        e.corners[i].previous = i ? i - 1 : e.count - 1;
        e.corners[i].next = i + 1 < e.count ? i + 1 : 0;
    }
    return cut_ears(b, &e, p);
}
