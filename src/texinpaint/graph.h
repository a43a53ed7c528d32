#ifndef TEXINPAINT_GRAPH_H
#define TEXINPAINT_GRAPH_H

#include "layout.h"

/* ---- graph of texels -------------------------------------------------------------------------
   The unknown texels of a map as nodes of a graph, with links to their neighbours on the surface,
   across the seams of the atlas too. Weights are such that

       sum over links  w (u_i - u_j)^2   approximates   integral over the surface of |grad u|^2

   so that its minimum is harmonic on the surface, however the atlas is stretched or sheared. With
   the metric G of a face (per texel) the integral over a texel is  grad u . D grad u,
   D = sqrt(det G) G^-1; D is written as a sum of  w_e e e^T  with weights w_e >= 0 and three whole
   offsets e, which are the links (Selling's reduction; for squares: right and down, both of weight
   1). No weight is negative, so that u never leaves the range of its boundary values.

   An offset that leaves the face of a texel is walked along the surface. Where the walk crosses
   a seam it ends between texels of another chart; the link is then shared out to the four
   around, bilinearly, so that functions that are linear on the surface pass seams unchanged. */

enum {
    TXI_WALK_MOST = 64,    /* faces that one walk may cross; ours                               */
    TXI_STENCIL = 3,       /* offsets                                                           */
    TXI_MERGE_MOST = 256,  /* links of a row that are merged; ours: the time is quadratic       */
    TXI_LINKS_MOST = 24    /* links made by one node: 3 offsets, to and fro, 4 texels each      */
};
#define TXI_SHEAR 64.0   /* ratio of the eigenvalues of D at most: offsets stay below 9 texels */

/* Nodes are unknown texels in the order of the picture. Links to other nodes lie in `to`, each
   in the rows of both its nodes; those to known texels in `rim`. */
typedef struct txi_texel_graph {
    size_t count;
    uint32_t *texel;       /* 1 per node                                                        */
    uint32_t *first, *to;  /* links of node i: to[first[i]] .. to[first[i + 1] - 1], nodes      */
    float *weight;         /* 1 per link                                                        */
    uint32_t *rim_first, *rim; /* the same for known neighbours, which are texels               */
    float *rim_weight;
} txi_texel_graph;

/* The links of a texel: offsets e and weights w_e. */
typedef struct txi_stencil {
    int x[TXI_STENCIL], y[TXI_STENCIL];
    double weight[TXI_STENCIL];
} txi_stencil;

/* D = (a b; b c), positive definite, as a sum of w e e^T. Starting with the superbase (1, 0),
   (0, 1), (-1, -1), two vectors u, v of it with u . D v > 0 are replaced by -u, v, and u - v,
   until no two are left; then  D = sum over pairs of  -(u . D v) (third vector, turned by 90
   degrees) (...)^T. */
static txi_stencil txi_stencil_of(double a, double b, double c) {
    txi_stencil s = {{1, 0, -1}, {0, 1, -1}, {0, 0, 0}};
    for (int round = 0, k = 0; round < 64 && k < 3; round++) {
        for (k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const double dot = a * s.x[i] * s.x[j] + c * s.y[i] * s.y[j] +
                               b * (s.x[i] * s.y[j] + s.y[i] * s.x[j]);
            s.weight[k] = -dot;
            if (dot > 1e-12 * (a + c)) {
                s.x[k] = s.x[i] - s.x[j];
                s.y[k] = s.y[i] - s.y[j];
                s.x[i] = -s.x[i];
                s.y[i] = -s.y[i];
                break;
            }
        }
    }
    for (int k = 0; k < 3; k++) {
        const int x = s.x[k];
        s.x[k] = -s.y[k];
        s.y[k] = x;
        if (s.weight[k] < 0) s.weight[k] = 0;
    }
    return s;
}

