#ifndef TEXINPAINT_HARMONIC_H
#define TEXINPAINT_HARMONIC_H

#include "graph.h"
#include "multigrid.h"

/* ---- smooth fill ----------------------------------------------------------------------------
   Each map becomes a harmonic function on the missing part of the surface. Quantities are chosen so
   that they may be averaged: colours are multiplied by their alpha; the vectors of normal maps are
   turned from the axes of the texture, which differ from chart to chart, into space. Labels are not
   averaged: each texel gets that of the nearest known one.                                     */

enum { TXI_FILL_MOST = 5 }; /* quantities of a map */

/* How the samples of a map are treated. */
typedef struct txi_quantities {
    const txm_image *image;
    int count;     /* of quantities                                                            */
    int is_normal; /* 1 or 2, as in texinpaint_map                                             */
    int has_alpha; /* the last channel is alpha, and the others are multiplied by it           */
} txi_quantities;

static txi_quantities txi_quantities_of(const txi_domain *d, int map) {
    const texinpaint_map *m = map ? &d->desc->maps[map - 1] : NULL;
    txi_quantities q;
    q.image = &d->maps[map];
    q.is_normal = m ? m->is_normal : 0;
    q.has_alpha = txi_has_alpha(d, map);
    q.count = q.image->channels + (q.is_normal && d->surface ? 1 : 0);
    return q;
}

/* The directions in space of the x and y axes of a normal map at a texel: unit. */
static void txi_tangents(const txi_domain *d, uint32_t texel, int is_normal, txm_dvec3 axis[2]) {
    const uint32_t face = d->surface->owner[texel];
    txm_dvec3 pu, pv;
    axis[0] = txm_d3(1, 0, 0);
    axis[1] = txm_d3(0, 1, 0);
    if (face == TXI_NO_FACE || !txi_face_axes(d->surface, face, &pu, &pv)) return;
    const txm_dvec3 n = txm_d3_unit(txi_face_area2(d->surface, face));
    const txm_dvec3 y = txm_d3_cross(n, txm_d3_unit(pu));
    if (!(txm_d3_len2(y) > 0.5)) return;
    /* at a right angle to x, on the side of v, which runs downwards */
    const int down = txm_d3_dot(y, pv) > 0;
    axis[0] = txm_d3_unit(pu);
    axis[1] = txm_d3_scale(y, down == (is_normal == 2) ? 1 : -1);
}

/* The quantities of a texel. */
static void txi_quantities_get(const txi_domain *d, const txi_quantities *q, uint32_t texel,
                               double out[TXI_FILL_MOST]) {
    const int x = (int)(texel % (uint32_t)d->width), y = (int)(texel / (uint32_t)d->width);
    const int channels = q->image->channels;
    for (int c = 0; c < channels; c++) out[c] = (double)txm_image_get(q->image, x, y, c);
    for (int c = 0; c + 1 < channels && q->has_alpha; c++)
        out[c] *= fmin(fmax(out[channels - 1], 0), 1);
    for (int c = 0; c < 3 && q->is_normal; c++)
        out[c] = txm_normal_decode(out[c], q->image->sample);
    if (q->is_normal && d->surface) { /* the vector in the tangent plane, as one in space */
        txm_dvec3 axis[2];
        txi_tangents(d, texel, q->is_normal, axis);
        const txm_dvec3 v = txm_d3_mad(txm_d3_scale(axis[0], out[0]), axis[1], out[1]);
        const double height = out[2], rest = out[3];
        out[0] = v.x;
        out[1] = v.y;
        out[2] = v.z;
        out[3] = height;
        out[4] = rest;
    }
}

