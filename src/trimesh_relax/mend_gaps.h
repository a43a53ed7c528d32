#ifndef TRIMESH_RELAX_MEND_GAPS_H
#define TRIMESH_RELAX_MEND_GAPS_H

#include "surface.h"
#include "mend.h"

/* ---- mending: gaps between borders -------------------------------------------------------- */

/* Borders that run along each other but share no edges leave gaps, mostly too narrow to see:

        a-----------b            a-----------b       T-junction: v lies on the side of another face,
        |           |            |  .     .  |       which is split there
        |           |            | .       . |
        a-----v-----b    ->      a-----v-----b
        |     |     |            |     |     |
        +-----+-----+            +-----+-----+

   First vertices on borders that are close are welded, then vertices on borders that are close to a
   border edge are put into it, if then a part of it is an edge of another face. */

#define TMR_CLOSE 1e-5      /* ours: how close, in diagonals                                     */
#define TMR_CLOSE_EDGES 0.1 /* ours: but no more than this part of the edges there               */
enum {
    TMR_LEAST_LEVEL = -40, /* edges shorter than 2^this diagonals are as those of that length  */
    TMR_CELLS_OF_EDGE = 8  /* an edge is no longer than a cell: two of them each way, at most  */
};

/* A vertex to be put into the edge opposite to a corner. */
typedef struct tmr_stitch {
    int32_t corner, vertex;
    int32_t next; /* the next one of that edge, farther along; -1 = none             */
    float along;  /* 0..1 from the vertex of the next corner to that of the previous one */
} tmr_stitch;

/* Border edges by the cells that they touch. Each level has cells of 2^level diagonals and the edges
   that are about as long, so that neither long nor short ones fill many cells or one. */
typedef struct tmr_gaps {
    double close;       /* how close, in diagonals */
    double *reach;      /* 1 per vertex: how close in view of the edges there; not on a border: -1 */
    txm_pair *cell;     /* by key; value: corner */
    size_t cell_count;
    uint64_t levels;    /* bit level - TMR_LEAST_LEVEL: there are such edges */
    tmr_stitch *stitch;
    size_t stitch_count;
    int32_t *first;     /* 1 per corner: the first stitch of its edge, -1 = none */
} tmr_gaps;

static int tmr_is_border(const tmr_mend *m, int32_t c) {
    return m->opposite[c] == -1;
}

static double tmr_edge_length(const tmr_mend *m, int32_t c) {
    return txm_d3_dist(m->point[m->vertex[tmr_next(c)]], m->point[m->vertex[tmr_prev(c)]]);
}

/* How far each vertex on a border may be from what it is joined with. Returns how many border edges
   there are. */
static size_t tmr_gaps_reach(const tmr_mend *m, tmr_gaps *g) {
    size_t count = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) g->reach[v] = -1;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_border(m, c)) continue;
        g->reach[m->vertex[tmr_next(c)]] = g->reach[m->vertex[tmr_prev(c)]] = g->close;
        count++;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        const double length = tmr_edge_length(m, c), most = TMR_CLOSE_EDGES * length;
        if (length <= 2 * m->noise) continue; /* in the same place but for rounding */
        double *a = g->reach + m->vertex[tmr_next(c)], *b = g->reach + m->vertex[tmr_prev(c)];
        if (*a > most) *a = most;
        if (*b > most) *b = most;
    }
    return count;
}

/* ---- vertices on edges -------------------------------------------------------------------- */

static uint32_t tmr_gap_key(txm_dvec3 cell, int level) {
    return (uint32_t)(txm_hash(tmr_hash_cell(cell) + (uint64_t)(level - TMR_LEAST_LEVEL)) >> 32);
}

