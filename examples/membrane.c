/* membrane.c - a phospholipid bilayer on a closed surface, lipid by lipid
   SPDX-License-Identifier: MIT OR Unlicense

   membrane sphere|capsule OUT.glb|OUT.xyz|OUT.png [cut]

   What trimesh_relax.h was made for: a surface is retiled into nearly equilateral triangles, a patch
   of places for lipids is put on every triangle, once for each leaflet, and what comes out is a
   list of instances. The GLB has each kind of lipid once and draws it many times
   (EXT_mesh_gpu_instancing); the XYZ lists all beads, for viewers of molecules; the PNG is a picture.
   cut leaves out an eighth, to look inside. All lengths are in Angstrom.                        */
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"

#include "image_io.h"
#include "mesh_io.h"
#include "render.h"

#include <stdio.h>

/* ---- the surface: where f = 0 on the rays from the origin ---- */

enum {
    GRID = 40, /* squares along the side of a cube's face */
    SURFACE_VERTICES = 6 * (GRID + 1) * (GRID + 1),
    SURFACE_TRIANGLES = 12 * GRID * GRID
};

static double sphere(const double p[3]) {
    return sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 140;
}

/* a capsule along x, and a smaller sphere that melts into it: the smooth minimum of two distances */
static double capsule(const double p[3]) {
    const double along = p[0] < -90 ? p[0] + 90 : p[0] > 90 ? p[0] - 90 : 0;
    const double body = sqrt(along * along + p[1] * p[1] + p[2] * p[2]) - 80;
    const double dx = p[0] + 50, dy = p[1] - 75, blend = 40;
    const double bump = sqrt(dx * dx + dy * dy + p[2] * p[2]) - 55;
    const double h = fmax(blend - fabs(body - bump), 0) / blend;
    return fmin(body, bump) - 0.25 * h * h * blend;
}

static void find_surface(double (*f)(const double[3]), const double d[3], float *out) {
    double near = 0, far = 1000 / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int i = 0; i < 60; i++) {
        const double t = 0.5 * (near + far), p[3] = {t * d[0], t * d[1], t * d[2]};
        if (f(p) < 0) near = t;
        else far = t;
    }
    for (int k = 0; k < 3; k++) out[k] = (float)(near * d[k]);
}

/* The six faces of a cube, blown up, each a grid of its own: trimesh_retile welds them. */
static void make_surface(double (*f)(const double[3]), float *positions, uint32_t *indices) {
    for (uint32_t side = 0; side < 6; side++) {
        const uint32_t first = side * (GRID + 1) * (GRID + 1);
        for (uint32_t j = 0; j <= GRID; j++) {
            for (uint32_t i = 0; i <= GRID; i++, positions += 3) {
                double d[3];
                d[side % 3] = side < 3 ? GRID : -GRID;
                d[(side + 1) % 3] = 2.0 * i - GRID;
                d[(side + 2) % 3] = 2.0 * j - GRID;
                find_surface(f, d, positions);
            }
        }
        for (uint32_t j = 0; j < GRID; j++) {
            for (uint32_t i = 0; i < GRID; i++, indices += 6) {
                /* counter-clockwise from outside: on the last three faces the axes change places */
                const uint32_t a = first + j * (GRID + 1) + i, up = a + GRID + 1;
                const uint32_t b = side < 3 ? a + 1 : up, c = side < 3 ? up : a + 1;
                const uint32_t two[6] = {a, b, c, c, b, up + 1};
                memcpy(indices, two, sizeof two);
            }
        }
    }
}

static double area_of(const trimesh_view *m) {
    double area = 0;
    for (size_t t = 0; t < m->triangle_count; t++) {
        txm_vec3 p[3];
        for (size_t k = 0; k < 3; k++) {
            const float *v = m->positions + 3 * (size_t)m->indices[3 * t + k];
            p[k] = txm_v3(v[0], v[1], v[2]);
        }
        area += 0.5 * (double)txm_vec3_length(txm_vec3_cross(txm_vec3_sub(p[1], p[0]),
                                                             txm_vec3_sub(p[2], p[0])));
    }
    return area;
}

/* ---- lipids: a few beads each; z = 0 where the tails begin, upwards to the water ---- */

