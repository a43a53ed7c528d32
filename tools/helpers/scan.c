/* scan.c - make a textured model with holes in its texture: scan KIND OUT SIDE [PHOTO]
   SPDX-License-Identifier: MIT OR Unlicense

   OUT.obj is the model, OUT.png its texture of SIDE x SIDE pixels, which is gray where it is missing,
   OUT-mask.png is white there, OUT-whole.png is the texture before. KIND is
     ball   a ball with bumps in six charts, drawn stripes that run across them, two holes
     ring   a torus in eight charts, every other one turned, covered with PHOTO and its mirror images,
            or with stripes; two holes
   Holes lie across seams. Around the charts are 4 pixels of gutter.                             */
#include "files/image_io.h"

#include <stdio.h>

enum { GUTTER = 4, STEPS = 24, MAX_CHARTS = 8, GRAY = 128 };

/* Where a chart lies in the texture, and whether it is turned by half a turn. */
typedef struct chart {
    int x, y, width, height, turned;
} chart;

typedef struct model {
    int charts, columns, rows, is_ring;
    const txm_image *photo; /* or NULL */
} model;

typedef struct point {
    double x, y, z;
} point;

static chart place(const model *m, int k, int side) {
    const int w = side / m->columns, h = side / m->rows;
    const int square = w < h ? w : h;
    chart c = {k % m->columns * w + GUTTER, k / m->columns * h + GUTTER, w - 2 * GUTTER,
               h - 2 * GUTTER, m->is_ring && k % 2};
    if (!m->is_ring) c.width = c.height = square - 2 * GUTTER;
    return c;
}

/* The place on the cube of side k, u and v 0..n: whole numbers, so that neighbouring sides agree. */
static void on_cube(int k, double u, double v, double n, double c[3]) {
    const int axis = k / 2;
    c[axis] = k % 2 ? 0 : n;
    c[(axis + 1) % 3] = k % 2 ? v : u;
    c[(axis + 2) % 3] = k % 2 ? u : v;
}

/* The point of chart k at u, v, 0..1 each. */
static point at(const model *m, int k, double u, double v) {
    point p;
    if (m->is_ring) {
        const int row = k / 4;
        const double s = 2 * TXM_PI * (k % 4 + u) / 4, t = 2 * TXM_PI * (row + v) / 2;
        const double r = 1 + 0.45 * cos(t);
        p.x = r * cos(s), p.y = 0.45 * sin(t), p.z = -r * sin(s);
        return p;
    }
    double c[3], length = 0;
    on_cube(k, u, v, 1, c);
    for (int i = 0; i < 3; i++) { /* equal steps on the cube become nearly equal angles */
        c[i] = tan(TXM_PI / 4 * (2 * c[i] - 1));
        length += c[i] * c[i];
    }
    for (int i = 0; i < 3; i++) c[i] /= sqrt(length);
    const double r = 1 + 0.10 * sin(3.1 * c[0] + 1) * cos(2.3 * c[1]) + 0.08 * sin(4.3 * c[2] - 2 * c[1]);
    p.x = r * c[0], p.y = r * c[1], p.z = r * c[2];
    return p;
}

/* ---- colors ---------------------------------------------------------------------------------- */

static unsigned char to_byte(double v) {
    return (unsigned char)(v < 0 ? 0 : v > 255 ? 255 : v + 0.5);
}

/* Stripes across a tilted axis, of two colors, a little wavy and grainy. */
static void stripes(const point *p, uint64_t grain, unsigned char *rgb) {
    static const double light[3] = {232, 222, 198}, dark[3] = {58, 74, 120};
    const double phase = 2.6 * (0.35 * p->x + 0.9 * p->y + 0.2 * p->z) + 0.25 * sin(3 * p->x + 1) +
                         0.2 * cos(4 * p->z);
    const double wave = sin(2 * TXM_PI * phase) / 0.3;
    const double t = wave < -1 ? 0 : wave > 1 ? 1 : (wave + 1) / 2;
    const double noise = (double)(txm_hash(grain) >> 56) / 16 - 8;
    for (int c = 0; c < 3; c++) rgb[c] = to_byte(light[c] * (1 - t) + dark[c] * t + noise);
}

/* 0..n - 1, there and back again */
static int mirror(double place, int n) {
    const int i = (int)floor(place * n) % (2 * n);
    return i < n ? i : 2 * n - 1 - i;
}

static void color(const model *m, int k, double u, double v, uint64_t grain, unsigned char *rgb) {
    const point p = at(m, k, u, v);
    if (!m->photo) {
        stripes(&p, grain, rgb);
        return;
    }
    const int row = k / 4;
    const int x = mirror(k % 4 + u, m->photo->width), y = mirror(row + v, m->photo->height);
    memcpy(rgb, (const unsigned char *)txm_image_row_const(m->photo, y) + 3 * x, 3);
}

/* Does the point lie in a hole? They are balls around points at seams, with a wavy rim. */
static int is_missing(const model *m, const point *p) {
    static const double balls[2][2][4] = {{{0.62, 0.5, 0.6, 0.42}, {-0.7, 0.1, -0.75, 0.3}},
                                          {{0, 0.1, -1.45, 0.36}, {-0.95, 0.3, 0.95, 0.3}}};
    for (int i = 0; i < 2; i++) {
        const double *b = balls[m->is_ring][i];
        const double x = p->x - b[0], y = p->y - b[1], z = p->z - b[2];
        if (sqrt(x * x + y * y + z * z) < b[3] * (1 + 0.12 * sin(9 * p->x + 7 * p->y) * cos(8 * p->z)))
            return 1;
    }
    return 0;
}

