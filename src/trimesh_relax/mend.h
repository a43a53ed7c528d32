#ifndef TRIMESH_RELAX_MEND_H
#define TRIMESH_RELAX_MEND_H

#include "config.h"

/* ---- mending: state and checks ------------------------------------------------------------ */

enum {
    TMR_MOST = 1 << 26, /* vertices and triangles of an input or a result                    */
    TMR_MOST_SLOTS = INT32_MAX / 3, /* vertices or triangles: int32_t numbers the corners        */
    TMR_NO_VERTEX = -1,   /* in the first corner of a triangle: to be removed                  */
    TMR_OVERFULL = -2,    /* as opposite: the edge has more than two triangles                 */
    TMR_MAPPED = 8,       /* as turn: corners do not match; use the nearest point of origin   */
    TMR_MEND_ROUNDS = 8,  /* ours: of flipping and collapsing; one or two are enough           */
    TMR_FLIP_SWEEPS = 64, /* ours: back and forth over the thin triangles; mostly three        */
    TMR_FAN_LIMIT = 256   /* ours: vertices of more triangles are left as they are             */
};

/* The input while it is mended. Vertices keep the caller's numbers to the end: no face refers to a
   vertex that was welded to another one, or to an unused one. */
typedef struct tmr_mend {
    const trimesh_desc *desc;
    txm_env *env;
    trimesh_report report;
    int32_t vertex_count, face_count;
    txm_dvec3 *point;  /* 1 per input vertex, scaled                                      */
    int32_t *rename;   /* 1 per input vertex: the vertex that replaces it                    */
    int32_t *degree;   /* 1 per input vertex: a count, used by each step                  */
    int32_t *stamp;    /* 1 per input vertex: marks neighbours                              */
    int32_t *vertex;   /* the next four as in tmr_surface, with room for the input        */
    int32_t *opposite;
    uint32_t *origin;
    uint8_t *turn;
    uint8_t *flag;     /* 1 per face, of the step at hand                                 */
    uint8_t *twin;     /* 1 per face: it had a duplicate of opposite winding              */
    int single;        /* non-zero: some face has no such duplicate                       */
    int32_t *list;     /* 1 per face, of the step at hand                                 */
    uint32_t *sides;   /* 1 per corner: the sides in the order of their edges; as much scratch */
    txm_arena *arena, *scratch; /* what the surface keeps; what is freed after mending   */
    int32_t *table;    /* hash table: index + 1, 0 = free                                 */
    size_t table_size; /* a power of two, at least twice the vertices and the faces       */
    txm_dvec3 centre;
    double diagonal;
    double noise; /* scaled units: resolution of single precision                   */
} tmr_mend;

static txm_status tmr_mend_cancel(tmr_mend *m, float fraction) {
    if (!txm_progress(m->env, fraction, "mend")) return TXM_OK;
    return txm_fail(m->env, TXM_CANCELLED, "cancelled while mending the surface");
}

static txm_status tmr_check_scale(const trimesh_desc *desc, txm_env *env) {
    const size_t count = desc->surface.vertex_count;
    double least = 0, most = 0;
    for (size_t i = 0; i < count; i++) {
        const double s = desc->scale[i];
        if (!txm_is_finite(s) || !(s > 0))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "scale: of vertex # it must be finite and above 0", i, 0);
        if (i == 0 || s < least) least = s;
        if (i == 0 || s > most) most = s;
    }
    if (most > 1000 * least)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "scale: the largest is more than 1000 times the least");
    return TXM_OK;
}