/* The derivatives of the place on a face by u and v, per texel. 0: it has no area in the atlas. */
static int txi_face_axes(const txi_surface *s, uint32_t face, txm_dvec3 *pu, txm_dvec3 *pv) {
    const txm_vec2 *t = s->uv + 3 * (size_t)face;
    const double area = txi_cross2(t[0], t[1], t[2]);
    const txm_dvec3 p = txi_corner_point(s, 3 * face);
    const txm_dvec3 q = txm_d3_sub(txi_corner_point(s, 3 * face + 1), p);
    const txm_dvec3 r = txm_d3_sub(txi_corner_point(s, 3 * face + 2), p);
    if (!(fabs(area) > 1e-9)) return 0;
    *pu = txm_d3_scale(txm_d3_sub(txm_d3_scale(q, (double)t[2].y - t[0].y),
                                  txm_d3_scale(r, (double)t[1].y - t[0].y)), 1 / area);
    *pv = txm_d3_scale(txm_d3_sub(txm_d3_scale(r, (double)t[1].x - t[0].x),
                                  txm_d3_scale(q, (double)t[2].x - t[0].x)), 1 / area);
    return 1;
}

/* The links of the texels of a face; of a picture: its four neighbours. */
static txi_stencil txi_face_stencil(const txi_domain *d, uint32_t face) {
    txm_dvec3 pu, pv;
    if (!d->surface || !txi_face_axes(d->surface, face, &pu, &pv)) return txi_stencil_of(1, 0, 1);
    const double e = txm_d3_len2(pu), f = txm_d3_dot(pu, pv), g = txm_d3_len2(pv);
    const double det = e * g - f * f;
    if (!(e + g > 0)) return txi_stencil_of(1, 0, 1);
    /* ratio of the eigenvalues about (e + g)^2 / det: what is more is taken off the larger one */
    const double least = (e + g) * (e + g) / TXI_SHEAR;
    const double more = det < least ? (e + g) / TXI_SHEAR : 0;
    const double root = sqrt((e + more) * (g + more) - f * f);
    return txi_stencil_of((g + more) / root, -f / root, (e + more) / root);
}

/* ---- graph: walks ------------------------------------------------------------------------- */

/* The face on the other side of a side, and a place on the side, s of the way along it, and a
   step in the plane of the first face turned into the plane of the second: place and step in
   texels of that face. Sewn sides change neither. 0: the second face has no area. */
static int txi_cross_side(const txi_surface *s, uint32_t side, double along, double place[2],
                          double step[2]) {
    const uint32_t other = s->opposite[side], next = txi_next_corner(other);
    const txm_vec2 from = s->uv[next], to = s->uv[other]; /* the side as the first face runs
                                                             along it                            */
    txm_dvec3 pu, pv, qu, qv;
    if (txi_is_sewn(s, side, other)) return 1;
    if (!txi_face_axes(s, side / 3, &pu, &pv) || !txi_face_axes(s, other / 3, &qu, &qv)) return 0;
    const txm_dvec3 edge = txm_d3_unit(
        txm_d3_sub(txi_corner_point(s, txi_next_corner(side)), txi_corner_point(s, side)));
    const txm_dvec3 out = txm_d3_unit(txm_d3_cross(edge, txi_face_area2(s, side / 3)));
    const txm_dvec3 in = txm_d3_unit(txm_d3_cross(edge, txi_face_area2(s, other / 3)));
    const txm_dvec3 move = txm_d3_add(txm_d3_scale(pu, step[0]), txm_d3_scale(pv, step[1]));
    const txm_dvec3 turned = txm_d3_add(txm_d3_scale(edge, txm_d3_dot(move, edge)),
                                        txm_d3_scale(in, txm_d3_dot(move, out)));
    /* turned = x qu + y qv */
    const double e = txm_d3_len2(qu), f = txm_d3_dot(qu, qv), g = txm_d3_len2(qv);
    const double det = e * g - f * f, u = txm_d3_dot(turned, qu), v = txm_d3_dot(turned, qv);
    if (!(det > 1e-12 * e * g)) return 0;
    step[0] = (g * u - f * v) / det;
    step[1] = (e * v - f * u) / det;
    place[0] = from.x + ((double)to.x - from.x) * along;
    place[1] = from.y + ((double)to.y - from.y) * along;
    return 1;
}

/* Walk on the surface: from a place on a face, in its own texels, by a step. face and place receive
   where it ends. 0: at a border of the surface, or where a face has no area. */
