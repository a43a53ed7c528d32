/* test_trimesh_cad.c - parts with chamfers and fillets: edges become lines, size and volume stay
   SPDX-License-Identifier: MIT OR Unlicense

   Chamfers and fillets of any width, narrower and wider than an edge of the result. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "trimesh_relax.h"
#include "surfaces.h"
#include "testkit.h"

#define SIZE_ERROR 0.001    /* of the bounding box: by how much it may grow or shrink          */
#define VOLUME_ERROR 0.002  /* relative                                                        */
#define FIT_OUT 0.02        /* free vertices beside lines, out of the part, in edge lengths    */
#define LINE_OUT 0.2        /* vertices on lines, which stand for a strip                      */

static const double sides[3] = {3, 2, 1};

/* ---- parts ---------------------------------------------------------------------------------- */

/* The vertex of corner `sign` of the box with chamfers that lies in the face of an axis. */
static uint32_t box_vertex(const int sign[3], int axis, double chamfer) {
    double p[3];
    for (int k = 0; k < 3; k++) p[k] = sign[k] * (sides[k] / 2 - (k == axis ? 0 : chamfer));
    return vertex(p[0], p[1], p[2]);
}

/* A triangle whose normal points away from the origin. */
static void outward_triangle(uint32_t a, uint32_t b, uint32_t c) {
    const txm_dvec3 p = txm_d3_load(in.at + 3 * a), q = txm_d3_load(in.at + 3 * b),
                    r = txm_d3_load(in.at + 3 * c);
    if (txm_d3_dot(txm_d3_area2(p, q, r), p) > 0) triangle(a, b, c);
    else triangle(a, c, b);
}

static void outward_quad(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    outward_triangle(a, b, c);
    outward_triangle(a, c, d);
}

/* A box of 3 x 2 x 1 around the origin, all edges with chamfers. */
static void make_box(double chamfer) {
    uint32_t v[8][3]; /* of corner i, whose signs are its bits; in the face of each axis */
    in.vertices = in.triangles = 0;
    for (int i = 0; i < 8; i++) {
        const int sign[3] = {i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1};
        for (int k = 0; k < 3; k++) v[i][k] = box_vertex(sign, k, chamfer);
        outward_triangle(v[i][0], v[i][1], v[i][2]);
    }
    for (int axis = 0; axis < 3; axis++) {
        const int one = 1 << axis, x = 1 << (axis + 1) % 3, y = 1 << (axis + 2) % 3;
        for (int side = 0; side < 8; side++) {
            if (side & (x | y)) continue; /* 0 and one: the two faces */
            outward_quad(v[side][axis], v[side | x][axis], v[side | x | y][axis], v[side | y][axis]);
        }
        for (int edge = 0; edge < 8; edge++) { /* along the axis, between two faces */
            if (edge & one) continue;
            const int p = (axis + 1) % 3, q = (axis + 2) % 3;
            outward_quad(v[edge][p], v[edge | one][p], v[edge | one][q], v[edge][q]);
        }
    }
}

/* A solid of revolution around z: the profile goes up, from the axis to the axis. */
static void make_revolved(const double (*profile)[2], int count, int segments) {
    in.vertices = in.triangles = 0;
    const uint32_t bottom = vertex(0, 0, profile[0][1]), top = vertex(0, 0, profile[count - 1][1]);
    for (int k = 1; k < count - 1; k++) {
        for (int i = 0; i < segments; i++) {
            const double angle = 2 * TXM_PI * i / segments;
            vertex(profile[k][0] * cos(angle), profile[k][0] * sin(angle), profile[k][1]);
        }
    }
    for (int i = 0; i < segments; i++) {
        const uint32_t a = (uint32_t)(2 + i), b = (uint32_t)(2 + (i + 1) % segments);
        const uint32_t row = (uint32_t)segments, last = (uint32_t)((count - 3) * segments);
        triangle(bottom, b, a);
        for (uint32_t k = 0; k < last; k += row) quad(a + k, b + k, b + k + row, a + k + row);
        triangle(top, a + last, b + last);
    }
}

