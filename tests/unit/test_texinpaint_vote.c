/* test_texinpaint_vote.c - tensor voting against cases whose answer is known
   SPDX-License-Identifier: MIT OR Unlicense

   make build/tests/unit/test_texinpaint_vote && build/tests/unit/test_texinpaint_vote */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "texinpaint/vote.h"

#include "testkit.h"

static const double pi = 3.14159265358979323846;

static double uniform(txm_rng *rng) {
    return 2 * txm_rng_double(rng) - 1;
}

static txm_dvec3 random_unit(txm_rng *rng) {
    for (;;) {
        const txm_dvec3 v = txm_d3(uniform(rng), uniform(rng), uniform(rng));
        const double n = txm_d3_len(v);
        if (n > 0.1 && n < 1) return txm_d3_scale(v, 1 / n);
    }
}

/* ---- the fields -------------------------------------------------------------------------- */

static void test_stick_is_tangent_to_circles(void **state) {
    (void)state;
    txi_fields f;
    txi_fields_make(&f, 10, 1);
    for (int i = 1; i < 44; i++) {
        /* a circle of radius r through the origin, its normal there z; the point at angle 2 a      */
        const double a = pi * i / 180, r = 8;
        const txm_dvec3 p = txm_d3(r * sin(2 * a), 0, r * (1 - cos(2 * a)));
        const txm_dvec3 normal = txm_d3(-sin(2 * a), 0, cos(2 * a));
        double t[6] = {0}, value[3], e[3][3];
        txi_vote_stick(&f, txm_d3(0, 0, 1), p, 1, t);
        if (txm_d3_len(p) > f.reach) continue;
        assert_int_equal(txm_eigen3(t, value, e), TXM_OK);
        assert_true(fabs(e[0][0] * normal.x + e[0][2] * normal.z) > 1 - 1e-9);
        /* the decay over the arc's length and curvature                                          */
        const double s = 2 * a * r, d = exp(-(s * s + f.c / r / r) / (f.sigma * f.sigma));
        assert_true(fabs(value[0] - d) < 1e-6);
        assert_true(fabs(value[1]) < 1e-9 && fabs(value[2]) < 1e-9);
    }
    double t[6] = {0}; /* nothing beyond 45 degrees, nor at the stick itself                       */
    txi_vote_stick(&f, txm_d3(0, 0, 1), txm_d3(2, 0, 2.1), 1, t);
    txi_vote_stick(&f, txm_d3(0, 0, 1), txm_d3(0, 0, 0), 1, t);
    for (int i = 0; i < 6; i++) assert_true(t[i] == 0);
}

/* Plates and balls are integrals of sticks: compare the tables with many random sticks. */
static void test_plate_and_ball_are_integrals(void **state) {
    (void)state;
    txi_fields f;
    txm_rng rng = txm_rng_make(3, 0);
    txi_fields_make(&f, 8, 1);
    for (int i = 0; i < 12; i++) {
        const txm_dvec3 tangent = random_unit(&rng), v = txm_d3_scale(random_unit(&rng), 1 + i);
        double plate[6] = {0}, ball[6] = {0}, sum[2][6] = {{0}};
        const int sticks = 60000;
        txi_vote_plate(&f, tangent, v, 1, plate);
        txi_vote_ball(&f, v, 1, ball);
        for (int k = 0; k < sticks; k++) {
            const txm_dvec3 n = random_unit(&rng);
            /* across the tangent: an even circle                                                 */
            const txm_dvec3 a = txm_d3_unit(txm_d3_cross(tangent, v)), b = txm_d3_cross(tangent, a);
            const double angle = pi * (k + 0.5) / sticks;
            txi_vote_stick(&f, txm_d3_mad(txm_d3_scale(a, cos(angle)), b, sin(angle)), v, 2.0 / sticks,
                           sum[0]);
            txi_vote_stick(&f, n, v, 3.0 / sticks, sum[1]);
        }
        for (int k = 0; k < 6; k++) {
            assert_true(fabs(plate[k] - sum[0][k]) < 0.02);
            assert_true(fabs(ball[k] - sum[1][k]) < 0.02);
        }
    }
}