static int txi_walk_surface(const txi_surface *s, uint32_t *face, double place[2],
                            const double by[2]) {
    double step[2] = {by[0], by[1]};
    uint32_t entry = TXM_NO_SIDE;
    for (int count = 0; count < TXI_WALK_MOST; count++) {
        const txm_vec2 *t = s->uv + 3 * (size_t)*face;
        double here[3], there[3], first = 1;
        int exit = -1;
        if (!txi_weights(t, place[0], place[1], here)) return 0;
        if (!txi_weights(t, place[0] + step[0], place[1] + step[1], there)) return 0;
        for (int k = 0; k < 3; k++) { /* side k is where the weight of corner k + 2 is 0 */
            const int c = (k + 2) % 3;
            if (3 * *face + (uint32_t)k == entry || there[c] >= -1e-9 || !(here[c] > there[c]))
                continue;
            const double at = here[c] > 0 ? here[c] / (here[c] - there[c]) : 0;
            if (exit >= 0 && at >= first) continue;
            first = at;
            exit = k;
        }
        if (exit < 0) {
            place[0] += step[0];
            place[1] += step[1];
            return 1;
        }
        const uint32_t side = 3 * *face + (uint32_t)exit;
        if (s->opposite[side] == TXM_NO_SIDE) return 0;
        const txm_vec2 a = t[exit], b = t[(exit + 1) % 3];
        const double dx = (double)b.x - a.x, dy = (double)b.y - a.y;
        place[0] += step[0] * first;
        place[1] += step[1] * first;
        const double along = ((place[0] - a.x) * dx + (place[1] - a.y) * dy) / (dx * dx + dy * dy);
        for (int k = 0; k < 2; k++) step[k] *= 1 - first;
        if (!txi_cross_side(s, side, fmin(fmax(along, 0), 1), place, step)) return 0;
        entry = s->opposite[side];
        *face = entry / 3;
    }
    return 0;
}

/* Where the texel lies on its face, in the texels of that. */
static void txi_texel_place(const txi_domain *d, uint32_t face, uint32_t texel, double place[2]) {
    const txm_vec2 *t = d->surface->uv + 3 * (size_t)face;
    double w[3];
    txi_texel_weights(d, face, texel, w);
    place[0] = w[0] * t[0].x + w[1] * t[1].x + w[2] * t[2].x;
    place[1] = w[0] * t[0].y + w[1] * t[1].y + w[2] * t[2].y;
}

/* ---- graph: links ------------------------------------------------------------------------- */

/* the links that one node makes */
typedef struct txi_links {
    uint32_t texel[TXI_LINKS_MOST];
    double weight[TXI_LINKS_MOST];
    int count;
} txi_links;

static void txi_links_add(txi_links *links, int64_t texel, double weight) {
    if (texel < 0 || !(weight > 0)) return;
    TXM_ASSERT(links->count < TXI_LINKS_MOST);
    links->texel[links->count] = (uint32_t)texel;
    links->weight[links->count++] = weight;
}

/* A link to a place between texels: to the four around it that exist, bilinearly, else to the
   nearest. */
static void txi_links_share(const txi_domain *d, uint32_t face, const double place[2],
                            double weight, txi_links *links) {
    const double fx = floor(place[0]), fy = floor(place[1]);
    double share[4], sum = 0;
    int64_t texel[4];
    for (int k = 0; k < 4; k++) {
        const double u = place[0] - fx, v = place[1] - fy;
        texel[k] = txi_tap(d, face, (int)fx + k % 2, (int)fy + k / 2);
        share[k] = (k % 2 ? u : 1 - u) * (k / 2 ? v : 1 - v);
        if (texel[k] >= 0 && share[k] > 0.01) sum += share[k];
    }
    if (sum > 0.05) {
        for (int k = 0; k < 4; k++) {
            if (share[k] > 0.01) txi_links_add(links, texel[k], weight * share[k] / sum);
        }
        return;
    }
    const txm_vec2 p = txm_v2(txm_float(place[0]), txm_float(place[1]));
    txi_links_add(links, txi_nearest_tap(d, face, p, 0), weight);
}

