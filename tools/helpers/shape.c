/* shape.c - make a mesh for demo and tests: shape KIND OUT.obj [STEPS]; shape list
   SPDX-License-Identifier: MIT OR Unlicense

   The meshes are uneven on purpose, as meshes from modellers are: sphere and blob are grids of
   longitude and latitude, crowded at the poles, torus and knot are tubes, long on the outside and
   short on the inside. STEPS, the quads once around, is 96 if not given.                         */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_STEPS = 2000 };

static const double PI = 3.14159265358979323846;

/* A point of a surface. s, t: 0..1, once around and once along. */
typedef void surface(double s, double t, double p[3]);

/* A direction for longitude s and latitude t. */
static void direction(double s, double t, double d[3]) {
    d[0] = sin(PI * t) * cos(2 * PI * s);
    d[1] = -cos(PI * t);
    d[2] = -sin(PI * t) * sin(2 * PI * s);
}

static void sphere(double s, double t, double p[3]) {
    direction(s, t, p);
}

/* a ball with bumps */
static void blob(double s, double t, double p[3]) {
    double d[3], r = 1;
    direction(s, t, d);
    r += 0.12 * sin(3.1 * d[0] + 1) * cos(2.3 * d[1]) + 0.10 * sin(4.3 * d[2] - 2 * d[1]);
    r += 0.05 * cos(7 * d[0] - 3 * d[2]) * sin(6 * d[1] + 1);
    for (int k = 0; k < 3; k++) p[k] = r * d[k];
}

static void torus(double s, double t, double p[3]) {
    const double r = 1 + 0.45 * cos(2 * PI * t);
    p[0] = r * cos(2 * PI * s);
    p[1] = 0.45 * sin(2 * PI * t);
    p[2] = -r * sin(2 * PI * s);
}

/* the line that the knot's tube follows: twice around the axis while three times around a ring */
static void knot_line(double s, double p[3]) {
    const double a = 4 * PI * s, b = 6 * PI * s, r = 1 + 0.42 * cos(b);
    p[0] = r * cos(a);
    p[1] = 0.42 * sin(b);
    p[2] = -r * sin(a);
}

static void knot(double s, double t, double p[3]) {
    double at[3], next[3], along[3], out[3], side[3], length = 0, dot = 0;
    knot_line(s, at);
    knot_line(s + 1e-5, next);
    for (int k = 0; k < 3; k++) {
        along[k] = next[k] - at[k];
        length += along[k] * along[k];
    }
    /* away from the ring, made perpendicular to the line */
    out[0] = at[0] - cos(4 * PI * s);
    out[1] = at[1];
    out[2] = at[2] + sin(4 * PI * s);
    for (int k = 0; k < 3; k++) {
        along[k] /= sqrt(length);
        dot += out[k] * along[k];
    }
    length = 0;
    for (int k = 0; k < 3; k++) {
        out[k] -= dot * along[k];
        length += out[k] * out[k];
    }
    for (int k = 0; k < 3; k++) out[k] /= sqrt(length);
    for (int k = 0; k < 3; k++) {
        const int l = (k + 1) % 3, m = (k + 2) % 3;
        side[k] = along[l] * out[m] - along[m] * out[l];
    }
    for (int k = 0; k < 3; k++)
        p[k] = at[k] + 0.26 * (cos(2 * PI * t) * out[k] - sin(2 * PI * t) * side[k]);
}

static const struct {
    const char *name;
    surface *at;
    int poles; /* t does not close: it ends in two points */
} shapes[] = {{"sphere", sphere, 1}, {"blob", blob, 1}, {"torus", torus, 0}, {"knot", knot, 0}};

static int fail(const char *what, const char *why) {
    fprintf(stderr, "shape: '%s': %s\n", what, why);
    return 1;
}

/* A grid of quads, each in two; at poles the first and the last row shrink to triangles. */
static int write_obj(FILE *file, surface *at, int poles, int steps) {
    const int along = poles ? steps / 2 : steps * 3 / 8, rows = poles ? along - 1 : along;
    fprintf(file, "# texkit shape, %d steps\n", steps);
    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < steps; i++) {
            double p[3];
            at((double)i / steps, (double)(j + poles) / along, p);
            fprintf(file, "v %.6f %.6f %.6f\n", p[0], p[1], p[2]);
        }
    }
    for (int end = 0; end < 2 && poles; end++) {
        double p[3];
        at(0, end, p);
        fprintf(file, "v %.6f %.6f %.6f\n", p[0], p[1], p[2]);
    }
    for (int j = 0; j < rows - poles; j++) {
        for (int i = 0; i < steps; i++) {
            const int row = j * steps + 1, next = (j + 1) % rows * steps + 1, e = (i + 1) % steps;
            fprintf(file, "f %d %d %d\nf %d %d %d\n", row + i, row + e, next + i, next + i, row + e,
                    next + e);
        }
    }
    for (int i = 0; i < steps && poles; i++) {
        const int e = (i + 1) % steps, last = (rows - 1) * steps + 1, south = rows * steps + 1;
        fprintf(file, "f %d %d %d\nf %d %d %d\n", south, e + 1, i + 1, south + 1, last + i, last + e);
    }
    return !ferror(file);
}

int main(int argc, char **argv) {
    size_t kind = 0;
    const size_t count = sizeof shapes / sizeof shapes[0];
    if (argc == 2 && !strcmp(argv[1], "list")) {
        for (; kind < count; kind++) printf("%s\n", shapes[kind].name);
        return 0;
    }
    if (argc < 3 || argc > 4) return fail("", "usage: shape KIND OUT.obj [STEPS]; shape list");
    const int steps = argc > 3 ? atoi(argv[3]) : 96;
    while (kind < count && strcmp(argv[1], shapes[kind].name) != 0) kind++;
    if (kind == count) return fail(argv[1], "no such kind; see shape list");
    if (steps < 8 || steps > MAX_STEPS) return fail(argv[3], "give 8 to 2000 steps");
    FILE *file = fopen(argv[2], "wb");
    if (!file) return fail(argv[2], "cannot write");
    const int ok = write_obj(file, shapes[kind].at, shapes[kind].poles, steps);
    return fclose(file) == 0 && ok ? 0 : fail(argv[2], "cannot write");
}