/* Store a texel by its quantities. */
static void txi_quantities_set(const txi_domain *d, const txi_quantities *q, uint32_t texel,
                               double in[TXI_FILL_MOST]) {
    const int x = (int)(texel % (uint32_t)d->width), y = (int)(texel / (uint32_t)d->width);
    const int channels = q->image->channels;
    if (q->is_normal) {
        if (d->surface) {
            txm_dvec3 axis[2];
            const txm_dvec3 v = txm_d3(in[0], in[1], in[2]);
            txi_tangents(d, texel, q->is_normal, axis);
            in[0] = txm_d3_dot(v, axis[0]);
            in[1] = txm_d3_dot(v, axis[1]);
            in[2] = in[3];
            in[3] = in[4];
        }
        const double n = sqrt(in[0] * in[0] + in[1] * in[1] + in[2] * in[2]);
        for (int c = 0; c < 3; c++)
            in[c] = txm_normal_encode(n > 1e-6 ? in[c] / n : c == 2, q->image->sample);
    }
    for (int c = 0; c + 1 < channels && q->has_alpha; c++)
        in[c] = in[channels - 1] > 1e-6 ? in[c] / fmin(in[channels - 1], 1) : 0;
    for (int c = 0; c < channels; c++) txm_image_set(q->image, x, y, c, txm_float(in[c]));
}

/* The mean quantities of all known texels, for holes without any around them. */
static void txi_quantities_mean(const txi_domain *d, const txi_quantities *q, const uint8_t *marks,
                                double mean[TXI_FILL_MOST]) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    size_t count = 0;
    memset(mean, 0, TXI_FILL_MOST * sizeof *mean);
    for (size_t i = 0; i < texels; i++) {
        double value[TXI_FILL_MOST];
        if (marks[i] != TXI_NODE_KNOWN) continue;
        txi_quantities_get(d, q, (uint32_t)i, value);
        for (int c = 0; c < q->count; c++) mean[c] += value[c];
        count++;
    }
    for (int c = 0; c < q->count && count; c++) mean[c] /= (double)count;
}

/* ---- Poisson equation on the surface --------------------------------------------------------- */

/* The equation for one graph; for any number of right sides. */
typedef struct txi_poisson_system {
    const txi_texel_graph *g;
    txi_grid grid;
    double screen;
    uint8_t *anchor; /* 1 per node: 1 for one node of each part that is not connected with the
                        rim                                                                      */
} txi_poisson_system;

/* What is given along the links of a graph, in the order of their rows. */
typedef struct txi_steps {
    const float *link; /* 1 per link of `to`: how much u rises from the node to its neighbour;
                          the other way round the same with the other sign. NULL: 0              */
    const float *rim;  /* 1 per link of `rim`, likewise. NULL: 0                                */
    const float *rim_value; /* 1 per link of `rim`: u there                                     */
} txi_steps;

