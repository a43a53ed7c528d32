#ifndef TRIMESH_RELAX_PIECES_H
#define TRIMESH_RELAX_PIECES_H

#include "mend_all.h"
#include "creases.h"

/* ---- pieces: how many vertices each needs, and which are dropped --------------------------- */

/* Scans have crumbs: pieces so small that their share of the vertices is less than any piece needs.
   Hundreds of them would take the vertices of the body. So the largest are kept while what they take
   beyond their share stays small, and the others are dropped. If there is no body, that is, if crumbs
   are a good part of the surface, all are kept. */

#define TMR_CRUMB 4         /* ours: vertices that a piece is worth by its area                  */
#define TMR_CRUMB_ROOM 0.05 /* ours: part of the vertices that crumbs may take beyond their share */
#define TMR_CRUMB_FEW 16    /* ours: or so many, if they are at most                             */
#define TMR_CRUMB_PART 0.25 /* this part of all                                                  */
#define TMR_CRUMB_AREA 0.1  /* ours: part of the surface that is dropped at most                 */

typedef struct tmr_piece {
    double area;   /* scaled units */
    double volume; /* inside: its part of that of the surface                */
    double weight; /* area relative to the square of the wanted edge length */
    double euler;  /* characteristic, its border loops not closed            */
    double loops;  /* border loops */
    double fixed;  /* vertices that its lines need at least: corners, and more on loops */
    double least;  /* vertices that it needs at least */
    int is_dropped;
} tmr_piece;

/* The least number of vertices for a piece. Closed, Heawood's bound: 4 for a sphere, 7 for a torus;
   each border loop has 3 of its own. */
static double tmr_piece_least(const tmr_piece *p) {
    const double heawood = ceil((7 + sqrt(fmax(49 - 24 * (p->euler + p->loops), 1))) / 2);
    return fmax(p->fixed, p->loops > 0 ? 3 * p->loops : heawood);
}

static txm_status tmr_measure_pieces(const tmr_surface *s, const tmr_lines *l, tmr_piece *pieces,
                                     txm_arena *scratch) {
    uint8_t *seen = (uint8_t *)txm_arena_zero(scratch, 3 * (size_t)s->face_count, 1);
    if (!seen) return TXM_OUT_OF_MEMORY;
    memset(pieces, 0, (size_t)s->component_count * sizeof *pieces);
    for (int32_t f = 0; f < s->face_count; f++) {
        const int32_t *v = s->vertex + 3 * f;
        tmr_piece *p = pieces + s->component[f];
        const double area =
            0.5 * txm_d3_len(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]));
        const double size =
            s->scale ? (s->scale[v[0]] + (double)s->scale[v[1]] + s->scale[v[2]]) / 3 : 1;
        p->area += area;
        p->volume += txm_d3_dot(s->point[v[0]], txm_d3_area2(s->point[v[0]], s->point[v[1]],
                                                             s->point[v[2]])) / 6;
        p->weight += area / (size * size);
        p->euler -= 0.5; /* a face and its three halves of edges; 1/2 more for each border edge */
        for (int32_t c = 3 * f; c < 3 * f + 3; c++) {
            if (s->opposite[c] >= 0) continue;
            p->euler -= 0.5;
            p->loops += !seen[c];
            for (int32_t k = c; !seen[k]; k = tmr_next_border(s, k)) seen[k] = 1;
        }
    }
    for (int32_t v = 0; v < s->vertex_count; v++) {
        tmr_piece *p = pieces + s->component[s->corner[v] / 3];
        p->euler++;
        p->fixed += l->kind[v] == TRIMESH_CORNER;
    }
    for (int32_t i = 0; i < l->line_count; i++) { /* a loop has three edges */
        const int32_t first = l->first[i], last = l->first[i + 1] - 1;
        tmr_piece *p = pieces + s->component[l->face[first]];
        p->fixed += l->closed[i] ? 3 : l->a[first] == l->b[last] ? 2 : 0;
    }
    for (int32_t i = 0; i < s->component_count; i++) pieces[i].least = tmr_piece_least(pieces + i);
    return TXM_OK;
}

/* Choose the crumbs to be dropped. all: the weight of all pieces. */
static txm_status tmr_choose_crumbs(const tmr_surface *s, double vertices, double all,
                                    tmr_piece *pieces, txm_arena *scratch) {
    const size_t n = (size_t)s->component_count;
    txm_pair *order = (txm_pair *)txm_arena_alloc(scratch, 2 * n, sizeof(txm_pair));
    const double room =
        fmax(TMR_CRUMB_ROOM * vertices, fmin(TMR_CRUMB_FEW, TMR_CRUMB_PART * vertices));
    double more = 0, crumbs = 0;
    size_t count = 0;
    if (!order) return TXM_OUT_OF_MEMORY;
    for (size_t i = 0; i < n; i++) {
        const double worth = pieces[i].weight / all * vertices;
        if (pieces[i].is_dropped || worth >= TMR_CRUMB) continue;
        order[count].key = ~txm_sort_key(txm_float(pieces[i].weight)); /* the largest first */
        order[count++].value = (uint32_t)i;
        more += fmax(pieces[i].least - worth, 0);
        crumbs += pieces[i].weight;
    }
    if (more <= room || crumbs > TMR_CRUMB_AREA * all) return TXM_OK;
    txm_sort_pairs(order, order + n, count);
    more = 0;
    for (size_t i = 0; i < count; i++) {
        tmr_piece *p = pieces + order[i].value;
        more += fmax(p->least - p->weight / all * vertices, 0);
        p->is_dropped = more > room;
    }
    return TXM_OK;
}

