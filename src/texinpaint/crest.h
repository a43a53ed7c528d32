#ifndef TEXINPAINT_CREST_H
#define TEXINPAINT_CREST_H

#include "curvature.h"

/* ---- crest lines ----------------------------------------------------------------------------
   Ridges, where the larger curvature k_max has a maximum along its own direction [2, section 3]:

       e_max = 0,   de_max / dt_max < 0,   k_max > |k_min|

   and valleys, the ridges of the surface turned inside out. Both are traced through the triangles,
   from crossing to crossing of their edges.

   Not in [2]: lines are left out whose curvature hardly falls off to their sides, relative to
   its size (k'' / k^3 has no unit; across the tip of an ellipse of axes 1 and c it is 3
   (1 - c^2)). On a sphere, a cylinder or a torus, where k_max has no extremum, they are
   artefacts of the mesh. */

enum {
    TXI_CREST_PAIRED = 8,   /* links at a node that are paired; ours                           */
    TXI_CREST_ROUNDING = 8, /* how far rounded positions are assumed to move derivatives, in
                               units of 2^-24 coordinate / edge^3; ours                          */
    TXI_CREST_NONE = -1
};
#define TXI_CREST_STRENGTH 2.0  /* default threshold: a line twice as long as its radius of
                                   curvature; ours                                               */
#define TXI_CREST_SHARE 0.02    /* and this share of the strongest line; ours                   */

#define TXI_CREST_SHARP 0.3     /* least k'' / k^3, the mean along a line; ours: on spheres and
                                   tori of thousands of triangles it stays below 0.2, on the
                                   ridges of animals and figures above 0.55                      */
#define TXI_CREST_BESIDE 0.25   /* cosine between an edge and t below which it runs along a line;
                                   ours                                                          */

/* What counts at a vertex for ridges or for valleys. */
typedef struct txi_crest_value {
    double k, e; /* of the surface, or of the surface inside out                                */
    txm_dvec3 t;
    int is_candidate;
} txi_crest_value;

static txi_crest_value txi_crest_value_of(const txi_curvature *c, int is_valley) {
    txi_crest_value v;
    v.k = is_valley ? -c->k[1] : c->k[0];
    v.e = is_valley ? -c->e[1] : c->e[0];
    v.t = c->t[is_valley];
    v.is_candidate = c->is_valid && v.k > fabs(c->k[!is_valley]);
    return v;
}

/* The lines of one kind as a graph: nodes where they cross edges (and inside triangles where three
   meet), links between them. */
typedef struct txi_crest_net {
    txm_dvec3 *place; /* 1 per node                                                             */
    double *k;        /* 1 per node: the curvature                                              */
    double *sharp;    /* 1 per node: k'' / k^3                                                  */
    uint32_t *link;   /* 2 per link: its nodes                                                  */
    int64_t *mate;    /* 2 per link: the end of another link that continues the line here, as
                         2 * link + end, or TXI_CREST_NONE                                       */
    size_t node_count, link_count;
} txi_crest_net;

/* Where a line crosses an edge. */
typedef struct txi_crest_crossing {
    double at;       /* 0..1 from the first end                                                 */
    double k, sharp; /* curvature there, and k'' / k^3                                          */
} txi_crest_crossing;

/* Does a line cross the edge a b? The signs of t, and with it of e, are arbitrary: those of b
   are turned to agree with a. */
static int txi_crest_crosses(const txi_shape *s, size_t edge, int is_valley, double rounding,
                             txi_crest_crossing *crossing) {
    const uint32_t a = s->ends[2 * edge], b = s->ends[2 * edge + 1];
    const txi_crest_value p = txi_crest_value_of(&s->curvature[a], is_valley);
    const txi_crest_value q = txi_crest_value_of(&s->curvature[b], is_valley);
    if (!p.is_candidate || !q.is_candidate) return 0;
    const double turn = txm_d3_dot(p.t, q.t) < 0 ? -1 : 1, e = turn * q.e;
    if ((p.e < 0) == (e < 0)) return 0;
    const txm_dvec3 d = txm_d3_sub(txm_d3_load(s->mesh.positions + 3 * (size_t)b),
                                   txm_d3_load(s->mesh.positions + 3 * (size_t)a));
    const double length = txm_d3_len(d), jump = fabs(p.e) + fabs(e);
    const int is_rounding = !(jump * length * length * length > rounding);
    /* a maximum: from one of the two the curvature rises towards the other. Where a line runs
       along an edge that cannot be told, and the edges beside it decide */
    const double along = txm_d3_dot(p.t, d), back = -txm_d3_dot(q.t, d) * turn;
    const int is_beside = fmax(fabs(along), fabs(back)) < TXI_CREST_BESIDE * length;
    if (!is_rounding && !is_beside && !(p.e * along > 0) && !(e * back > 0)) return 0;
    crossing->at = jump > 0 ? fabs(p.e) / jump : 0.5;
    crossing->k = p.k + (q.k - p.k) * crossing->at;
    crossing->sharp = is_rounding ? 0 : jump / length / (crossing->k * crossing->k * crossing->k);
    return 1;
}

