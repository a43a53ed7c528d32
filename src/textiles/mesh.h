#ifndef TEXTILES_MESH_H
#define TEXTILES_MESH_H

#include "set.h"

/* ---- meshes: edges and their colours ---------------------------------------------------- */

enum {
    TXT_RING = 16,         /* ours: faces at an edge that are looked at; keeps soups linear */
    TXT_PASSES = 32,       /* ours: over the faces to separate equal neighbours             */
    TXT_REPORT_FACES = 1 << 14
};

/* Side k of face f runs from its corner k to the next and has the number f * corners + k. The sides
   at one edge, that is with the same two vertices, form a ring by `next`, and have one colour. */
typedef struct txt_cover {
    const textiles_set *set;
    txm_env *env;
    txm_arena arena;
    txm_mesh mesh;
    uint64_t seed;
    uint32_t faces, corners, sides; /* of the mesh; corners: 3 or 4 a face    */
    uint32_t *next;                 /* by side                                */
    uint8_t *color;                 /* by side                                */
    int32_t *tile;                  /* by face; -1 = none yet                 */
} txt_cover;

/* the tile (variant 0) * 4 + rotation for the colours of a face, or -1 */
static int32_t txt_face_entry(const txt_cover *c, uint32_t face) {
    const textiles_set *s = c->set;
    const uint32_t first = face * c->corners;
    int code = 0;
    if (c->corners == 4) { /* west, south, east, north; the code begins with north */
        for (int k = 3; k >= 0; k--) code = code * s->colors + c->color[first + (uint32_t)k];
        return s->lookup[code];
    }
    for (uint32_t side = first; side < first + 3; side++)
        code = code * s->symbols + 2 * c->color[side] + txm_mesh_runs_down(&c->mesh, side);
    return s->lookup[code];
}

/* How many neighbours of a face show the tile. */
static int txt_equal_neighbors(const txt_cover *c, uint32_t face, int32_t tile) {
    int equal = 0;
    for (uint32_t k = 0; k < c->corners; k++) {
        const uint32_t side = face * c->corners + k;
        uint32_t other = c->next[side];
        for (int i = 0; i < TXT_RING && other != side; i++, other = c->next[other]) {
            const uint32_t f = other / c->corners;
            equal += f != face && c->tile[f] == tile;
        }
    }
    return equal;
}

/* Give a face the tile of its colours in the variant that the fewest neighbours show, of equally
   good ones the first from a random variant on. Returns how many neighbours show it. */
static int txt_choose_tile(txt_cover *c, uint32_t face) {
    const int variants = c->set->variants;
    const int32_t base = txt_face_entry(c, face) / 4;
    const uint64_t h = txm_hash(txm_hash(c->seed + 1) + face) >> 32;
    const int first = (int)(h * (uint64_t)variants >> 32);
    int32_t best = base;
    int least = -1;
    for (int i = 0; i < variants && least != 0; i++) {
        const int32_t tile = base + (first + i) % variants;
        const int equal = txt_equal_neighbors(c, face, tile);
        if (least >= 0 && equal >= least) continue;
        least = equal;
        best = tile;
    }
    c->tile[face] = best;
    return least;
}

/* Color the edge of a side, choose tiles for the faces there, and count their equal neighbours. */
static int txt_try_color(txt_cover *c, uint32_t side, uint8_t color, const uint32_t *faces, int count) {
    uint32_t other = side;
    int equal = 0;
    do {
        c->color[other] = color;
        other = c->next[other];
    } while (other != side);
    for (int i = 0; i < count; i++) c->tile[faces[i]] = -1;
    for (int i = 0; i < count; i++) txt_choose_tile(c, faces[i]);
    for (int i = 0; i < count; i++) equal += txt_equal_neighbors(c, faces[i], c->tile[faces[i]]);
    return equal;
}

/* Give an edge the colour with which its faces have the fewest equal neighbours. If no colour is
   better, an equally good one is taken when bit 0 of coin is set, to leave local minima. */