/* screen: 0 or more, see txi_surface_poisson. */
static txm_status txi_poisson_make(const txi_texel_graph *g, double screen, txm_arena *arena,
                                   txm_env *env, txi_poisson_system *s) {
    const size_t n = g->count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    s->g = g;
    s->screen = screen;
    s->anchor = (uint8_t *)txm_arena_alloc(arena, n, 1);
    double *ground = (double *)txm_arena_zero(&scratch, n, sizeof(double));
    uint32_t *queue = (uint32_t *)txm_arena_alloc(&scratch, n, sizeof(uint32_t));
    if (arena->failed || scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    txi_graph_islands(g, queue, s->anchor);
    for (size_t i = 0; i < n; i++) {
        if (s->anchor[i]) { /* the first of its island: the others need no ground */
            txi_graph_spread(g, (uint32_t)i, queue, s->anchor);
            s->anchor[i] = !(screen > 0);
        }
        ground[i] = screen + s->anchor[i];
        for (uint32_t k = g->rim_first[i]; k < g->rim_first[i + 1]; k++)
            ground[i] += (double)g->rim_weight[k];
    }
    const txm_status status =
        txi_grid_make(n, g->first, g->to, g->weight, ground, arena, env, &s->grid);
    txm_arena_free(&scratch);
    return status;
}

/* The u that has the given values at the rim and whose differences along the links come nearest to
   the given steps: the Poisson equation on the surface, across the seams of the atlas:

       minimise  sum over links  w (u_j - u_i - step)^2  +  screen sum (u_i - u0_i)^2

   Without steps and screen it is the harmonic function with these values.
   u          on entry u0, which is also the first guess; receives the solution. A part that is not
              connected with the rim (screen 0) keeps the u0 of one of its nodes as its level
   scratch    room for 1 per node
   tolerance  of the residual, relative
   return     TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED: u is then of no use
   cost       some 10 iterations of about 0.15 us per node                                  */
static txm_status txi_surface_poisson(const txi_poisson_system *s, const txi_steps *steps,
                                      double *u, double *scratch, double tolerance, txm_env *env) {
    const txi_texel_graph *g = s->g;
    for (size_t i = 0; i < g->count; i++) {
        double sum = (s->screen + s->anchor[i]) * u[i];
        for (uint32_t k = g->first[i]; k < g->first[i + 1] && steps->link; k++)
            sum -= (double)g->weight[k] * steps->link[k];
        for (uint32_t k = g->rim_first[i]; k < g->rim_first[i + 1]; k++) {
            const double rise = steps->rim ? (double)steps->rim[k] : 0;
            sum += (double)g->rim_weight[k] * (steps->rim_value[k] - rise);
        }
        scratch[i] = sum;
    }
    return txi_grid_solve(&s->grid, scratch, u, tolerance, "smooth fill", env);
}

/* ---- smooth fill: labels -------------------------------------------------------------------- */

/* where a texel lies: in space, or in the picture */
static txm_dvec3 txi_fill_point(const txi_domain *d, uint32_t texel) {
    if (d->surface) return txi_texel_point(d, d->surface->owner[texel], texel);
    const int y = (int)(texel / (uint32_t)d->width);
    return txm_d3((int)(texel % (uint32_t)d->width), y, 0);
}

/* For each node the known texel that is nearest, of those at the rim that its neighbours have:
   distances in a straight line, spread from the rim along the links until nothing changes. It is
   nearest to within a texel. Nodes of islands get UINT32_MAX. */
static txm_status txi_nearest_known(const txi_domain *d, const txi_texel_graph *g, uint32_t *source,
                                    txm_env *env) {
    txm_arena scratch;
    size_t head = 0, waiting = 0;
    txm_arena_init(&scratch, env);
    txm_dvec3 *point = (txm_dvec3 *)txm_arena_alloc(&scratch, g->count, sizeof(txm_dvec3));
    double *least = (double *)txm_arena_alloc(&scratch, g->count, sizeof(double));
    /* a ring */
    uint32_t *queue = (uint32_t *)txm_arena_alloc(&scratch, g->count, sizeof(uint32_t));
    uint8_t *queued = (uint8_t *)txm_arena_zero(&scratch, g->count, 1);
    if (scratch.failed) {
        txm_arena_free(&scratch);
        return txi_no_memory(env);
    }
    for (size_t i = 0; i < g->count; i++) {
        point[i] = txi_fill_point(d, g->texel[i]);
        source[i] = UINT32_MAX;
        least[i] = 0;
        for (uint32_t k = g->rim_first[i]; k < g->rim_first[i + 1]; k++) {
            const double apart = txm_d3_dist2(point[i], txi_fill_point(d, g->rim[k]));
            if (source[i] != UINT32_MAX && !(apart < least[i])) continue;
            source[i] = g->rim[k];
            least[i] = apart;
        }
        if (source[i] == UINT32_MAX) continue;
        queue[waiting++] = (uint32_t)i;
        queued[i] = 1;
    }
    while (waiting > 0) {
        const uint32_t i = queue[head];
        head = head + 1 < g->count ? head + 1 : 0;
        waiting--;
        queued[i] = 0;
        const txm_dvec3 from = txi_fill_point(d, source[i]);
        for (uint32_t k = g->first[i]; k < g->first[i + 1]; k++) {
            const uint32_t j = g->to[k];
            const double apart = txm_d3_dist2(point[j], from);
            if (source[j] != UINT32_MAX && !(apart < least[j])) continue;
            source[j] = source[i];
            least[j] = apart;
            if (queued[j]) continue;
            queued[j] = 1;
            const size_t end = head + waiting;
            TXM_ASSERT(waiting < g->count);
            queue[end < g->count ? end : end - g->count] = j;
            waiting++;
        }
    }
    txm_arena_free(&scratch);
    return TXM_OK;
}

/* The label of the nearest known texel; the first known one of the map where there is none. */
static void txi_fill_labels(const txi_domain *d, const txi_texel_graph *g, int map,
                            const uint32_t *source, const uint8_t *marks) {
    const txm_image *image = &d->maps[map];
    const size_t bytes = (size_t)image->channels * txm_sample_bytes(image->sample);
    const size_t texels = (size_t)d->width * (size_t)d->height;
    uint8_t *pixels = (uint8_t *)image->pixels; /* packed rows */
    size_t any = 0;
    while (any + 1 < texels && marks[any] != TXI_NODE_KNOWN) any++;
    for (size_t i = 0; i < g->count; i++) {
        const size_t from = source[i] == UINT32_MAX ? any : source[i];
        memcpy(pixels + bytes * g->texel[i], pixels + bytes * from, bytes);
    }
}

/* ---- smooth fill: equations ------------------------------------------------------------------ */

/* The error that is left, relative to the right side: well below a step of the samples. */
static double txi_fill_tolerance(txm_sample sample) {
    return sample == TXM_U8 ? 1e-4 : sample == TXM_U16 ? 1e-6 : 1e-7;
}

/* Fill one map of the nodes: its quantities are known at the rim. */
static txm_status txi_fill_map(const txi_domain *d, const txi_poisson_system *s, int map,
                               const uint8_t *marks, txm_arena *arena, txm_env *env) {
    const txi_quantities q = txi_quantities_of(d, map);
    const txi_texel_graph *g = s->g;
    const size_t n = g->count, rims = g->rim_first[n];
    double mean[TXI_FILL_MOST], value[TXI_FILL_MOST];
    float *rim = (float *)txm_arena_alloc(arena, rims + 1, (size_t)q.count * sizeof(float));
    double *u = (double *)txm_arena_alloc(arena, n, (size_t)q.count * sizeof(double));
    double *scratch = (double *)txm_arena_alloc(arena, n, sizeof(double));
    if (arena->failed) return txi_no_memory(env);
    txi_quantities_mean(d, &q, marks, mean);
    for (size_t k = 0; k < rims; k++) {
        txi_quantities_get(d, &q, g->rim[k], value);
        for (int c = 0; c < q.count; c++) rim[(size_t)c * rims + k] = txm_float(value[c]);
    }
    for (int c = 0; c < q.count; c++) {
        const txi_steps steps = {NULL, NULL, rim + (size_t)c * rims};
        txi_stage stage;
        for (size_t i = 0; i < n; i++) u[(size_t)c * n + i] = mean[c]; /* stays so without a rim */
        txi_stage_begin(&stage, env, (float)c / (float)q.count, (float)(c + 1) / (float)q.count);
        const txm_status status =
            txi_surface_poisson(s, &steps, u + (size_t)c * n, scratch,
                                txi_fill_tolerance(q.image->sample), &stage.env);
        if (status != TXM_OK) return txi_stage_end(&stage, status);
    }
    for (size_t i = 0; i < n; i++) {
        for (int c = 0; c < q.count; c++) value[c] = u[(size_t)c * n + i];
        txi_quantities_set(d, &q, g->texel[i], value);
    }
    return TXM_OK;
}

/* Fill the label maps. */
static txm_status txi_fill_all_labels(const txi_domain *d, const txi_texel_graph *g,
                                      const uint8_t *marks, txm_arena *arena, txm_env *env) {
    uint32_t *source = (uint32_t *)txm_arena_alloc(arena, g->count, sizeof(uint32_t));
    if (!source) return txi_no_memory(env);
    const txm_status status = txi_nearest_known(d, g, source, env);
    for (int map = 0; map < d->map_count && status == TXM_OK; map++) {
        if (txi_is_label(d, map)) txi_fill_labels(d, g, map, source, marks);
    }
    return status;
}

/* Fill the unknown texels of all maps. */
static txm_status txi_fill_nodes(const txi_domain *d, const uint8_t *marks, txm_arena *arena,
                                 txm_env *env) {
    txi_texel_graph g;
    txi_poisson_system system;
    int labels = 0;
    txm_status status = txi_graph_make(d, marks, arena, env, &g);
    if (status != TXM_OK || g.count == 0) return status;
    for (int map = 0; map < d->map_count; map++) labels += txi_is_label(d, map);
    if (labels) status = txi_fill_all_labels(d, &g, marks, arena, env);
    if (status == TXM_OK) status = txi_poisson_make(&g, 0, arena, env, &system);
    for (int map = 0; map < d->map_count && status == TXM_OK; map++) {
        txi_stage stage;
        txm_arena scratch;
        if (txi_is_label(d, map)) continue;
        txm_arena_init(&scratch, env);
        txi_stage_begin(&stage, env, (float)map / (float)d->map_count,
                        (float)(map + 1) / (float)d->map_count);
        status = txi_stage_end(&stage,
                               txi_fill_map(d, &system, map, marks, &scratch, &stage.env));
        txm_arena_free(&scratch);
    }
    return status;
}

/* Fill the missing texels that a chart covers smoothly, in all maps. d->missing is not changed.
   return  TXM_OK, TXM_TOO_SMALL if nothing is known, TXM_TOO_LARGE, TXM_OUT_OF_MEMORY,
           TXM_CANCELLED; after these the missing texels of some maps may be filled
   cost    about 3 us per missing texel for three channels, 300 bytes                       */
static txm_status txi_harmonic_fill(const txi_domain *d, txm_env *env) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    size_t known = 0, unknown = 0;
    txm_arena arena;
    txm_arena_init(&arena, env);
    uint8_t *marks = (uint8_t *)txm_arena_alloc(&arena, texels, 1);
    if (!marks) return txi_no_memory(env);
    for (size_t i = 0; i < texels; i++) {
        marks[i] = (uint8_t)(!d->covered[i]    ? TXI_NODE_NONE
                             : !d->missing[i] ? TXI_NODE_KNOWN
                                              : TXI_NODE_UNKNOWN);
        known += marks[i] == TXI_NODE_KNOWN;
        unknown += marks[i] == TXI_NODE_UNKNOWN;
    }
    txm_status status = TXM_OK;
    if (unknown > 0 && known == 0)
        status = txm_fail(env, TXM_TOO_SMALL, "nothing in the charts is known");
    else if (unknown > 0)
        status = txi_fill_nodes(d, marks, &arena, env);
    txm_arena_free(&arena);
    return status;
}

