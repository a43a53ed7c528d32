/* bench_inpaint.c - seconds and memory of completion, and what each step contributes
   SPDX-License-Identifier: MIT OR Unlicense

   bench_inpaint [--ablation DIR] [PICTURE | FOLDER]...

   The first table completes holes in textures of 1024 x 1024 texels on a ball of 19,200 triangles, in
   drawn bars, and in each PICTURE, which is repeated in mirror images to 512 x 512 pixels. A FOLDER
   is a case with a known answer: truth.png, mask.png, and mesh.obj if truth.png is the texture of a
   mesh. The second table leaves out one step at a time; DIR receives a picture of what each made,
   and sheet.png, which shows a part of the last three: the truth, the hole, then what was made in the
   order of the table.
   Seconds are of the clock; those of the second table, of the processor.

     edges   F measure of the edges in the hole against the true ones, within 2 pixels and 30 degrees:
             1 is the truth
     detail  mean difference of neighbours in the hole over the truth's: below 1 is blurred
     border  the same across the border of the hole: above 1 it shows                             */
#define _XOPEN_SOURCE 700 /* clock_gettime, popen */
static int bench_left_out;
#define TXI_LEFT_OUT bench_left_out
#define TEXINPAINT_IMPLEMENTATION
#include "texinpaint.h"
#include "texinpaint/config.h" /* the steps that can be left out */

#include "bench.h"
#include "files/mesh_io.h"

#include <limits.h>

enum { STEPS = 40, CHART = 320, ATLAS = 1024, SIDE = 512, MOST_SCENES = 32, MOST_PATH = 1024 };

/* Something to complete, and the truth. */
typedef struct scene {
    char name[32];
    txm_image truth, mask;
    float *positions, *uv;
    uint32_t *indices;
    mesh_data mesh; /* of a folder */
    texinpaint_desc desc;
    int is_drawn; /* its edges tell how well lines go on */
} scene;

static void *need(void *block) {
    if (!block) give_up("memory", "out of it");
    return block;
}

static void begin_scene(scene *s, const char *name, int side) {
    memset(s, 0, sizeof *s);
    snprintf(s->name, sizeof s->name, "%s", name);
    if (!image_new(side, side, 3, TXM_U8, &s->truth) || !image_new(side, side, 1, TXM_U8, &s->mask))
        give_up(name, "out of memory");
    s->desc.image = s->truth;
    s->desc.mask = s->mask;
    s->desc.seed = 1;
}

static void end_scene(scene *s) {
    image_free(&s->truth);
    image_free(&s->mask);
    free(s->positions);
    free(s->uv);
    free(s->indices);
    mesh_free(&s->mesh);
}

static unsigned char *pixel(const scene *s, int x, int y) {
    return (unsigned char *)s->truth.pixels + 3 * ((size_t)y * (size_t)s->truth.width + (size_t)x);
}

static void set_missing(const scene *s, int x, int y) {
    ((unsigned char *)s->mask.pixels)[(size_t)y * (size_t)s->truth.width + (size_t)x] = 255;
}

static int is_missing(const scene *s, int x, int y) {
    return ((const unsigned char *)s->mask.pixels)[(size_t)y * (size_t)s->truth.width + (size_t)x];
}

/* ---- scenes ---------------------------------------------------------------------------------- */

/* The point of side k of a cube, blown up to a ball. */
static void on_ball(int k, double u, double v, double p[3]) {
    const int axis = k / 2;
    double length = 0;
    p[axis] = k % 2 ? -1 : 1;
    p[(axis + 1) % 3] = tan(TXM_PI / 4 * (2 * (k % 2 ? v : u) - 1));
    p[(axis + 2) % 3] = tan(TXM_PI / 4 * (2 * (k % 2 ? u : v) - 1));
    for (int i = 0; i < 3; i++) length += p[i] * p[i];
    for (int i = 0; i < 3; i++) p[i] /= sqrt(length);
}