static void txt_recolor(txt_cover *c, uint32_t side, uint32_t coin) {
    const int colors = c->set->colors;
    const uint8_t old = c->color[side];
    uint32_t faces[TXT_RING], other = side;
    int32_t tiles[TXT_RING];
    int count = 0, least = 0;
    do { /* each face once */
        const uint32_t f = other / c->corners;
        int known = 0;
        for (int i = 0; i < count; i++) known |= faces[i] == f;
        if (!known && count == TXT_RING) return;
        if (!known) faces[count++] = f;
        other = c->next[other];
    } while (other != side);
    for (int i = 0; i < count; i++) {
        tiles[i] = c->tile[faces[i]];
        least += txt_equal_neighbors(c, faces[i], tiles[i]);
    }
    uint8_t best = old;
    for (int i = 0; i < colors; i++) {
        const uint8_t color = (uint8_t)((old + 1 + i) % colors);
        const int equal = txt_try_color(c, side, color, faces, count);
        if (equal > least || (equal == least && (best != old || color == old || !(coin & 1)))) continue;
        least = equal;
        best = color;
    }
    txt_try_color(c, side, best, faces, count);
    if (best == old) {
        int equal = 0;
        for (int i = 0; i < count; i++) equal += txt_equal_neighbors(c, faces[i], c->tile[faces[i]]);
        if (equal <= least) return;
        for (int i = 0; i < count; i++) c->tile[faces[i]] = tiles[i]; /* no better: restore */
    }
}

/* Choose all tiles, then separate equal neighbours by other variants and, where edges may be
   recoloured, by other colours. 0 when cancelled. */
static int txt_choose_tiles(txt_cover *c, int recolor) {
    for (uint32_t f = 0; f < c->faces; f++) c->tile[f] = -1;
    for (uint32_t f = 0; f < c->faces; f++) {
        if (f % TXT_REPORT_FACES == 0 &&
            txm_progress(c->env, 0.5f + 0.3f * (float)f / (float)c->faces, "tiles"))
            return 0;
        txt_choose_tile(c, f);
    }
    for (int pass = 0; pass < TXT_PASSES; pass++) {
        int found = 0;
        for (uint32_t f = 0; f < c->faces; f++) {
            if (f % TXT_REPORT_FACES == 0) {
                const float done = ((float)pass + (float)f / (float)c->faces) / (float)TXT_PASSES;
                if (txm_progress(c->env, 0.8f + 0.2f * done, "neighbors")) return 0;
            }
            if (!txt_equal_neighbors(c, f, c->tile[f])) continue;
            found = 1;
            if (!txt_choose_tile(c, f) || !recolor) continue;
            const uint32_t h = (uint32_t)(txm_hash(txm_hash(c->seed + 2) +
                                                   ((uint64_t)pass << 32 | f)) >> 32);
            for (uint32_t i = 0; i < c->corners; i++) {
                const uint32_t k = (h + i) % c->corners;
                txt_recolor(c, f * c->corners + k, h >> (8 + i));
                if (!txt_equal_neighbors(c, f, c->tile[f])) break;
            }
        }
        if (!found) break;
    }
    return 1;
}

/* ---- meshes: checks and colours ---------------------------------------------------------- */

/* May two sides of quads share an edge? North meets south and east meets west, with one colour and
   in opposite directions. */
static int txt_sides_match(const txt_cover *c, uint32_t a, uint32_t b) {
    const uint32_t *v = c->mesh.indices;
    return ((a ^ b) & 3) == 2 && v[a] != v[b] && c->color[a] == c->color[b];
}

/* Do all sides of quads match those at the same edge? Sides from a vertex to itself have no edge:
   around a pole all faces have one at the same vertex. */
static txm_status txt_check_sides(const txt_cover *c) {
    for (uint32_t side = 0; side < c->sides; side++) {
        uint32_t other = TXM_NO_SIDE;
        for (uint32_t s = c->next[side]; s < side; s = c->next[s]) /* rings run downwards */
            if (!txt_sides_match(c, side, s)) other = s;
        if (other != TXM_NO_SIDE)
            return txm_fail_numbers(c->env, TXM_BAD_ARGUMENT,
                                    "faces # and # share an edge whose sides do not match: it must "
                                    "be north and south, or east and west, of one color and equal "
                                    "winding",
                                    other / 4, side / 4);
    }
    return TXM_OK;
}

/* Colours by hash (edges NULL), or as given for quads; 0 when cancelled. */
static int txt_color_sides(txt_cover *c, const int *edges) {
    for (uint32_t i = 0; i < c->sides; i++) {
        if (i % (4 * TXT_REPORT_FACES) == 0 &&
            txm_progress(c->env, 0.5f * (float)i / (float)c->sides, "edges"))
            return 0;
        c->color[i] =
            (uint8_t)(edges ? edges[i - i % 4 + (3 - i % 4)]
                            : txm_mesh_edge_color(&c->mesh, i, c->seed, c->set->colors));
    }
    return 1;
}