/* The link of a texel by an offset. */
static void txi_links_step(const txi_domain *d, uint32_t texel, uint32_t face, int x, int y,
                           double weight, txi_links *links) {
    const int tx = (int)(texel % (uint32_t)d->width) + x,
              ty = (int)(texel / (uint32_t)d->width) + y;
    if (!d->surface) {
        txi_links_add(links, txi_tap(d, face, tx, ty), weight);
        return;
    }
    const size_t direct = (size_t)txi_wrap(ty, d->height) * (size_t)d->width +
                          (size_t)txi_wrap(tx, d->width);
    if (d->surface->owner[direct] == face) {
        txi_links_add(links, (int64_t)direct, weight);
        return;
    }
    double place[2];
    const double by[2] = {(double)x, (double)y};
    txi_texel_place(d, face, texel, place);
    if (!txi_walk_surface(d->surface, &face, place, by)) return;
    const double rx = floor(place[0] + 0.5), ry = floor(place[1] + 0.5);
    if (fabs(place[0] - rx) < 1e-3 && fabs(place[1] - ry) < 1e-3) { /* within a chart: at a texel */
        const int64_t t = txi_tap(d, face, (int)rx, (int)ry);
        txi_links_add(links, t, weight);
        if (t >= 0) return;
    }
    txi_links_share(d, face, place, weight, links);
}

/* All links that a texel makes; `weight` counts half for each of two unknown texels, as both
   make the link between them, but in full where the other is known. */
static void txi_links_of(const txi_domain *d, uint32_t texel, txi_links *links) {
    const uint32_t face = d->surface ? d->surface->owner[texel] : TXI_NO_FACE;
    const txi_stencil s = txi_face_stencil(d, face);
    links->count = 0;
    for (int k = 0; k < 2 * TXI_STENCIL; k++) {
        const int sign = k % 2 ? -1 : 1;
        if (s.weight[k / 2] > 1e-6)
            txi_links_step(d, texel, face, sign * s.x[k / 2], sign * s.y[k / 2], s.weight[k / 2],
                           links);
    }
}

/* Merge the links of one row that go to the same node: sorted by node. Returns their number.
   Rows of very many links (where texels differ much in size) are left as they are. */
static uint32_t txi_merge_links(uint32_t *to, float *weight, uint32_t count) {
    uint32_t kept = 0;
    if (count > TXI_MERGE_MOST) return count;
    for (uint32_t i = 1; i < count; i++) {
        const uint32_t t = to[i];
        const float w = weight[i];
        uint32_t k = i;
        for (; k > 0 && to[k - 1] > t; k--) {
            to[k] = to[k - 1];
            weight[k] = weight[k - 1];
        }
        to[k] = t;
        weight[k] = w;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (kept && to[kept - 1] == to[i]) {
            weight[kept - 1] += weight[i];
        } else {
            to[kept] = to[i];
            weight[kept++] = weight[i];
        }
    }
    return kept;
}

/* What a texel is to a graph. */
enum { TXI_NODE_NONE = 0, TXI_NODE_KNOWN = 1, TXI_NODE_UNKNOWN = 2 };

/* Count the links of all nodes, or (filling) store them. node: 1 per texel, the node of unknown
   ones. */
static void txi_graph_pass(const txi_domain *d, const uint8_t *marks, const uint32_t *node,
                           int filling, txi_texel_graph *g, size_t total[2]) {
    total[0] = total[1] = 0;
    for (size_t i = 0; i < g->count; i++) {
        txi_links links;
        txi_links_of(d, g->texel[i], &links);
        for (int k = 0; k < links.count; k++) {
            const uint32_t texel = links.texel[k];
            if (marks[texel] == TXI_NODE_NONE || texel == g->texel[i]) continue;
            if (marks[texel] == TXI_NODE_KNOWN) {
                total[1]++;
                if (!filling) {
                    g->rim_first[i + 1]++;
                    continue;
                }
                const uint32_t at = --g->rim_first[i + 1];
                g->rim[at] = texel;
                g->rim_weight[at] = txm_float(links.weight[k]);
                continue;
            }
            for (int end = 0; end < 2; end++) {
                const size_t row = end ? node[texel] : i;
                total[0]++;
                if (!filling) {
                    g->first[row + 1]++;
                    continue;
                }
                const uint32_t at = --g->first[row + 1];
                g->to[at] = end ? (uint32_t)i : node[texel];
                g->weight[at] = txm_float(links.weight[k] / 2);
            }
        }
    }
}