/* A vote turns with the tokens: no direction of space is special. */
static void test_votes_turn(void **state) {
    (void)state;
    txi_fields f;
    txm_rng rng = txm_rng_make(4, 0);
    txi_fields_make(&f, 8, 1);
    for (int i = 0; i < 200; i++) {
        const txm_dvec3 x = random_unit(&rng), y = txm_d3_unit(txm_d3_cross(x, random_unit(&rng)));
        const txm_dvec3 z = txm_d3_cross(x, y), v = txm_d3_scale(random_unit(&rng), 1 + 0.05 * i);
        const txm_dvec3 w = txm_d3_add(txm_d3_add(txm_d3_scale(x, v.x), txm_d3_scale(y, v.y)),
                                       txm_d3_scale(z, v.z));
        double a[6] = {0}, b[6] = {0}, va[3], vb[3], ea[3][3], eb[3][3];
        txi_vote_plate(&f, txm_d3(1, 0, 0), v, 1, a);
        txi_vote_plate(&f, x, w, 1, b);
        txi_vote_stick(&f, txm_d3(0, 1, 0), v, 1, a);
        txi_vote_stick(&f, y, w, 1, b);
        txm_eigen3(a, va, ea);
        txm_eigen3(b, vb, eb);
        for (int k = 0; k < 3; k++) assert_true(fabs(va[k] - vb[k]) < 1e-9);
        const txm_dvec3 e = txm_d3_add(
            txm_d3_add(txm_d3_scale(x, ea[0][0]), txm_d3_scale(y, ea[0][1])), txm_d3_scale(z, ea[0][2]));
        if (va[0] - va[1] > 1e-3)
            assert_true(fabs(e.x * eb[0][0] + e.y * eb[0][1] + e.z * eb[0][2]) > 1 - 1e-6);
    }
}

/* ---- shapes ------------------------------------------------------------------------------ */

enum { POINTS = 1200 };

typedef struct shape {
    txm_arena arena;
    txi_tokens tokens;
    double scratch[6 * POINTS];
} shape;

static shape *shape_make(double reach) {
    shape *s = (shape *)malloc(sizeof *s);
    txm_arena_init(&s->arena, NULL);
    assert_int_equal(txi_tokens_make(&s->tokens, POINTS, reach, &s->arena, NULL), TXM_OK);
    return s;
}

static void shape_add(shape *s, txm_dvec3 p) {
    static const double unit[6] = {1, 0, 0, 1, 0, 1};
    txi_tokens_add(&s->tokens, p, unit);
}

static void shape_free(shape *s) {
    txm_arena_free(&s->arena);
    free(s);
}

/* two rounds: balls, then what they have become */
static void shape_vote(shape *s, const txi_fields *f) {
    txi_vote_sparse(f, &s->tokens, 1, NULL, s->scratch);
    txi_vote_sparse(f, &s->tokens, 0, NULL, s->scratch);
}

static void test_line(void **state) {
    (void)state;
    txi_fields f;
    txm_rng rng = txm_rng_make(5, 0);
    txi_fields_make(&f, 6, 1);
    shape *s = shape_make(f.reach);
    const txm_dvec3 d = txm_d3_unit(txm_d3(1, 2, -0.5));
    for (int i = 0; i < 100; i++) shape_add(s, txm_d3_scale(d, i));
    for (int i = 0; i < 100; i++) /* as many outliers                                             */
        shape_add(s, txm_d3(50 + 50 * uniform(&rng), 90 + 50 * uniform(&rng), 50 * uniform(&rng)));
    shape_vote(s, &f);
    double line = 0, noise = 0;
    for (int i = 0; i < 200; i++) {
        const txi_token *k = &s->tokens.at[i];
        if (i < 100) {
            assert_true(fabs(txm_d3_dot(k->tangent, d)) > 0.999);
            assert_true(k->plate > 3 * k->stick && k->plate > 3 * k->ball);
            line += k->plate;
        } else {
            noise += k->plate;
        }
    }
    assert_true(line > 10 * noise);
    shape_free(s);
}