/* Wavy stripes on a ball of six charts; the hole is a disc, of that share of the surface, about a corner
   where three charts meet. */
static void make_ball(scene *s, const char *name, double share) {
    const size_t row = STEPS + 1, vertices = 6 * row * row, faces = 12 * STEPS * STEPS;
    const double reach = 1 - 2 * share; /* cosine of the radius of a cap of that share */
    begin_scene(s, name, ATLAS);
    s->is_drawn = 1;
    s->positions = (float *)need(malloc(3 * vertices * sizeof(float)));
    s->uv = (float *)need(malloc(2 * vertices * sizeof(float)));
    s->indices = (uint32_t *)need(malloc(3 * faces * sizeof(uint32_t)));
    uint32_t *to = s->indices;
    for (size_t k = 0; k < 6; k++) {
        const int left = 10 + (int)(k % 3) * (CHART + 20), top = 10 + (int)(k / 3) * (CHART + 20);
        for (size_t i = 0; i < row * row; i++) {
            const size_t column = i % row, line = i / row;
            const double u = (double)column / STEPS, v = (double)line / STEPS;
            const size_t at = k * row * row + i;
            double p[3];
            on_ball((int)k, u, v, p);
            for (size_t n = 0; n < 3; n++) s->positions[3 * at + n] = (float)(floor(p[n] * 1e5 + 0.5) / 1e5);
            s->uv[2 * at] = (float)((left + u * CHART) / ATLAS);
            s->uv[2 * at + 1] = (float)((top + v * CHART) / ATLAS);
            if (column == STEPS || line == STEPS) continue;
            const size_t corners[6] = {at, at + 1, at + row + 1, at, at + row + 1, at + row};
            for (int n = 0; n < 6; n++) *to++ = (uint32_t)corners[n];
        }
        for (int y = -4; y < CHART + 4; y++) {
            for (int x = -4; x < CHART + 4; x++) {
                double p[3];
                on_ball((int)k, txm_clampf(((float)x + 0.5f) / CHART, 0, 1),
                        txm_clampf(((float)y + 0.5f) / CHART, 0, 1), p);
                const int px = left + x, py = top + y;
                const double wave = sin(30 * (0.3 * p[0] + 0.9 * p[1] + 0.2 * p[2]) +
                                        3 * sin(3 * p[0] + 1) + 2 * cos(4 * p[2]));
                const int light = wave > 0, grain = (int)(txm_hash((uint64_t)(py * ATLAS + px)) >> 59);
                unsigned char *rgb = pixel(s, px, py);
                for (int c = 0; c < 3; c++)
                    rgb[c] = (unsigned char)((light ? 210 - 10 * c : 50 + 20 * c) + grain);
                if ((p[0] + p[1] + p[2]) / sqrt(3.0) > reach) set_missing(s, px, py);
            }
        }
    }
    s->desc.mesh.positions = s->positions;
    s->desc.mesh.indices = s->indices;
    s->desc.mesh.vertex_count = vertices;
    s->desc.mesh.face_count = faces;
    s->desc.uv = s->uv;
    s->desc.uv_count = vertices;
}

/* An ellipse of a twentieth of the picture. */
static void cut_ellipse(scene *s) {
    const double rx = 0.14 * SIDE, ry = 0.05 * SIDE * SIDE / (TXM_PI * rx);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const double u = (x - 0.5 * SIDE) / rx, v = (y - 0.5 * SIDE) / ry;
            if (u * u + v * v < 1) set_missing(s, x, y);
        }
    }
}

