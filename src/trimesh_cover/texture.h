#ifndef TRIMESH_COVER_TEXTURE_H
#define TRIMESH_COVER_TEXTURE_H

#include "check.h"

/* ---- texturing ------------------------------------------------------------------------------- */

TRIMESH_COVER_API txm_status trimesh_atlas_make(int count, int size, int gutter, txm_env *env,
                                          trimesh_atlas *atlas) {
    const int n = count ? count : 4, s = size ? size : 256, g = gutter == -1 ? 8 : gutter;
    if (!atlas) return txm_fail(env, TXM_BAD_ARGUMENT, "atlas is NULL");
    if (n < 1 || n > 256) return txm_fail(env, TXM_BAD_ARGUMENT, "count must be 1 to 256");
    if (s < 2 || s > 16384) return txm_fail(env, TXM_BAD_ARGUMENT, "size must be 2 to 16384");
    if (g < 0 || g > s) return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be -1 to size");
    atlas->count = n;
    atlas->size = s;
    atlas->gutter = g;
    atlas->pitch = s + 2 * g;
    atlas->width = n * atlas->pitch;
    atlas->height = (int)ceil(s * TMC_H) + 2 * g;
    return TXM_OK;
}

TRIMESH_COVER_API int trimesh_atlas_uv(const trimesh_atlas *atlas, int patch, float *uv) {
    if (!atlas || !uv || patch < -1 || patch >= atlas->count) return 0;
    const int first = patch < 0 ? 0 : patch, end = patch < 0 ? atlas->count : patch + 1;
    for (int p = first; p < end; p++) {
        for (int k = 0; k < 3; k++, uv += 2) {
            const double across = k == 0 ? 0 : k == 1 ? 1 : 0.5;
            const double x = (double)p * atlas->pitch + atlas->gutter + across * atlas->size;
            const double y = atlas->height - atlas->gutter - (k == 2 ? atlas->size * TMC_H : 0);
            uv[0] = txm_float(x / atlas->width);
            uv[1] = txm_float(y / atlas->height);
        }
    }
    return 1;
}

/* All triangles in breadth-first order. */
static void tmc_breadth_first(const uint32_t *next, size_t triangles, uint8_t *seen,
                              uint32_t *order) {
    size_t end = 0;
    for (size_t first = 0, at = 0; first < triangles; first++) {
        if (seen[first]) continue;
        seen[first] = 1;
        order[end++] = (uint32_t)first;
        for (; at < end; at++) {
            for (size_t side = 3 * (size_t)order[at]; side < 3 * (size_t)order[at] + 3; side++) {
                for (size_t s = next[side]; s != side; s = next[s]) {
                    if (seen[s / 3]) continue;
                    seen[s / 3] = 1;
                    TXM_ASSERT(end < triangles);
                    order[end++] = (uint32_t)(s / 3);
                }
            }
        }
    }
}

/* The cost of a choice beside the neighbours' choices so far: 0 = none of them has this patch. */
static int tmc_clashes(const uint32_t *next, const int *choice, int patches, size_t t, int chosen) {
    int sum = 0;
    for (size_t side = 3 * t; side < 3 * t + 3; side++) {
        int looked = 0; /* not for edges of very many triangles          */
        for (size_t s = next[side]; s != side && looked < 8; s = next[s], looked++) {
            const int other = choice[s / 3];
            if (other >= 0 && other % patches == chosen % patches) sum += other == chosen ? 8 : 1;
        }
    }
    return sum;
}

/* Choose in the reverse of that order: then every triangle but the last of its piece still has a
   neighbour without a choice, so that at most two neighbours constrain it. choice = patch + patches
   * rotation. */