/* Check all numbers of the input. */
static txm_status tmr_check_surface(const trimesh_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a trimesh_desc");
    const size_t limit = TRIMESH_MAX_VERTICES < TMR_MOST ? TRIMESH_MAX_VERTICES : TMR_MOST;
    const txm_status status = txm_mesh_check(&desc->surface, "surface", 3, 1, limit, env);
    if (status != TXM_OK) return status;
    if (desc->surface.vertex_count == 0 || desc->surface.face_count == 0)
        return txm_fail(env, TXM_TOO_SMALL, "surface: no vertices or no triangles");
    if (!(desc->weld >= 0 && desc->weld <= 0.01f) && !(desc->weld >= -1 && desc->weld <= -1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "weld must be 0 to 0.01, or -1 for none");
    return desc->scale ? tmr_check_scale(desc, env) : TXM_OK;
}

/* Allocate what there is for each face and corner, with room for so many faces, and the table. What
   the surface keeps lies in m->arena, the rest in m->scratch. */
static txm_status tmr_mend_alloc_faces(tmr_mend *m, size_t faces) {
    const size_t v = (size_t)m->vertex_count;
    m->table_size = 16;
    while (m->table_size < 2 * (v > faces ? v : faces)) m->table_size *= 2;
    m->vertex = (int32_t *)txm_arena_alloc(m->arena, 3 * faces, sizeof(int32_t));
    m->opposite = (int32_t *)txm_arena_alloc(m->arena, 3 * faces, sizeof(int32_t));
    m->origin = (uint32_t *)txm_arena_alloc(m->arena, faces, sizeof(uint32_t));
    m->turn = (uint8_t *)txm_arena_zero(m->arena, faces, 1);
    m->flag = (uint8_t *)txm_arena_zero(m->scratch, 2 * faces, 1);
    m->list = (int32_t *)txm_arena_alloc(m->scratch, faces, sizeof(int32_t));
    m->sides = (uint32_t *)txm_arena_alloc(m->scratch, 6 * faces, sizeof(uint32_t));
    m->table = (int32_t *)txm_arena_alloc(m->scratch, m->table_size, sizeof(int32_t));
    if (m->arena->failed || m->scratch->failed)
        return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    m->twin = m->flag + faces;
    return TXM_OK;
}

/* Allocate all that the mending needs. */
static txm_status tmr_mend_alloc(tmr_mend *m) {
    const size_t v = (size_t)m->vertex_count;
    m->rename = (int32_t *)txm_arena_alloc(m->scratch, 3 * v, sizeof(int32_t));
    if (!m->rename) return txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory to mend the surface");
    m->degree = m->rename + v;
    m->stamp = m->degree + v;
    return tmr_mend_alloc_faces(m, (size_t)m->face_count);
}

/* ---- mending: vertices -------------------------------------------------------------------- */

/* Scale the used vertices; afterwards rename is -1 for the others. */
static txm_status tmr_mend_scale(tmr_mend *m) {
    const txm_mesh *in = &m->desc->surface;
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0}, largest = 0;
    for (int32_t i = 0; i < m->vertex_count; i++) m->rename[i] = -1;
    for (size_t i = 0; i < 3 * in->face_count; i++)
        m->rename[in->indices[i]] = (int32_t)in->indices[i];
    for (int k = 0; k < 3; k++)
        low[k] = high[k] = in->positions[3 * (size_t)in->indices[0] + (size_t)k];
    for (int32_t i = 0; i < m->vertex_count; i++) {
        m->report.unused += m->rename[i] < 0;
        for (int k = 0; k < 3 && m->rename[i] >= 0; k++) {
            const double x = in->positions[3 * (size_t)i + (size_t)k];
            if (x < low[k]) low[k] = x;
            if (x > high[k]) high[k] = x;
            if (fabs(x) > largest) largest = fabs(x);
        }
    }
    const txm_dvec3 size = txm_d3(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    m->diagonal = txm_d3_len(size);
    m->centre =
        txm_d3(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]));
    if (!(m->diagonal > 0))
        return txm_fail(m->env, TXM_TOO_SMALL, "all vertices of the surface are in one place");
    m->noise = largest / m->diagonal * (1.0 / (1 << 23));
    for (int32_t i = 0; i < m->vertex_count; i++) {
        const float *p = in->positions + 3 * (size_t)i;
        m->point[i] = txm_d3((p[0] - m->centre.x) / m->diagonal, (p[1] - m->centre.y) / m->diagonal,
                             (p[2] - m->centre.z) / m->diagonal);
    }
    return TXM_OK;
}