/* From ends of rows, as a filling pass leaves them, to merged rows. */
static void txi_graph_merge(size_t count, uint32_t total, uint32_t *first, uint32_t *to,
                            float *weight) {
    uint32_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        const uint32_t begin = first[i + 1], end = i + 1 < count ? first[i + 2] : total;
        memmove(to + kept, to + begin, (end - begin) * sizeof *to);
        memmove(weight + kept, weight + begin, (end - begin) * sizeof *weight);
        first[i] = kept;
        kept += txi_merge_links(to + kept, weight + kept, end - begin);
    }
    first[count] = kept;
}

/* The graph of the unknown texels.
   marks   1 per texel: TXI_NODE_...
   return  TXM_OK, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY, TXM_CANCELLED
   cost    about 0.3 us and 100 bytes per unknown texel, 4 bytes per texel                  */
static txm_status txi_graph_make(const txi_domain *d, const uint8_t *marks, txm_arena *arena,
                                 txm_env *env, txi_texel_graph *g) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    size_t total[2], count = 0;
    memset(g, 0, sizeof *g);
    for (size_t i = 0; i < texels; i++) g->count += marks[i] == TXI_NODE_UNKNOWN;
    g->texel = (uint32_t *)txm_arena_alloc(arena, g->count + 1, sizeof(uint32_t));
    g->first = (uint32_t *)txm_arena_zero(arena, g->count + 1, sizeof(uint32_t));
    g->rim_first = (uint32_t *)txm_arena_zero(arena, g->count + 1, sizeof(uint32_t));
    uint32_t *node = (uint32_t *)txm_arena_alloc(arena, texels, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < texels; i++) {
        node[i] = (uint32_t)count;
        if (marks[i] != TXI_NODE_UNKNOWN) continue;
        TXM_ASSERT(count < g->count);
        g->texel[count++] = (uint32_t)i;
    }
    txi_graph_pass(d, marks, node, 0, g, total);
    if (total[0] > UINT32_MAX || total[1] > UINT32_MAX)
        return txm_fail(env, TXM_TOO_LARGE, "too many missing texels for one system of equations");
    if (txm_progress(env, 0, "smooth fill")) return txi_stopped(env);
    for (size_t i = 0; i < g->count; i++) {
        g->first[i + 1] += g->first[i];
        g->rim_first[i + 1] += g->rim_first[i];
    }
    g->to = (uint32_t *)txm_arena_alloc(arena, total[0] + 1, sizeof(uint32_t));
    g->weight = (float *)txm_arena_alloc(arena, total[0] + 1, sizeof(float));
    g->rim = (uint32_t *)txm_arena_alloc(arena, total[1] + 1, sizeof(uint32_t));
    g->rim_weight = (float *)txm_arena_alloc(arena, total[1] + 1, sizeof(float));
    if (arena->failed) return txi_no_memory(env);
    txi_graph_pass(d, marks, node, 1, g, total);
    txi_graph_merge(g->count, (uint32_t)total[0], g->first, g->to, g->weight);
    txi_graph_merge(g->count, (uint32_t)total[1], g->rim_first, g->rim, g->rim_weight);
    return TXM_OK;
}

/* Set the marks of all nodes that links connect with the one given to 0. queue: room for 1 per
   node. */
static void txi_graph_spread(const txi_texel_graph *g, uint32_t from, uint32_t *queue,
                             uint8_t *mark) {
    size_t count = 1;
    queue[0] = from;
    mark[from] = 0;
    for (size_t k = 0; k < count; k++) {
        for (uint32_t l = g->first[queue[k]]; l < g->first[queue[k] + 1]; l++) {
            if (!mark[g->to[l]]) continue;
            mark[g->to[l]] = 0;
            TXM_ASSERT(count < g->count);
            queue[count++] = g->to[l];
        }
    }
}

/* Mark the nodes that no links connect with a known texel: 1 in `island`. queue: room for 1 per
   node. */
static void txi_graph_islands(const txi_texel_graph *g, uint32_t *queue, uint8_t *island) {
    memset(island, 1, g->count);
    for (size_t i = 0; i < g->count; i++) {
        if (island[i] && g->rim_first[i] < g->rim_first[i + 1])
            txi_graph_spread(g, (uint32_t)i, queue, island);
    }
}

#endif /* TEXINPAINT_GRAPH_H */