/* Three straight bars and a bent one, which cross and meet in the hole. */
static void make_bars(scene *s) {
    static const int bars[4][6] = {{3, 4, 1792, 60, 40, 70}, {4, -3, 300, 40, 170, 40},
                                   {1, 0, 268, 8, 40, 40}, {0, 1, 210, 12, 60, 120}};
    begin_scene(s, "bars", SIDE);
    s->is_drawn = 1;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const int grain = (int)(txm_hash((uint64_t)(y * SIDE + x)) >> 60);
            int color[3] = {214, 210, 196};
            for (int b = 0; b < 4; b++) {
                const int *bar = bars[b], bend = b == 3 ? (x - 256) * (x - 256) / 900 : 0;
                if (abs(bar[0] * x + bar[1] * (y - bend) - bar[2]) > bar[3]) continue;
                for (int c = 0; c < 3; c++) color[c] = bar[4] + (c == b % 3 ? bar[5] : 0);
            }
            for (int c = 0; c < 3; c++) pixel(s, x, y)[c] = (unsigned char)(color[c] + grain);
        }
    }
    cut_ellipse(s);
}

/* A picture and its mirror images. */
static void make_picture(scene *s, const char *path) {
    txm_image in;
    const char *why;
    if (!image_read(path, 3, &in, &why)) give_up(path, why);
    begin_scene(s, file_name(path), SIDE);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const int u = x % (2 * in.width), v = y % (2 * in.height);
            const unsigned char *row = (const unsigned char *)txm_image_row_const(
                &in, v < in.height ? v : 2 * in.height - 1 - v);
            memcpy(pixel(s, x, y), row + 3 * (u < in.width ? u : 2 * in.width - 1 - u), 3);
        }
    }
    cut_ellipse(s);
    image_free(&in);
}

/* A file of a folder into path: is there one? */
static int find_file(const char *folder, const char *name, char path[MOST_PATH]) {
    snprintf(path, MOST_PATH, "%s/%s", folder, name);
    return access(path, R_OK) == 0;
}

/* A case with a known answer. Whether lines go on is measured as in drawn scenes. */
static void make_case(scene *s, const char *folder) {
    char path[MOST_PATH];
    const char *why;
    memset(s, 0, sizeof *s);
    snprintf(s->name, sizeof s->name, "%s", file_name(folder));
    find_file(folder, "truth.png", path);
    if (!image_read(path, 3, &s->truth, &why)) give_up(path, why);
    find_file(folder, "mask.png", path);
    if (!image_read(path, 1, &s->mask, &why)) give_up(path, why);
    if (s->mask.width != s->truth.width || s->mask.height != s->truth.height)
        give_up(path, "not as large as truth.png");
    s->is_drawn = 1;
    s->desc.image = s->truth;
    s->desc.mask = s->mask;
    s->desc.seed = 1;
    if (!find_file(folder, "mesh.obj", path)) return;
    if (!mesh_read(path, 0, &s->mesh, &why)) give_up(path, why);
    if (!s->mesh.uvs) give_up(path, "no texture coordinates");
    s->desc.mesh = mesh_view(&s->mesh);
    s->desc.uv = s->mesh.uvs;
    s->desc.uv_count = 3 * s->mesh.triangle_count;
}

/* ---- how good a result is -------------------------------------------------------------------- */

static int luma(const txm_image *im, int x, int y) {
    const unsigned char *p = (const unsigned char *)im->pixels + 3 * ((size_t)y * (size_t)im->width + (size_t)x);
    return 2 * p[0] + 5 * p[1] + p[2]; /* 0..2040 */
}

/* Gradient of the mean over 3 x 3; its length, 0..255 or more. */
static double gradient(const txm_image *im, int x, int y, double g[2]) {
    int sx = 0, sy = 0;
    for (int d = -1; d <= 1; d++) {
        for (int e = 1; e <= 2; e++) {
            sx += luma(im, x + e, y + d) - luma(im, x - e, y + d);
            sy += luma(im, x + d, y + e) - luma(im, x + d, y - e);
        }
    }
    g[0] = sx / 48.0;
    g[1] = sy / 48.0;
    return sqrt(g[0] * g[0] + g[1] * g[1]);
}