/* ---- smooth fill: public calls --------------------------------------------------------------- */

/* Copy the maps out. */
static void txi_deliver(const txi_domain *d, const txm_image *out) {
    for (int map = 0; map < d->map_count; map++) txi_copy_picture(&d->maps[map], &out[map]);
}

TEXINPAINT_API txm_status texinpaint_harmonic(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out) {
    txi_domain d;
    txi_stage stage;
    txm_arena arena;
    txm_status status = txi_check_common(desc, env);
    if (status == TXM_OK) status = txi_check_mask(&desc->mask, "mask", &desc->image, env);
    if (status == TXM_OK) status = txi_check_outputs(desc, out, 1 + desc->map_count, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&arena, env);
    status = txi_domain_make(&d, desc, &arena, env);
    if (status == TXM_OK) status = txi_surface_make(&d, &arena, env);
    if (status == TXM_OK) {
        txi_stage_begin(&stage, env, 0, 0.95f);
        status = txi_stage_end(&stage, txi_harmonic_fill(&d, &stage.env));
    }
    if (status == TXM_OK && txm_progress(env, 0.95f, "gutters")) status = txi_stopped(env);
    if (status == TXM_OK) {
        const size_t texels = (size_t)d.width * (size_t)d.height;
        size_t filled;
        for (size_t i = 0; i < texels; i++) {
            if (d.covered[i]) d.missing[i] = 0;
        }
        status = txi_gutter(&d, &arena, env, &filled);
    }
    if (status == TXM_OK) status = txi_bleed(&d, env);
    if (status == TXM_OK) txi_deliver(&d, out);
    txm_arena_free(&arena);
    return status;
}

