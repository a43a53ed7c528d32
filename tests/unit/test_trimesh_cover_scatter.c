/* test_trimesh_cover_scatter.c - trimesh_cover.h: things on triangles, and patches of points for them
   SPDX-License-Identifier: MIT OR Unlicense

   On meshes made here, so that nothing of the retiling itself matters.                          */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_cover.h"
#include "coverkit.h"

/* ---- geometry ---- */

/* Points on every side and corner: each edge and vertex of the mesh shows them once, whatever the
   rotations; the hexagonal patch gives the vertices of the subdivided mesh. */
static void test_owned_once(void **state) {
    enum { STEPS = 4 };
    shape s[3];
    (void)state;
    make_sphere(&s[0], 6);
    make_torus(&s[1], 11, 6, 0.35);
    make_plane(&s[2], 8, 5);
    for (int i = 0; i < 3; i++) {
        const size_t v = s[i].vertices, f = s[i].triangles;
        const size_t border = i == 2 ? 2 * (8 + 5) : 0, e = (3 * f + border) / 2;
        trimesh_patch patch;
        trimesh_scatter_desc d;
        size_t count;
        make_patch(STEPS * STEPS / 2, 1, 0, &patch);
        assert_int_equal(patch.count, (STEPS + 1) * (STEPS + 2) / 2);
        memset(&d, 0, sizeof d);
        d.mesh = s[i].view;
        d.patches = &patch;
        d.patch_count = 1;
        trimesh_instance *out = scatter(&d, NULL, &count);
        assert_int_equal(count, v + e * (STEPS - 1) + f * ((STEPS - 1) * (STEPS - 2) / 2));
        for (size_t a = 0; a < count; a++) { /* no two in one place */
            for (size_t b = 0; b < a; b++) {
                double gap = 0;
                for (int k = 0; k < 3; k++)
                    gap += fabs((double)out[a].position[k] - out[b].position[k]);
                assert_true(gap > 1e-3);
            }
        }
        for (size_t a = 0; a < count; a++) { /* frames: unit quaternions, z the normal */
            const float *q = out[a].rotation, up[3] = {0, 0, 1}, right[3] = {1, 0, 0};
            float z[3], x[3];
            trimesh_instance turn = out[a];
            assert_float_equal(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-6);
            assert_true(q[3] >= 0);
            memset(turn.position, 0, sizeof turn.position);
            turn.scale = 1;
            trimesh_instance_apply(&turn, up, z);
            trimesh_instance_apply(&turn, right, x);
            assert_float_equal(dot3(z, x), 0, 1e-6);
            if (i == 0) assert_true(dot3(z, out[a].position) > 0.99 * length3(out[a].position));
            if (i == 2) assert_float_equal(z[2], 1, 1e-6);
            if (i == 2) { /* x lies at a multiple of 60 degrees */
                const double angle = atan2(x[1], x[0]) / (TXM_PI / 3);
                assert_float_equal(angle, floor(angle + 0.5), 1e-5);
                assert_float_equal(out[a].scale, 1, 1e-5);
            }
        }
        free(out);
        free((void *)(uintptr_t)patch.points);
        shape_free(&s[i]);
    }
}

