/* mesh_figures.c - figures about a mesh for --stats: topology, valences, shapes of triangles
   SPDX-License-Identifier: MIT OR Unlicense */
#include "retile.h"

/* The root of an item's set; paths are halved on the way. */
static uint32_t find_root(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static size_t join(uint32_t *parent, uint32_t a, uint32_t b) {
    const uint32_t x = find_root(parent, a), y = find_root(parent, b);
    parent[x > y ? x : y] = x > y ? y : x;
    return x != y;
}

typedef struct figures {
    size_t edges, components, loops;
    double inner, six; /* vertices inside, and those of valence 6 */
} figures;

/* Count edges, components, border loops and valences. An inner edge has two sides, a border edge
   one. */
static int count_edges(const trimesh_mesh *m, figures *f) {
    const txm_mesh mesh = trimesh_as_view(m);
    const size_t sides = txm_mesh_sides(&mesh), n = m->vertex_count;
    uint32_t *sorted = (uint32_t *)new_array(sides, 2 * sizeof *sorted);
    uint32_t *pieces = (uint32_t *)new_array(n, 3 * sizeof *pieces);
    if (!sorted || !pieces) {
        free(sorted);
        free(pieces);
        return 0;
    }
    uint32_t *rims = pieces + n, *valence = rims + n;
    memset(f, 0, sizeof *f);
    for (size_t i = 0; i < n; i++) {
        pieces[i] = rims[i] = (uint32_t)i;
        valence[i] = 0;
    }
    f->components = n;
    txm_mesh_sort_sides(&mesh, sorted);
    for (size_t i = 0, end; i < sides; i = end) {
        const uint32_t a = txm_mesh_low(&mesh, sorted[i]), b = txm_mesh_high(&mesh, sorted[i]);
        end = txm_mesh_edge_end(&mesh, sorted, i);
        f->edges++;
        f->components -= join(pieces, a, b);
        valence[a] += valence[a] < 1u << 30;
        valence[b] += valence[b] < 1u << 30;
        if (end - i > 1) continue;
        /* a border edge: one more loop if it closes a chain */
        f->loops += 1 - join(rims, a, b);
        valence[a] |= 1u << 31;
        valence[b] |= 1u << 31;
    }
    for (size_t i = 0; i < n; i++) {
        if (valence[i] >> 31) continue;
        f->inner++;
        f->six += valence[i] == 6;
    }
    free(sorted);
    free(pieces);
    return 1;
}

/* Sums for a mean and a coefficient of variation. */
typedef struct spread {
    double sum, squares, count;
} spread;

static void spread_add(spread *s, double x) {
    s->sum += x;
    s->squares += x * x;
    s->count++;
}

static double spread_mean(const spread *s) {
    return s->count > 0 ? s->sum / s->count : 0;
}

static double spread_variation(const spread *s) {
    const double mean = spread_mean(s), square = s->count > 0 ? s->squares / s->count : 0;
    return mean > 0 && square > mean * mean ? sqrt(square - mean * mean) / mean : 0;
}

/* The angle opposite to side a in degrees. */
static double angle_of(double a, double b, double c) {
    const double x = (b * b + c * c - a * a) / (2 * b * c);
    return acos(x < -1 ? -1 : x > 1 ? 1 : x) * 180 / 3.14159265358979;
}

/* Measure the mesh for --stats, lengths times scale; returns the mean quality and the share of valence 6. */
int mesh_figures(cli *run, const trimesh_mesh *m, const trimesh_report *r, double scale,
                 double *mean_quality, double *valence_6) {
    spread edges = {0, 0, 0}, areas = {0, 0, 0}, qualities = {0, 0, 0};
    double least_quality = 1, least_angle = 180;
    figures f;
    if (!count_edges(m, &f)) return fail_memory(run);
    for (size_t t = 0; t < m->triangle_count; t++) {
        double side[3];
        for (size_t k = 0; k < 3; k++) { /* side k is opposite to corner k */
            const float *p = m->positions + 3 * (size_t)m->indices[3 * t + (k + 1) % 3];
            const float *q = m->positions + 3 * (size_t)m->indices[3 * t + (k + 2) % 3];
            double sum = 0;
            for (int c = 0; c < 3; c++) {
                const double d = (double)p[c] - (double)q[c];
                sum += d * d;
            }
            side[k] = sqrt(sum);
            spread_add(&edges, side[k]);
        }
        const double a = side[0], b = side[1], c = side[2], product = a * b * c;
        const double excess = (b + c - a) * (c + a - b) * (a + b - c);
        const double quality = product > 0 && excess > 0 ? excess / product : 0;
        spread_add(&qualities, quality);
        spread_add(&areas, excess > 0 ? 0.25 * sqrt(excess * (a + b + c)) : 0);
        if (quality < least_quality) least_quality = quality;
        for (int k = 0; k < 3; k++) {
            const double angle =
                product > 0 ? angle_of(side[k], side[(k + 1) % 3], side[(k + 2) % 3]) : 0;
            if (angle < least_angle) least_angle = angle;
        }
    }
    const int mended[7] = {(int)r->welded, (int)r->unused, (int)r->degenerate, (int)r->duplicate,
                           (int)r->fins, (int)r->turned, (int)r->split};
    const int repaired[6] = {(int)r->overfull, (int)r->opened,   (int)r->cut,
                             (int)r->closed,   (int)r->stitched, (int)r->dropped};
    *mean_quality = spread_mean(&qualities);
    *valence_6 = f.inner > 0 ? f.six / f.inner : 0;
    cli_figure(run, "vertices", (double)m->vertex_count);
    cli_figure(run, "triangles", (double)m->triangle_count);
    cli_figure(run, "euler",
               (double)m->vertex_count - (double)f.edges + (double)m->triangle_count);
    cli_figure(run, "components", (double)f.components);
    cli_figure(run, "loops", (double)f.loops);
    cli_figures(run, "mended", mended, 7);
    cli_figures(run, "repaired", repaired, 6);
    cli_figure(run, "crease_edges", (double)r->crease_edges);
    cli_figure(run, "seam_edges", (double)r->seam_edges);
    cli_figure(run, "edge_length", m->edge_length * scale);
    cli_figure(run, "volume_change", m->volume_change);
    cli_figure(run, "quality", *mean_quality);
    cli_figure(run, "quality_least", least_quality);
    cli_figure(run, "valence_6", *valence_6);
    cli_figure(run, "edge_variation", spread_variation(&edges));
    cli_figure(run, "area_variation", spread_variation(&areas));
    cli_figure(run, "least_angle", least_angle);
    return CLI_DONE;
}
