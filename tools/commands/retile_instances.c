/* retile_instances.c - objects on the triangles of 'texkit retile'
   SPDX-License-Identifier: MIT OR Unlicense */
#include "retile.h"

enum { SPHERE_STEPS = 3 }; /* 72 triangles */

static const double TRIANGLE_HEIGHT = 0.86602540378443864676; /* sqrt(3) / 2 */

/* The prototype of this color, made if there is none yet; -1: too many, -2: no memory. */
static int sphere_of(retile_job *j, const unsigned char color[4]) {
    for (int i = 0; i < j->prototype_count; i++) {
        if (!memcmp(j->prototypes[i].colors, color, 4)) return i;
    }
    if (j->prototype_count == MAX_PROTOTYPES) return -1;
    mesh_data *m = &j->prototypes[j->prototype_count++];
    if (!mesh_sphere(SPHERE_STEPS, m)) return -2;
    for (size_t i = 0; i < m->vertex_count; i++) memcpy(m->colors + 4 * i, color, 4);
    return j->prototype_count - 1;
}

/* The quaternion of the shortest rotation from z to a direction, times any positive factor. */
static void turn_z_to(const float *n, float q[4]) {
    const txm_vec3 d = txm_vec3_normalize(txm_v3(n[0], n[1], n[2]));
    q[0] = -d.y;
    q[1] = d.x;
    q[2] = 0;
    q[3] = 1 + d.z;
    if (q[3] > 1e-6f) return;
    q[0] = 1; /* straight down: half a turn about x */
    q[1] = q[3] = 0;
}

/* A point of a patch: where it is on the reference triangle. 0 if it is outside. */
static int take_point(const mesh_data *m, size_t i, float scale, trimesh_point *to) {
    const float *p = m->positions + 3 * i;
    const double v = (double)p[1] / TRIANGLE_HEIGHT, u = (double)p[0] - v / 2, slack = 1e-3;
    memset(to, 0, sizeof *to);
    if (!(u >= -slack && v >= -slack && u + v <= 1 + slack && fabs((double)p[2]) <= 1000)) return 0;
    to->u = (float)(u < 0 ? 0 : u > 1 ? 1 : u);
    to->v = (float)(v < 0 ? 0 : v > 1 ? 1 : v);
    if (to->u + to->v > 1) to->v = 1 - to->u;
    to->height = p[2];
    to->scale = scale;
    if (m->rotations) memcpy(to->rotation, m->rotations + 4 * i, sizeof to->rotation);
    else if (m->normals) turn_z_to(m->normals + 3 * i, to->rotation);
    return 1;
}

/* Points become spheres. Without --dot these touch if the points are spread evenly. */
static int take_points(retile_job *j, trimesh_point *points) {
    static const unsigned char plain[4] = {200, 200, 200, 255};
    const mesh_data *m = &j->patch;
    const double radius = j->dot ? j->dot / 100.0 : 0.5 * sqrt(0.5 / (double)m->vertex_count);
    for (size_t i = 0; i < m->vertex_count; i++) {
        const int sphere = sphere_of(j, m->colors ? m->colors + 4 * i : plain);
        if (sphere == -2) return fail_memory(&j->run);
        if (sphere < 0)
            return cli_fail(&j->run, CLI_FAILED, "'%s': more than %d different colors",
                            j->instances, MAX_PROTOTYPES);
        if (!take_point(m, i, (float)radius, &points[i]))
            return cli_fail(&j->run, CLI_FAILED,
                            "'%s': point %lu lies outside the triangle (0,0), "
                            "(1,0), (1/2,sqrt(3)/2)",
                            j->instances, (unsigned long)i);
        points[i].prototype = (uint32_t)sphere;
    }
    return CLI_DONE;
}

/* A mesh becomes one instance, attached at the middle of the triangle. */
static void take_mesh(retile_job *j, trimesh_point *point) {
    mesh_data *m = &j->prototypes[j->prototype_count++];
    *m = j->patch;
    memset(&j->patch, 0, sizeof j->patch);
    for (size_t i = 0; i < m->vertex_count; i++) {
        m->positions[3 * i] -= 0.5f;
        m->positions[3 * i + 1] -= (float)(TRIANGLE_HEIGHT / 3);
    }
    memset(point, 0, sizeof *point);
    point->u = point->v = (float)(1.0 / 3);
}

/* Sort the instances by prototype into the arrays that a writer takes. */
static int sort_instances(retile_job *j, const trimesh_instance *list, size_t count) {
    size_t at[MAX_PROTOTYPES + 1] = {0};
    j->placements = (float *)new_array(count, 10 * sizeof(float));
    if (!j->placements) return fail_memory(&j->run);
    float *translations = j->placements, *rotations = translations + 3 * count;
    float *scales = rotations + 4 * count;
    for (size_t i = 0; i < count; i++) at[list[i].prototype + 1]++;
    for (int p = 0; p < j->prototype_count; p++) {
        mesh_instances *t = &j->instanced[p];
        t->mesh = &j->prototypes[p];
        t->count = at[p + 1];
        at[p + 1] += at[p];
        t->translations = translations + 3 * at[p];
        t->rotations = rotations + 4 * at[p];
        t->scales = scales + 3 * at[p];
    }
    for (size_t i = 0; i < count; i++) {
        const size_t to = at[list[i].prototype]++;
        memcpy(translations + 3 * to, list[i].position, 3 * sizeof(float));
        memcpy(rotations + 4 * to, list[i].rotation, 4 * sizeof(float));
        for (size_t k = 0; k < 3; k++) scales[3 * to + k] = list[i].scale;
    }
    j->placed = count;
    return CLI_DONE;
}

int retile_place_instances(retile_job *j) {
    trimesh_patch patch = {0};
    trimesh_scatter_desc d = {0};
    trimesh_instance *list = NULL;
    size_t count = 0;
    const int has_points = j->patch.triangle_count == 0;
    trimesh_point *points =
        (trimesh_point *)new_array(has_points ? j->patch.vertex_count : 1, sizeof *points);
    int status = points ? CLI_DONE : fail_memory(&j->run);
    if (points) {
        patch.points = points;
        patch.count = has_points ? j->patch.vertex_count : 1;
        if (has_points) status = take_points(j, points);
        else take_mesh(j, points);
    }
    d.mesh = trimesh_as_view(j->result);
    d.normals = j->result->normals;
    d.patches = &patch;
    d.patch_count = 1;
    d.curve = (float)j->curved;
    d.seed = j->run.seed;
    if (!status)
        status = check_result(&j->run, trimesh_scatter(&d, &j->run.env, NULL, 0, &count),
                              j->instances);
    if (!status && count) {
        list = (trimesh_instance *)new_array(count, sizeof *list);
        if (!list) status = fail_memory(&j->run);
        if (!status)
            status = check_result(&j->run, trimesh_scatter(&d, &j->run.env, list, count, &count),
                                  j->instances);
        if (!status) status = sort_instances(j, list, count);
    }
    free(list);
    free(points);
    return status;
}