/* What is spread and what is filled. */
enum { TXI_SPREAD_NOT = 0, TXI_SPREAD_FROM = 1, TXI_SPREAD_TO = 2 };

/* Is the pixel fully transparent? */
static int txi_is_clear(const txm_image *image, int x, int y) {
    return image->channels % 2 == 0 && !(txm_image_get(image, x, y, image->channels - 1) > 0);
}

/* Mark the texels; returns how many there are to spread. is_solid: the picture's transparent pixels
   are filled with colour, and stay transparent. */
static size_t txi_spread_marks(const txi_domain *d, int is_solid, uint8_t *marks) {
    size_t known = 0;
    for (int y = 0; y < d->height; y++) {
        for (int x = 0; x < d->width; x++) {
            const size_t i = (size_t)y * (size_t)d->width + (size_t)x;
            const int missing = is_solid ? txi_is_clear(&d->maps[0], x, y) : d->missing[i];
            const int fills = d->surface ? !d->covered[i] : missing;
            marks[i] = fills ? TXI_SPREAD_TO : missing ? TXI_SPREAD_NOT : TXI_SPREAD_FROM;
            known += marks[i] == TXI_SPREAD_FROM;
        }
    }
    return known;
}

/* Give texels the values of the nearest one that is spread, at most `reach` away
   (0: any distance). */
