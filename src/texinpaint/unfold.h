#ifndef TEXINPAINT_UNFOLD_H
#define TEXINPAINT_UNFOLD_H

#include "geodesic.h"

/* ---- unfold: a disk of faces ----------------------------------------------------------------- */

/* ours, radians: a disk that has more curvature than this is slit, from there to its border */
#define TXI_BEND 0.8

/* Faces that form a topological disk, glued along their sides. A vertex of the surface that the
   disk meets from several parts of its border has a copy in each. */
typedef struct txi_disk {
    uint32_t *faces;        /* of the surface                                                    */
    size_t face_count, room;
    uint32_t *corner;       /* 3 per face: its vertices, of the disk; while it grows, to be resolved
                               by txi_root                                                       */
    uint32_t *grown_from;   /* 1 per face: the face that it was added to; the first: itself      */
    size_t vertex_count;
    uint32_t *parent;       /* while it grows: vertices that are one                             */
    uint32_t *next, *prev;  /* the loop of sides that are the border; side k of face i is 3 i + k */
    uint8_t *is_border;     /* 1 per side                                                        */
    size_t loop;            /* sides of the border                                               */
    uint32_t border;        /* one of them                                                       */
    uint32_t *slot;         /* 1 per face of the surface: its place in faces, or TXI_NO_FACE     */
    double bend;            /* curvature within the disk, in radians, since it was last slit      */
    const double *depth;    /* 1 per vertex of the surface: it may be slit where this is above
                               slit_from; NULL: nowhere                                          */
    double slit_from;
} txi_disk;