/* ---- files ----------------------------------------------------------------------------------- */

static int fail(const char *what, const char *why) {
    fprintf(stderr, "scan: '%s': %s\n", what, why);
    return 1;
}

/* A grid of STEPS x STEPS quads for each chart. Vertices at seams stand there twice, at the same place:
   numbers have few digits, so that all charts give the same ones. */
static int write_obj(const model *m, const char *path, int side) {
    FILE *file = fopen(path, "wb");
    if (!file) return fail(path, "cannot write");
    fprintf(file, "# texkit scan\n");
    for (int k = 0; k < m->charts; k++) {
        const chart c = place(m, k, side);
        for (int i = 0; i < (STEPS + 1) * (STEPS + 1); i++) {
            const int column = i % (STEPS + 1), row = i / (STEPS + 1);
            const double u = (double)column / STEPS, v = (double)row / STEPS;
            const double a = c.turned ? 1 - u : u, b = c.turned ? 1 - v : v;
            const point p = at(m, k, u, v);
            fprintf(file, "v %.5f %.5f %.5f\nvt %.6f %.6f\n", p.x + 0.0, p.y + 0.0, p.z + 0.0,
                    (c.x + a * c.width) / side, 1 - (c.y + b * c.height) / side);
        }
    }
    for (int k = 0; k < m->charts; k++) {
        for (int i = 0; i < STEPS * STEPS; i++) {
            const int a = k * (STEPS + 1) * (STEPS + 1) + i / STEPS * (STEPS + 1) + i % STEPS + 1;
            const int b = a + 1, d = a + STEPS + 1, e = d + 1;
            fprintf(file, "f %d/%d %d/%d %d/%d\nf %d/%d %d/%d %d/%d\n", a, a, b,
                    b, e, e, a, a, e, e, d, d);
        }
    }
    const int ok = !ferror(file);
    return fclose(file) == 0 && ok ? 0 : fail(path, "cannot write");
}

static void draw(const model *m, const txm_image *whole, const txm_image *hole, const txm_image *mask) {
    for (int k = 0; k < m->charts; k++) {
        const chart c = place(m, k, whole->width);
        for (int y = -GUTTER; y < c.height + GUTTER; y++) {
            for (int x = -GUTTER; x < c.width + GUTTER; x++) {
                double u = txm_clampf(((float)x + 0.5f) / (float)c.width, 0, 0.99999f);
                double v = txm_clampf(((float)y + 0.5f) / (float)c.height, 0, 0.99999f);
                const size_t i = (size_t)(c.y + y) * (size_t)whole->width + (size_t)(c.x + x);
                unsigned char *rgb = (unsigned char *)whole->pixels + 3 * i;
                if (c.turned) u = 1 - u, v = 1 - v;
                const point p = at(m, k, u, v);
                color(m, k, u, v, i, rgb);
                const int missing = is_missing(m, &p);
                ((unsigned char *)mask->pixels)[i] = missing ? 255 : 0;
                for (size_t n = 0; n < 3; n++)
                    ((unsigned char *)hole->pixels)[3 * i + n] = missing ? GRAY : rgb[n];
            }
        }
    }
}

int main(int argc, char **argv) {
    model m = {6, 3, 2, 0, NULL};
    txm_image photo = {0}, pictures[3] = {{0}, {0}, {0}};
    const char *why = "out of memory", *const endings[3] = {"-whole.png", ".png", "-mask.png"};
    char path[1024];
    const int side = argc > 3 ? atoi(argv[3]) : 0;
    if (argc < 4 || argc > 5) return fail("", "usage: scan ball|ring OUT SIDE [PHOTO]");
    if (!strcmp(argv[1], "ring")) {
        m.charts = MAX_CHARTS, m.columns = m.rows = 4, m.is_ring = 1;
    } else if (strcmp(argv[1], "ball") != 0) {
        return fail(argv[1], "no such kind: ball or ring");
    }
    if (side < 64 || side > 8192) return fail(argv[3], "give a side of 64 to 8192 pixels");
    if (argc == 5 && !image_read(argv[4], 3, &photo, &why)) return fail(argv[4], why);
    if (argc == 5 && m.is_ring) m.photo = &photo;
    int status = 0;
    for (int i = 0; i < 3 && !status; i++) {
        if (!image_new(side, side, i < 2 ? 3 : 1, TXM_U8, &pictures[i])) status = fail(argv[2], why);
    }
    if (!status) draw(&m, &pictures[0], &pictures[1], &pictures[2]);
    for (int i = 0; i < 3 && !status; i++) {
        snprintf(path, sizeof path, "%s%s", argv[2], endings[i]);
        if (!image_write(path, &pictures[i], &why)) status = fail(path, why);
    }
    snprintf(path, sizeof path, "%s.obj", argv[2]);
    if (!status) status = write_obj(&m, path, side);
    for (int i = 0; i < 3; i++) image_free(&pictures[i]);
    image_free(&photo);
    return status;
}