static txm_status txi_spread(const txi_domain *d, uint8_t *marks, int is_solid, int reach,
                             txm_env *env) {
    const size_t texels = (size_t)d->width * (size_t)d->height;
    const txm_image *image = &d->maps[0];
    const size_t bytes = txm_sample_bytes(image->sample), pixel = (size_t)image->channels * bytes;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    int32_t *nearest = (int32_t *)txm_arena_alloc(&scratch, texels, sizeof(int32_t));
    uint8_t *from = (uint8_t *)txm_arena_alloc(&scratch, texels, 1);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    for (size_t i = 0; i < texels && status == TXM_OK; i++) from[i] = marks[i] == TXI_SPREAD_FROM;
    if (status == TXM_OK) status = txi_nearest(from, d->width, d->height, env, nearest);
    for (size_t i = 0; i < texels && status == TXM_OK; i++) {
        if (marks[i] != TXI_SPREAD_TO || nearest[i] < 0) continue;
        const int64_t dx = (int64_t)(i % (size_t)d->width) - nearest[i] % d->width;
        const int64_t dy = (int64_t)(i / (size_t)d->width) - nearest[i] / d->width;
        if (reach > 0 && dx * dx + dy * dy > (int64_t)reach * reach) continue;
        txi_copy_texel(d, (size_t)nearest[i], i);
        if (is_solid) memset((uint8_t *)image->pixels + (i + 1) * pixel - bytes, 0, bytes);
    }
    txm_arena_free(&scratch);
    return status;
}

TEXINPAINT_API txm_status texinpaint_dilate(const texinpaint_desc *desc, txm_env *env,
                                            const txm_image *out) {
    txi_domain d;
    txm_arena arena;
    uint8_t *marks = NULL;
    txm_status status = txi_check_common(desc, env);
    if (status == TXM_OK && desc->mask.pixels)
        status = txi_check_mask(&desc->mask, "mask", &desc->image, env);
    if (status == TXM_OK) status = txi_check_outputs(desc, out, 1 + desc->map_count, env);
    if (status != TXM_OK) return status;
    const int is_solid = !desc->mask.pixels && desc->mesh.face_count == 0;
    txm_arena_init(&arena, env);
    status = txi_domain_make(&d, desc, &arena, env);
    if (status == TXM_OK && txm_progress(env, 0, "gutters")) status = txi_stopped(env);
    if (status == TXM_OK) status = txi_surface_make(&d, &arena, env);
    if (status == TXM_OK) {
        marks = (uint8_t *)txm_arena_alloc(&arena, (size_t)d.width * (size_t)d.height, 1);
        if (!marks) status = txi_no_memory(env);
    }
    if (status == TXM_OK && txi_spread_marks(&d, is_solid, marks) == 0)
        status = txm_fail(env, TXM_TOO_SMALL, "no texel has a colour that could be spread");
    if (status == TXM_OK && txm_progress(env, 0.5f, "gutters")) status = txi_stopped(env);
    if (status == TXM_OK && desc->gutter >= 0)
        status = txi_spread(&d, marks, is_solid, desc->gutter, env);
    if (status == TXM_OK) txi_deliver(&d, out);
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXINPAINT_HARMONIC_H */