/* List the border edges, or count the entries where g->cell is NULL. */
static void tmr_gaps_fill(const tmr_mend *m, tmr_gaps *g) {
    g->cell_count = 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_border(m, c)) continue;
        const txm_dvec3 a = m->point[m->vertex[tmr_next(c)]], b = m->point[m->vertex[tmr_prev(c)]];
        const double more = g->close;
        int level = 0;
        frexp(txm_d3_dist(a, b) + 2 * more, &level); /* which is less than 2^level */
        if (level < TMR_LEAST_LEVEL) level = TMR_LEAST_LEVEL;
        const double size = ldexp(1, level);
        const txm_dvec3 low = tmr_cell(txm_d3(fmin(a.x, b.x) - more, fmin(a.y, b.y) - more,
                                              fmin(a.z, b.z) - more), size);
        const txm_dvec3 high = tmr_cell(txm_d3(fmax(a.x, b.x) + more, fmax(a.y, b.y) + more,
                                               fmax(a.z, b.z) + more), size);
        g->levels |= (uint64_t)1 << (level - TMR_LEAST_LEVEL);
        for (int k = 0; k < TMR_CELLS_OF_EDGE; k++) {
            const txm_dvec3 cell = txm_d3(low.x + (k & 1), low.y + (k >> 1 & 1), low.z + (k >> 2));
            if (cell.x > high.x || cell.y > high.y || cell.z > high.z) continue;
            if (g->cell) {
                g->cell[g->cell_count].key = tmr_gap_key(cell, level);
                g->cell[g->cell_count].value = (uint32_t)c;
            }
            g->cell_count++;
        }
    }
}

/* Does vertex v lie on the edge of corner c, between its ends? */
static int tmr_lies_on(const tmr_mend *m, const tmr_gaps *g, int32_t v, int32_t c, float *along) {
    const int32_t i = m->vertex[tmr_next(c)], j = m->vertex[tmr_prev(c)];
    if (v == i || v == j || v == m->vertex[c]) return 0;
    const txm_dvec3 a = m->point[i], ab = txm_d3_sub(m->point[j], a);
    const double length = txm_d3_len(ab), reach = fmin(g->reach[v], TMR_CLOSE_EDGES * length);
    const txm_dvec3 av = txm_d3_sub(m->point[v], a);
    const double t = length > 0 ? txm_d3_dot(av, ab) / length : 0;
    if (!(t > reach && t < length - reach)) return 0;
    *along = txm_float(t / length);
    return txm_d3_len2(txm_d3_mad(av, ab, -t / length)) <= reach * reach;
}

/* Find the vertices on edges. g->stitch NULL: only count them. */
static void tmr_find_stitches(const tmr_mend *m, tmr_gaps *g) {
    size_t count = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (!(g->reach[v] >= 0)) continue;
        for (int bit = 0; g->levels >> bit; bit++) {
            const int level = TMR_LEAST_LEVEL + bit;
            if (!(g->levels >> bit & 1)) continue;
            const uint32_t key = tmr_gap_key(tmr_cell(m->point[v], ldexp(1, level)), level);
            size_t low = 0, high = g->cell_count;
            while (low < high) {
                const size_t middle = (low + high) / 2;
                if (g->cell[middle].key < key) low = middle + 1;
                else high = middle;
            }
            for (; low < g->cell_count && g->cell[low].key == key; low++) {
                const int32_t c = (int32_t)g->cell[low].value;
                float along = 0;
                if (!tmr_lies_on(m, g, v, c, &along)) continue;
                if (g->stitch) {
                    TRIMESH_ASSERT(count < g->stitch_count);
                    g->stitch[count].corner = c;
                    g->stitch[count].vertex = v;
                    g->stitch[count].along = along;
                }
                count++;
            }
        }
    }
    g->stitch_count = count;
}

/* ---- which of them join edges ------------------------------------------------------------- */

/* Borders as sets of edges: how often there is each. */
typedef struct tmr_edge_set {
    uint64_t *key; /* 0 = free */
    uint8_t *several;
    size_t mask;
} tmr_edge_set;

static size_t tmr_edge_slot(const tmr_edge_set *e, int32_t a, int32_t b) {
    const uint64_t low = (uint64_t)(a < b ? a : b), high = (uint64_t)(a < b ? b : a);
    const uint64_t key = (low << 32 | high) + 1;
    size_t i = (size_t)txm_hash(key) & e->mask;
    while (e->key[i] && e->key[i] != key) i = (i + 1) & e->mask;
    if (!e->key[i]) e->key[i] = key;
    else e->several[i] |= 2; /* 1: it was asked for before; 2: and once more since then */
    return i;
}

/* Walk along the parts of the border edge of corner c. count: note them in the set. Else: is one of
   them part of another border edge, too? */