/* Room for so many faces. */
static txm_status txi_disk_init(txi_disk *disk, const txi_surface *s, size_t room, txm_arena *arena,
                                txm_env *env) {
    memset(disk, 0, sizeof *disk);
    disk->room = room;
    disk->faces = (uint32_t *)txm_arena_alloc(arena, room, sizeof(uint32_t));
    disk->corner = (uint32_t *)txm_arena_alloc(arena, room, 3 * sizeof(uint32_t));
    disk->grown_from = (uint32_t *)txm_arena_alloc(arena, room, sizeof(uint32_t));
    disk->parent = (uint32_t *)txm_arena_alloc(arena, room + 2, sizeof(uint32_t));
    disk->next = (uint32_t *)txm_arena_alloc(arena, room, 3 * sizeof(uint32_t));
    disk->prev = (uint32_t *)txm_arena_alloc(arena, room, 3 * sizeof(uint32_t));
    disk->is_border = (uint8_t *)txm_arena_zero(arena, room, 3);
    disk->slot = (uint32_t *)txm_arena_alloc(arena, s->face_count, sizeof(uint32_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t f = 0; f < s->face_count; f++) disk->slot[f] = TXI_NO_FACE;
    return TXM_OK;
}

static uint32_t txi_new_vertex(txi_disk *disk) {
    disk->parent[disk->vertex_count] = (uint32_t)disk->vertex_count;
    return (uint32_t)disk->vertex_count++;
}

/* the side of the disk that this side of the surface is, TXM_NO_SIDE if its face is not in the
   disk */
static uint32_t txi_disk_side(const txi_disk *disk, uint32_t side) {
    if (side == TXM_NO_SIDE || disk->slot[side / 3] == TXI_NO_FACE) return TXM_NO_SIDE;
    return 3 * disk->slot[side / 3] + side % 3;
}
/* the side of the surface that this side of the disk is */
static uint32_t txi_surface_side(const txi_disk *disk, uint32_t side) {
    return 3 * disk->faces[side / 3] + side % 3;
}

static void txi_disk_link(txi_disk *disk, uint32_t side, uint32_t next) {
    disk->next[side] = next;
    disk->prev[next] = side;
}

/* The first face. */
static void txi_disk_begin(txi_disk *disk, uint32_t face) {
    disk->faces[0] = face;
    disk->grown_from[0] = 0;
    disk->slot[face] = 0;
    disk->face_count = 1;
    disk->loop = 3;
    disk->border = 0;
    for (uint32_t k = 0; k < 3; k++) {
        disk->corner[k] = txi_new_vertex(disk);
        disk->is_border[k] = 1;
        txi_disk_link(disk, k, (k + 1) % 3);
    }
}

/* The angle of the vector (x, y), y at least 0: 0 to pi. With tan(a / 2) = y / (r + x), halved
   twice more, then Taylor; only operations that give the same bits everywhere. */
static double txi_angle(double x, double y) {
    const double r = sqrt(x * x + y * y);
    if (!(r > 0) || (x < 0 && y <= -x * 1e-9)) return r > 0 ? TXM_PI : 0;
    double t = y / (r + x), turns = 2;
    for (; turns < 16 || t > 0.2; turns *= 2) t /= 1 + sqrt(1 + t * t);
    const double tt = t * t;
    return turns * t *
           (1 - tt * (1.0 / 3 - tt * (1.0 / 5 - tt * (1.0 / 7 - tt * (1.0 / 9 - tt / 11)))));
}

/* The curvature at a vertex of the surface: what the angles of its faces lack to a full turn. */
static double txi_angle_lack(const txi_surface *s, uint32_t vertex) {
    double sum = 2 * TXM_PI;
    for (uint32_t i = s->first[vertex]; i < s->first[vertex + 1]; i++) {
        const uint32_t c = s->corners[i], p = txi_next_corner(c), q = txi_next_corner(p);
        const txm_dvec3 a = txm_d3_sub(txi_corner_point(s, p), txi_corner_point(s, c));
        const txm_dvec3 b = txm_d3_sub(txi_corner_point(s, q), txi_corner_point(s, c));
        if (txi_is_flat_face(s, c / 3)) continue;
        sum -= txi_angle(txm_d3_dot(a, b), txm_d3_len(txm_d3_cross(a, b)));
    }
    return sum;
}

/* A vertex is about to come to lie within the disk. Should the disk stay slit there, as it has
   become too curved to lie flat? */
static int txi_disk_slits(txi_disk *disk, const txi_surface *s, uint32_t vertex) {
    disk->bend += txi_angle_lack(s, vertex);
    if (!disk->depth || disk->depth[vertex] <= disk->slit_from || fabs(disk->bend) < TXI_BEND)
        return 0;
    disk->bend = 0;
    return 1;
}

/* Glue the border's side with the next one as long as they are the two sides of one edge, then the
   sides before and behind them, and so on. At least three sides stay. */
static void txi_disk_zip(txi_disk *disk, const txi_surface *s, uint32_t side) {
    while (disk->loop >= 5) {
        const uint32_t other = disk->next[side], before = disk->prev[side],
                       behind = disk->next[other];
        if (txi_disk_side(disk, s->opposite[txi_surface_side(disk, side)]) != other) return;
        if (txi_disk_slits(disk, s, s->vertex[txi_surface_side(disk, other)])) return;
        txi_join_sets(disk->parent, disk->corner[side], disk->corner[txi_next_corner(other)]);
        disk->is_border[side] = disk->is_border[other] = 0;
        txi_disk_link(disk, before, behind);
        disk->loop -= 2;
        disk->border = before;
        side = before;
    }
}

/* Add the face beyond a side of the border, which must not be in the disk yet:

           c              The border runs  p, a b, q  before,  p, a c, c b, q  after. Where p and a
                          c
       n1 / \ n2          are the two sides of one edge they are glued, and a lies within; so are c
                          b
         /   \            and q. Where an edge returns to another part of the border it is not: that
    p > a --> b > q       would make a ring. It stays a cut.                                      */
static void txi_disk_add(txi_disk *disk, const txi_surface *s, uint32_t side) {
    const uint32_t o = s->opposite[txi_surface_side(disk, side)];
    const uint32_t i = (uint32_t)disk->face_count++, before = disk->prev[side],
                   behind = disk->next[side];
    const uint32_t base = 3 * i + o % 3, n1 = txi_next_corner(base), n2 = txi_next_corner(n1);
    disk->faces[i] = o / 3;
    disk->grown_from[i] = side / 3;
    disk->slot[o / 3] = i;
    disk->corner[base] = disk->corner[txi_next_corner(side)];
    disk->corner[n1] = disk->corner[side];
    disk->corner[n2] = txi_new_vertex(disk);
    disk->is_border[side] = 0;
    disk->is_border[n1] = disk->is_border[n2] = 1;
    txi_disk_link(disk, before, n1);
    txi_disk_link(disk, n1, n2);
    txi_disk_link(disk, n2, behind);
    disk->loop++;
    disk->border = n1;
    txi_disk_zip(disk, s, n2);
    if (disk->is_border[n1] && disk->is_border[disk->prev[n1]])
        txi_disk_zip(disk, s, disk->prev[n1]);
}

/* Number the vertices from 0 and resolve the corners. point receives one for each. */
static void txi_disk_finish(txi_disk *disk, const txi_surface *s, uint32_t *number,
                            txm_dvec3 *point) {
    uint32_t count = 0;
    for (size_t v = 0; v < disk->vertex_count; v++) number[v] = TXI_NO_FACE;
    for (size_t c = 0; c < 3 * disk->face_count; c++) {
        const uint32_t v = txi_root(disk->parent, disk->corner[c]);
        if (number[v] == TXI_NO_FACE) {
            point[count] = txi_corner_point(s, txi_surface_side(disk, (uint32_t)c));
            number[v] = count++;
        }
        disk->corner[c] = number[v];
    }
    disk->vertex_count = count;
}

/* How far the disk grows. Keys of faces: what lies deeper is added first. */
typedef struct txi_growth {
    const double *key;     /* 1 per face of the surface; faces above stop are not added          */
    double stop;
    const double *size;    /* 1 per face: how much it counts                                     */
    double wanted;         /* beyond stop_least it stops once so much has been added             */
    double stop_least;
    double most;           /* of all faces: stop in any case                                     */
    const double *weight;  /* 1 per face: how much it counts for most                            */
} txi_growth;

/* Grow a disk from a face, always by the face with the least key that touches it. */
static txm_status txi_disk_grow(txi_disk *disk, const txi_surface *s, uint32_t seed,
                                const txi_growth *g, txm_env *env) {
    txm_arena scratch;
    txi_heap heap;
    int good = 1;
    double size = g->size[seed], weight = g->weight[seed];
    memset(&heap, 0, sizeof heap);
    txm_arena_init(&scratch, env);
    txi_disk_begin(disk, seed);
    for (uint32_t at = 0; good && disk->face_count < disk->room;) {
        for (uint32_t side = 3 * at; side < 3 * at + 3 && good; side++) {
            const uint32_t o = s->opposite[txi_surface_side(disk, side)];
            if (o != TXM_NO_SIDE && disk->slot[o / 3] == TXI_NO_FACE)
                good = txi_heap_push(&heap, &scratch, g->key[o / 3], side);
        }
        uint32_t side = TXM_NO_SIDE, face = 0;
        while (heap.count && side == TXM_NO_SIDE) {
            const txi_wait next = txi_heap_pop(&heap);
            face = s->opposite[txi_surface_side(disk, next.vertex)] / 3;
            if (disk->slot[face] == TXI_NO_FACE) side = next.vertex;
        }
        if (side == TXM_NO_SIDE || g->key[face] > g->stop || weight + g->weight[face] > g->most ||
            (g->key[face] > g->stop_least && size >= g->wanted))
            break;
        at = (uint32_t)disk->face_count;
        txi_disk_add(disk, s, side);
        size += g->size[face];
        weight += g->weight[face];
    }
    txm_arena_free(&scratch);
    return good ? TXM_OK : txi_no_memory(env);
}

#endif /* TEXINPAINT_UNFOLD_H */