/* The share of a's edges in the hole that b has, too. */
static double edges_in(const scene *s, const txm_image *a, const txm_image *b) {
    enum { LEAST = 24, REACH = 2 };
    double all = 0, found = 0;
    for (int y = 8; y < a->height - 8; y++) {
        for (int x = 8; x < a->width - 8; x++) {
            double g[2], h[2];
            if (!is_missing(s, x, y) || gradient(a, x, y, g) < LEAST) continue;
            int hit = 0;
            for (int v = -REACH; v <= REACH && !hit; v++) {
                for (int u = -REACH; u <= REACH && !hit; u++) {
                    const double m = gradient(b, x + u, y + v, h);
                    const double n = sqrt(g[0] * g[0] + g[1] * g[1]);
                    hit = m >= LEAST && g[0] * h[0] + g[1] * h[1] > 0.86 * m * n;
                }
            }
            all += 1;
            found += hit;
        }
    }
    return all > 0 ? found / all : 1;
}

/* Mean differences of neighbours: both missing, or one of them. */
static void differences(const scene *s, const txm_image *im, double mean[2]) {
    double sum[2] = {0, 0}, n[2] = {1e-9, 1e-9};
    for (int y = 1; y < im->height; y++) {
        for (int x = 1; x < im->width; x++) {
            for (int down = 0; down < 2; down++) {
                const int there = is_missing(s, x - !down, y - down) != 0, here = is_missing(s, x, y) != 0;
                if (!there && !here) continue;
                sum[there != here] += abs(luma(im, x, y) - luma(im, x - !down, y - down));
                n[there != here] += 1;
            }
        }
    }
    for (int k = 0; k < 2; k++) mean[k] = sum[k] / n[k] + 1;
}

typedef struct marks {
    double edges, detail, border, seconds;
} marks;

static marks judge(const scene *s, const txm_image *made, double seconds) {
    marks m;
    double now[2], then[2];
    const double hit = edges_in(s, &s->truth, made), true_ones = edges_in(s, made, &s->truth);
    differences(s, made, now);
    differences(s, &s->truth, then);
    m.edges = 2 * hit * true_ones / (hit + true_ones + 1e-9);
    m.detail = now[0] / then[0];
    m.border = now[1] / then[1];
    m.seconds = seconds;
    return m;
}

/* ---- tables ---------------------------------------------------------------------------------- */

/* Complete a scene; *preview: seconds until the first step is done. */
static result run(const scene *s, int threads, txm_image *out, double *preview) {
    txm_env env = make_env(&threads);
    texinpaint_job *job = NULL;
    result r = no_result;
    int more = 1;
    const watch w = start();
    txm_status status = texinpaint_begin(&s->desc, &env, &job);
    for (int step = 0; status == TXM_OK && more; step++) {
        status = texinpaint_step(job, &env, &more);
        if (step == 0) *preview = clock_of(CLOCK_MONOTONIC) - w.wall;
    }
    if (status == TXM_OK) status = texinpaint_draw(job, 0, &env, out);
    stop(&w, &r);
    texinpaint_free(job);
    if (status != TXM_OK) give_up(s->name, env.message);
    return r;
}

static void times(const scene *scenes, int count, txm_image *out) {
    const int threads = env_cores();
    printf("completing a hole; seconds on 1 and on %d threads\n\n", threads);
    printf("%-16s %9s  hole %%  preview 1 thread %2d threads speedup peak MiB  edges detail border\n",
           "what", "size", threads);
    for (int i = 0; i < count; i++) {
        const scene *s = &scenes[i];
        double preview = 0, missing = 0, ignored;
        for (int k = 0; k < s->mask.width * s->mask.height; k++)
            missing += ((const unsigned char *)s->mask.pixels)[k] != 0;
        const result all = run(s, threads, out + i, &ignored), one = run(s, 1, out + i, &preview);
        const marks m = judge(s, out + i, one.seconds);
        printf("%-16s %4dx%-4d %7.2f %8.2f %8.2f %10.2f %7.2f %8.1f %6.3f %6.2f %6.2f\n", s->name,
               s->truth.width, s->truth.height, 100 * missing / s->mask.width / s->mask.height, preview,
               one.seconds, all.seconds, one.seconds / all.seconds, mebibytes(one.peak), m.edges,
               m.detail, m.border);
        fflush(stdout);
    }
}

