/* draw.c - draw an exemplar if there is no photograph: draw KIND OUT.png [SIDE [CHANNELS]]
   SPDX-License-Identifier: MIT OR Unlicense

   The pictures are the project's own, drawn with integers only, so they are the same everywhere.
   Channels: 1, 3 (default) or 4, whose alpha is made of one of the others.

   draw discs OUT.png SIDE X,Y,W,H... draws a mask: white in the ellipses of these boxes.        */
#include "files/image_io.h"

#include <stdio.h>

enum { MAX_SIDE = 4096 };

static int clamp_byte(int v) {
    return v < 0 ? 0 : v > 255 ? 255 : v;
}

/* 0..255 at random for a lattice point, the same on each call */
static int at_random(int x, int y, int which) {
    uint64_t place = (uint64_t)(uint32_t)x << 32 | (uint32_t)y;
    return (int)(txm_hash(place + 0x9e3779b97f4a7c15u * (uint64_t)(uint32_t)(which + 1)) >> 56);
}

/* smooth noise 0..255: random values on a lattice of that spacing, blended between its points */
static int noise(int x, int y, int spacing, int which) {
    int i = x / spacing, j = y / spacing, u = x % spacing, v = y % spacing;
    int top = at_random(i, j, which) * (spacing - u) + at_random(i + 1, j, which) * u;
    int low = at_random(i, j + 1, which) * (spacing - u) + at_random(i + 1, j + 1, which) * u;
    return (top * (spacing - v) + low * v) / (spacing * spacing);
}

/* a wave of period 256 between -255 and 255, made of parabolas */
static int wave(int phase) {
    int t = phase & 255, half = t & 127;
    int v = half * (128 - half) * 255 / 4096;
    return t < 128 ? v : -v;
}

typedef void drawing(int x, int y, int rgb[3]);

/* fine and coarse noise on top of each other */
static void draw_clouds(int x, int y, int rgb[3]) {
    int v = (4 * noise(x, y, 24, 0) + 3 * noise(x, y, 9, 1) + 2 * noise(x, y, 4, 2)) / 9;
    int grain = at_random(x, y, 3) / 8;
    rgb[0] = v * 5 / 4 - 20 + grain;
    rgb[1] = v + grain;
    rgb[2] = v * 3 / 4 + 10 + grain;
}

/* grains of sand: every pixel on its own, and a few large dark ones */
static void draw_sand(int x, int y, int rgb[3]) {
    int v = 130 + at_random(x, y, 0) / 4 + noise(x, y, 3, 1) / 4;
    if (noise(x, y, 5, 2) > 190) v -= 70;
    rgb[0] = v + 20;
    rgb[1] = v;
    rgb[2] = v - 50 + noise(x, y, 16, 3) / 8;
}

/* wavy stripes, like ripples */
static void draw_stripes(int x, int y, int rgb[3]) {
    int bend = noise(x, y, 32, 0) + noise(x, y, 12, 1) / 3;
    int v = 128 + wave(16 * y + 2 * bend) / 3 + at_random(x, y, 2) / 10;
    rgb[0] = v;
    rgb[1] = v - 15;
    rgb[2] = v - 40;
}

/* pebbles: each pixel belongs to the nearest of one random point per lattice square */
static void draw_cells(int x, int y, int rgb[3]) {
    const int spacing = 12;
    int best = 1 << 30, second = 1 << 30, tone = 0;
    for (int j = y / spacing - 1; j <= y / spacing + 1; j++) {
        for (int i = x / spacing - 1; i <= x / spacing + 1; i++) {
            int dx = i * spacing + at_random(i, j, 0) * spacing / 256 - x;
            int dy = j * spacing + at_random(i, j, 1) * spacing / 256 - y;
            int d = dx * dx + dy * dy;
            if (d < best) {
                second = best;
                best = d;
                tone = at_random(i, j, 2);
            } else if (d < second) {
                second = d;
            }
        }
    }
    int v = second - best < 14 ? 40 : 100 + tone / 2 - best;
    v += at_random(x, y, 3) / 12;
    rgb[0] = v;
    rgb[1] = v - 5 + tone / 16;
    rgb[2] = v - 25 + tone / 8;
}

/* blades of grass: short strokes across noise */
static void draw_blades(int x, int y, int rgb[3]) {
    int v = noise(x + y / 3, y, 3, 0) / 2 + noise(2 * x + 3 * MAX_SIDE - y, y / 2, 4, 1) / 2;
    v = v * 3 / 2 - 60 + noise(x, y, 20, 2) / 4;
    rgb[0] = v * 2 / 3;
    rgb[1] = v + 25;
    rgb[2] = v / 3;
}

/* a woven grid with thread noise */
static void draw_weave(int x, int y, int rgb[3]) {
    int over = ((x / 8) + (y / 8)) & 1;
    int v = 120 + wave(over ? 16 * y : 16 * x) / 5 * (((over ? y : x) / 8) & 1 ? -1 : 1);
    v += noise(over ? x : x * 4, over ? y * 4 : y, 6, 4) / 4 + at_random(x, y, 5) / 16;
    rgb[0] = v - 30;
    rgb[1] = v - 20;
    rgb[2] = v + 10;
}

/* What a wall of bricks has at (x, y): how deep inside a brick, 0 for the joint, up to 256; tone: a
   number 0..255 of the brick. Courses are 22 pixels high, bricks 44 long, every second course moved
   by half of one; edges are a little uneven. */