static void tmc_choose(const uint32_t *next, const uint32_t *order, size_t triangles, int patches,
                       int total, uint64_t seed, int *choice) {
    for (size_t t = 0; t < triangles; t++) choice[t] = -1;
    for (size_t i = triangles; i-- > 0;) {
        const size_t t = order[i];
        txm_rng rng = txm_rng_make(seed, t);
        const int first = (int)txm_rng_below(&rng, (uint32_t)total);
        int best = first, least = INT_MAX;
        for (int k = 0; k < total && k < 64 && least > 0; k++) {
            const int chosen = (int)(((int64_t)first + k) % total);
            const int clashes = tmc_clashes(next, choice, patches, t, chosen);
            if (clashes >= least) continue;
            least = clashes;
            best = chosen;
        }
        choice[t] = best;
    }
}

static void tmc_put_choice(int choice, int patches, size_t t, int *out, int *rotations) {
    out[t] = choice % patches;
    if (rotations) rotations[t] = choice / patches;
}

TRIMESH_COVER_API txm_status trimesh_choose(const txm_mesh *mesh, const trimesh_choose_desc *desc,
                                      txm_env *env, int *patches, int *rotations) {
    trimesh_choose_desc none;
    txm_arena arena;
    memset(&none, 0, sizeof none);
    if (!desc) desc = &none;
    const int n = desc->patches ? desc->patches : 4, turns = desc->rotations ? desc->rotations : 3;
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (n < 1 || n > 65536) return txm_fail(env, TXM_BAD_ARGUMENT, "patches must be 1 to 65536");
    if (turns != 1 && turns != 3)
        return txm_fail(env, TXM_BAD_ARGUMENT, "rotations must be 1 or 3");
    const size_t count = mesh->face_count;
    if (count == 0) return TXM_OK;
    if (!patches || (turns == 3 && !rotations))
        return txm_fail(env, TXM_BAD_ARGUMENT, "patches or rotations is NULL");
    if (tmc_report(env, 0, "patches") != TXM_OK) return TXM_CANCELLED;
    for (size_t t = 0; desc->repeat && t < count; t++) {
        txm_rng rng = txm_rng_make(desc->seed, t);
        tmc_put_choice((int)txm_rng_below(&rng, (uint32_t)(n * turns)), n, t, patches, rotations);
    }
    if (desc->repeat) return TXM_OK;
    txm_arena_init(&arena, env);
    uint32_t *next = (uint32_t *)txm_arena_alloc(&arena, count, 3 * sizeof(uint32_t));
    uint32_t *order = (uint32_t *)txm_arena_alloc(&arena, count, sizeof(uint32_t));
    int *choice = (int *)txm_arena_alloc(&arena, count, sizeof(int));
    uint8_t *seen = (uint8_t *)txm_arena_zero(&arena, count, 1);
    status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) status = tmc_link(mesh, env, next);
    if (status == TXM_OK) status = tmc_report(env, 0.5, "patches");
    if (status == TXM_OK) {
        tmc_breadth_first(next, count, seen, order);
        tmc_choose(next, order, count, n, n * turns, desc->seed, choice);
        for (size_t t = 0; t < count; t++) tmc_put_choice(choice[t], n, t, patches, rotations);
    }
    txm_arena_free(&arena);
    return status;
}

TRIMESH_COVER_API txm_status trimesh_place_tiles(size_t triangle_count, const int *tiles,
                                           const int *rotations, const float *tile_uv,
                                           size_t tile_count, txm_env *env, float *uv) {
    if (triangle_count > TRIMESH_MAX_VERTICES)
        return txm_fail(env, TXM_TOO_LARGE, "more than TRIMESH_MAX_VERTICES triangles");
    if (triangle_count == 0) return TXM_OK;
    if (!tiles || !tile_uv || !uv)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tiles, tile_uv or uv is NULL");
    for (size_t t = 0; t < triangle_count; t++) {
        if (tiles[t] < 0 || (size_t)tiles[t] >= tile_count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "the tile of triangle # is not 0..tile_count - 1", t, 0);
        if (rotations && (rotations[t] < 0 || rotations[t] > 2))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "the rotation of triangle # is not 0..2",
                                    t, 0);
    }
    for (size_t t = 0; t < triangle_count; t++) {
        const size_t turn = rotations ? (size_t)rotations[t] : 0;
        for (size_t k = 0; k < 3; k++) {
            const float *from = tile_uv + 6 * (size_t)tiles[t] + 2 * ((k + turn) % 3);
            uv[6 * t + 2 * k] = from[0];
            uv[6 * t + 2 * k + 1] = from[1];
        }
    }
    return TXM_OK;
}

