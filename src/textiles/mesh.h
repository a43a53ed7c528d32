#ifndef TEXTILES_MESH_H
#define TEXTILES_MESH_H

#include "grid.h"

/* ---- meshes: edges and their colours ---------------------------------------------------- */

enum {
    TXT_RING = 16,         /* ours: faces at an edge that are looked at; keeps soups linear */
    TXT_PASSES = 32,       /* ours: over the faces to part equal neighbours                 */
    TXT_REPORT_FACES = 1 << 14
};
#define TXT_NO_SIDE 0xffffffffu

/* Side k of face f runs from its corner k to the next and has the number f * corners + k. The sides
   at one edge, that is with the same two vertices, form a ring by `next`, and have one colour. */
typedef struct txt_mesh {
    const textiles_set *set;
    const uint32_t *indices;
    txm_env *env;
    uint32_t faces, corners; /* 3 or 4 corners a face                */
    uint64_t seed;
    uint32_t *next;          /* by side                              */
    uint8_t *color;          /* by side                              */
    int32_t *tile;           /* by face; -1 = none yet               */
} txt_mesh;

/* the vertices of a side, lower number first */
static void txt_side_ends(const txt_mesh *m, uint32_t side, uint32_t *low, uint32_t *high) {
    const uint32_t k = side % m->corners, first = side - k;
    const uint32_t a = m->indices[side], b = m->indices[k + 1 < m->corners ? side + 1 : first];
    *low = a < b ? a : b;
    *high = a < b ? b : a;
}

static uint64_t txt_edge_hash(const txt_mesh *m, uint32_t low, uint32_t high) {
    return txm_hash(txm_hash(m->seed ^ 0x7465787475726573u) + ((uint64_t)high << 32 | low));
}

/* the tile (variant 0) * 4 + rotation for the colours of a face, or -1 */
static int32_t txt_face_entry(const txt_mesh *m, uint32_t face) {
    const textiles_set *s = m->set;
    const uint32_t first = face * m->corners;
    int code = 0;
    if (m->corners == 4) { /* west, south, east, north; the code begins with north */
        for (int k = 3; k >= 0; k--) code = code * s->colors + m->color[first + (uint32_t)k];
        return s->lookup[code];
    }
    for (uint32_t k = 0; k < 3; k++) {
        /* Along an edge to the same vertex there is no direction; that of the corners' numbers keeps
           the three from running one way round. */
        const uint32_t n = k == 2 ? 0 : k + 1, a = m->indices[first + k], b = m->indices[first + n];
        const int against = a > b || (a == b && k > n);
        code = code * s->symbols + 2 * m->color[first + k] + against;
    }
    return s->lookup[code];
}

/* How often faces beside this one show the tile. */
static int txt_equal_neighbors(const txt_mesh *m, uint32_t face, int32_t tile) {
    int equal = 0;
    for (uint32_t k = 0; k < m->corners; k++) {
        const uint32_t side = face * m->corners + k;
        uint32_t other = m->next[side];
        for (int i = 0; i < TXT_RING && other != side; i++, other = m->next[other]) {
            const uint32_t f = other / m->corners;
            equal += f != face && m->tile[f] == tile;
        }
    }
    return equal;
}

/* Give a face the tile of its colours, in the variant that the fewest neighbours show; the first of
   these, from one that is random for the face. Returns how many do. */
static int txt_choose_tile(txt_mesh *m, uint32_t face) {
    const int variants = m->set->variants;
    const int32_t base = txt_face_entry(m, face) / 4;
    const uint64_t h = txm_hash(txm_hash(m->seed + 1) + face) >> 32;
    const int first = (int)(h * (uint64_t)variants >> 32);
    int32_t best = base;
    int least = -1;
    for (int i = 0; i < variants && least != 0; i++) {
        const int32_t tile = base + (first + i) % variants;
        const int equal = txt_equal_neighbors(m, face, tile);
        if (least >= 0 && equal >= least) continue;
        least = equal;
        best = tile;
    }
    m->tile[face] = best;
    return least;
}