/* Find the crossings, node[edge] receives their nodes or UINT32_MAX, and count the links. */
static txm_status txi_crest_nodes(const txi_shape *s, int is_valley, txm_arena *arena,
                                  uint32_t *node, txi_crest_net *net, txm_env *env) {
    size_t crossings = 0, centres = 0;
    double rounding = 0;
    txi_crest_crossing crossing;
    for (size_t i = 0; i < 3 * s->mesh.face_count; i++) {
        const txm_dvec3 p = txm_mesh_point(&s->mesh, i);
        rounding = fmax(rounding, fmax(fabs(p.x), fmax(fabs(p.y), fabs(p.z))));
    }
    rounding *= (double)TXI_CREST_ROUNDING / 16777216.0;
    for (size_t i = 0; i < s->edge_count; i++) {
        const int crosses = txi_crest_crosses(s, i, is_valley, rounding, &crossing);
        node[i] = crosses ? (uint32_t)crossings++ : UINT32_MAX;
    }
    net->node_count = crossings;
    net->link_count = 0;
    for (size_t f = 0; f < s->mesh.face_count; f++) {
        int count = 0;
        for (int i = 0; i < 3; i++) count += node[s->edge[3 * f + (size_t)i]] != UINT32_MAX;
        net->link_count += count == 2 ? 1 : count == 3 ? 3 : 0;
        centres += count == 3;
    }
    net->node_count += centres;
    if (net->node_count == 0) return TXM_OK;
    net->place = (txm_dvec3 *)txm_arena_alloc(arena, net->node_count, sizeof(txm_dvec3));
    net->k = (double *)txm_arena_alloc(arena, net->node_count, sizeof(double));
    net->sharp = (double *)txm_arena_alloc(arena, net->node_count, sizeof(double));
    net->link = (uint32_t *)txm_arena_alloc(arena, net->link_count, 2 * sizeof(uint32_t));
    net->mate = (int64_t *)txm_arena_alloc(arena, net->link_count, 2 * sizeof(int64_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < s->edge_count; i++) {
        if (node[i] == UINT32_MAX) continue;
        txi_crest_crosses(s, i, is_valley, rounding, &crossing);
        const txm_dvec3 p = txm_d3_load(s->mesh.positions + 3 * (size_t)s->ends[2 * i]);
        const txm_dvec3 q = txm_d3_load(s->mesh.positions + 3 * (size_t)s->ends[2 * i + 1]);
        net->place[node[i]] = txm_d3_mad(p, txm_d3_sub(q, p), crossing.at);
        net->k[node[i]] = crossing.k;
        net->sharp[node[i]] = crossing.sharp;
    }
    return TXM_OK;
}

/* Link the crossings of each triangle: two with each other, three with a node in their middle. */
static void txi_crest_links(const txi_shape *s, const uint32_t *node, txi_crest_net *net) {
    size_t links = 0, centre = 0;
    for (size_t i = 0; i < s->edge_count; i++) centre += node[i] != UINT32_MAX;
    for (size_t f = 0; f < s->mesh.face_count; f++) {
        uint32_t n[3];
        int count = 0;
        for (size_t i = 0; i < 3; i++) {
            if (node[s->edge[3 * f + i]] != UINT32_MAX) n[count++] = node[s->edge[3 * f + i]];
        }
        if (count == 2) {
            TXM_ASSERT(links < net->link_count);
            net->link[2 * links] = n[0];
            net->link[2 * links++ + 1] = n[1];
        } else if (count == 3) {
            txm_dvec3 sum = txm_d3(0, 0, 0);
            TXM_ASSERT(centre < net->node_count && links + 3 <= net->link_count);
            net->k[centre] = net->sharp[centre] = 0;
            for (int i = 0; i < 3; i++) {
                sum = txm_d3_add(sum, net->place[n[i]]);
                net->k[centre] += net->k[n[i]] / 3;
                net->sharp[centre] += net->sharp[n[i]] / 3;
                net->link[2 * links] = n[i];
                net->link[2 * links++ + 1] = (uint32_t)centre;
            }
            net->place[centre++] = txm_d3_scale(sum, 1.0 / 3);
        }
    }
}

/* the direction of the line that leaves a node by this end of a link */
static txm_dvec3 txi_crest_direction(const txi_crest_net *net, int64_t end) {
    return txm_d3_unit(
        txm_d3_sub(net->place[net->link[end ^ 1]], net->place[net->link[end]]));
}

/* Pair the ends of links at one node: again and again those two that continue each other best. */
static void txi_crest_pair(txi_crest_net *net, int64_t *ends, int count) {
    for (; count > 1; count -= 2) {
        int a = 0, b = 1;
        double best = 2;
        for (int i = 0; i < count && count > 2; i++) {
            for (int j = i + 1; j < count; j++) {
                const double turn = txm_d3_dot(txi_crest_direction(net, ends[i]),
                                               txi_crest_direction(net, ends[j]));
                if (turn >= best) continue;
                best = turn;
                a = i;
                b = j;
            }
        }
        net->mate[ends[a]] = ends[b];
        net->mate[ends[b]] = ends[a];
        ends[b] = ends[count - 1]; /* a < b: first the later one */
        ends[a] = ends[count - 2];
    }
}

/* Find which links continue each other. first: room for one more than nodes; ends: 2 per link. */
static void txi_crest_join(txi_crest_net *net, uint32_t *first, uint32_t *ends) {
    memset(first, 0, (net->node_count + 1) * sizeof *first);
    for (size_t i = 0; i < 2 * net->link_count; i++) {
        first[net->link[i] + 1]++;
        net->mate[i] = TXI_CREST_NONE;
    }
    for (size_t i = 0; i < net->node_count; i++) first[i + 1] += first[i];
    for (size_t i = 2 * net->link_count; i-- > 0;) ends[--first[net->link[i] + 1]] = (uint32_t)i;
    for (size_t i = 0; i < net->node_count; i++) first[i] = first[i + 1];
    first[net->node_count] = (uint32_t)(2 * net->link_count);
    for (size_t i = 0; i < net->node_count; i++) {
        int64_t list[TXI_CREST_PAIRED];
        int count = 0;
        for (size_t k = first[i]; k < first[i + 1] && count < TXI_CREST_PAIRED; k++)
            list[count++] = ends[k];
        txi_crest_pair(net, list, count);
    }
}

/* A line of a net, by the end of a link that it begins with. */
typedef struct txi_crest_run {
    int64_t begin;
    size_t count; /* points */
    double strength, length;
    double sharp; /* integral of k'' / k^3 */
    int net; /* 0 ridges, 1 valleys */
} txi_crest_run;

/* Follow a line to its end, or once round, and mark its links. Its strength is the integral of the
   curvature along it. */
static txi_crest_run txi_crest_follow(const txi_crest_net *net, int64_t begin, uint8_t *seen) {
    txi_crest_run run = {begin, 1, 0, 0, 0, 0};
    for (int64_t end = begin; end != TXI_CREST_NONE && !seen[end / 2]; end = net->mate[end ^ 1]) {
        const uint32_t a = net->link[end], b = net->link[end ^ 1];
        seen[end / 2] = 1;
        run.count++;
        const double length = txm_d3_dist(net->place[a], net->place[b]);
        run.length += length;
        run.strength += length * (net->k[a] + net->k[b]) / 2;
        run.sharp += length * (net->sharp[a] + net->sharp[b]) / 2;
    }
    return run;
}

/* All lines of a net that are sharp enough: first those that end somewhere, then the closed
   ones. runs: room for 1 per link; seen: 1 per link. Returns their number. */
static size_t txi_crest_collect(const txi_crest_net *net, int which, uint8_t *seen,
                                txi_crest_run *runs) {
    size_t count = 0;
    memset(seen, 0, net->link_count);
    for (size_t i = 0; i < 4 * net->link_count; i++) {
        const int64_t end = (int64_t)(i < 2 * net->link_count ? i : i - 2 * net->link_count);
        if (seen[end / 2] || (i < 2 * net->link_count && net->mate[end] != TXI_CREST_NONE))
            continue;
        runs[count] = txi_crest_follow(net, end, seen);
        runs[count].net = which;
        count += runs[count].sharp > TXI_CREST_SHARP * runs[count].length;
    }
    return count;
}

/* Find the lines of one kind. */
static txm_status txi_crest_trace(const txi_shape *s, int is_valley, txm_arena *arena,
                                  txi_crest_net *net, txi_crest_run **runs, size_t *count,
                                  txm_env *env) {
    uint32_t *node = (uint32_t *)txm_arena_alloc(arena, s->edge_count, sizeof(uint32_t));
    if (!node) return txi_no_memory(env);
    const txm_status status = txi_crest_nodes(s, is_valley, arena, node, net, env);
    if (status != TXM_OK || net->link_count == 0) return status;
    uint32_t *first = (uint32_t *)txm_arena_alloc(arena, net->node_count + 1, sizeof(uint32_t));
    uint32_t *ends = (uint32_t *)txm_arena_alloc(arena, net->link_count, 2 * sizeof(uint32_t));
    uint8_t *seen = (uint8_t *)txm_arena_alloc(arena, net->link_count, 1);
    *runs = (txi_crest_run *)txm_arena_alloc(arena, net->link_count, sizeof(txi_crest_run));
    if (arena->failed) return txi_no_memory(env);
    txi_crest_links(s, node, net);
    txi_crest_join(net, first, ends);
    *count = txi_crest_collect(net, is_valley, seen, *runs);
    return TXM_OK;
}

/* Choose the lines at or above the threshold, the strongest first. chosen receives indices into the
   runs of both nets, the valleys' after the ridges'; scratch: as many. Returns their number. */
static size_t txi_crest_choose(txi_crest_run *const runs[2], const size_t counts[2],
                               float threshold, txm_pair *chosen, txm_pair *scratch) {
    double least = (double)threshold, most = 0;
    size_t count = 0;
    for (size_t i = 0; i < counts[0] + counts[1]; i++)
        most = fmax(most, i < counts[0] ? runs[0][i].strength : runs[1][i - counts[0]].strength);
    if (!(threshold > 0)) least = fmax(TXI_CREST_STRENGTH, TXI_CREST_SHARE * most);
    for (size_t i = 0; i < counts[0] + counts[1]; i++) {
        const txi_crest_run *run = i < counts[0] ? &runs[0][i] : &runs[1][i - counts[0]];
        if (run->strength < least) continue;
        chosen[count].key = ~txm_sort_key(txm_float(run->strength));
        chosen[count++].value = (uint32_t)i;
    }
    txm_sort_pairs(chosen, scratch, count);
    return count;
}

/* Copy a line out. */
static void txi_crest_emit(const txi_crest_net *net, const txi_crest_run *run, float *out) {
    int64_t end = run->begin;
    for (size_t i = 0; i < run->count; i++) {
        const int is_last = i + 1 == run->count;
        const txm_dvec3 p = net->place[net->link[is_last ? end ^ 1 : end]];
        *out++ = txm_float(p.x);
        *out++ = txm_float(p.y);
        *out++ = txm_float(p.z);
        if (i + 2 < run->count) end = net->mate[end ^ 1];
    }
}

/* The chosen lines as the caller gets them. */
static txm_status txi_crest_deliver(const txi_crest_net nets[2], txi_crest_run *const runs[2],
                                    const size_t counts[2], const txm_pair *chosen, size_t count,
                                    txm_env *env, texinpaint_crests **out) {
    txm_arena memory;
    size_t points = 0, used = 0;
    txm_arena_init(&memory, env);
    for (size_t i = 0; i < count; i++) {
        const size_t n = chosen[i].value;
        points += n < counts[0] ? runs[0][n].count : runs[1][n - counts[0]].count;
    }
    texinpaint_crests *crests = (texinpaint_crests *)txm_arena_zero(&memory, 1, sizeof *crests);
    texinpaint_line *lines =
        (texinpaint_line *)txm_arena_alloc(&memory, count, sizeof(texinpaint_line));
    float *strengths = (float *)txm_arena_alloc(&memory, count, sizeof(float));
    uint8_t *kinds = (uint8_t *)txm_arena_alloc(&memory, count, 1);
    float *places = (float *)txm_arena_alloc(&memory, points, 3 * sizeof(float));
    if (memory.failed) {
        txm_arena_free(&memory);
        return txi_no_memory(env);
    }
    for (size_t i = 0; i < count; i++) {
        const size_t n = chosen[i].value;
        const txi_crest_run *run = n < counts[0] ? &runs[0][n] : &runs[1][n - counts[0]];
        txi_crest_emit(&nets[run->net], run, places + 3 * used);
        lines[i].points = places + 3 * used;
        lines[i].count = (int)run->count;
        strengths[i] = txm_float(run->strength);
        kinds[i] = run->net ? TEXINPAINT_VALLEY : TEXINPAINT_RIDGE;
        used += run->count;
    }
    crests->lines = lines;
    crests->strengths = strengths;
    crests->kinds = kinds;
    crests->line_count = count;
    crests->memory = memory;
    *out = crests;
    return TXM_OK;
}

/* Everything but the checks. */
static txm_status txi_crest_find(const texinpaint_crest_desc *desc, txm_arena *arena, txm_env *env,
                                 texinpaint_crests **out) {
    txm_mesh welded;
    txi_shape shape;
    txi_crest_net nets[2];
    txi_crest_run *runs[2] = {NULL, NULL};
    size_t counts[2] = {0, 0};
    memset(nets, 0, sizeof nets);
    txm_status status = txi_welded_make(&desc->mesh, arena, env, &welded);
    if (status == TXM_OK) status = txi_shape_make(&welded, desc->rings, arena, env, &shape);
    for (int i = 0; i < 2 && status == TXM_OK && shape.edge_count; i++) {
        if (desc->kinds && !(desc->kinds & (i ? TEXINPAINT_VALLEY : TEXINPAINT_RIDGE))) continue;
        if (txm_progress(env, i ? 0.95f : 0.9f, "crest lines")) return txi_stopped(env);
        status = txi_crest_trace(&shape, i, arena, &nets[i], &runs[i], &counts[i], env);
    }
    if (status != TXM_OK) return status;
    const size_t most = counts[0] + counts[1];
    txm_pair *chosen = (txm_pair *)txm_arena_alloc(arena, most, 2 * sizeof(txm_pair));
    if (arena->failed) return txi_no_memory(env);
    const size_t count =
        most ? txi_crest_choose(runs, counts, desc->threshold, chosen, chosen + most) : 0;
    return txi_crest_deliver(nets, runs, counts, chosen, count, env, out);
}

TEXINPAINT_API txm_status texinpaint_crest(const texinpaint_crest_desc *desc, txm_env *env,
                                           texinpaint_crests **out) {
    txm_arena arena;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL");
    txm_status status = txm_mesh_check(&desc->mesh, "mesh", 3, 1, 1u << 29, env);
    if (status != TXM_OK) return status;
    if (!(desc->threshold >= 0 && desc->threshold <= 1e6f))
        return txm_fail(env, TXM_BAD_ARGUMENT, "threshold must be 0 to 1e6");
    if (desc->kinds < 0 || desc->kinds > (TEXINPAINT_RIDGE | TEXINPAINT_VALLEY))
        return txm_fail(env, TXM_BAD_ARGUMENT, "kinds must be 0 to 3");
    if (desc->rings < 0 || desc->rings > TXI_FIT_MOST_RINGS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "rings must be 0 to 8");
    txm_arena_init(&arena, env);
    status = txi_crest_find(desc, &arena, env, out);
    txm_arena_free(&arena);
    return status;
}

TEXINPAINT_API void texinpaint_crests_free(texinpaint_crests *crests) {
    if (!crests) return;
    txm_arena memory = crests->memory;
    txm_arena_free(&memory);
}

#endif /* TEXINPAINT_CREST_H */