/* Where the point of a patch comes to lie, which way it looks, and what the options do to it. */
static void test_placing(void **state) {
    shape s;
    trimesh_scatter_desc d;
    trimesh_point point;
    trimesh_patch patch;
    int rotation = 0, choice = 0;
    trimesh_instance out;
    size_t count;
    const float right[3] = {1, 0, 0};
    float x[3];
    (void)state;
    make_plane(&s, 1, 1);
    memset(&d, 0, sizeof d);
    memset(&point, 0, sizeof point);
    point.u = 0.5f;
    point.v = 0.125f;
    point.height = 0.25f;
    point.prototype = 9;
    patch.points = &point;
    patch.count = 1;
    d.mesh = s.view;
    d.mesh.face_count = 1;
    d.patches = &patch;
    d.patch_count = 1;
    d.rotations = &rotation;
    d.choices = &choice;
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    assert_int_equal(count, 1);
    assert_float_equal(out.position[0], 0.5625, 1e-6);
    assert_float_equal(out.position[1], 0.125 * sqrt(0.75), 1e-6);
    assert_float_equal(out.position[2], 0.25, 1e-6);
    assert_float_equal(out.rotation[3], 1, 1e-6);
    assert_int_equal(out.prototype, 9);
    rotation = 1; /* corner 0 of the triangle is corner 1 of the patch: turned by -120 degrees */
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    assert_float_equal(out.position[0], 0.5 * 0 + 0.375 * 0.5 + 0.125 * 1, 1e-6);
    memset(out.position, 0, sizeof out.position);
    trimesh_instance_apply(&out, right, x);
    assert_float_equal(x[0], -0.5, 1e-6);
    assert_float_equal(x[1], -sqrt(0.75), 1e-6);
    rotation = 0;
    d.inside = 1;
    d.height = 1;
    d.unit = 2;
    point.scale = 3;
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    assert_float_equal(out.position[2], -2.5, 1e-6);
    assert_float_equal(out.scale, 6, 1e-6);
    memset(out.position, 0, sizeof out.position);
    const float up[3] = {0, 0, 1};
    trimesh_instance_apply(&out, up, x);
    assert_float_equal(x[2], -6, 1e-5);
    trimesh_instance_apply(&out, right, x);
    assert_float_equal(x[0], 6, 1e-5);
    /* the point's own turn comes on top: a quarter about z */
    d.inside = 0;
    d.unit = d.height = 0;
    point.scale = 0;
    point.rotation[2] = point.rotation[3] = 5;
    assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), TXM_OK);
    memset(out.position, 0, sizeof out.position);
    trimesh_instance_apply(&out, right, x);
    assert_float_equal(x[1], 1, 1e-6);
    shape_free(&s);
    /* on a sphere with curve 1 things stand on the sphere */
    make_sphere(&s, 8);
    memset(point.rotation, 0, sizeof point.rotation);
    point.height = 0;
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.normals = s.positions;
    d.patches = &patch;
    d.patch_count = 1;
    double worst[2] = {0, 0};
    for (int c = 0; c < 2; c++) {
        d.curve = (float)c;
        trimesh_instance *all = scatter(&d, NULL, &count);
        for (size_t i = 0; i < count; i++)
            worst[c] = fmax(worst[c], fabs(length3(all[i].position) - 1));
        free(all);
    }
    print_message("# distance to the sphere: flat %.2g, curved %.2g\n", worst[0], worst[1]);
    assert_true(worst[1] < 0.02 * worst[0]);
    shape_free(&s);
}

static void test_mix_and_spin(void **state) {
    shape s;
    trimesh_patch patch;
    trimesh_scatter_desc d;
    size_t count;
    const float mix[3] = {3, 0, 1}, right[3] = {1, 0, 0};
    double used[3] = {0, 0, 0}, sum[2] = {0, 0};
    (void)state;
    make_plane(&s, 20, 20);
    make_patch(20, 0, 4, &patch);
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.patches = &patch;
    d.patch_count = 1;
    d.mix = mix;
    d.mix_count = 3;
    d.spin = 1;
    trimesh_instance *out = scatter(&d, NULL, &count);
    for (size_t i = 0; i < count; i++) {
        float x[3];
        assert_in_range(out[i].prototype, 0, 2);
        used[out[i].prototype] += 1 / (double)count;
        memset(out[i].position, 0, sizeof out[i].position);
        out[i].scale = 1;
        trimesh_instance_apply(&out[i], right, x);
        sum[0] += x[0] / (double)count;
        sum[1] += x[1] / (double)count;
    }
    assert_float_equal(used[0], 0.75, 0.02);
    assert_true(used[1] == 0);
    assert_true(fabs(sum[0]) < 0.03 && fabs(sum[1]) < 0.03); /* all ways alike */
    free(out);
    free((void *)(uintptr_t)patch.points);
    shape_free(&s);
}

/* ---- patches ---- */

/* least and mean distance to the nearest neighbour of instances on a flat mesh, away from its border,
   in units of that of the hexagonal lattice of their number */
static void spacing(const trimesh_instance *out, size_t count, double density, double gap[2]) {
    const double ideal = sqrt(2 / sqrt(3.0) / density);
    size_t inside = 0;
    gap[0] = 1e9;
    gap[1] = 0;
    for (size_t i = 0; i < count; i++) {
        const double y = out[i].position[1], x = out[i].position[0] - y / sqrt(3.0);
        double nearest = 1e9;
        if (x < 1 || y < 1 || x > 7 || y > 6) continue;
        for (size_t k = 0; k < count; k++) {
            const double dx = (double)out[k].position[0] - out[i].position[0];
            const double dy = (double)out[k].position[1] - out[i].position[1];
            if (k != i) nearest = fmin(nearest, dx * dx + dy * dy);
        }
        nearest = sqrt(nearest) / ideal;
        gap[0] = fmin(gap[0], nearest);
        gap[1] += nearest;
        inside++;
    }
    gap[1] /= (double)inside;
}