static int tmr_walk_parts(const tmr_mend *m, const tmr_gaps *g, const tmr_edge_set *e, int32_t c) {
    int several = 0;
    int32_t from = m->vertex[tmr_next(c)];
    for (int32_t k = g->first[c];; k = g->stitch[k].next) {
        const int32_t to = k >= 0 ? g->stitch[k].vertex : m->vertex[tmr_prev(c)];
        several |= e->several[tmr_edge_slot(e, from, to)];
        from = to;
        if (k < 0) return several;
    }
}

/* List the stitches of each edge along it, and forget those that join nothing. Returns how many are
   left. */
static size_t tmr_list_stitches(const tmr_mend *m, tmr_gaps *g, txm_pair *pairs,
                                const tmr_edge_set *e) {
    const size_t n = g->stitch_count;
    size_t kept = 0;
    for (size_t i = 0; i < n; i++) {
        pairs[i].key = txm_sort_key(g->stitch[i].along);
        pairs[i].value = (uint32_t)i;
    }
    txm_sort_pairs(pairs, pairs + n, n);
    for (int32_t c = 0; c < 3 * m->face_count; c++) g->first[c] = -1;
    for (size_t i = n; i-- > 0;) { /* from the far end, each becomes the first */
        tmr_stitch *s = g->stitch + pairs[i].value;
        const int32_t next = g->first[s->corner];
        if (next >= 0 && g->stitch[next].vertex == s->vertex) continue;
        s->next = next;
        g->first[s->corner] = (int32_t)pairs[i].value;
    }
    for (int32_t c = 0; c < 3 * m->face_count; c++)
        if (tmr_is_border(m, c)) tmr_walk_parts(m, g, e, c);
    for (size_t i = 0; i <= e->mask; i++) e->several[i] = e->several[i] != 0;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (g->first[c] < 0) continue;
        if (!(tmr_walk_parts(m, g, e, c) & 1)) g->first[c] = -1;
        for (int32_t k = g->first[c]; k >= 0; k = g->stitch[k].next) kept++;
    }
    return kept;
}

/* ---- splitting faces ---------------------------------------------------------------------- */

/* The stitch in the middle of the longest side of face f that has any; *corner: of that side. The
   list of the side ends before it, *rest receives what follows it. -1: none. */
static int32_t tmr_take_stitch(const tmr_mend *m, tmr_gaps *g, int32_t f, int32_t *corner,
                               int32_t *rest) {
    double longest = -1;
    int32_t count = 0;
    for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
        if (g->first[c] < 0 || tmr_edge_length(m, c) <= longest) continue;
        longest = tmr_edge_length(m, c);
        *corner = c;
    }
    if (longest < 0) return -1;
    for (int32_t k = g->first[*corner]; k >= 0; k = g->stitch[k].next) count++;
    int32_t *link = g->first + *corner;
    for (int32_t k = count / 2; k > 0; k--) link = &g->stitch[*link].next;
    const int32_t taken = *link;
    *link = -1;
    *rest = g->stitch[taken].next;
    return taken;
}

/* Split faces until no side has stitches left: (p, a, b) at v between a and b into (p, a, v), which
   stays, and (p, v, b). */
static void tmr_split_stitched(tmr_mend *m, tmr_gaps *g) {
    for (int32_t f = 0; f < m->face_count; f++) {
        int32_t c = 0, rest = -1;
        for (int32_t k; (k = tmr_take_stitch(m, g, f, &c, &rest)) >= 0;) {
            const int32_t v = g->stitch[k].vertex, h = m->face_count++;
            m->vertex[3 * h] = m->vertex[c];
            m->vertex[3 * h + 1] = v;
            m->vertex[3 * h + 2] = m->vertex[tmr_prev(c)];
            m->vertex[tmr_prev(c)] = v;
            g->first[3 * h] = rest;
            g->first[3 * h + 1] = g->first[tmr_next(c)]; /* the side from b to p */
            g->first[3 * h + 2] = -1;
            g->first[tmr_next(c)] = -1;
            m->origin[h] = m->origin[f];
            m->turn[f] = m->turn[h] = TMR_MAPPED;
            m->twin[h] = m->twin[f];
        }
    }
}

