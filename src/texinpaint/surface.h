#ifndef TEXINPAINT_SURFACE_H
#define TEXINPAINT_SURFACE_H

#include "check.h"

/* ---- surface: a mesh across the seams of its atlas ------------------------------------------- */

#define TXI_NO_FACE 0xffffffffu

enum {
    TXI_REPEATS = 64, /* ours: pictures that a face may cover in u or v; others cover no texel    */
    TXI_TILE = 8,     /* ours: texels of a side                                                   */
    TXI_FINS = 16     /* ours: sides of an edge that are compared with one another, at most       */
};

/* The mesh as a surface. Faces that name a vertex twice are linked with nothing; the faces to both
   sides of such a one are linked with each other. */
struct txi_surface {
    size_t face_count, vertex_count; /* vertices: welded, those at equal positions are one      */
    txm_dvec3 *point;    /* 1 per vertex                                                       */
    uint32_t *vertex;    /* 3 per face: its vertices                                           */
    uint32_t *opposite;  /* 3 per face: the side beyond side k, which runs from corner k to the
                            next; TXM_NO_SIDE at borders                                         */
    txm_vec2 *uv;        /* 3 per face: its corners in texels, texel centres are whole numbers; not
                            wrapped                                                            */
    uint32_t *chart;     /* 1 per face: faces that are connected in the atlas, or that overlap
                            there, have the same number                                        */
    uint32_t *owner;     /* 1 per texel: the first face that covers its centre, or TXI_NO_FACE  */
    uint32_t *first, *corners; /* the corners of vertex v: corners[first[v]] .. [first[v + 1] -
                                  1]                                                             */
    uint32_t *hole_first, *hole; /* the texels of face f that were missing, in the same form     */
    uint32_t *tile;      /* 1 per TXI_TILE x TXI_TILE texels: the chart, if they all have the
                            same, or TXI_NO_FACE                                                 */
    size_t tile_stride;  /* tiles in a row                                                     */
    size_t cursor;       /* no texel before this one is missing and covered                    */
};

static uint32_t txi_next_corner(uint32_t c) {
    return c % 3 == 2 ? c - 2 : c + 1;
}

/* Does the face name a vertex twice? */
static int txi_is_flat_face(const txi_surface *s, uint32_t face) {
    const uint32_t *v = s->vertex + 3 * (size_t)face;
    return v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
}

static txm_dvec3 txi_corner_point(const txi_surface *s, uint32_t corner) {
    return s->point[s->vertex[corner]];
}

/* twice the area of a face times its unit normal */
static txm_dvec3 txi_face_area2(const txi_surface *s, uint32_t face) {
    return txm_d3_area2(txi_corner_point(s, 3 * face), txi_corner_point(s, 3 * face + 1),
                        txi_corner_point(s, 3 * face + 2));
}

/* twice the signed area of a b c in the plane */
static double txi_cross2(txm_vec2 a, txm_vec2 b, txm_vec2 c) {
    return ((double)b.x - a.x) * ((double)c.y - a.y) - ((double)c.x - a.x) * ((double)b.y - a.y);
}

/* The three weights of p in the triangle t. 0: it has no area. */
static int txi_weights(const txm_vec2 t[3], double x, double y, double weight[3]) {
    const double area = txi_cross2(t[0], t[1], t[2]);
    if (!(fabs(area) > 1e-12)) return 0;
    weight[1] = ((x - t[0].x) * ((double)t[2].y - t[0].y) -
                 ((double)t[2].x - t[0].x) * (y - t[0].y)) / area;
    weight[2] = (((double)t[1].x - t[0].x) * (y - t[0].y) -
                 (x - t[0].x) * ((double)t[1].y - t[0].y)) / area;
    weight[0] = 1 - weight[1] - weight[2];
    return 1;
}

/* ---- surface: vertices and sides ------------------------------------------------------------- */