/* Color the edge of a side, choose tiles for the faces there, and count their equal neighbours. */
static int txt_try_color(txt_mesh *m, uint32_t side, uint8_t color, const uint32_t *faces, int count) {
    uint32_t other = side;
    int equal = 0;
    do {
        m->color[other] = color;
        other = m->next[other];
    } while (other != side);
    for (int i = 0; i < count; i++) m->tile[faces[i]] = -1;
    for (int i = 0; i < count; i++) txt_choose_tile(m, faces[i]);
    for (int i = 0; i < count; i++) equal += txt_equal_neighbors(m, faces[i], m->tile[faces[i]]);
    return equal;
}

/* Give an edge the colour with which the fewest faces there lie beside their like. A colour that is
   no better is taken for a change now and then, by a bit of coin. */
static void txt_recolor(txt_mesh *m, uint32_t side, uint32_t coin) {
    const int colors = m->set->colors;
    const uint8_t old = m->color[side];
    uint32_t faces[TXT_RING], other = side;
    int32_t tiles[TXT_RING];
    int count = 0, least = 0;
    do { /* each face once */
        const uint32_t f = other / m->corners;
        int known = 0;
        for (int i = 0; i < count; i++) known |= faces[i] == f;
        if (!known && count == TXT_RING) return;
        if (!known) faces[count++] = f;
        other = m->next[other];
    } while (other != side);
    for (int i = 0; i < count; i++) {
        tiles[i] = m->tile[faces[i]];
        least += txt_equal_neighbors(m, faces[i], tiles[i]);
    }
    uint8_t best = old;
    for (int i = 0; i < colors; i++) {
        const uint8_t color = (uint8_t)((old + 1 + i) % colors);
        const int equal = txt_try_color(m, side, color, faces, count);
        if (equal > least || (equal == least && (best != old || color == old || !(coin & 1)))) continue;
        least = equal;
        best = color;
    }
    txt_try_color(m, side, best, faces, count);
    if (best == old) {
        int equal = 0;
        for (int i = 0; i < count; i++) equal += txt_equal_neighbors(m, faces[i], m->tile[faces[i]]);
        if (equal <= least) return;
        for (int i = 0; i < count; i++) m->tile[faces[i]] = tiles[i]; /* no better: as it was */
    }
}

/* Choose all tiles, then part those beside their like, by variants and, where edges may be recoloured,
   by colours. 0 when cancelled. */
static int txt_choose_tiles(txt_mesh *m, int recolor) {
    for (uint32_t f = 0; f < m->faces; f++) m->tile[f] = -1;
    for (uint32_t f = 0; f < m->faces; f++) {
        if (f % TXT_REPORT_FACES == 0 &&
            txm_progress(m->env, 0.5f + 0.3f * (float)f / (float)m->faces, "tiles"))
            return 0;
        txt_choose_tile(m, f);
    }
    for (int pass = 0; pass < TXT_PASSES; pass++) {
        int found = 0;
        for (uint32_t f = 0; f < m->faces; f++) {
            if (f % TXT_REPORT_FACES == 0) {
                const float done = ((float)pass + (float)f / (float)m->faces) / (float)TXT_PASSES;
                if (txm_progress(m->env, 0.8f + 0.2f * done, "neighbors")) return 0;
            }
            if (!txt_equal_neighbors(m, f, m->tile[f])) continue;
            found = 1;
            if (!txt_choose_tile(m, f) || !recolor) continue;
            const uint32_t h = (uint32_t)(txm_hash(txm_hash(m->seed + 2) +
                                                   ((uint64_t)pass << 32 | f)) >> 32);
            for (uint32_t i = 0; i < m->corners; i++) {
                const uint32_t k = (h + i) % m->corners;
                txt_recolor(m, f * m->corners + k, h >> (8 + i));
                if (!txt_equal_neighbors(m, f, m->tile[f])) break;
            }
        }
        if (!found) break;
    }
    return 1;
}