static void test_reference_patch(void **state) {
    static const int sizes[5] = {1, 7, 32, 50, 200};
    shape s;
    (void)state;
    make_plane(&s, 8, 8);
    for (int i = 0; i < (tk_full() ? 5 : 4); i++) {
        for (int share = 10; share >= 7; share -= 3) { /* of the points, by thinning */
            trimesh_patch patch[3];
            trimesh_scatter_desc d;
            size_t count;
            double gap[2];
            for (int k = 0; k < 3; k++) make_patch(sizes[i], 0, (uint64_t)k, &patch[k]);
            memset(&d, 0, sizeof d);
            d.mesh = s.view;
            d.patches = patch;
            d.patch_count = 3;
            const double density = 0.1 * share * sizes[i] / (0.5 * sqrt(0.75));
            if (share < 10) d.density = (float)density;
            trimesh_instance *out = scatter(&d, NULL, &count);
            spacing(out, count, density, gap);
            print_message("# %d points, %d %%: nearest neighbour mean %.3f, least %.3f of ideal\n",
                          sizes[i], 10 * share, gap[1], gap[0]);
            if (sizes[i] >= 7) assert_true(gap[0] > (share < 10 ? 0.5 : 0.6));
            free(out);
            for (int k = 0; k < 3; k++) free((void *)(uintptr_t)patch[k].points);
        }
    }
    trimesh_patch_desc d = {5000, 0, 0, 0};
    size_t count;
    assert_int_equal(trimesh_reference_patch(&d, NULL, NULL, 0, &count), TXM_BAD_ARGUMENT);
    shape_free(&s);
}

/* ---- density ---- */

/* Relative error of the number of instances in discs of `area` around the centres of triangles, on the
   sphere of radius r: root mean square and worst. */
static void disc_error(const trimesh_instance *out, size_t count, const shape *s, double r,
                       double area, double density, double error[2]) {
    /* a cap of this area on the sphere: area = 2 pi r^2 (1 - cos) */
    const double cosine = 1 - area / (2 * TXM_PI * r * r);
    size_t discs = 0;
    error[0] = error[1] = 0;
    for (size_t t = 0; t < s->triangles; t += s->triangles / 100, discs++) {
        float c[3];
        size_t inside = 0;
        const uint32_t *v = s->indices + 3 * t;
        for (size_t k = 0; k < 3; k++)
            c[k] = s->positions[3 * v[0] + k] + s->positions[3 * v[1] + k] +
                   s->positions[3 * v[2] + k];
        const double limit = cosine * length3(c);
        for (size_t i = 0; i < count; i++)
            inside += dot3(c, out[i].position) > limit * length3(out[i].position);
        const double e = (double)inside / (area * density) - 1;
        error[0] += e * e;
        error[1] = fmax(error[1], fabs(e));
    }
    error[0] = sqrt(error[0] / (double)discs);
}