static void keep_picture(const char *folder, const char *name, const scene *s, const txm_image *out) {
    char path[MOST_PATH];
    const char *why;
    snprintf(path, sizeof path, "%s/%s-%s.png", folder, s->name, name);
    if (!image_write(path, out, &why)) give_up(path, why);
}

/* ---- the sheet ------------------------------------------------------------------------------- */

enum {
    SHEET_SCENES = 3, /* the last ones                                                            */
    SHEET_LINES = 2,  /* of tiles, for each scene                                                 */
    SHEET_COLUMNS = 7,
    TILE = 128,  /* pixels of a side                                                              */
    TILE_GAP = 2,
    TILE_STEP = 8, /* pixels between the places that are tried                                    */
    HOLE_GRAY = 128
};

/* The corner of the tile that shows most of the hole. */
static void find_tile(const scene *s, int corner[2]) {
    int most = -1;
    for (int y = 0; y + TILE <= s->truth.height; y += TILE_STEP) {
        for (int x = 0; x + TILE <= s->truth.width; x += TILE_STEP) {
            int count = 0;
            for (int k = 0; k < TILE * TILE; k += TILE_STEP)
                count += is_missing(s, x + k % TILE, y + k / TILE) != 0;
            if (count <= most) continue;
            most = count;
            corner[0] = x;
            corner[1] = y;
        }
    }
}

static void make_sheet(txm_image *sheet) {
    if (!image_new(SHEET_COLUMNS * (TILE + TILE_GAP) - TILE_GAP,
                   SHEET_SCENES * SHEET_LINES * (TILE + TILE_GAP) - TILE_GAP, 3, TXM_U8, sheet))
        give_up("sheet", "out of memory");
    memset(sheet->pixels, UCHAR_MAX, 3 * (size_t)sheet->width * (size_t)sheet->height);
}

/* Tile number k of a scene, which is line * SHEET_LINES further down; with is_hole it is gray there. */
static void add_tile(txm_image *sheet, int line, int k, const scene *s, const txm_image *from,
                     int is_hole) {
    const int left = k % SHEET_COLUMNS * (TILE + TILE_GAP);
    const int top = (line * SHEET_LINES + k / SHEET_COLUMNS) * (TILE + TILE_GAP);
    int corner[2] = {0, 0};
    if (k >= SHEET_LINES * SHEET_COLUMNS) return;
    find_tile(s, corner);
    for (int y = 0; y < TILE && corner[1] + y < from->height; y++) {
        for (int x = 0; x < TILE && corner[0] + x < from->width; x++) {
            const size_t to = (size_t)(top + y) * (size_t)sheet->width + (size_t)(left + x);
            const size_t at = (size_t)(corner[1] + y) * (size_t)from->width + (size_t)(corner[0] + x);
            unsigned char *rgb = (unsigned char *)sheet->pixels + 3 * to;
            if (is_hole && is_missing(s, corner[0] + x, corner[1] + y)) memset(rgb, HOLE_GRAY, 3);
            else memcpy(rgb, (const unsigned char *)from->pixels + 3 * at, 3);
        }
    }
}

static void keep_sheet(const char *folder, const txm_image *sheet) {
    char path[MOST_PATH];
    const char *why;
    snprintf(path, sizeof path, "%s/sheet.png", folder);
    if (!image_write(path, sheet, &why)) give_up(path, why);
}