static uint64_t tmr_hash_cell(txm_dvec3 cell) {
    uint64_t bits[3];
    cell = txm_d3_add(cell, txm_d3(0, 0, 0)); /* -0 to +0 */
    memcpy(&bits[0], &cell.x, sizeof bits[0]);
    memcpy(&bits[1], &cell.y, sizeof bits[1]);
    memcpy(&bits[2], &cell.z, sizeof bits[2]);
    return txm_hash(txm_hash(txm_hash(bits[0]) ^ bits[1]) ^ bits[2]);
}

static txm_dvec3 tmr_cell(txm_dvec3 p, double size) {
    return size > 0 ? txm_d3(floor(p.x / size), floor(p.y / size), floor(p.z / size)) : p;
}

/* The lowest vertex in a cell that is not farther than size from point i, or else best. reach: NULL,
   or 1 per vertex: not farther than this of both, either. */
static int32_t tmr_weld_find(const tmr_mend *m, txm_dvec3 cell, int32_t i, double size,
                             const double *reach, int32_t best) {
    size_t slot = (size_t)tmr_hash_cell(cell) & (m->table_size - 1);
    for (; m->table[slot]; slot = (slot + 1) & (m->table_size - 1)) {
        const int32_t j = m->table[slot] - 1;
        const double most = reach ? fmin(size, fmin(reach[i], reach[j])) : size;
        if ((best < 0 || j < best) && txm_d3_dist2(m->point[i], m->point[j]) <= most * most)
            best = j;
    }
    return best;
}

/* Each vertex, in order, is welded to the first kept vertex that is near enough, or else is kept.
   So chains of near vertices do not collapse into one, and a cell of the grid holds few kept
   vertices. With size 0 only vertices in equal places are welded. reach: as tmr_weld_find has it;
   vertices for which it is negative are left out. */
static void tmr_weld(tmr_mend *m, double size, const double *reach) {
    if (size < 1e-14) size = 0; /* so that a cell's number plus 1 is another number */
    const int range = size > 0 ? 1 : 0;
    memset(m->table, 0, m->table_size * sizeof *m->table);
    for (int32_t i = 0; i < m->vertex_count; i++) {
        if (m->rename[i] != i || (reach && reach[i] < 0)) continue;
        const txm_dvec3 cell = tmr_cell(m->point[i], size);
        int32_t best = -1;
        for (int x = -range; x <= range; x++) {
            for (int y = -range; y <= range; y++) {
                for (int z = -range; z <= range; z++)
                    best = tmr_weld_find(m, txm_d3_add(cell, txm_d3(x, y, z)), i, size, reach,
                                         best);
            }
        }
        if (best >= 0) {
            m->rename[i] = best;
            m->report.welded++;
            continue;
        }
        size_t slot = (size_t)tmr_hash_cell(cell) & (m->table_size - 1);
        while (m->table[slot]) slot = (slot + 1) & (m->table_size - 1);
        m->table[slot] = i + 1;
    }
}

/* ---- mending: faces ----------------------------------------------------------------------- */

static void tmr_mend_load(tmr_mend *m) {
    const uint32_t *indices = m->desc->surface.indices;
    for (int32_t c = 0; c < 3 * m->face_count; c++) m->vertex[c] = m->rename[indices[c]];
    for (int32_t f = 0; f < m->face_count; f++) m->origin[f] = (uint32_t)f;
}

/* Remove the faces that are marked with TMR_NO_VERTEX or have a vertex twice; count the latter. */
static void tmr_mend_compact(tmr_mend *m) {
    int32_t n = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        if (v[0] == TMR_NO_VERTEX) continue;
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) {
            m->report.degenerate++;
            continue;
        }
        memmove(m->vertex + 3 * n, v, 3 * sizeof *v);
        m->origin[n] = m->origin[f];
        m->turn[n] = m->turn[f];
        m->twin[n++] = m->twin[f];
    }
    m->face_count = n;
}