/* A cylinder of radius 1 and height 1 whose rims have a fillet of so many segments (1: a chamfer). */
static void make_cylinder(double radius, int steps, int segments) {
    double profile[64][2] = {{0, 0}};
    int count = 1;
    for (int rim = 0; rim < 2; rim++) {
        for (int k = 0; k <= steps; k++) {
            const double angle = TXM_PI / 2 * (rim ? k : steps - k) / steps;
            profile[count][0] = 1 - radius + radius * cos(angle);
            profile[count++][1] = rim ? 1 - radius + radius * sin(angle) : radius - radius * sin(angle);
        }
    }
    profile[count][0] = 0;
    profile[count++][1] = 1;
    make_revolved((const double(*)[2])profile, count, segments);
}

/* An angle of two plates, extruded; the inner edge has a fillet. */
static void make_bracket(double radius, int steps) {
    double outline[40][2] = {{0, 0}, {2, 0}, {2, 0.3}};
    int n = 3;
    for (int k = 0; k <= steps; k++) {
        const double angle = -TXM_PI / 2 * (1 + (double)k / steps);
        outline[n][0] = 0.3 + radius + radius * cos(angle);
        outline[n++][1] = 0.3 + radius + radius * sin(angle);
    }
    outline[n][0] = 0.3;
    outline[n++][1] = 1.5;
    outline[n][0] = 0;
    outline[n++][1] = 1.5;
    in.vertices = in.triangles = 0;
    for (int i = 0; i < 2 * n; i++) vertex(outline[i % n][0], outline[i % n][1], i / n);
    for (uint32_t i = 0; i < (uint32_t)n; i++) {
        const uint32_t j = (i + 1) % (uint32_t)n, m = (uint32_t)n;
        quad(i, j, m + j, m + i);
        if (i == 0 || j == 0) continue; /* all of the outline is seen from its first vertex */
        triangle(0, j, i);
        triangle(m, m + i, m + j);
    }
}

/* ---- measures -------------------------------------------------------------------------------- */

static double volume_of(const float *at, const uint32_t *t, size_t triangles) {
    double sum = 0;
    for (size_t f = 0; f < triangles; f++)
        sum += txm_d3_dot(txm_d3_load(at + 3 * t[3 * f]),
                          txm_d3_cross(txm_d3_load(at + 3 * t[3 * f + 1]), txm_d3_load(at + 3 * t[3 * f + 2])));
    return sum / 6;
}

static void box_of(const float *at, size_t vertices, double low[3], double high[3]) {
    for (int k = 0; k < 3; k++) low[k] = high[k] = (double)at[k];
    for (size_t i = 3; i < 3 * vertices; i++) {
        low[i % 3] = fmin(low[i % 3], (double)at[i]);
        high[i % 3] = fmax(high[i % 3], (double)at[i]);
    }
}

static void check_size(const trimesh_mesh *mesh, double error) {
    double low[3], high[3], low2[3], high2[3];
    box_of(in.at, in.vertices, low, high);
    box_of(mesh->positions, mesh->vertex_count, low2, high2);
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(low2[k] - low[k]) <= error * (high[k] - low[k]));
        assert_true(fabs(high2[k] - high[k]) <= error * (high[k] - low[k]));
    }
}

static void check_volume(const trimesh_mesh *mesh, double error) {
    const double change = volume_of(mesh->positions, mesh->indices, mesh->triangle_count) /
                              volume_of(in.at, in.t, in.triangles) - 1;
    assert_true(fabs(change) <= error);
    assert_true(fabs(change - mesh->volume_change) < 1e-5);
}

/* How far does the vertex stick out of a convex part, in edge lengths? */
static double outside(const trimesh_mesh *mesh, size_t v) {
    const txm_dvec3 p = txm_d3_load(mesh->positions + 3 * v);
    double most = 0;
    for (size_t f = 0; f < in.triangles; f++) {
        const txm_dvec3 a = txm_d3_load(in.at + 3 * in.t[3 * f]);
        const txm_dvec3 n = txm_d3_unit(txm_d3_area2(a, txm_d3_load(in.at + 3 * in.t[3 * f + 1]),
                                                     txm_d3_load(in.at + 3 * in.t[3 * f + 2])));
        most = fmax(most, txm_d3_dot(n, txm_d3_sub(p, a)));
    }
    return most / mesh->edge_length;
}