/* Remove the pieces that are dropped from the surface. */
static txm_status tmr_drop_pieces(tmr_surface *s, const tmr_piece *pieces, trimesh_report *report,
                                  txm_arena *scratch) {
    const size_t n = (size_t)s->face_count;
    int32_t *face = (int32_t *)txm_arena_alloc(scratch, n, sizeof(int32_t));
    int32_t *vertex = (int32_t *)txm_arena_alloc(scratch, (size_t)s->vertex_count, sizeof(int32_t));
    int32_t *piece =
        (int32_t *)txm_arena_alloc(scratch, (size_t)s->component_count, sizeof(int32_t));
    int32_t faces = 0, vertices = 0, count = 0;
    if (!face || !vertex || !piece) return TXM_OUT_OF_MEMORY;
    for (int32_t i = 0; i < s->component_count; i++)
        piece[i] = pieces[i].is_dropped ? -1 : count++;
    for (int32_t f = 0; f < s->face_count; f++)
        face[f] = piece[s->component[f]] < 0 ? -1 : faces++;
    for (int32_t v = 0; v < s->vertex_count; v++)
        vertex[v] = face[s->corner[v] / 3] < 0 ? -1 : vertices++;
    for (int32_t v = 0; v < s->vertex_count; v++) { /* downwards only: nothing is overwritten early */
        const int32_t to = vertex[v];
        if (to < 0) continue;
        s->point[to] = s->point[v];
        s->vertex_normal[to] = s->vertex_normal[v];
        s->corner[to] = 3 * face[s->corner[v] / 3] + s->corner[v] % 3;
        if (s->scale) s->scale[to] = s->scale[v];
    }
    for (int32_t f = 0; f < s->face_count; f++) {
        const int32_t to = face[f];
        if (to < 0) continue;
        for (int32_t k = 0; k < 3; k++) {
            const int32_t o = s->opposite[3 * f + k];
            s->vertex[3 * to + k] = vertex[s->vertex[3 * f + k]];
            s->opposite[3 * to + k] = o < 0 ? -1 : 3 * face[o / 3] + o % 3;
            if (s->section) s->section[3 * to + k] = s->section[3 * f + k];
        }
        s->normal[to] = s->normal[f];
        s->component[to] = piece[s->component[f]];
        s->origin[to] = s->origin[f];
        s->turn[to] = s->turn[f];
    }
    for (int32_t i = 0; i < s->component_count; i++) {
        const tmr_piece *p = pieces + i;
        if (!p->is_dropped) continue;
        s->volume -= p->volume;
        report->dropped++;
        report->dropped_area += p->area / s->area;
        report->euler -= (long)floor(p->euler + 0.5);
        report->loops -= (size_t)p->loops;
    }
    s->area *= 1 - report->dropped_area;
    s->border_count = 0;
    for (int32_t c = 0; c < 3 * faces; c++) s->border_count += s->opposite[c] < 0;
    s->loop_count = (int32_t)report->loops;
    s->face_count = faces;
    s->vertex_count = vertices;
    s->component_count = count;
    report->components = (size_t)count;
    report->vertices = (size_t)vertices;
    report->triangles = (size_t)faces;
    return TXM_OK;
}

/* Drop the pieces below the caller's share of the area, and crumbs.

   vertices  of the result
   again     non-zero: this was done before; only count
   least     receives how many vertices the others need at least
   dropped   receives non-zero if any was dropped: then the lines must be built again         */
static txm_status tmr_settle_pieces(tmr_surface *s, const tmr_lines *l, const trimesh_desc *desc,
                                    double vertices, trimesh_report *report, txm_arena *scratch,
                                    int again, double *least, int *dropped) {
    tmr_piece *pieces =
        (tmr_piece *)txm_arena_alloc(scratch, (size_t)s->component_count, sizeof(tmr_piece));
    double all = 0;
    int32_t largest = 0;
    if (!pieces) return TXM_OUT_OF_MEMORY;
    txm_status status = tmr_measure_pieces(s, l, pieces, scratch);
    if (status != TXM_OK) return status;
    for (int32_t i = 0; i < s->component_count; i++)
        if (pieces[i].area > pieces[largest].area) largest = i;
    for (int32_t i = 0; i < s->component_count; i++) { /* one is always kept */
        pieces[i].is_dropped = !again && i != largest && pieces[i].area < desc->drop_below * s->area;
        all += pieces[i].is_dropped ? 0 : pieces[i].weight;
    }
    if (!again) status = tmr_choose_crumbs(s, vertices, all, pieces, scratch);
    if (status != TXM_OK) return status;
    *least = 0;
    *dropped = 0;
    for (int32_t i = 0; i < s->component_count; i++) {
        *least += pieces[i].is_dropped ? 0 : pieces[i].least;
        *dropped |= pieces[i].is_dropped;
    }
    return *dropped ? tmr_drop_pieces(s, pieces, report, scratch) : TXM_OK;
}

/* Find the lines; drop pieces, and then find them again. vertices: of the result; spacing: as
   tmr_lines_build has it. least: receives how many vertices the pieces that are left need. */
static txm_status tmr_settle_lines(tmr_surface *s, const trimesh_desc *desc, double vertices,
                                   double angle, double spacing, txm_arena *arena,
                                   txm_arena *scratch, trimesh_report *report, tmr_lines *l,
                                   double *least) {
    int dropped = 1;
    for (int round = 0; dropped && round < 2; round++) {
        txm_status status =
            tmr_lines_build(s, desc, angle, spacing, arena, scratch, report, l);
        if (status == TXM_OK)
            status = tmr_settle_pieces(s, l, desc, vertices, report, scratch, round, least, &dropped);
        if (status != TXM_OK) return status;
    }
    return TXM_OK;
}

#endif /* TRIMESH_RELAX_PIECES_H */