typedef struct bead {
    const char *element;
    float x, y, z, radius;
    unsigned char color[3];
} bead;

#define TAIL(x, y) \
    {"C", x, y, -2.5f, 3.3f, {222, 200, 140}}, {"C", 1.1f * (x), y, -5.6f, 3.3f, {222, 200, 140}}, \
    {"C", 1.2f * (x), y, -8.6f, 3.3f, {216, 190, 126}}, {"C", x, 1.3f * (y), -11, 3.2f, {206, 178, 112}}
#define GLYCEROL {"O", -1.7f, 0, 1, 3.2f, {214, 96, 70}}, {"O", 1.7f, 0, 1, 3.2f, {214, 96, 70}}

static const bead choline[] = {{"N", 0.8f, 0, 8.4f, 4.3f, {70, 110, 210}},
                               {"P", 0, 0, 4.4f, 3.8f, {240, 150, 40}},
                               GLYCEROL, TAIL(-2.1f, 0), TAIL(2.1f, 0.6f)};
static const bead ethanolamine[] = {{"N", -0.5f, 0.4f, 7.6f, 3.7f, {90, 190, 220}},
                                    {"P", 0, 0, 4.2f, 3.8f, {240, 150, 40}},
                                    GLYCEROL, TAIL(-2.2f, 0.5f), TAIL(1.9f, -0.5f)};
static const bead serine[] = {{"N", 1.6f, 0, 8, 3.4f, {150, 90, 200}},
                              {"O", -1.6f, 0.3f, 7.8f, 3.2f, {220, 70, 110}},
                              {"P", 0, 0, 4.4f, 3.8f, {240, 150, 40}},
                              GLYCEROL, TAIL(-2, -0.6f), TAIL(2.2f, 0)};
static const bead cholesterol[] = {{"O", 0, 0, 1.5f, 3.2f, {210, 80, 70}},
                                   {"C", -1, 0, -1.6f, 3.4f, {130, 180, 110}},
                                   {"C", 1, 0, -3.6f, 3.4f, {130, 180, 110}},
                                   {"C", -0.6f, 0, -6.2f, 3.4f, {120, 170, 100}},
                                   {"C", 0.4f, 0, -9.6f, 3.1f, {120, 160, 96}}};

enum { KINDS = 4, MOST_BEADS = 13 };
static const struct {
    const bead *beads;
    int count;
    float share;
} lipids[KINDS] = {{choline, sizeof choline / sizeof *choline, 5},
                   {ethanolamine, sizeof ethanolamine / sizeof *ethanolamine, 2},
                   {serine, sizeof serine / sizeof *serine, 1},
                   {cholesterol, sizeof cholesterol / sizeof *cholesterol, 3}};

/* A lipid as one mesh: a ball of 8 steps^2 triangles for each bead. */
static int make_lipid(int kind, int steps, mesh_data *out, const char **why) {
    mesh_data balls[MOST_BEADS];
    mesh_instances beads[MOST_BEADS];
    float at[3 * MOST_BEADS], scales[3 * MOST_BEADS];
    int made = 0, ok = 1;
    memset(beads, 0, sizeof beads);
    for (; made < lipids[kind].count && ok; made++) {
        const bead *d = &lipids[kind].beads[made];
        const float centre[3] = {d->x, d->y, d->z};
        ok = mesh_sphere(steps, &balls[made]);
        for (size_t i = 0; ok && i < balls[made].vertex_count; i++)
            memcpy(balls[made].colors + 4 * i, d->color, 3);
        for (int k = 0; k < 3; k++) {
            at[3 * made + k] = centre[k];
            scales[3 * made + k] = d->radius;
        }
        beads[made].mesh = &balls[made];
        beads[made].count = 1;
        beads[made].translations = at + 3 * made;
        beads[made].scales = scales + 3 * made;
    }
    if (!ok) *why = "no memory";
    ok = ok && mesh_bake(beads, made, out, why);
    while (made > 0) mesh_free(&balls[--made]);
    return ok;
}

/* ---- the bilayer ---- */

typedef struct membrane {
    trimesh_instance *lipids;
    size_t count;
} membrane;