/* ---- meshes: which sides share an edge -------------------------------------------------- */

/* May two sides of quads lie at one edge? North meets south and east meets west, each running against
   the other round its face, with one colour. */
static int txt_sides_match(const txt_mesh *m, uint32_t a, uint32_t b) {
    return ((a ^ b) & 3) == 2 && m->indices[a] != m->indices[b] && m->color[a] == m->color[b];
}

/* Link the sides into rings, by a hash table of 4/3 places per side with linear probing. Colours are
   hashed (colors NULL) or given, and then checked. Sides of quads from a vertex to itself are left
   alone: around a pole they are all at the same vertex. */
static txm_status txt_link_sides(txt_mesh *m, uint32_t *table, uint64_t places) {
    const uint32_t sides = m->faces * m->corners;
    for (uint64_t i = 0; i < places; i++) table[i] = TXT_NO_SIDE;
    for (uint32_t side = 0; side < sides; side++) {
        uint32_t low, high, other = TXT_NO_SIDE;
        if (side % (4 * TXT_REPORT_FACES) == 0 &&
            txm_progress(m->env, 0.5f * (float)side / (float)sides, "edges"))
            return txt_cancelled(m->env);
        m->next[side] = side;
        txt_side_ends(m, side, &low, &high);
        if (m->corners == 4 && low == high) continue;
        uint64_t at = (txm_hash((uint64_t)high << 32 | low) >> 32) * places >> 32;
        for (; table[at] != TXT_NO_SIDE; at = at + 1 < places ? at + 1 : 0) {
            uint32_t l, h;
            txt_side_ends(m, table[at], &l, &h);
            if (l != low || h != high) continue;
            other = table[at];
            break;
        }
        if (other == TXT_NO_SIDE) {
            table[at] = side;
            continue;
        }
        for (uint32_t s = other; m->corners == 4;) {
            if (!txt_sides_match(m, side, s))
                return txt_fail_numbers(m->env, TXM_BAD_ARGUMENT,
                                        "faces # and # share an edge whose sides do not match: it "
                                        "must be north and south, or east and west, of one color "
                                        "and equal winding",
                                        s / 4, side / 4);
            s = m->next[s];
            if (s == other) break;
        }
        m->next[side] = m->next[other];
        m->next[other] = side;
    }
    return TXM_OK;
}

/* What both kinds of meshes need: checks, colours, rings, tiles. edges: as for quads, or NULL. The
   mesh's arrays lie in the arena. */