static void ablation(const scene *scenes, int count, txm_image *out, const char *folder) {
    static const struct {
        const char *name;
        int left_out, structure;
    } rows[] = {{"nothing", 0, TEXINPAINT_AUTO},
                {"lines", 0, TEXINPAINT_TEXTURE},
                {"choice: always picture", 0, TEXINPAINT_PICTURE},
                {"choice: always pattern", 0, TEXINPAINT_PATTERN},
                {"tensor voting", TXI_VOTES, TEXINPAINT_AUTO},
                {"matching of joins", TXI_MATCHING, TEXINPAINT_AUTO},
                {"strips of texture", TXI_STRIPS, TEXINPAINT_AUTO},
                {"belief propagation", TXI_BELIEF, TEXINPAINT_AUTO},
                {"turned copies", TXI_TURNS, TEXINPAINT_AUTO},
                {"expected detail", TXI_DETAIL, TEXINPAINT_AUTO},
                {"cuts of pieces", TXI_PIECES, TEXINPAINT_AUTO},
                {"Poisson blending", TXI_POISSON, TEXINPAINT_AUTO}};
    printf("\nwithout one step, one thread; edges: mean of drawn scenes, the rest: mean of pictures, of "
           "scenes without\nthem\n\nwithout                  edges detail border seconds\n");
    const int unshown = count - SHEET_SCENES;
    txm_image sheet;
    make_sheet(&sheet);
    for (int i = unshown; i < count; i++) {
        add_tile(&sheet, i - unshown, 0, &scenes[i], &scenes[i].truth, 0);
        add_tile(&sheet, i - unshown, 1, &scenes[i], &scenes[i].truth, 1);
    }
    for (size_t r = 0; r < sizeof rows / sizeof rows[0]; r++) {
        marks sum = {0, 0, 0, 0};
        int drawn = 0;
        for (int i = 0; i < count; i++) {
            scene s = scenes[i];
            double preview;
            s.desc.structure = rows[r].structure;
            bench_left_out = rows[r].left_out;
            const result one = run(&s, 1, out + i, &preview);
            const marks m = judge(&s, out + i, one.cpu);
            bench_left_out = 0;
            if (s.is_drawn) sum.edges += m.edges;
            else sum.detail += m.detail, sum.border += m.border;
            drawn += s.is_drawn;
            sum.seconds += m.seconds;
            if (folder) keep_picture(folder, rows[r].name, &s, out + i);
            if (i >= unshown) add_tile(&sheet, i - unshown, 2 + (int)r, &s, out + i, 0);
        }
        const double others = count > drawn ? count - drawn : 1;
        printf("%-24s %5.3f %6.2f %6.2f %7.2f\n", rows[r].name, drawn ? sum.edges / drawn : 0,
               sum.detail / others, sum.border / others, sum.seconds / count);
        fflush(stdout);
    }
    if (folder) keep_sheet(folder, &sheet);
    image_free(&sheet);
}

int main(int argc, char **argv) {
    static scene scenes[MOST_SCENES];
    static txm_image out[MOST_SCENES];
    const int has_folder = argc > 2 && !strcmp(argv[1], "--ablation");
    int count = 0;
    env_let_threads_sleep(argv);
    make_ball(&scenes[count++], "ball, 5 %", 0.05);
    make_ball(&scenes[count++], "ball, 10 %", 0.10);
    make_bars(&scenes[count++]);
    for (int i = has_folder ? 3 : 1; i < argc && count < MOST_SCENES; i++) {
        char path[MOST_PATH];
        if (find_file(argv[i], "truth.png", path)) make_case(&scenes[count++], argv[i]);
        else make_picture(&scenes[count++], argv[i]);
    }
    for (int i = 0; i < count; i++) {
        if (!image_new(scenes[i].truth.width, scenes[i].truth.height, 3, TXM_U8, &out[i]))
            give_up(scenes[i].name, "out of memory");
    }
    times(scenes, count, out);
    ablation(scenes, count, out, has_folder ? argv[2] : NULL);
    for (int i = 0; i < count; i++) {
        end_scene(&scenes[i]);
        image_free(&out[i]);
    }
    return 0;
}