/* One leaflet, appended. Lipids have a size: `unit` 1 keeps heights and shapes in Angstrom, and
   density thins the patches until there is one for every 50 square Angstrom where the tails begin. */
static txm_status add_leaflet(const trimesh_mesh *mesh, const trimesh_patch *patches, int patch_count,
                              int inside, txm_env *env, membrane *m) {
    trimesh_scatter_desc d = {0};
    float mix[KINDS];
    size_t count;
    for (int k = 0; k < KINDS; k++) mix[k] = lipids[k].share;
    d.mesh = trimesh_as_view(mesh);
    d.normals = mesh->normals;
    d.patches = patches;
    d.patch_count = patch_count;
    d.unit = 1;
    d.height = 13;
    d.inside = inside;
    d.curve = 1;
    d.density = 1 / 50.0f;
    d.spin = 1;
    d.mix = mix;
    d.mix_count = KINDS;
    d.seed = (uint64_t)inside;
    txm_status status = trimesh_scatter(&d, env, NULL, 0, &count);
    if (status != TXM_OK) return status;
    trimesh_instance *more = realloc(m->lipids, (m->count + count) * sizeof *more);
    if (!more) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the lipids");
    m->lipids = more;
    status = trimesh_scatter(&d, env, more + m->count, count, &count);
    if (status == TXM_OK) m->count += count;
    return status;
}

static txm_status make_membrane(double (*f)(const double[3]), txm_env *env, membrane *m) {
    enum { PATCHES = 4, MOST_POINTS = 400 };
    static float positions[3 * SURFACE_VERTICES];
    static uint32_t indices[3 * SURFACE_TRIANGLES];
    static trimesh_point points[PATCHES][MOST_POINTS];
    trimesh_patch patches[PATCHES];
    trimesh_mesh *mesh = NULL;
    trimesh_desc desc = {0};
    make_surface(f, positions, indices);
    desc.surface.positions = positions;
    desc.surface.indices = indices;
    desc.surface.vertex_count = SURFACE_VERTICES;
    desc.surface.triangle_count = SURFACE_TRIANGLES;
    desc.crease_angle = 180;
    /* triangles of 45 Angstrom: 877 square Angstrom, two for each vertex */
    desc.vertices = (size_t)(area_of(&desc.surface) / (2 * 877)) + 2;
    txm_status status = trimesh_retile(&desc, env, NULL, &mesh);
    if (status != TXM_OK) return status;
    /* Enough places for the largest triangle of either leaflet: the call says when there are not. */
    for (int wanted = 24;; wanted = wanted * 5 / 4) {
        for (int p = 0; p < PATCHES && status == TXM_OK; p++) {
            const trimesh_patch_desc pd = {wanted, 0, 0, (uint64_t)p};
            patches[p].points = points[p];
            status = trimesh_reference_patch(&pd, env, points[p], MOST_POINTS, &patches[p].count);
        }
        m->count = 0;
        for (int inside = 0; inside < 2 && status == TXM_OK; inside++)
            status = add_leaflet(mesh, patches, PATCHES, inside, env, m);
        if (status != TXM_TOO_SMALL) break;
        status = TXM_OK;
    }
    trimesh_free(mesh);
    return status;
}

/* Leave out the eighth that faces the viewer. */
static void cut_away(membrane *m) {
    size_t kept = 0;
    for (size_t i = 0; i < m->count; i++) {
        const float *p = m->lipids[i].position;
        if (!(p[0] > 0 && p[1] > 0 && p[2] > 0)) m->lipids[kept++] = m->lipids[i];
    }
    m->count = kept;
}

/* ---- files ---- */

static const char *write_xyz(const membrane *m, const char *path) {
    FILE *file = fopen(path, "wb");
    size_t beads = 0;
    if (!file) return "cannot open the file";
    for (size_t i = 0; i < m->count; i++) beads += (size_t)lipids[m->lipids[i].prototype].count;
    fprintf(file, "%lu\n%lu lipids, Angstrom\n", (unsigned long)beads, (unsigned long)m->count);
    for (size_t i = 0; i < m->count; i++) {
        const uint32_t kind = m->lipids[i].prototype;
        for (int b = 0; b < lipids[kind].count; b++) {
            const bead *d = &lipids[kind].beads[b];
            const float from[3] = {d->x, d->y, d->z};
            float p[3];
            trimesh_instance_apply(&m->lipids[i], from, p);
            fprintf(file, "%s %.3f %.3f %.3f\n", d->element, (double)p[0], (double)p[1],
                    (double)p[2]);
        }
    }
    const int failed = ferror(file);
    return fclose(file) != 0 || failed ? "cannot write the file" : NULL;
}

