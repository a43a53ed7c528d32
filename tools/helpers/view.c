/* view.c - a picture of a mesh: view MESH -o OUT.png [options]; meshes are of any format
   SPDX-License-Identifier: MIT OR Unlicense

     --size WxH            default 800x800
     --azimuth A           degrees, default 30; where the camera stands
     --elevation E         degrees, default 20
     --zoom Z              default 1, all of the mesh
     --field F             degrees from top to bottom, default 30; 0 = parallel rays
     --z-up                +z is up, not +y
     --wire [W]            lines along the edges, W pixels wide; default 1
     --flat                each triangle lit by itself
     --crease D            degrees from which on an edge looks sharp, default 40
     --texture PICTURE     on meshes with texture coordinates
     --colors              the colors of the vertices
     --valence             triangles at each vertex: 6 gray, 5 blue, 7 red; 4 and 8 darker; others
                           darker still; at borders, where there is no telling, light
     --points POINTS.ply   spheres too, of the points' colors; a MESH of points alone does as well
     --radius R            of these, in units of the mesh; default a hundredth of its extent
     --lengths             by the length of the edges: short blue, mean white, long red           */
#include "files/image_io.h"
#include "render.h"

#include <stdio.h>

typedef struct options {
    render_desc desc;
    const char *mesh, *output, *texture, *points;
    float crease, radius;
    int valence, lengths;
} options;

static int fail(const char *path, const char *why) {
    fprintf(stderr, "view: '%s': %s\n", path, why);
    return 1;
}

/* ---- the command line ---------------------------------------------------------------------- */

static int read_float(const char *text, float *value) {
    char *end;
    *value = (float)strtod(text, &end);
    return end != text && *end == 0 && txm_is_finite((double)*value);
}

/* Options that take a number. 1 if it is one. */
static int number_option(options *o, const char *name, float **target) {
    if (!strcmp(name, "--azimuth")) *target = &o->desc.azimuth;
    else if (!strcmp(name, "--elevation")) *target = &o->desc.elevation;
    else if (!strcmp(name, "--zoom")) *target = &o->desc.zoom;
    else if (!strcmp(name, "--field")) *target = &o->desc.field;
    else if (!strcmp(name, "--crease")) *target = &o->crease;
    else if (!strcmp(name, "--radius")) *target = &o->radius;
    else return 0;
    return 1;
}

static int parse(options *o, int argc, char **argv) {
    for (int i = 1; i < argc; i++) {
        const char *name = argv[i], *value = i + 1 < argc ? argv[i + 1] : "";
        float *number = NULL;
        int used = 1;
        if (number_option(o, name, &number)) {
            if (!read_float(value, number)) return fail(name, "give a number");
        } else if (!strcmp(name, "--size")) {
            if (sscanf(value, "%5dx%5d", &o->desc.width, &o->desc.height) != 2)
                return fail(value, "give a size, such as --size 800x600");
        } else if (!strcmp(name, "-o")) {
            o->output = value;
        } else if (!strcmp(name, "--texture")) {
            o->texture = value;
        } else if (!strcmp(name, "--points")) {
            o->points = value;
        } else {
            used = 0;
            if (!strcmp(name, "--z-up")) o->desc.z_up = 1;
            else if (!strcmp(name, "--flat")) o->desc.flat = 1;
            else if (!strcmp(name, "--colors")) o->desc.colors = 1;
            else if (!strcmp(name, "--valence")) o->valence = 1;
            else if (!strcmp(name, "--lengths")) o->lengths = 1;
            else if (!strcmp(name, "--wire")) {
                used = read_float(value, &o->desc.wire);
                if (!used) o->desc.wire = 1;
            } else if (name[0] == '-') return fail(name, "no such option");
            else if (o->mesh) return fail(name, "a second mesh");
            else o->mesh = name;
        }
        i += used;
    }
    if (!o->mesh || !o->output)
        return fail("", "usage: view MESH -o OUT.png [options], see view.c");
    return 0;
}

/* ---- colors that tell something -------------------------------------------------------------- */

static int paint(mesh_data *m) {
    free(m->colors);
    m->colors = (unsigned char *)malloc(4 * m->vertex_count);
    return m->colors != NULL;
}

static void set_color(unsigned char *to, int r, int g, int b) {
    to[0] = (unsigned char)r;
    to[1] = (unsigned char)g;
    to[2] = (unsigned char)b;
    to[3] = 255;
}

/* A vertex is inside if its triangles lead once around it: then each vertex that follows it in one
   of them precedes it in another, so the sums of both are equal. */
static int color_by_valence(mesh_data *m) {
    uint32_t *valence = (uint32_t *)calloc(m->vertex_count, sizeof *valence);
    uint64_t *sums = (uint64_t *)calloc(m->vertex_count, sizeof *sums);
    const int ok = valence && sums && paint(m);
    for (size_t c = 0; c < 3 * m->triangle_count && ok; c++) {
        const uint32_t v = m->indices[c];
        const uint32_t next = m->indices[c % 3 == 2 ? c - 2 : c + 1];
        const uint32_t before = m->indices[c % 3 == 0 ? c + 2 : c - 1];
        valence[v]++;
        sums[v] += txm_hash(next) - txm_hash(before);
    }
    for (size_t i = 0; i < m->vertex_count && ok; i++) {
        unsigned char *c = m->colors + 4 * i;
        const uint32_t n = valence[i];
        if (sums[i]) set_color(c, 225, 225, 205);
        else if (n == 6) set_color(c, 205, 205, 205);
        else if (n == 5) set_color(c, 90, 150, 250);
        else if (n == 7) set_color(c, 250, 100, 80);
        else if (n == 4) set_color(c, 20, 50, 160);
        else if (n == 8) set_color(c, 150, 20, 20);
        else set_color(c, n < 6 ? 0 : 60, 0, n < 6 ? 60 : 0);
    }
    free(valence);
    free(sums);
    return ok;
}