static txm_status txt_assign(txt_mesh *m, size_t face_count, size_t vertex_count, const int *edges,
                             txm_arena *arena) {
    if (face_count > (TXT_NO_SIDE - 1) / m->corners || face_count > SIZE_MAX / 64)
        return txm_fail(m->env, TXM_TOO_LARGE, "more faces than 32 bits can number the sides of");
    m->faces = (uint32_t)face_count;
    const uint32_t sides = m->faces * m->corners;
    for (uint32_t i = 0; i < sides; i++) {
        if (m->indices[i] >= vertex_count)
            return txt_fail_numbers(m->env, TXM_BAD_ARGUMENT,
                                    "indices: face # names vertex #, not below vertex_count",
                                    i / m->corners, m->indices[i]);
        if (edges && (edges[i] < 0 || edges[i] >= m->set->colors))
            return txt_fail_numbers(m->env, TXM_BAD_ARGUMENT,
                                    "edges: a color of face # is not 0..#", i / m->corners,
                                    (uint64_t)m->set->colors - 1);
    }

    txm_arena scratch;
    const uint64_t places = (uint64_t)sides + sides / 3 + 1;
    txm_arena_init(&scratch, m->env);
    m->next = (uint32_t *)txm_arena_alloc(arena, sides, sizeof(uint32_t));
    m->color = (uint8_t *)txm_arena_alloc(arena, sides, 1);
    m->tile = (int32_t *)txm_arena_alloc(arena, m->faces, sizeof(int32_t));
    uint32_t *table = (uint32_t *)txm_arena_alloc(&scratch, (size_t)places, sizeof(uint32_t));
    txm_status status = TXM_OK;
    if (!m->next || !m->color || !m->tile || !table)
        status = txm_fail(m->env, TXM_OUT_OF_MEMORY, "no memory for the edges of the mesh");
    for (uint32_t side = 0; side < sides && status == TXM_OK; side++) {
        uint32_t low, high;
        txt_side_ends(m, side, &low, &high);
        const uint64_t h = txt_edge_hash(m, low, high) >> 32;
        m->color[side] = (uint8_t)(edges ? edges[side - side % 4 + (3 - side % 4)]
                                         : (int)(h * (uint64_t)m->set->colors >> 32));
    }
    if (status == TXM_OK) status = txt_link_sides(m, table, places);
    txm_arena_free(&scratch);
    for (uint32_t f = 0; f < m->faces && status == TXM_OK; f++) {
        if (txt_face_entry(m, f) < 0)
            status = txt_fail_numbers(m->env, TXM_BAD_ARGUMENT,
                                      "edges: the set has no tile with the colors of face #", f, 0);
    }
    if (status == TXM_OK && !txt_choose_tiles(m, !edges)) status = txt_cancelled(m->env);
    if (status == TXM_OK && txm_progress(m->env, 1, "neighbors")) status = txt_cancelled(m->env);
    return status;
}

/* ---- public: meshes --------------------------------------------------------------------- */

TEXTILES_API txm_status textiles_assign_triangles(const textiles_set *set, const uint32_t *indices,
                                                  size_t face_count, size_t vertex_count,
                                                  uint64_t seed, txm_env *env, int *tiles,
                                                  int *rotations) {
    txt_mesh m;
    txm_arena arena;
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    if (set->kind != TEXTILES_TRIANGLE)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "faces of three corners need a triangle set; for quads there is "
                        "textiles_assign_quads");
    if (face_count == 0) return TXM_OK;
    if (!indices || !tiles || !rotations)
        return txm_fail(env, TXM_BAD_ARGUMENT, "indices, tiles or rotations is NULL");
    memset(&m, 0, sizeof m);
    m.set = set;
    m.indices = indices;
    m.env = env;
    m.corners = 3;
    m.seed = seed;
    txm_arena_init(&arena, env);
    const txm_status status = txt_assign(&m, face_count, vertex_count, NULL, &arena);
    for (uint32_t f = 0; f < m.faces && status == TXM_OK; f++) {
        tiles[f] = m.tile[f];
        rotations[f] = (int)(txt_face_entry(&m, f) & 3);
    }
    txm_arena_free(&arena);
    return status;
}

TEXTILES_API txm_status textiles_assign_quads(const textiles_set *set, const uint32_t *indices,
                                              size_t face_count, size_t vertex_count,
                                              const int *edges, uint64_t seed, txm_env *env,
                                              int *tiles) {
    txt_mesh m;
    txm_arena arena;
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    if (set->kind != TEXTILES_WANG && set->kind != TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "quads need a wang or frame set, with colors on its edges");
    if (!edges && !set->complete)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "without edges the colors are hashed, which takes a complete wang set; give "
                        "edges, or make the set without reduced");
    if (face_count == 0) return TXM_OK;
    if (!indices || !tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "indices or tiles is NULL");
    memset(&m, 0, sizeof m);
    m.set = set;
    m.indices = indices;
    m.env = env;
    m.corners = 4;
    m.seed = seed;
    txm_arena_init(&arena, env);
    const txm_status status = txt_assign(&m, face_count, vertex_count, edges, &arena);
    for (uint32_t f = 0; f < m.faces && status == TXM_OK; f++) tiles[f] = m.tile[f];
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXTILES_MESH_H */