/* Two leaflets on a sphere whose triangles differ by a factor of 1.7 in area. */
static void test_density(void **state) {
    shape s;
    trimesh_patch patch[4];
    (void)state;
    make_sphere(&s, 12);
    for (int k = 0; k < 4; k++) make_patch(160, 0, (uint64_t)k + 50, &patch[k]);
    const double mean = 4 * TXM_PI / (double)s.triangles, edge2 = mean / sqrt(0.1875);
    for (int inside = tk_full() ? 0 : 1; inside < 2; inside++) {
        trimesh_scatter_desc d;
        size_t count;
        double thin[2], full[2];
        memset(&d, 0, sizeof d);
        d.mesh = s.view;
        d.normals = s.positions;
        d.patches = patch;
        d.patch_count = 4;
        d.inside = inside;
        d.unit = 1;
        d.height = 0.1f;
        const double r = inside ? 0.9 : 1.1, area = 10 * edge2 * r * r, density = 100 / mean;
        trimesh_instance *out = scatter(&d, NULL, &count);
        disc_error(out, count, &s, r, area, (double)count / (4 * TXM_PI * r * r), full);
        free(out);
        d.density = (float)density;
        out = scatter(&d, NULL, &count);
        const double there = 4 * TXM_PI * r * r * density;
        disc_error(out, count, &s, r, area, density, thin);
        print_message("# %s: %d instances, %.1f wanted; error in discs rms %.4f worst %.4f; without "
                      "thinning %.4f %.4f\n", inside ? "inside" : "outside", (int)count, there,
                      thin[0], thin[1], full[0], full[1]);
        assert_true(fabs((double)count / there - 1) < 0.01);
        assert_true(thin[0] < 0.015 && thin[1] < 0.03);
        assert_true(full[1] > 0.1);
        free(out);
    }
    /* too dense for the patch: how many the largest triangle needs */
    trimesh_scatter_desc d;
    txm_env env;
    size_t count;
    memset(&d, 0, sizeof d);
    memset(&env, 0, sizeof env);
    d.mesh = s.view;
    d.patches = patch;
    d.patch_count = 4;
    d.density = (float)(300 / mean);
    assert_int_equal(trimesh_scatter(&d, &env, NULL, 0, &count), TXM_TOO_SMALL);
    print_message("# %s\n", env.message);
    for (int k = 0; k < 4; k++) free((void *)(uintptr_t)patch[k].points);
    shape_free(&s);
}

/* ---- threads, bad arguments ---- */

/* A big mesh by threads: many blocks. */
static void test_threads(void **state) {
    shape s;
    trimesh_patch patch;
    trimesh_scatter_desc d;
    size_t count;
    uint64_t hash[3];
    (void)state;
    make_torus(&s, 150, 60, 0.4);
    make_patch(8, 0, 3, &patch);
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.patches = &patch;
    d.patch_count = 1;
    for (int i = 0; i < 3; i++) {
        txm_env env = tk_env(NULL, NULL);
        if (i) env.parallel_for = i == 1 ? tk_parallel_threads : tk_parallel_reverse;
        trimesh_instance *out = scatter(&d, &env, &count);
        hash[i] = tk_hash(0, out, count * sizeof *out);
        free(out);
    }
    assert_true(hash[0] == hash[1] && hash[0] == hash[2]);
    free((void *)(uintptr_t)patch.points);
    shape_free(&s);
}

/* Every field of a scatter out of its range in turn. */
static void test_bad_scatter(void **state) {
    enum { CASES = 20 };
    shape s;
    (void)state;
    make_plane(&s, 2, 2);
    const float y = s.positions[4];
    for (int i = 0; i <= CASES; i++) {
        trimesh_point point;
        trimesh_patch patch;
        trimesh_scatter_desc d;
        const float mix[2] = {1, i == 14 ? -1.0f : 1.0f};
        const float normals[27] = {i == 15 ? (float)NAN : 0.0f};
        int wrong[8] = {0, 0, 0, 0, 0, 0, 0, 3};
        size_t count = 77;
        trimesh_instance out;
        const int turns[8] = {0, 0, 0, 0, 0, 0, 0, 0};
        memset(&out, 0, sizeof out);
        memset(&point, 0, sizeof point);
        memset(&d, 0, sizeof d);
        point.u = point.v = 0.25f;
        patch.points = &point;
        patch.count = 1;
        d.mesh = s.view;
        d.patches = &patch;
        d.patch_count = 1;
        d.rotations = turns;
        txm_status status = TXM_BAD_ARGUMENT;
        switch (i) {
        case 0: d.patches = NULL; break;
        case 1: d.patch_count = 0; break;
        case 2: d.unit = -1; break;
        case 3: d.height = (float)NAN; break;
        case 4: d.curve = 1.1f; break;
        case 5: d.density = (float)INFINITY; break;
        case 6: d.mix = mix; break;
        case 7: d.rotations = wrong; break;
        case 8: d.choices = wrong; break;
        case 9: point.u = 1.1f; break;
        case 10: point.v = (float)NAN; break;
        case 11: point.height = 1001; break;
        case 12: point.scale = -1; break;
        case 13: point.rotation[1] = (float)INFINITY; break;
        case 14:
            d.mix = mix;
            d.mix_count = 2;
            break;
        case 15: d.normals = normals; break;
        case 16: d.mesh.indices = NULL; break;
        case 17: s.indices[4] = 9; break;
        case 18: s.positions[4] = (float)INFINITY; break;
        case 19: patch.count = (1 << 20) + 1; break;
        default: status = TXM_TOO_LARGE; /* no room */
        }
        assert_int_equal(trimesh_scatter(&d, NULL, &out, 1, &count), status);
        assert_int_equal(count, i == CASES ? 8 : 77);
        assert_int_equal(out.triangle, 0);
        s.indices[4] = 4;
        s.positions[4] = y;
    }
    assert_int_equal(trimesh_scatter(NULL, NULL, NULL, 0, NULL), TXM_BAD_ARGUMENT);
    shape_free(&s);
}