/* By the mean length of the edges at a vertex, from 3/4 to 5/4 of that of all. */
static int color_by_length(mesh_data *m) {
    double *lengths = (double *)calloc(m->vertex_count, sizeof *lengths), all = 0;
    uint32_t *counts = (uint32_t *)calloc(m->vertex_count, sizeof *counts);
    const int ok = lengths && counts && paint(m);
    for (size_t c = 0; c < 3 * m->triangle_count && ok; c++) {
        const uint32_t v[2] = {m->indices[c], m->indices[c % 3 == 2 ? c - 2 : c + 1]};
        double sum = 0;
        for (size_t k = 0; k < 3; k++) {
            const double d = (double)m->positions[3 * (size_t)v[0] + k] -
                             (double)m->positions[3 * (size_t)v[1] + k];
            sum += d * d;
        }
        all += sqrt(sum);
        for (int k = 0; k < 2; k++) {
            lengths[v[k]] += sqrt(sum);
            counts[v[k]]++;
        }
    }
    all /= 3 * (double)m->triangle_count;
    for (size_t i = 0; i < m->vertex_count && ok; i++) {
        double x = counts[i] && all > 0 ? 4 * (lengths[i] / counts[i] / all - 1) : 0;
        x = x < -1 ? -1 : x > 1 ? 1 : x;
        const int fade = (int)(240 - 200 * fabs(x));
        set_color(m->colors + 4 * i, x > 0 ? 240 : fade, fade, x < 0 ? 240 : fade);
    }
    free(lengths);
    free(counts);
    return ok;
}

/* ---- points ----------------------------------------------------------------------------------- */

static float extent_of(const mesh_data *m) {
    float most = 0;
    for (size_t k = 0; k < 3; k++) {
        float low = m->positions[k], high = low;
        for (size_t i = 0; i < m->vertex_count; i++) {
            low = txm_minf(low, m->positions[3 * i + k]);
            high = txm_maxf(high, m->positions[3 * i + k]);
        }
        most = txm_maxf(most, high - low);
    }
    return most;
}

/* A sphere for each point, in one mesh. */
static int make_spheres(const mesh_data *points, float radius, mesh_data *spheres) {
    mesh_data one;
    mesh_instances copies = {&one, points->vertex_count, points->positions,
                             NULL, NULL, NULL, NULL, NULL};
    const char *why;
    if (!mesh_sphere(3, &one)) return 0;
    for (size_t i = 0; i < 3 * one.vertex_count; i++) one.positions[i] *= radius;
    const int ok = mesh_bake(&copies, 1, spheres, &why);
    for (size_t i = 0; ok && points->colors && i < spheres->vertex_count; i++)
        memcpy(spheres->colors + 4 * i, points->colors + 4 * (i / one.vertex_count), 4);
    mesh_free(&one);
    return ok;
}

/* ---- main ------------------------------------------------------------------------------------ */

static int write_picture(const char *path, const txm_image *picture) {
    const char *why;
    return image_write(path, picture, &why) ? 0 : fail(path, why);
}

/* Read everything and draw it. */
static int draw(options *o, mesh_data *mesh, mesh_data *points, mesh_data *spheres,
                txm_image *texture, txm_image *picture) {
    static const float nowhere[3] = {0, 0, 0};
    mesh_scene scene = {0};
    mesh_instances copy = {spheres, 1, nowhere, NULL, NULL, NULL, NULL, NULL};
    const char *why = "out of memory";
    if (!mesh_read(o->mesh, MESH_POINTS | MESH_UNMOVED, mesh, &why)) return fail(o->mesh, why);
    if (o->points && !mesh_read(o->points, MESH_POINTS | MESH_UNMOVED, points, &why)) return fail(o->points, why);
    if (o->texture && !image_read(o->texture, 3, texture, &why)) return fail(o->texture, why);
    if (o->texture) o->desc.texture = texture;
    if (o->radius == 0) o->radius = extent_of(mesh) / 100;
    if (mesh->triangle_count) {
        scene.surface = mesh;
        if (!mesh_crease(mesh, o->crease)) return fail(o->mesh, why);
    }
    if (!scene.surface || o->points) {
        const mesh_data *from = o->points ? points : mesh;
        if (!make_spheres(from, o->radius, spheres)) return fail(o->mesh, "too many points");
        scene.instances = &copy;
        scene.instance_count = 1;
    }
    if ((o->valence && !color_by_valence(mesh)) || (o->lengths && !color_by_length(mesh)))
        return fail(o->mesh, why);
    if (o->valence || o->lengths || scene.instances) o->desc.colors = 1;
    o->desc.cells = o->valence;
    return render(&scene, &o->desc, picture, &why) ? 0 : fail(o->mesh, why);
}

int main(int argc, char **argv) {
    options o;
    mesh_data mesh, points, spheres;
    txm_image texture = {0}, picture = {0};
    memset(&o, 0, sizeof o);
    memset(&mesh, 0, sizeof mesh);
    memset(&points, 0, sizeof points);
    memset(&spheres, 0, sizeof spheres);
    o.desc.width = o.desc.height = 800;
    o.desc.azimuth = 30;
    o.desc.elevation = 20;
    o.desc.field = 30;
    o.crease = 40;
    if (parse(&o, argc, argv)) return 2;
    int status = draw(&o, &mesh, &points, &spheres, &texture, &picture);
    if (!status) status = write_picture(o.output, &picture);
    image_free(&texture);
    image_free(&picture);
    mesh_free(&mesh);
    mesh_free(&points);
    mesh_free(&spheres);
    return status;
}