static void test_circle(void **state) {
    (void)state;
    txi_fields f;
    txi_fields_make(&f, 6, 1);
    shape *s = shape_make(f.reach);
    const txm_dvec3 x = txm_d3_unit(txm_d3(1, 1, 1)), y = txm_d3_unit(txm_d3(1, -1, 0));
    for (int i = 0; i < 190; i++) {
        const double a = 2 * pi * i / 190;
        shape_add(s, txm_d3_mad(txm_d3_scale(x, 30 * cos(a)), y, 30 * sin(a)));
    }
    shape_vote(s, &f);
    for (int i = 0; i < 190; i++) {
        const double a = 2 * pi * i / 190;
        const txm_dvec3 t = txm_d3_mad(txm_d3_scale(x, -sin(a)), y, cos(a));
        assert_true(fabs(txm_d3_dot(s->tokens.at[i].tangent, t)) > 0.999);
        assert_true(s->tokens.at[i].plate > s->tokens.at[i].stick);
    }
    /* a dense vote in a gap of the circle has the circle's direction, and is strongest on it      */
    shape *gap = shape_make(f.reach);
    for (int i = 6; i < 184; i++) shape_add(gap, s->tokens.at[i].place);
    shape_vote(gap, &f);
    double on[6], off[6];
    txi_token here, beside;
    txi_votes_at(&f, &gap->tokens, txm_d3_scale(x, 30), 0, on);
    txi_votes_at(&f, &gap->tokens, txm_d3_scale(x, 33), 0, off);
    txi_token_set(&here, on);
    txi_token_set(&beside, off);
    assert_true(fabs(txm_d3_dot(here.tangent, y)) > 0.999);
    assert_true(here.plate > 1.2 * beside.plate);
    shape_free(gap);
    shape_free(s);
}

static void test_plane_and_sphere(void **state) {
    (void)state;
    txi_fields f;
    txm_rng rng = txm_rng_make(6, 0);
    txi_fields_make(&f, 6, 1);
    shape *plane = shape_make(f.reach), *sphere = shape_make(f.reach);
    const txm_dvec3 n = txm_d3_unit(txm_d3(1, 2, 3)), x = txm_d3_unit(txm_d3(2, -1, 0));
    const txm_dvec3 y = txm_d3_cross(n, x);
    for (int i = 0; i < 400; i++) {
        shape_add(plane, txm_d3_mad(txm_d3_scale(x, 2 * (i % 20) + 0.4 * uniform(&rng)), y,
                                    2 * (i / 20) + 0.4 * uniform(&rng)));
    }
    for (int i = 0; i < 60; i++)
        shape_add(plane, txm_d3(40 * uniform(&rng), 40 * uniform(&rng), 40 * uniform(&rng)));
    shape_vote(plane, &f);
    for (int i = 0; i < 400; i++) {
        const txi_token *k = &plane->tokens.at[i];
        if (i % 20 < 2 || i % 20 > 17 || i < 40 || i >= 360) continue; /* the rim is half a line    */
        assert_true(fabs(txm_d3_dot(k->normal, n)) > 0.97);
        assert_true(k->stick > 1.2 * k->plate && k->stick > 1.2 * k->ball);
    }
    for (int i = 0; i < 1000; i++) { /* an even spiral over the sphere                              */
        const double z = 1 - (2 * i + 1) / 1000.0, r = sqrt(1 - z * z), a = 2.399963 * i;
        shape_add(sphere, txm_d3(25 * r * cos(a), 25 * r * sin(a), 25 * z));
    }
    shape_vote(sphere, &f);
    for (int i = 0; i < 1000; i++) {
        const txi_token *k = &sphere->tokens.at[i];
        assert_true(fabs(txm_d3_dot(k->normal, txm_d3_unit(k->place))) > 0.98);
        assert_true(k->stick > k->plate && k->stick > k->ball);
    }
    shape_free(plane);
    shape_free(sphere);
}