/* The bits of x, for -0 those of 0, so that equal numbers have equal bits. */
static uint32_t txi_float_bits(float x) {
    uint32_t bits;
    const float plain = x + 0.0f;
    memcpy(&bits, &plain, sizeof bits);
    return bits == 0x80000000u ? 0 : bits;
}

/* Give vertices at equal positions one number, in the order in which they come first. weld receives
   one number for each vertex of the mesh. */
static txm_status txi_weld(const txm_mesh *mesh, txi_surface *s, uint32_t *weld, txm_arena *arena,
                           txm_env *env) {
    size_t slots = 16;
    txm_arena scratch;
    while (slots < 2 * mesh->vertex_count) slots *= 2;
    txm_arena_init(&scratch, env);
    uint32_t *table = (uint32_t *)txm_arena_alloc(&scratch, slots, sizeof(uint32_t));
    s->point = (txm_dvec3 *)txm_arena_alloc(arena, mesh->vertex_count, sizeof(txm_dvec3));
    if (!table || !s->point) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    memset(table, 0xff, slots * sizeof *table);
    s->vertex_count = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const float *p = mesh->positions + 3 * v;
        const uint64_t xy = (uint64_t)txi_float_bits(p[0]) << 32 | txi_float_bits(p[1]);
        size_t slot = (size_t)txm_hash(txm_hash(xy) + txi_float_bits(p[2])) & (slots - 1);
        for (; table[slot] != UINT32_MAX; slot = (slot + 1) & (slots - 1)) {
            const txm_dvec3 q = s->point[table[slot]];
            if (!(q.x < p[0] || q.x > p[0] || q.y < p[1] || q.y > p[1] || q.z < p[2] || q.z > p[2]))
                break;
        }
        if (table[slot] == UINT32_MAX) {
            table[slot] = (uint32_t)s->vertex_count;
            TXM_ASSERT(s->vertex_count < mesh->vertex_count);
            s->point[s->vertex_count++] = txm_d3_load(p);
        }
        weld[v] = table[slot];
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

/* Do two sides that run against one another also lie together in the atlas? */
static int txi_is_sewn(const txi_surface *s, uint32_t a, uint32_t b) {
    const txm_vec2 p = s->uv[a], q = s->uv[txi_next_corner(a)];
    const txm_vec2 r = s->uv[txi_next_corner(b)], t = s->uv[b];
    return fabs((double)p.x - r.x) + fabs((double)p.y - r.y) + fabs((double)q.x - t.x) +
               fabs((double)q.y - t.y) < 1e-2;
}

/* Link those of the sides of an edge that have no opposite yet: two that run against one
   another, or where there are more, pairs that also lie together in the atlas. */
static void txi_link_edge(txi_surface *s, const uint32_t *indices, const uint32_t *sides,
                          size_t count) {
    uint32_t open[TXI_FINS];
    int n = 0;
    for (size_t i = 0; i < count; i++) {
        const uint32_t side = sides[i];
        if (s->opposite[side] != TXM_NO_SIDE || txi_is_flat_face(s, side / 3)) continue;
        if (n == TXI_FINS) return;
        open[n++] = side;
    }
    for (int i = 0; i < n; i++) {
        for (int j = i + 1; j < n && s->opposite[open[i]] == TXM_NO_SIDE; j++) {
            if (indices[open[i]] == indices[open[j]] || s->opposite[open[j]] != TXM_NO_SIDE)
                continue;
            if (n > 2 && !txi_is_sewn(s, open[i], open[j])) continue;
            s->opposite[open[i]] = open[j];
            s->opposite[open[j]] = open[i];
        }
    }
}

/* Fill opposite: first by the vertices that the mesh names, then by those at equal positions, as
   files are often cut along seams. Sides of neighbours that run the same way stay unlinked. */
static txm_status txi_link_sides(const txm_mesh *mesh, txi_surface *s, txm_env *env) {
    const size_t sides = 3 * s->face_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    uint32_t *sorted = (uint32_t *)txm_arena_alloc(&scratch, sides, 2 * sizeof(uint32_t));
    if (!sorted) return txi_no_memory(env);
    for (size_t i = 0; i < sides; i++) s->opposite[i] = TXM_NO_SIDE;
    for (int pass = 0; pass < 2; pass++) {
        txm_mesh part = *mesh;
        if (pass) {
            part.indices = s->vertex;
            part.vertex_count = s->vertex_count;
        }
        txm_mesh_sort_sides(&part, sorted);
        for (size_t i = 0, end; i < sides; i = end) {
            end = txm_mesh_edge_end(&part, sorted, i);
            txi_link_edge(s, part.indices, sorted + i, end - i);
        }
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

/* ---- surface: texels ------------------------------------------------------------------------- */

/* The corners of all faces in texels. Those that lie repeats away from the picture are moved,
   face by face, near to it, where numbers are exact. */
static void txi_load_uv(const txi_domain *d, txi_surface *s) {
    const texinpaint_desc *desc = d->desc;
    for (size_t f = 0; f < s->face_count; f++) {
        double u[3], v[3], du = 0, dv = 0;
        for (size_t k = 0; k < 3; k++) {
            const size_t c = 3 * f + k;
            const size_t entry = desc->uv_indices ? desc->uv_indices[c] : desc->mesh.indices[c];
            u[k] = desc->uv[2 * entry];
            v[k] = desc->uv[2 * entry + 1];
        }
        if (fabs(u[0]) > (double)TXI_REPEATS) du = floor(u[0]);
        if (fabs(v[0]) > (double)TXI_REPEATS) dv = floor(v[0]);
        for (size_t k = 0; k < 3; k++)
            s->uv[3 * f + k] = txm_v2(txm_float((u[k] - du) * d->width - 0.5),
                                      txm_float((v[k] - dv) * d->height - 0.5));
    }
}

static int txi_wrap(int i, int n) {
    const int r = i % n;
    return r < 0 ? r + n : r;
}

/* The texel at the middle of a face: the only one that can be said to be its own where faces are
   smaller than texels. */
static size_t txi_face_texel(const txi_domain *d, const txi_surface *s, size_t face) {
    const txm_vec2 *t = s->uv + 3 * face;
    const double x = ((double)t[0].x + t[1].x + t[2].x) / 3,
                 y = ((double)t[0].y + t[1].y + t[2].y) / 3;
    const int px = txi_wrap((int)floor(x + 0.5), d->width),
              py = txi_wrap((int)floor(y + 0.5), d->height);
    return (size_t)py * (size_t)d->width + (size_t)px;
}

/* A face meets a texel: it owns it if none before it does; else, if both lie well over the
   texel, their charts overlap. */
static void txi_own(txi_surface *s, uint32_t *charts, uint32_t face, size_t texel, int x, int y,
                    int width, int height) {
    const uint32_t owner = s->owner[texel];
    double mine[3], theirs[3];
    if (owner == TXI_NO_FACE) {
        s->owner[texel] = face;
        return;
    }
    if (txi_root(charts, owner) == txi_root(charts, face)) return;
    if (!txi_weights(s->uv + 3 * (size_t)face, x, y, mine)) return;
    /* where the owner has this texel: shifted by whole pictures */
    const txm_vec2 *t = s->uv + 3 * (size_t)owner;
    const double cx = ((double)t[0].x + t[1].x + t[2].x) / 3,
                 cy = ((double)t[0].y + t[1].y + t[2].y) / 3;
    const double sx = floor((cx - x) / width + 0.5) * width,
                 sy = floor((cy - y) / height + 0.5) * height;
    if (!txi_weights(t, x + sx, y + sy, theirs)) return;
    for (int k = 0; k < 3; k++) {
        if (mine[k] < 0.02 || theirs[k] < 0.02) return;
    }
    txi_join_sets(charts, owner, face);
}

/* Give a face the texels whose centres it covers, its border included, row by row. */
static void txi_cover_face(const txi_domain *d, txi_surface *s, uint32_t *charts, uint32_t face) {
    const txm_vec2 *t = s->uv + 3 * (size_t)face;
    const double area = txi_cross2(t[0], t[1], t[2]), turn = area < 0 ? -1 : 1;
    double left = t[0].x, right = left, top = t[0].y, bottom = top;
    for (int k = 1; k < 3; k++) {
        left = fmin(left, t[k].x);
        right = fmax(right, t[k].x);
        top = fmin(top, t[k].y);
        bottom = fmax(bottom, t[k].y);
    }
    if (!(fabs(area) > 1e-9) || right - left > (double)TXI_REPEATS * d->width ||
        bottom - top > (double)TXI_REPEATS * d->height)
        return;
    for (int y = (int)ceil(top - 1e-6); y <= (int)floor(bottom + 1e-6); y++) {
        double from = left, to = right;
        for (int k = 0; k < 3; k++) { /* a x + b >= 0 inside of side k */
            const txm_vec2 p = t[k], q = t[(k + 1) % 3];
            const double a = turn * ((double)p.y - q.y);
            const double b = turn * (((double)q.x - p.x) * (y - (double)p.y) -
                                     (double)p.x * ((double)p.y - q.y)) + 1e-6 * fabs(area);
            if (a > 0) from = fmax(from, -b / a);
            else if (a < 0) to = fmin(to, -b / a);
            else if (b < 0) to = from - 2;
        }
        const size_t row = (size_t)txi_wrap(y, d->height) * (size_t)d->width;
        const int begin = (int)ceil(from - 1e-6);
        int end = (int)floor(to + 1e-6) + 1;
        if (end - begin > d->width) end = begin + d->width;
        for (int x = begin; x < end; x++)
            txi_own(s, charts, face, row + (size_t)txi_wrap(x, d->width), x, y, d->width,
                    d->height);
    }
}

/* Fill owner, chart and d->covered. */
static void txi_cover(txi_domain *d, txi_surface *s) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    for (size_t i = 0; i < texels; i++) s->owner[i] = TXI_NO_FACE;
    for (uint32_t f = 0; f < s->face_count; f++) s->chart[f] = f;
    for (uint32_t side = 0; side < 3 * s->face_count; side++) {
        const uint32_t other = s->opposite[side];
        if (other < side && txi_is_sewn(s, side, other))
            txi_join_sets(s->chart, side / 3, other / 3);
    }
    for (uint32_t f = 0; f < s->face_count; f++) txi_cover_face(d, s, s->chart, f);
    for (uint32_t f = 0; f < s->face_count; f++) s->chart[f] = txi_root(s->chart, f);
    for (size_t i = 0; i < texels; i++) d->covered[i] = s->owner[i] != TXI_NO_FACE;
}

/* Which tiles lie in one chart. */
static void txi_fill_tiles(const txi_domain *d, txi_surface *s) {
    const size_t w = (size_t)d->width, h = (size_t)d->height;
    for (size_t y = 0; y < h; y++) {
        for (size_t x = 0; x < w; x++) {
            uint32_t *tile = &s->tile[y / TXI_TILE * s->tile_stride + x / TXI_TILE];
            const uint32_t owner = s->owner[y * w + x];
            const uint32_t chart = owner == TXI_NO_FACE ? TXI_NO_FACE : s->chart[owner];
            if (x % TXI_TILE == 0 && y % TXI_TILE == 0) *tile = chart;
            else if (*tile != chart) *tile = TXI_NO_FACE;
        }
    }
}

/* Lists by key: items receives the numbers i of all keys[i] below count, those of key k at
   first[k] .. first[k + 1] - 1. Only those with a mark, if there are marks. first: room for
   count + 1. */
static void txi_bin(const uint32_t *keys, size_t key_count, const uint8_t *marks, size_t count,
                    uint32_t *first, uint32_t *items) {
    memset(first, 0, (count + 1) * sizeof *first);
    for (size_t i = 0; i < key_count; i++) {
        if (keys[i] < count && (!marks || marks[i])) first[keys[i] + 1]++;
    }
    for (size_t k = 1; k <= count; k++) first[k] += first[k - 1];
    const uint32_t total = first[count];
    for (size_t i = key_count; i-- > 0;) { /* backwards, which leaves in first[k + 1] where k
                                              begins                                             */
        if (keys[i] < count && (!marks || marks[i])) items[--first[keys[i] + 1]] = (uint32_t)i;
    }
    for (size_t k = 0; k < count; k++) first[k] = first[k + 1];
    first[count] = total;
}

/* Make d->surface, if desc has a mesh, and d->covered. d->missing must be set. A picture is covered
   everywhere.
   cost    O(faces + texels), faces * log of the corners of a vertex; 80 bytes per face, 5 per
           texel */
static txm_status txi_surface_make(txi_domain *d, txm_arena *arena, txm_env *env) {
    const txm_mesh *mesh = &d->desc->mesh;
    const size_t texels = (size_t)d->width * (size_t)d->height, faces = mesh->face_count;
    size_t holes = 0;
    d->surface = NULL;
    d->covered = (uint8_t *)txm_arena_alloc(arena, texels, 1);
    if (!d->covered) return txi_no_memory(env);
    memset(d->covered, 1, texels);
    if (faces == 0) return TXM_OK;

    txi_surface *s = (txi_surface *)txm_arena_zero(arena, 1, sizeof *s);
    uint32_t *weld = (uint32_t *)txm_arena_alloc(arena, mesh->vertex_count, sizeof(uint32_t));
    if (!s || !weld) return txi_no_memory(env);
    s->face_count = faces;
    s->vertex = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    s->opposite = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    s->corners = (uint32_t *)txm_arena_alloc(arena, faces, 3 * sizeof(uint32_t));
    s->uv = (txm_vec2 *)txm_arena_alloc(arena, faces, 3 * sizeof(txm_vec2));
    s->chart = (uint32_t *)txm_arena_alloc(arena, faces, sizeof(uint32_t));
    s->owner = (uint32_t *)txm_arena_alloc(arena, texels, sizeof(uint32_t));
    s->tile_stride = (size_t)(d->width - 1) / TXI_TILE + 1;
    s->tile = (uint32_t *)txm_arena_alloc(
        arena, s->tile_stride * ((size_t)(d->height - 1) / TXI_TILE + 1), sizeof(uint32_t));
    s->hole_first = (uint32_t *)txm_arena_alloc(arena, faces + 1, sizeof(uint32_t));
    s->first = (uint32_t *)txm_arena_alloc(arena, mesh->vertex_count + 1, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);

    txm_status status = txi_weld(mesh, s, weld, arena, env);
    if (status != TXM_OK) return status;
    for (size_t c = 0; c < 3 * faces; c++) s->vertex[c] = weld[mesh->indices[c]];
    txi_load_uv(d, s);
    status = txi_link_sides(mesh, s, env);
    if (status != TXM_OK) return status;
    txi_cover(d, s);
    txi_fill_tiles(d, s);
    txi_bin(s->vertex, 3 * faces, NULL, s->vertex_count, s->first, s->corners);
    for (size_t i = 0; i < texels; i++) holes += d->missing[i] && d->covered[i];
    s->hole = (uint32_t *)txm_arena_alloc(arena, holes + 1, sizeof(uint32_t));
    if (!s->hole) return txi_no_memory(env);
    txi_bin(s->owner, texels, d->missing, faces, s->hole_first, s->hole);
    d->surface = s;
    return TXM_OK;
}

#endif /* TEXINPAINT_SURFACE_H */