static int brick_at(int x, int y, int *tone) {
    const int wide = 44, high = 22, joint = 4;
    const int u = x + (noise(x, y, 7, 0) - 128) / 80, v = y + (noise(x, y, 9, 1) - 128) / 80;
    const int course = v / high, along = u + course % 2 * (wide / 2);
    const int i = along % wide, j = v % high;
    const int from_end = i < wide - 1 - i ? i : wide - 1 - i;
    const int from_bed = j < high - 1 - j ? j : high - 1 - j;
    const int inside = (from_end < from_bed ? from_end : from_bed) - joint / 2 + 1;
    *tone = at_random(along / wide, course, 2);
    return inside < 0 ? 0 : inside > 4 ? 256 : 64 * inside;
}

/* a wall of bricks in running bond */
static void draw_bricks(int x, int y, int rgb[3]) {
    int tone, deep = brick_at(x, y, &tone);
    int grain = at_random(x, y, 3) / 16 + noise(x, y, 3, 4) / 10 - 20;
    int light = (256 - deep) / 12; /* the edges of a brick are worn */
    rgb[0] = (deep * (118 + tone / 4 + light) + (256 - deep) * 190) / 256 + grain;
    rgb[1] = (deep * (62 + tone / 5 + light) + (256 - deep) * 182) / 256 + grain;
    rgb[2] = (deep * (50 + tone / 6 + light) + (256 - deep) * 168) / 256 + grain;
}

/* how far the same wall stands out: a height map in register with it */
static void draw_bricks_height(int x, int y, int rgb[3]) {
    int tone, deep = brick_at(x, y, &tone);
    rgb[0] = rgb[1] = rgb[2] = 40 + deep * (160 + tone / 8) / 256 + noise(x, y, 3, 4) / 16;
}

static const struct {
    const char *name;
    drawing *draw;
} kinds[] = {{"clouds", draw_clouds}, {"sand", draw_sand},     {"stripes", draw_stripes},
             {"cells", draw_cells},   {"blades", draw_blades}, {"weave", draw_weave},
             {"bricks", draw_bricks}, {"bricks-height", draw_bricks_height}};

static int fail(const char *path, const char *why) {
    fprintf(stderr, "draw: '%s': %s\n", path, why);
    return 1;
}

/* A mask of one channel; texts: the boxes of its ellipses. Returns NULL, or what went wrong. */
static const char *draw_discs(const txm_image *out, char **texts, int count) {
    unsigned char *to = (unsigned char *)out->pixels;
    memset(to, 0, (size_t)out->width * (size_t)out->height);
    for (int k = 0; k < count; k++) {
        int left, top, width, height;
        if (sscanf(texts[k], "%d,%d,%d,%d", &left, &top, &width, &height) != 4 || width < 1 ||
            width > MAX_SIDE || height < 1 || height > MAX_SIDE)
            return "a box is X,Y,W,H";
        for (int i = 0; i < out->width * out->height; i++) {
            const int x = i % out->width - left, y = i / out->width - top;
            const double u = 2 * (x + 0.5) / width - 1, v = 2 * (y + 0.5) / height - 1;
            if (u * u + v * v <= 1) to[i] = 255;
        }
    }
    return NULL;
}

int main(int argc, char **argv) {
    txm_image out = {0};
    const char *why = NULL;
    size_t kind = 0, count = sizeof kinds / sizeof kinds[0];
    if (argc == 2 && !strcmp(argv[1], "list")) {
        for (kind = 0; kind < count; kind++) printf("%s\n", kinds[kind].name);
        return 0;
    }
    if (argc < 3) return fail("", "usage: draw KIND OUT.png [SIDE [CHANNELS]]; draw list");
    const int discs = !strcmp(argv[1], "discs");
    int side = argc > 3 ? atoi(argv[3]) : 256, channels = discs ? 1 : argc > 4 ? atoi(argv[4]) : 3;
    while (kind < count && strcmp(argv[1], kinds[kind].name) != 0) kind++;
    if (kind == count && !discs) return fail(argv[1], "no such kind; see draw list");
    if (side < 1 || side > MAX_SIDE || channels < 1 || channels > 4)
        return fail(argv[2], "bad size");

    out.width = out.height = side;
    out.channels = channels;
    out.pixels = malloc((size_t)side * (size_t)side * 4);
    if (!out.pixels) return fail(argv[2], "out of memory");
    unsigned char *to = (unsigned char *)out.pixels;
    if (discs) why = draw_discs(&out, argv + 4, argc > 4 ? argc - 4 : 0);
    for (int y = 0; y < side && !discs; y++) {
        for (int x = 0; x < side; x++) {
            int rgb[3];
            kinds[kind].draw(x + 64, y + 64, rgb); /* away from negative lattice points */
            int gray = (2 * rgb[0] + 5 * rgb[1] + rgb[2]) / 8;
            for (int k = 0; k < (channels < 3 ? 1 : 3); k++)
                *to++ = (unsigned char)clamp_byte(channels < 3 ? gray : rgb[k]);
            if (channels % 2 == 0) *to++ = (unsigned char)(gray > 110 ? 255 : clamp_byte(2 * gray));
        }
    }

    const int ok = !why && image_write(argv[2], &out, &why);
    free(out.pixels);
    return ok ? 0 : fail(argv[2], why);
}