/* Triangles without area, in all possible ways, harm nobody. */
static void test_degenerate(void **state) {
    shape s;
    trimesh_patch patch;
    trimesh_scatter_desc d;
    size_t count;
    (void)state;
    make_plane(&s, 4, 4);
    face(&s, 0, 3, 3, 3);
    face(&s, 1, 3, 3, 4);
    face(&s, 2, 5, 6, 7);
    face(&s, 3, 5, 6, 7);
    put(&s, 6, s.positions[15], s.positions[16], 0);
    make_patch(12, 0, 1, &patch);
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.patches = &patch;
    d.patch_count = 1;
    for (int i = 0; i < 4; i++) {
        d.density = i & 1 ? 5.0f : 0.0f;
        d.curve = i & 2 ? 1.0f : 0.0f;
        trimesh_instance *out = scatter(&d, NULL, &count);
        for (size_t k = 0; k < count; k++) {
            double length = 0;
            for (int c = 0; c < 4; c++) length += (double)out[k].rotation[c] * out[k].rotation[c];
            assert_float_equal(length, 1, 1e-6);
            for (int c = 0; c < 3; c++) assert_true(txm_is_finite(out[k].position[c]));
        }
        free(out);
    }
    txm_mesh_place *sources = random_places(&s, s.vertices);
    const trimesh_values values = {s.positions, s.vertices, NULL, 3};
    float *out = (float *)malloc(9 * s.triangles * sizeof(float));
    assert_int_equal(trimesh_transfer_corners(&s.view, &values, &s.view, sources, NULL, out), TXM_OK);
    for (size_t i = 0; i < 9 * s.triangles; i++) assert_true(txm_is_finite(out[i]));
    int *color = (int *)malloc(s.triangles * sizeof(int));
    int *turn = (int *)malloc(s.triangles * sizeof(int));
    assert_int_equal(trimesh_proper_colors(&s.view, NULL, color, NULL), TXM_OK);
    assert_int_equal(trimesh_choose(&s.view, NULL, NULL, color, turn), TXM_OK);
    free(color);
    free(turn);
    free(out);
    free(sources);
    free((void *)(uintptr_t)patch.points);
    shape_free(&s);
}

/* Near the end of the range of floats things stay within it. */
static void test_far(void **state) {
    static const float corners[3][3] = {{3e38f, 0, 3e38f}, {3.2e38f, 0, 3e38f}, {3e38f, 2e37f, 3e38f}};
    static const float heights[] = {0, 3, 1000};
    shape s;
    trimesh_patch patch;
    trimesh_scatter_desc d;
    size_t count;
    (void)state;
    make_plane(&s, 1, 1);
    s.view.face_count = 1;
    for (int k = 0; k < 3; k++) put(&s, s.indices[k], corners[k][0], corners[k][1], corners[k][2]);
    make_patch(12, 0, 1, &patch);
    memset(&d, 0, sizeof d);
    d.mesh = s.view;
    d.patches = &patch;
    d.patch_count = 1;
    for (int i = 0; i < 6; i++) {
        d.height = heights[i / 2];
        d.unit = i & 1 ? 3e38f : 0.0f;
        trimesh_instance *out = scatter(&d, NULL, &count);
        assert_true(count > 0);
        for (size_t k = 0; k < count; k++) {
            for (int c = 0; c < 3; c++) assert_true(txm_is_finite(out[k].position[c]));
            assert_true(txm_is_finite(out[k].scale));
        }
        free(out);
    }
    free((void *)(uintptr_t)patch.points);
    shape_free(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_far),
        cmocka_unit_test(test_owned_once),
        cmocka_unit_test(test_placing),
        cmocka_unit_test(test_mix_and_spin),
        cmocka_unit_test(test_reference_patch),
        cmocka_unit_test(test_density),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_bad_scatter),
        cmocka_unit_test(test_degenerate),
    };
    return cmocka_run_group_tests_name("trimesh_cover_scatter", tests, NULL, NULL);
}