/* 0: other vertices; 1: the same, in the same winding; -1: in the opposite winding */
static int tmr_same_face(const int32_t *a, const int32_t *b) {
    for (int k = 0; k < 3; k++) {
        if (a[0] != b[k]) continue;
        if (a[1] == b[(k + 1) % 3] && a[2] == b[(k + 2) % 3]) return 1;
        if (a[2] == b[(k + 1) % 3] && a[1] == b[(k + 2) % 3]) return -1;
    }
    return 0;
}

/* Of faces with the same three vertices keep the first; note whether another had opposite
   winding. */
static void tmr_mend_duplicates(tmr_mend *m) {
    const size_t mask = m->table_size - 1;
    memset(m->table, 0, m->table_size * sizeof *m->table);
    for (int32_t f = 0; f < m->face_count; f++) {
        const int32_t *v = m->vertex + 3 * f;
        /* a sum, which does not depend on their order */
        size_t slot = (size_t)(txm_hash((uint64_t)v[0] + 1) + txm_hash((uint64_t)v[1] + 1) +
                               txm_hash((uint64_t)v[2] + 1)) & mask;
        int same = 0;
        for (; m->table[slot]; slot = (slot + 1) & mask) {
            same = tmr_same_face(m->vertex + 3 * (m->table[slot] - 1), v);
            if (same) break;
        }
        if (!same) {
            m->table[slot] = f + 1;
            continue;
        }
        if (same < 0) m->twin[m->table[slot] - 1] = 1;
        m->report.duplicate++;
        m->vertex[3 * f] = TMR_NO_VERTEX;
    }
    tmr_mend_compact(m);
}

/* ---- mending: edges ----------------------------------------------------------------------- */

/* The faces as they are now. */
static txm_mesh tmr_mend_mesh(const tmr_mend *m) {
    txm_mesh mesh;
    memset(&mesh, 0, sizeof mesh);
    mesh.indices = (const uint32_t *)m->vertex;
    mesh.vertex_count = (size_t)m->vertex_count;
    mesh.face_count = (size_t)m->face_count;
    return mesh;
}

/* the corner opposite to the side that is the i-th in the order of the edges */
static int32_t tmr_opposite_corner(const tmr_mend *m, int32_t i) {
    return tmr_prev((int32_t)m->sides[i]);
}

/* The end of the run of sides of one edge that begins at i. */
static int32_t tmr_run_end(const tmr_mend *m, int32_t i) {
    const txm_mesh mesh = tmr_mend_mesh(m);
    return (int32_t)txm_mesh_edge_end(&mesh, m->sides, (size_t)i);
}

/* Find the opposites. Returns how many edges have more than two faces. */
static int32_t tmr_mend_opposites(tmr_mend *m) {
    const txm_mesh mesh = tmr_mend_mesh(m);
    int32_t overfull = 0;
    txm_mesh_sort_sides(&mesh, m->sides);
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        const int32_t c = tmr_opposite_corner(m, i);
        end = tmr_run_end(m, i);
        if (end == i + 1) m->opposite[c] = -1;
        else if (end == i + 2) {
            m->opposite[c] = tmr_opposite_corner(m, i + 1);
            m->opposite[m->opposite[c]] = c;
        } else {
            for (int32_t k = i; k < end; k++) m->opposite[tmr_opposite_corner(m, k)] = TMR_OVERFULL;
            overfull++;
        }
    }
    return overfull;
}

