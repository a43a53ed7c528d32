#ifndef TRIMESH_RELAX_RENUMBER_H
#define TRIMESH_RELAX_RENUMBER_H

#include "work.h"

/* ---- neighbours side by side in memory ------------------------------------------------------ */

/* Splits and collapses leave triangles all over their arrays, between dead ones. So they are numbered
   anew now and then: breadth-first across their edges, and vertices in the order in which triangles
   come to them, so that what passes over the mesh finds most of it in the cache. */

/* List the live triangles breadth-first; number[f]: the place of triangle f in the list. */
static void tmr_breadth_first(const tmr_mesh *m, int32_t *list, int32_t *number) {
    int32_t count = 0, done = 0;
    for (int32_t f = 0; f < m->face_count; f++) number[f] = -1;
    for (int32_t f = 0; f < m->face_count; f++) {
        if (tmr_is_dead(m, f) || number[f] >= 0) continue;
        TRIMESH_ASSERT(count < m->live_faces);
        number[f] = count;
        list[count++] = f;
        for (; done < count; done++) {
            for (int32_t c = 3 * list[done]; c < 3 * list[done] + 3; c++) {
                const int32_t g = m->opposite[c] / 3;
                if (number[g] >= 0) continue;
                TRIMESH_ASSERT(count < m->live_faces);
                number[g] = count;
                list[count++] = g;
            }
        }
    }
    TRIMESH_ASSERT(count == m->live_faces);
}

/* The triangles in the order of the list; room: 3 per triangle. */
static void tmr_permute_faces(tmr_mesh *m, const int32_t *list, const int32_t *number, int32_t *room) {
    int32_t *const array[3] = {m->vertex, m->opposite, m->edge};
    for (int a = 0; a < 3; a++) {
        for (int32_t f = 0; f < m->live_faces; f++) {
            for (int32_t k = 0; k < 3; k++) {
                const int32_t x = array[a][3 * list[f] + k];
                room[3 * f + k] = a == 1 ? 3 * number[x / 3] + x % 3 : x;
            }
        }
        memcpy(array[a], room, 3 * (size_t)m->live_faces * sizeof(int32_t));
    }
    m->face_count = m->live_faces;
}

/* The vertices in the order in which triangles come to them, those of no triangle left out.
   number, list: scratch, 1 per vertex. Uses w->moved, w->landed and w->mask_room. */
static void tmr_permute_vertices(tmr_work *w, int32_t *number, int32_t *list) {
    tmr_mesh *m = &w->m;
    txm_dvec3 *const place[2] = {m->p, m->n};
    int32_t *const whole[2] = {m->source, m->valence};
    int32_t count = 0;
    for (int32_t v = 0; v < m->vertex_count; v++) number[v] = -1;
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        const int32_t v = m->vertex[c];
        if (number[v] < 0) {
            TRIMESH_ASSERT(count < m->live + m->ghosts);
            number[v] = count;
            list[count++] = v;
        }
        m->vertex[c] = number[v];
    }
    TRIMESH_ASSERT(count == m->live + m->ghosts);
    for (int a = 0; a < 2; a++) {
        for (int32_t v = 0; v < count; v++) w->moved[v] = place[a][list[v]];
        memcpy(place[a], w->moved, (size_t)count * sizeof(txm_dvec3));
        for (int32_t v = 0; v < count; v++) w->landed[v] = whole[a][list[v]];
        memcpy(whole[a], w->landed, (size_t)count * sizeof(int32_t));
    }
    float *const size = (float *)w->moved;
    uint8_t *const flags = w->mask_room;
    for (int32_t v = 0; v < count; v++) {
        size[v] = w->size[list[v]];
        flags[v] = m->flags[list[v]];
    }
    memcpy(w->size, size, (size_t)count * sizeof(float));
    memcpy(m->flags, flags, (size_t)count);
    m->vertex_count = count;
    for (int32_t c = 3 * m->face_count - 1; c >= 0; c--) m->corner[m->vertex[c]] = c;
}

/* Number the mesh anew, without dead slots. Costs O(slots). */
static txm_status tmr_renumber(tmr_work *w) {
    tmr_mesh *m = &w->m;
    const size_t faces = (size_t)m->face_count, vertices = (size_t)m->vertex_count;
    const size_t most = faces > vertices ? faces : vertices;
    txm_arena arena;
    txm_arena_init(&arena, w->env);
    int32_t *number = (int32_t *)txm_arena_alloc(&arena, most, sizeof(int32_t));
    int32_t *list = (int32_t *)txm_arena_alloc(&arena, most, sizeof(int32_t));
    int32_t *room = (int32_t *)txm_arena_alloc(&arena, (size_t)m->live_faces, 3 * sizeof(int32_t));
    const txm_status status = tmr_check_memory(&arena);
    if (status == TXM_OK) {
        tmr_breadth_first(m, list, number);
        tmr_permute_faces(m, list, number, room);
        tmr_permute_vertices(w, number, list);
    }
    txm_arena_free(&arena);
    return status;
}

#endif /* TRIMESH_RELAX_RENUMBER_H */