TRIMESH_COVER_API txm_status trimesh_edge_colors(const txm_mesh *mesh, int colors, uint64_t seed,
                                           txm_env *env, int *edge_colors, int *directions) {
    const txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (colors < 1 || colors > 65536)
        return txm_fail(env, TXM_BAD_ARGUMENT, "colors must be 1 to 65536");
    if (mesh->face_count && !edge_colors)
        return txm_fail(env, TXM_BAD_ARGUMENT, "edge_colors is NULL");
    for (size_t i = 0; i < 3 * mesh->face_count; i++) {
        edge_colors[i] = txm_mesh_edge_color(mesh, i, seed, colors);
        if (directions) directions[i] = txm_mesh_runs_down(mesh, i) ? -1 : 1;
    }
    return TXM_OK;
}

TRIMESH_COVER_API txm_status trimesh_random_colors(size_t vertex_count, int count, uint64_t seed,
                                             txm_env *env, int *colors) {
    const int n = count ? count : 3;
    if (vertex_count > TRIMESH_MAX_VERTICES)
        return txm_fail(env, TXM_TOO_LARGE, "more than TRIMESH_MAX_VERTICES vertices");
    if (n < 1 || n > 65536) return txm_fail(env, TXM_BAD_ARGUMENT, "count must be 1 to 65536");
    if (vertex_count && !colors) return txm_fail(env, TXM_BAD_ARGUMENT, "colors is NULL");
    for (size_t v = 0; v < vertex_count; v++) {
        txm_rng rng = txm_rng_make(seed, v);
        colors[v] = (int)txm_rng_below(&rng, (uint32_t)n);
    }
    return TXM_OK;
}

/* ---- texturing: proper colours --------------------------------------------------------------- */

/* Which vertices share an edge: those of v are ends[first[v]] .. ends[first[v + 1] - 1]. */
typedef struct tmc_graph {
    size_t count;
    uint32_t *first, *ends;
    uint32_t *degree; /* neighbours left                                                  */
    uint32_t *order;  /* all vertices by degree; removed from the front                  */
    uint32_t *place;  /* where a vertex lies in order                                     */
    uint32_t *bucket; /* where the vertices of each degree begin                          */
} tmc_graph;

static txm_status tmc_graph_build(tmc_graph *g, const txm_mesh *mesh, txm_arena *arena,
                                  txm_env *env) {
    const size_t n = mesh->vertex_count, sides = 3 * mesh->face_count;
    txm_arena scratch;
    uint32_t *sorted;
    txm_arena_init(&scratch, env);
    g->count = n;
    g->first = (uint32_t *)txm_arena_zero(arena, n + 2, sizeof(uint32_t));
    g->ends = (uint32_t *)txm_arena_alloc(arena, sides, 2 * sizeof(uint32_t));
    txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) status = tmc_sort_sides(mesh, &scratch, env, &sorted);
    const int good = status == TXM_OK;
    for (int pass = 0; pass < 2 && good; pass++) {
        for (size_t i = 0; i < sides; i = txm_mesh_edge_end(mesh, sorted, i)) {
            const uint32_t low = txm_mesh_low(mesh, sorted[i]), high = txm_mesh_high(mesh, sorted[i]);
            if (low == high) continue;
            if (pass) {
                g->ends[g->first[low + 1]] = high;
                g->ends[g->first[high + 1]] = low;
            }
            /* count at + 2, then fill from + 1: afterwards first[v] is right */
            g->first[low + (pass ? 1 : 2)]++;
            g->first[high + (pass ? 1 : 2)]++;
        }
        for (size_t v = 2; !pass && v < n + 2; v++) g->first[v] += g->first[v - 1];
    }
    txm_arena_free(&scratch);
    return status;
}