/* Make room for more faces. */
static txm_status tmr_mend_grow(tmr_mend *m, size_t more) {
    const tmr_mend old = *m;
    const size_t n = (size_t)m->face_count;
    const txm_status status = tmr_mend_alloc_faces(m, n + more);
    if (status != TXM_OK) return status;
    memcpy(m->vertex, old.vertex, 3 * n * sizeof *m->vertex);
    memcpy(m->origin, old.origin, n * sizeof *m->origin);
    memcpy(m->turn, old.turn, n);
    memcpy(m->twin, old.twin, n);
    return TXM_OK;
}

/* Put vertices into the edges on which they lie. border: how many border edges there are. */
static txm_status tmr_stitch_edges(tmr_mend *m, tmr_gaps *g, size_t border) {
    static const char no_memory[] = "no memory to close gaps of the surface";
    tmr_edge_set e;
    tmr_gaps_fill(m, g); /* counts */
    g->cell = (txm_pair *)txm_arena_alloc(m->scratch, 2 * g->cell_count, sizeof(txm_pair));
    if (!g->cell) return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    tmr_gaps_fill(m, g);
    txm_sort_pairs(g->cell, g->cell + g->cell_count, g->cell_count);
    tmr_find_stitches(m, g); /* counts */
    const size_t n = g->stitch_count, corners = 3 * ((size_t)m->face_count + n);
    if (n == 0) return TXM_OK;
    if (n > (size_t)TMR_MOST_SLOTS - (size_t)m->face_count)
        return txm_fail(m->env, TXM_TOO_LARGE, "too many vertices lie on edges of other faces");
    for (e.mask = 16; e.mask < 2 * (border + n); e.mask *= 2) {}
    e.key = (uint64_t *)txm_arena_zero(m->scratch, e.mask, sizeof(uint64_t));
    e.several = (uint8_t *)txm_arena_zero(m->scratch, e.mask, 1);
    g->stitch = (tmr_stitch *)txm_arena_alloc(m->scratch, n, sizeof(tmr_stitch));
    g->first = (int32_t *)txm_arena_alloc(m->scratch, corners, sizeof(int32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(m->scratch, 2 * n, sizeof(txm_pair));
    if (m->scratch->failed) return txm_fail(m->env, TXM_OUT_OF_MEMORY, no_memory);
    e.mask--;
    tmr_find_stitches(m, g);
    m->report.stitched = tmr_list_stitches(m, g, pairs, &e);
    if (m->report.stitched == 0) return TXM_OK;
    const txm_status status = tmr_mend_grow(m, m->report.stitched);
    if (status == TXM_OK) tmr_split_stitched(m, g);
    return status;
}

/* ---- both --------------------------------------------------------------------------------- */

/* Weld the vertices on borders that are close. Returns how many were. */
static size_t tmr_weld_borders(tmr_mend *m, const tmr_gaps *g) {
    const size_t before = m->report.welded;
    tmr_weld(m, g->close, g->reach);
    const size_t welded = m->report.welded - before;
    for (int32_t c = 0; c < 3 * m->face_count && welded > 0; c++)
        m->vertex[c] = m->rename[m->vertex[c]];
    return welded;
}

/* Close gaps, unless nothing shall be welded. */
static txm_status tmr_mend_gaps(tmr_mend *m) {
    tmr_gaps g;
    memset(&g, 0, sizeof g);
    tmr_mend_compact(m);
    tmr_mend_duplicates(m);
    if (m->desc->weld < 0) return TXM_OK;
    g.close = m->desc->weld > 0 ? m->desc->weld : fmin(fmax(TMR_CLOSE, 4 * m->noise), 0.01);
    g.reach = (double *)txm_arena_alloc(m->scratch, (size_t)m->vertex_count, sizeof(double));
    if (!g.reach) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to close gaps");
    tmr_mend_opposites(m);
    size_t border = tmr_gaps_reach(m, &g);
    if (border > 0 && !(m->desc->weld > 0) && (m->report.closed = tmr_weld_borders(m, &g)) > 0) {
        tmr_mend_compact(m);
        tmr_mend_duplicates(m);
        tmr_mend_opposites(m);
        border = tmr_gaps_reach(m, &g);
    }
    return border > 0 ? tmr_stitch_edges(m, &g, border) : TXM_OK;
}

#endif /* TRIMESH_RELAX_MEND_GAPS_H */