/* Three lines at right angles: nearly a ball where they meet, plates along them. */
static void test_junction(void **state) {
    (void)state;
    txi_fields f;
    txm_rng rng = txm_rng_make(7, 0);
    txi_fields_make(&f, 5, 1);
    shape *s = shape_make(f.reach);
    for (int i = -30; i <= 30; i++) {
        if (i == 0) continue;
        shape_add(s, txm_d3(i, 0, 0));
        shape_add(s, txm_d3(0, i, 0));
        shape_add(s, txm_d3(0, 0, i));
    }
    for (int i = 0; i < 60; i++)
        shape_add(s, txm_d3(30 * uniform(&rng), 30 * uniform(&rng), 30 * uniform(&rng)));
    shape_vote(s, &f);
    double middle[6], arm[6];
    txi_token junction, line;
    txi_votes_at(&f, &s->tokens, txm_d3(0, 0, 0), 0, middle);
    txi_votes_at(&f, &s->tokens, txm_d3(20.5, 0, 0), 0, arm);
    txi_token_set(&junction, middle);
    txi_token_set(&line, arm);
    assert_true(junction.ball > 4 * (junction.stick + junction.plate));
    assert_true(junction.ball > 4 * line.ball);
    assert_true(line.plate > 3 * line.stick && fabs(line.tangent.x) > 0.99);
    shape_free(s);
}

/* A great circle of a sphere: with the surface as a constraint the
   tangent lies in the surface, and votes are strongest along the circle, also into a gap. */
static void test_on_surface(void **state) {
    (void)state;
    txi_fields f;
    txi_fields_make(&f, 6, 1);
    shape *s = shape_make(f.reach);
    txm_dvec3 normals[POINTS];
    double t[6], off[6];
    txi_token k, beside;
    for (int i = 6; i < 240; i++) {
        const double a = 2 * pi * i / 250;
        shape_add(s, txm_d3(40 * cos(a), 40 * sin(a), 0));
    }
    for (int i = 0; i < s->tokens.count; i++) normals[i] = txm_d3_unit(s->tokens.at[i].place);
    for (int round = 0; round < 2; round++) {
        txi_vote_sparse(&f, &s->tokens, round == 0, normals, s->scratch);
        for (int i = 0; i < s->tokens.count; i++) {
            const txi_token *o = &s->tokens.at[i];
            assert_true(fabs(o->normal.z) > 0.999); /* across the line, within the surface         */
            assert_true(o->stick > (round ? 4 : 1) * (o->plate + o->ball));
        }
    }
    txi_votes_at(&f, &s->tokens, txm_d3(40, 0, 0), 0, t);
    txi_votes_at(&f, &s->tokens, txm_d3(40 * cos(0.1), 0, 40 * sin(0.1)), 0, off);
    txi_onto_surface(t, txm_d3(1, 0, 0));
    txi_onto_surface(off, txm_d3(cos(0.1), 0, sin(0.1)));
    txi_token_set(&k, t);
    txi_token_set(&beside, off);
    assert_true(fabs(k.normal.z) > 0.999);
    assert_true(k.stick > 1.3 * beside.stick);
    shape_free(s);
}

static txm_status make_tokens(void *context, txm_env *env) {
    txm_arena arena;
    txi_tokens tokens;
    (void)context;
    txm_arena_init(&arena, env);
    const txm_status status = txi_tokens_make(&tokens, 10, 5, &arena, env);
    txm_arena_free(&arena);
    return status;
}

static void test_failed_allocations(void **state) {
    (void)state;
    assert_true(tk_sweep(make_tokens, NULL, TK_ALLOCATION) >= 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stick_is_tangent_to_circles),
        cmocka_unit_test(test_plate_and_ball_are_integrals),
        cmocka_unit_test(test_votes_turn),
        cmocka_unit_test(test_line),
        cmocka_unit_test(test_circle),
        cmocka_unit_test(test_plane_and_sphere),
        cmocka_unit_test(test_junction),
        cmocka_unit_test(test_on_surface),
        cmocka_unit_test(test_failed_allocations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