/* Remove the vertex with the fewest neighbours left, over and over; order receives them. Vertices
   are sorted by degree; one that loses a neighbour is swapped with the first of its degree. */
static txm_status tmc_smallest_first(tmc_graph *g, txm_arena *arena, txm_env *env) {
    const size_t n = g->count;
    g->degree = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    g->order = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    g->place = (uint32_t *)txm_arena_alloc(arena, n, sizeof(uint32_t));
    g->bucket = (uint32_t *)txm_arena_zero(arena, n + 2, sizeof(uint32_t));
    const txm_status status = tmc_check_memory(arena, env);
    if (status != TXM_OK) return status;
    for (size_t v = 0; v < n; v++) {
        g->degree[v] = g->first[v + 1] - g->first[v];
        g->bucket[g->degree[v] + 1]++;
    }
    for (size_t d = 1; d < n + 2; d++) g->bucket[d] += g->bucket[d - 1];
    for (size_t v = 0; v < n; v++) {
        g->place[v] = g->bucket[g->degree[v]]++;
        g->order[g->place[v]] = (uint32_t)v;
    }
    for (size_t d = n + 1; d > 0; d--) g->bucket[d] = g->bucket[d - 1];
    g->bucket[0] = 0;
    for (size_t i = 0; i < n; i++) {
        const uint32_t v = g->order[i];
        for (uint32_t e = g->first[v]; e < g->first[v + 1]; e++) {
            const uint32_t u = g->ends[e], d = g->degree[u];
            if (g->place[u] <= i || d <= g->degree[v]) continue; /* removed, or next anyway */
            const uint32_t to = g->bucket[d]++, w = g->order[to], from = g->place[u];
            g->order[from] = w;
            g->place[w] = from;
            g->order[to] = u;
            g->place[u] = to;
            g->degree[u] = d - 1;
        }
    }
    return TXM_OK;
}

/* Colour in the reverse order; taken[c] = v + 1: a neighbour of v has colour c. */
static int tmc_color_back(const tmc_graph *g, uint32_t *taken, int *colors) {
    int most = 0;
    for (size_t i = g->count; i-- > 0;) {
        const uint32_t v = g->order[i];
        for (uint32_t e = g->first[v]; e < g->first[v + 1]; e++) {
            if (g->place[g->ends[e]] > i) taken[colors[g->ends[e]]] = v + 1;
        }
        int c = 0;
        while (taken[c] == v + 1) c++;
        colors[v] = c;
        if (c + 1 > most) most = c + 1;
    }
    return most;
}

TRIMESH_COVER_API txm_status trimesh_proper_colors(const txm_mesh *mesh, txm_env *env, int *colors,
                                             int *count) {
    tmc_graph g;
    txm_arena arena;
    memset(&g, 0, sizeof g);
    txm_status status = txm_mesh_check(mesh, "mesh", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    const size_t n = mesh->vertex_count;
    if (n && !colors) return txm_fail(env, TXM_BAD_ARGUMENT, "colors is NULL");
    if (mesh->face_count == 0) {
        for (size_t v = 0; v < n; v++) colors[v] = 0;
        if (count) *count = n > 0;
        return TXM_OK;
    }
    if (tmc_report(env, 0, "edges") != TXM_OK) return TXM_CANCELLED;
    txm_arena_init(&arena, env);
    uint32_t *taken = (uint32_t *)txm_arena_zero(&arena, n + 1, sizeof(uint32_t));
    status = tmc_check_memory(&arena, env);
    if (status == TXM_OK) status = tmc_graph_build(&g, mesh, &arena, env);
    if (status == TXM_OK) status = tmc_smallest_first(&g, &arena, env);
    if (status == TXM_OK) status = tmc_report(env, 0.7, "colors");
    if (status == TXM_OK) {
        const int most = tmc_color_back(&g, taken, colors);
        if (count) *count = most;
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TRIMESH_COVER_TEXTURE_H */