static void check_outside(const trimesh_mesh *mesh, double fit) {
    for (size_t v = 0; v < mesh->vertex_count; v++)
        assert_true(outside(mesh, v) <= (mesh->kinds[v] == TRIMESH_FREE ? fit : LINE_OUT));
}

static trimesh_mesh *retile(size_t vertices, trimesh_report *report) {
    trimesh_desc d = desc_of_in(vertices);
    trimesh_mesh *mesh = NULL;
    d.report = report;
    assert_int_equal(trimesh_retile(&d, NULL, &mesh), TXM_OK);
    assert_int_equal(mesh->vertex_count, vertices);
    return mesh;
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void boxes_with_chamfers(void **state) {
    static const double chamfer[] = {0.001, 0.004, 0.02, 0.05, 0.1, 0.2};
    static const size_t vertices[] = {500, 2000};
    (void)state;
    for (int i = 0; i < 12; i++) {
        trimesh_report report;
        make_box(chamfer[i / 2]);
        trimesh_mesh *mesh = retile(vertices[i % 2], &report);
        const int narrow = chamfer[i / 2] < 0.3 * mesh->edge_length;
        assert_int_equal(report.crease_edges, narrow ? 12 : 24);
        check_size(mesh, SIZE_ERROR);
        check_volume(mesh, VOLUME_ERROR);
        check_outside(mesh, narrow ? FIT_OUT : LINE_OUT);
        trimesh_mesh_free(mesh);
    }
}

static void cylinders(void **state) {
    static const struct { double radius; int steps, segments; } part[] = {
        {0.01, 1, 48}, {0.02, 1, 64}, {0.02, 4, 64}, {0.05, 4, 64}, {0.06, 8, 96}, {0.03, 3, 32}};
    (void)state;
    for (int i = 0; i < 6; i++) {
        trimesh_report report;
        make_cylinder(part[i].radius, part[i].steps, part[i].segments);
        trimesh_mesh *mesh = retile(2000, &report);
        check_size(mesh, SIZE_ERROR);
        check_volume(mesh, VOLUME_ERROR);
        check_outside(mesh, 2 * FIT_OUT);
        trimesh_mesh_free(mesh);
    }
}

static void inner_fillets(void **state) {
    static const double radius[] = {0.01, 0.04, 0.08};
    (void)state;
    for (int i = 0; i < 3; i++) {
        make_bracket(radius[i], 5);
        trimesh_mesh *mesh = retile(2000, NULL);
        check_size(mesh, SIZE_ERROR);
        check_volume(mesh, VOLUME_ERROR);
        trimesh_mesh_free(mesh);
    }
}

/* A wire thinner than an edge loses volume; the mesh says how much. */
static void thin_wire(void **state) {
    static const double profile[4][2] = {{0, 0}, {0.5, 0}, {0.5, 1000}, {0, 1000}};
    (void)state;
    make_revolved(profile, 4, 12);
    trimesh_mesh *mesh = retile(2000, NULL);
    assert_true(mesh->volume_change < -0.1);
    check_volume(mesh, 1);
    trimesh_mesh_free(mesh);
}

/* Every allocation in turn fails, every report cancels. */
static txm_status sweep_part(void *context, txm_env *env) {
    trimesh_mesh *mesh = NULL;
    const txm_status status = trimesh_retile((const trimesh_desc *)context, env, &mesh);
    assert_true((status == TXM_OK) == (mesh != NULL));
    trimesh_mesh_free(mesh);
    return status;
}
static void sweep(void **state) {
    (void)state;
    make_box(0.02);
    trimesh_desc d = desc_of_in(200);
    assert_true(tk_sweep(sweep_part, &d, TK_ALLOCATION) > 10);
    assert_true(tk_sweep(sweep_part, &d, TK_ONWARD) > 10);
    assert_true(tk_sweep(sweep_part, &d, TK_CANCEL) > 4);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boxes_with_chamfers), cmocka_unit_test(cylinders),
        cmocka_unit_test(inner_fillets), cmocka_unit_test(thin_wire), cmocka_unit_test(sweep)};
    return cmocka_run_group_tests_name("trimesh_relax.h, parts", tests, NULL, NULL);
}
