/* test_trimesh_defects.c - trials that are taken back, and dislocations of a lattice that cancel
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define TRIMESH_RELAX_STATIC
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"
#include "testkit.h"

enum { SIDE = 20, MOST = SIDE * SIDE };

/* ---- a sheet of equilateral triangles, ready to be worked on ---------------------------------- */

static float at[3 * MOST];
static uint32_t triangles[6 * MOST];
static trimesh_desc desc;
static txm_env env;
static trimesh_job *job;
static txm_arena arena, scratch;

static tmr_work *begin_sheet(void) {
    float *p = at;
    uint32_t *t = triangles;
    for (int j = 0; j < SIDE; j++) {
        for (int i = 0; i < SIDE; i++) {
            *p++ = (float)(i + 0.5 * j);
            *p++ = (float)(j * sqrt(0.75));
            *p++ = 0;
        }
    }
    for (uint32_t j = 0; j + 1 < SIDE; j++) {
        for (uint32_t i = 0; i + 1 < SIDE; i++) {
            const uint32_t a = j * SIDE + i, b = a + 1, c = a + SIDE, d = c + 1;
            const uint32_t both[6] = {a, b, c, b, d, c};
            for (int k = 0; k < 6; k++) *t++ = both[k];
        }
    }
    memset(&desc, 0, sizeof desc);
    desc.surface.positions = at;
    desc.surface.indices = triangles;
    desc.surface.vertex_count = MOST;
    desc.surface.face_count = (size_t)(t - triangles) / 3;
    desc.vertices = MOST;
    env = tk_env(NULL, NULL);
    assert_int_equal(trimesh_begin(&desc, &env, &job), TXM_OK);
    assert_int_equal(trimesh_step(job, &env, NULL), TXM_OK); /* mends it and finds the lines */
    txm_arena_init(&arena, &job->env);
    txm_arena_init(&scratch, &job->env);
    assert_int_equal(tmr_copy_surface(&job->w, 100, &arena), TXM_OK);
    tmr_work *w = &job->w;
    w->pull = w->step = 1;
    w->length = tmr_ideal_length(w);
    memset(w->bad, 0, (size_t)w->m.vertex_limit);
    memset(w->flag, 0, (size_t)w->m.face_limit);
    return w;
}

static void end_sheet(void) {
    txm_arena_free(&arena);
    txm_arena_free(&scratch);
    trimesh_free(job);
}

static int32_t vertex_at(const tmr_work *w, int i, int j) {
    const float *p = at + 3 * (j * SIDE + i);
    int32_t best = 0;
    double least = -1;
    for (int32_t v = 0; v < w->m.vertex_count; v++) {
        if (tmr_is_ghost(&w->m, v)) continue;
        const txm_dvec3 q = txm_d3_add(txm_d3_scale(w->m.p[v], w->s->diagonal), w->s->centre);
        const double d = txm_d3_dist2(q, txm_d3(p[0], p[1], p[2]));
        if (least >= 0 && d >= least) continue;
        least = d;
        best = v;
    }
    return best;
}

static int inner_defects(const tmr_work *w) {
    int count = 0;
    for (int32_t v = 0; v < w->m.vertex_count; v++) {
        if (w->m.corner[v] < 0 || tmr_is_ghost(&w->m, v)) continue;
        count += tmr_kind_of(&w->m, v) == TRIMESH_FREE && w->m.valence[v] != 6;
    }
    return count;
}

/* ---- trials ------------------------------------------------------------------------------------ */

typedef struct whole {
    txm_dvec3 p[MOST + 200];
    int32_t source[MOST + 200], corner[MOST + 200], valence[MOST + 200];
    int32_t vertex[6 * MOST + 900], opposite[6 * MOST + 900], edge[6 * MOST + 900];
    int32_t counts[4];
} whole;

static void copy_whole(const tmr_mesh *m, whole *to) {
    const size_t n = (size_t)m->vertex_count, c = 3 * (size_t)m->face_count;
    assert_true(n <= MOST + 200 && c <= 6 * MOST + 900);
    memset(to, 0, sizeof *to);
    memcpy(to->p, m->p, n * sizeof m->p[0]);
    memcpy(to->source, m->source, n * sizeof(int32_t));
    memcpy(to->corner, m->corner, n * sizeof(int32_t));
    memcpy(to->valence, m->valence, n * sizeof(int32_t));
    memcpy(to->vertex, m->vertex, c * sizeof(int32_t));
    memcpy(to->opposite, m->opposite, c * sizeof(int32_t));
    memcpy(to->edge, m->edge, c * sizeof(int32_t));
    to->counts[0] = m->live;
    to->counts[1] = m->live_faces;
    to->counts[2] = m->vertex_count;
    to->counts[3] = m->face_count;
}

/* On a sheet that is perfect every step makes things worse: all are taken back, and then the mesh is
   what it was, to the bit. */