/* Has the triangle no area, as far as single precision can tell? */
static int tmr_is_thin(const tmr_mend *m, const txm_dvec3 p[3]) {
    double longest = 0;
    for (int k = 0; k < 3; k++) longest = fmax(longest, txm_d3_dist2(p[k], p[(k + 1) % 3]));
    longest = sqrt(longest);
    const double height = longest > 0 ? txm_d3_len(txm_d3_area2(p[0], p[1], p[2])) / longest : 0;
    /* a height within rounding errors counts only if the triangle is slim as well */
    return height <= 1e-6 * longest || (height <= m->noise && height <= 1e-3 * longest);
}
static void tmr_face_points(const tmr_mend *m, int32_t f, txm_dvec3 p[3]) {
    for (int k = 0; k < 3; k++) p[k] = m->point[m->vertex[3 * f + k]];
}
static int tmr_face_is_thin(const tmr_mend *m, int32_t f) {
    txm_dvec3 p[3];
    tmr_face_points(m, f, p);
    return tmr_is_thin(m, p);
}

/* A fin is attached at the edge of its corner c only: its other two edges are borders. */
static int tmr_is_fin(const tmr_mend *m, int32_t c, int thin_only) {
    return m->opposite[tmr_next(c)] == -1 && m->opposite[tmr_prev(c)] == -1 &&
           (!thin_only || tmr_face_is_thin(m, c / 3));
}

/* Mark the fins of a run if two or more faces remain; if not, try only those without area. */
static int tmr_cut_fins(tmr_mend *m, int32_t begin, int32_t end) {
    for (int thin_only = 0; thin_only < 2; thin_only++) {
        int32_t fins = 0;
        for (int32_t k = begin; k < end; k++)
            fins += tmr_is_fin(m, tmr_opposite_corner(m, k), thin_only);
        if (fins == 0 || end - begin - fins < 2) continue;
        for (int32_t k = begin; k < end; k++) {
            const int32_t c = tmr_opposite_corner(m, k);
            if (tmr_is_fin(m, c, thin_only)) m->flag[c / 3] = 1;
        }
        return 1;
    }
    return 0;
}

/* An interior wall of two faces back to back, of which the first step kept one, is removed where it
   meets two faces of the outside, or only other walls; so is all of the wall that is connected to
   it. (If all faces of the input were double, they are the outside.) */
static int tmr_cut_twins(tmr_mend *m, int32_t begin, int32_t end) {
    int32_t twins = 0, top = 0;
    for (int32_t k = begin; k < end; k++) twins += m->twin[m->sides[k] / 3];
    const int32_t others = end - begin - twins;
    if (twins == 0 || !(others == 2 || (others == 0 && m->single))) return 0;
    for (int32_t k = begin; k < end; k++) {
        const int32_t f = (int32_t)m->sides[k] / 3;
        if (!m->twin[f] || m->flag[f]) continue;
        m->flag[f] = 1;
        m->list[top++] = f;
    }
    while (top > 0) {
        const int32_t f = m->list[--top];
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
            const int32_t g = m->opposite[c] < 0 ? f : m->opposite[c] / 3;
            if (!m->twin[g] || m->flag[g]) continue;
            m->flag[g] = 1;
            TRIMESH_ASSERT(top < m->face_count);
            m->list[top++] = g;
        }
    }
    return 1;
}

static void tmr_clear_flags(tmr_mend *m) {
    for (int32_t f = 0; f < m->face_count; f++) m->flag[f] = 0;
}

/* Call `mend` for the edges with more than two faces. Returns how many of them it mended. */
static int32_t tmr_mend_overfull(tmr_mend *m, int (*mend)(tmr_mend *, int32_t, int32_t)) {
    int32_t mended = 0;
    for (int32_t i = 0, end; i < 3 * m->face_count; i = end) {
        end = tmr_run_end(m, i);
        if (end - i > 2) mended += mend(m, i, end);
    }
    return mended;
}

/* Remove the flagged faces. Returns how many. */
static size_t tmr_cut_flagged(tmr_mend *m) {
    size_t count = 0;
    for (int32_t f = 0; f < m->face_count; f++) {
        if (m->flag[f]) m->vertex[3 * f] = TMR_NO_VERTEX;
        count += m->flag[f];
    }
    tmr_mend_compact(m);
    return count;
}

#endif /* TRIMESH_RELAX_MEND_H */