/* Cover a mesh of 3 or 4 corners a face: check it, color its edges (edges: as for quads, or NULL),
   choose tiles. What it allocates is in the arena, which the caller frees in any case. */
static txm_status txt_cover_make(txt_cover *c, const textiles_set *set, const uint32_t *indices,
                                 int corners, size_t face_count, size_t vertex_count,
                                 const int *edges, uint64_t seed, txm_env *env) {
    memset(c, 0, sizeof *c);
    c->set = set;
    c->env = env;
    c->seed = seed;
    txm_arena_init(&c->arena, env);
    c->mesh.indices = indices;
    c->mesh.face_count = face_count;
    c->mesh.vertex_count = vertex_count;
    c->mesh.corners = corners;
    txm_status status = txm_mesh_check(&c->mesh, "indices", corners, 0, 0, env);
    if (status != TXM_OK) return status;
    c->faces = (uint32_t)face_count;
    c->corners = (uint32_t)corners;
    c->sides = (uint32_t)txm_mesh_sides(&c->mesh);
    for (uint32_t i = 0; edges && i < c->sides; i++) {
        if (edges[i] < 0 || edges[i] >= set->colors)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "edges: a color of face # is not 0..#",
                                    i / c->corners, (uint64_t)set->colors - 1);
    }

    uint32_t *sorted = (uint32_t *)txm_arena_alloc(&c->arena, c->sides, 2 * sizeof(uint32_t));
    c->color = (uint8_t *)txm_arena_alloc(&c->arena, c->sides, 1);
    c->tile = (int32_t *)txm_arena_alloc(&c->arena, c->faces, sizeof(int32_t));
    if (c->arena.failed)
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the edges of the mesh");
    if (!txt_color_sides(c, edges)) return txt_cancelled(env);
    c->next = sorted + c->sides; /* scratch of the sort, free after it */
    txm_mesh_sort_sides(&c->mesh, sorted);
    txm_mesh_link(&c->mesh, sorted, TXM_LINK_DOWN | (corners == 3 ? TXM_LINK_POINTS : 0), c->next);
    if (corners == 4) status = txt_check_sides(c);
    for (uint32_t f = 0; f < c->faces && status == TXM_OK; f++) {
        if (txt_face_entry(c, f) < 0)
            status = txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                      "edges: the set has no tile with the colors of face #", f, 0);
    }
    if (status == TXM_OK && !txt_choose_tiles(c, !edges)) status = txt_cancelled(env);
    if (status == TXM_OK && txm_progress(env, 1, "neighbors")) status = txt_cancelled(env);
    return status;
}

/* ---- public: meshes --------------------------------------------------------------------- */

TEXTILES_API txm_status textiles_assign_triangles(const textiles_set *set, const uint32_t *indices,
                                                  size_t face_count, size_t vertex_count,
                                                  uint64_t seed, txm_env *env, int *tiles,
                                                  int *rotations) {
    txt_cover c;
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    if (set->kind != TEXTILES_TRIANGLE)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "faces of three corners need a triangle set; for quads there is "
                        "textiles_assign_quads");
    if (face_count == 0) return TXM_OK;
    if (!indices || !tiles || !rotations)
        return txm_fail(env, TXM_BAD_ARGUMENT, "indices, tiles or rotations is NULL");
    const txm_status status =
        txt_cover_make(&c, set, indices, 3, face_count, vertex_count, NULL, seed, env);
    for (uint32_t f = 0; f < c.faces && status == TXM_OK; f++) {
        tiles[f] = c.tile[f];
        rotations[f] = (int)(txt_face_entry(&c, f) & 3);
    }
    txm_arena_free(&c.arena);
    return status;
}

TEXTILES_API txm_status textiles_assign_quads(const textiles_set *set, const uint32_t *indices,
                                              size_t face_count, size_t vertex_count,
                                              const int *edges, uint64_t seed, txm_env *env,
                                              int *tiles) {
    txt_cover c;
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
    const txm_status status =
        txt_cover_make(&c, set, indices, 4, face_count, vertex_count, edges, seed, env);
    if (status == TXM_OK) memcpy(tiles, c.tile, face_count * sizeof *tiles);
    txm_arena_free(&c.arena);
    return status;
}

#endif /* TEXTILES_MESH_H */