static void test_taken_back(void **state) {
    static whole before, after;
    static tmr_patch patch;
    int tried[3] = {0, 0, 0};
    (void)state;
    tmr_work *w = begin_sheet();
    tmr_mesh *m = &w->m;
    copy_whole(m, &before);
    for (int32_t c = 0; c < 3 * m->face_count; c++) {
        if (!tmr_is_real_edge(m, c) || m->edge[c]) continue;
        if (tmr_is_ghost(m, m->vertex[c]) || tmr_is_ghost(m, m->vertex[m->opposite[c]])) continue;
        for (int kind = 0; kind < 3; kind++) {
            int done = 0;
            assert_true(tmr_patch_keep(w, &patch, c));
            if (kind == 0 && tmr_can_flip(m, c)) {
                tmr_flip(m, c);
                done = 1;
            } else if (kind == 1) {
                done = tmr_try_collapse(w, c, 0, 1);
            } else if (kind == 2) {
                patch.added = tmr_split_edge(w, c);
                done = patch.added >= 0;
            }
            if (!done) continue;
            tried[kind]++;
            assert_int_equal(tmr_patch_judge(w, &patch, 0), 0);
            copy_whole(m, &after);
            assert_memory_equal(&before, &after, sizeof before);
        }
    }
    for (int32_t v = 0; v < m->vertex_limit; v++) assert_int_equal(w->bad[v], 0);
    for (int32_t f = 0; f < m->face_limit; f++) assert_int_equal(w->flag[f], 0);
    for (int kind = 0; kind < 3; kind++) assert_true(tried[kind] > MOST);
    end_sheet();
}

/* ---- dislocations ------------------------------------------------------------------------------ */

/* Flip the edges between two rows from i = 8 on: what is above has slipped by one along them, and at
   either end there is a vertex of valence five beside one of seven. They glide back together. */
static void test_pair_cancels(void **state) {
    (void)state;
    for (int length = 1; length <= 4; length++) {
        tmr_work *w = begin_sheet();
        assert_int_equal(inner_defects(w), 0);
        for (int k = 0; k < length; k++) {
            const int32_t c = tmr_find_edge(&w->m, vertex_at(w, 8 + k, 9), vertex_at(w, 7 + k, 10));
            assert_true(c >= 0);
            tmr_flip(&w->m, tmr_prev(c));
        }
        assert_int_equal(inner_defects(w), 4);
        for (int k = 0; k < 10; k++) tmr_relax(w);
        assert_int_equal(tmr_mend_defects(w, MOST, &scratch), TXM_OK);
        assert_int_equal(inner_defects(w), 0);
        assert_int_equal(w->m.live, MOST);
        end_sheet();
    }
}

/* A vertex too many, and one too few: both go, where the number that is wanted says so. */
static void test_number(void **state) {
    (void)state;
    for (int extra = 0; extra < 2; extra++) {
        tmr_work *w = begin_sheet();
        const int32_t c = tmr_find_edge(&w->m, vertex_at(w, 9, 9), vertex_at(w, 10, 9));
        if (extra) assert_true(tmr_split_edge(w, tmr_prev(c)) >= 0);
        else assert_true(tmr_try_collapse(w, tmr_prev(c), 0, 1));
        tmr_flip_valences(w, 3, 0.3);
        for (int k = 0; k < 10; k++) tmr_relax(w);
        const int before = inner_defects(w);
        assert_true(before > 0);
        assert_int_equal(tmr_mend_defects(w, MOST, &scratch), TXM_OK);
        print_message("# %s vertex: %d defects, then %d; %d vertices\n", extra ? "one more" : "one less",
                      before, inner_defects(w), (int)w->m.live);
        assert_int_equal(inner_defects(w), 0);
        assert_int_equal(w->m.live, MOST);
        end_sheet();
    }
}

/* ---- slivers ----------------------------------------------------------------------------------- */

static int slivers_of(const tmr_work *w) {
    int count = 0;
    for (int32_t f = 0; f < w->m.face_count; f++) count += tmr_is_sliver(w, f);
    return count;
}

/* A vertex right beside another one: it goes, or a flip lets it move away. */
static void test_slivers(void **state) {
    (void)state;
    for (int count_too = 0; count_too < 2; count_too++) {
        tmr_work *w = begin_sheet();
        const int32_t a = vertex_at(w, 9, 9), b = vertex_at(w, 10, 9);
        const int32_t v = tmr_split_edge(w, tmr_prev(tmr_find_edge(&w->m, a, b)));
        assert_true(v >= 0);
        assert_int_equal(slivers_of(w), 4);
        w->m.p[v] = txm_d3_mad(w->m.p[a], txm_d3_sub(w->m.p[b], w->m.p[a]), 0.05);
        assert_int_equal(slivers_of(w), 2);
        assert_int_equal(tmr_mend_slivers(w, count_too, &scratch), TXM_OK);
        assert_true(slivers_of(w) <= (count_too ? 0 : 2));
        if (!count_too) assert_int_equal(w->m.live, MOST + 1);
        end_sheet();
    }
}

/* The vertex that is missing is put in where one was taken out. */
static void test_missing(void **state) {
    (void)state;
    tmr_work *w = begin_sheet();
    const int32_t c = tmr_find_edge(&w->m, vertex_at(w, 9, 9), vertex_at(w, 10, 9));
    assert_true(tmr_try_collapse(w, tmr_prev(c), 0, 1));
    tmr_flip_valences(w, 3, 0.3);
    for (int k = 0; k < 10; k++) tmr_relax(w);
    assert_int_equal(w->m.live, MOST - 1);
    assert_int_equal(inner_defects(w), 4);
    assert_int_equal(tmr_count_beside_defects(w, MOST, &scratch), TXM_OK);
    assert_int_equal(w->m.live, MOST);
    end_sheet();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_taken_back),
        cmocka_unit_test(test_pair_cancels),
        cmocka_unit_test(test_number),
        cmocka_unit_test(test_slivers),
        cmocka_unit_test(test_missing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