static const char *write_bytes(const char *path, const unsigned char *bytes, size_t size) {
    FILE *file = fopen(path, "wb");
    if (!file) return "cannot open the file";
    const int failed = fwrite(bytes, 1, size, file) != size;
    return fclose(file) != 0 || failed ? "cannot write the file" : NULL;
}

/* The lipids of each kind as one mesh with many places; a GLB, or a picture of it. */
static const char *write_scene(const membrane *m, const char *extension, const char *path) {
    mesh_data meshes[KINDS];
    mesh_instances groups[KINDS];
    mesh_scene scene = {0};
    float *at = malloc(m->count * 3 * sizeof *at), *turn = malloc(m->count * 4 * sizeof *turn);
    unsigned char *bytes = NULL;
    size_t size = 0, n = 0;
    const char *why = NULL;
    const int is_picture = strcmp(extension, ".png") == 0;
    if (!at || !turn) why = "no memory";
    memset(groups, 0, sizeof groups);
    memset(meshes, 0, sizeof meshes);
    for (int k = 0; k < KINDS && !why; k++) {
        if (!make_lipid(k, is_picture ? 3 : 2, &meshes[k], &why)) break;
        groups[k].mesh = &meshes[k];
        groups[k].translations = at + 3 * n;
        groups[k].rotations = turn + 4 * n;
        for (size_t i = 0; i < m->count; i++) {
            if (m->lipids[i].prototype != (uint32_t)k) continue;
            memcpy(at + 3 * n, m->lipids[i].position, 3 * sizeof *at);
            memcpy(turn + 4 * n++, m->lipids[i].rotation, 4 * sizeof *turn);
            groups[k].count++;
        }
    }
    scene.instances = groups;
    scene.instance_count = KINDS;
    if (!why && is_picture) {
        /* into the opening if there is one, past the near rim */
        const render_desc view = {.width = 1200, .height = 900, .azimuth = 18, .elevation = 14,
                                  .colors = 1, .field = 30};
        txm_image picture;
        if (render(&scene, &view, &picture, &why)) {
            image_encode(extension, &picture, &bytes, &size, &why);
            image_free(&picture);
        }
    } else if (!why) {
        mesh_encode(extension, &scene, &bytes, &size, &why);
    }
    if (bytes) why = write_bytes(path, bytes, size);
    for (int k = 0; k < KINDS; k++) mesh_free(&meshes[k]);
    free(bytes);
    free(at);
    free(turn);
    return why;
}

int main(int argc, char **argv) {
    const int is_sphere = argc > 1 && strcmp(argv[1], "sphere") == 0;
    const int is_cut = argc == 4 && strcmp(argv[3], "cut") == 0;
    char extension[8] = "";
    if (argc > 2) file_extension(argv[2], extension);
    const int xyz = strcmp(extension, ".xyz") == 0;
    if (argc < 3 || argc > 4 || (argc == 4 && !is_cut) ||
        (!is_sphere && strcmp(argv[1], "capsule") != 0) ||
        (!xyz && strcmp(extension, ".glb") != 0 && strcmp(extension, ".png") != 0)) {
        fprintf(stderr, "usage: membrane sphere|capsule OUT.glb|OUT.xyz|OUT.png [cut]\n");
        return 2;
    }
    txm_env env = {0};
    membrane m = {0};
    const char *why = NULL;
    if (make_membrane(is_sphere ? sphere : capsule, &env, &m) != TXM_OK) why = env.message;
    if (is_cut) cut_away(&m);
    if (!why) why = xyz ? write_xyz(&m, argv[2]) : write_scene(&m, extension, argv[2]);
    if (why) fprintf(stderr, "membrane: %s\n", why);
    else printf("%s: %lu lipids\n", argv[2], (unsigned long)m.count);
    free(m.lipids);
    return why != NULL;
}
