/* golden_texinpaint.c - hashes of completed pictures and textures of meshes; see golden.h
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#define TEXINPAINT_IMPLEMENTATION
#include "texinpaint.h"

#include "golden.h"

enum { SIDE = 96, WIDTH = 192, HEIGHT = 128, CELLS = 6, CELL = 64, MARGIN = 4 };
static uint8_t picture[WIDTH * HEIGHT * 4], mask[WIDTH * HEIGHT], out[WIDTH * HEIGHT * 4];

/* ---- pictures ---------------------------------------------------------------------------- */

/* two bars that cross, on rough ground */
static void draw_bars(uint8_t *to, int channels) {
    txm_rng rng = txm_rng_make(5, (uint64_t)channels);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const int is_bar = abs(x - y) < 7, is_thin = abs(3 * x + 4 * y - 330) < 20;
            for (int c = 0; c < channels; c++) {
                const int v = is_thin ? 40 + 60 * c : is_bar ? 220 - 30 * c : 130 + 10 * c;
                to[(y * SIDE + x) * channels + c] = (uint8_t)(v + (int)txm_rng_below(&rng, 8));
            }
        }
    }
}

/* an ellipse, and a corner of the picture */
static void draw_hole(int rx, int ry) {
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const int u = x - SIDE / 2, v = y - SIDE / 2;
            const int inside = u * u * ry * ry + v * v * rx * rx < rx * rx * ry * ry;
            mask[y * SIDE + x] = (uint8_t)(inside || x + y < 9 ? 255 : 0);
        }
    }
}

static texinpaint_desc describe(int channels) {
    texinpaint_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.image = golden_image(picture, SIDE, SIDE, channels, TXM_U8);
    desc.mask = golden_image(mask, SIDE, SIDE, 1, TXM_U8);
    desc.seed = 3;
    return desc;
}

static uint64_t complete(const texinpaint_desc *desc, txm_env *env) {
    const txm_image *i = &desc->image;
    const txm_image image = golden_image(out, i->width, i->height, i->channels, i->sample);
    golden_need(texinpaint_complete(desc, env, &image), "complete", env);
    const size_t unit = txm_sample_bytes(i->sample);
    const size_t samples = (size_t)i->width * (size_t)i->height * (size_t)i->channels;
    return golden_hash(0, out, samples * unit, unit);
}

/* what it finds best, and each structure by itself */
static uint64_t bars(txm_env *env) {
    uint64_t hash = 0;
    draw_bars(picture, 3);
    draw_hole(17, 14);
    texinpaint_desc desc = describe(3);
    for (desc.structure = TEXINPAINT_AUTO; desc.structure <= TEXINPAINT_PATTERN; desc.structure++)
        hash = hash * 31 + complete(&desc, env);
    return hash;
}

static uint64_t grain(txm_env *env) {
    golden_noise(picture, SIDE, SIDE, 1);
    draw_hole(20, 16);
    const texinpaint_desc desc = describe(1);
    return complete(&desc, env);
}

static uint64_t wall(txm_env *env) {
    golden_bricks(picture, SIDE, SIDE, 3);
    draw_hole(15, 18);
    const texinpaint_desc desc = describe(3);
    return complete(&desc, env);
}

/* alpha, a source mask, lines that were drawn, short joins */
static uint64_t guided(txm_env *env) {
    static const float drawn[9] = {10, 40, 0, 48, 52, 0, 90, 30, 0};
    static uint8_t source[SIDE * SIDE];
    golden_blobs(picture, SIDE, SIDE, 4);
    draw_hole(16, 16);
    for (int i = 0; i < SIDE * SIDE; i++) {
        source[i] = (uint8_t)(i % SIDE > 8 ? 200 : 0);
        picture[4 * i + 3] = (uint8_t)(i / SIDE < 20 ? 90 : 255);
    }
    texinpaint_line line;
    line.points = drawn;
    line.count = 3;
    texinpaint_desc desc = describe(4);
    desc.source = golden_image(source, SIDE, SIDE, 1, TXM_U8);
    desc.prior = TEXINPAINT_PRIOR_LINES;
    desc.lines = &line;
    desc.line_count = 1;
    desc.alpha = 40;
    desc.beta = 20;
    return complete(&desc, env);
}

/* maps in register: 16 bits, normals, labels; every step, the preview too */
static uint64_t maps(txm_env *env) {
    static uint16_t deep[SIDE * SIDE], deep_out[SIDE * SIDE];
    static uint8_t normal[SIDE * SIDE * 3], normal_out[SIDE * SIDE * 3];
    static uint8_t label[SIDE * SIDE], label_out[SIDE * SIDE];
    texinpaint_map kinds[3];
    texinpaint_job *job = NULL;
    uint64_t hash = 0;
    int more = 1;
    draw_bars(picture, 3);
    draw_hole(18, 15);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int r = picture[3 * i], g = picture[3 * i + 1];
        const double x = r / 400.0 - 0.3, y = g / 400.0 - 0.3, z = sqrt(1 - x * x - y * y);
        deep[i] = (uint16_t)(r * 200 + g);
        normal[3 * i] = (uint8_t)(x * 127 + 128);
        normal[3 * i + 1] = (uint8_t)(y * 127 + 128);
        normal[3 * i + 2] = (uint8_t)(z * 127 + 128);
        label[i] = (uint8_t)(r / 64);
    }
    memset(kinds, 0, sizeof kinds);
    kinds[0].image = golden_image(deep, SIDE, SIDE, 1, TXM_U16);
    kinds[1].image = golden_image(normal, SIDE, SIDE, 3, TXM_U8);
    kinds[1].is_normal = 1;
    kinds[2].image = golden_image(label, SIDE, SIDE, 1, TXM_U8);
    kinds[2].is_label = 1;
    texinpaint_desc desc = describe(3);
    desc.maps = kinds;
    desc.map_count = 3;
    const txm_image to[4] = {golden_image(out, SIDE, SIDE, 3, TXM_U8),
                             golden_image(deep_out, SIDE, SIDE, 1, TXM_U16),
                             golden_image(normal_out, SIDE, SIDE, 3, TXM_U8),
                             golden_image(label_out, SIDE, SIDE, 1, TXM_U8)};
    golden_need(texinpaint_begin(&desc, env, &job), "begin", env);
    while (more) {
        golden_need(texinpaint_step(job, env, &more), "step", env);
        for (int m = 0; m < 4; m++) golden_need(texinpaint_draw(job, m, env, &to[m]), "draw", env);
        hash = tk_hash(hash, out, SIDE * SIDE * 3);
        hash = golden_hash(hash, deep_out, sizeof deep_out, 2);
        hash = tk_hash(hash, normal_out, sizeof normal_out);
        hash = tk_hash(hash, label_out, sizeof label_out);
    }
    texinpaint_free(job);
    return hash;
}

/* ---- meshes ------------------------------------------------------------------------------ */

/* A box in six charts, with stripes across them; a hole around one of its corners, and one that lies
   in a side. */
static texinpaint_desc describe_box(golden_surface *s, float *uv, int thickness) {
    static const int cells[3] = {CELLS, CELLS, CELLS};
    const int chart = CELL - 2 * MARGIN, row = CELLS + 1;
    memset(s, 0, sizeof *s);
    memset(picture, 0, sizeof picture);
    memset(mask, 0, sizeof mask);
    golden_box(s, cells, 0, 0, 0);
    for (size_t i = 0; i < s->vertex_count; i++) {
        const int side = (int)i / (row * row), u = (int)i % row, v = (int)i / row % row;
        uv[2 * i] = (float)(side % 3 * CELL + MARGIN + u * chart / CELLS) / WIDTH;
        uv[2 * i + 1] = (float)(side / 3 * CELL + MARGIN + v * chart / CELLS) / HEIGHT;
    }
    txm_rng rng = txm_rng_make(8, 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const int side = i % WIDTH / CELL + 3 * (i / WIDTH / CELL), axis = side / 2;
        int p[3]; /* where on the box, 0..2 chart - 1 */
        p[axis] = side % 2 ? 2 * chart : 0;
        p[(axis + 1) % 3] = 2 * txm_clampi(i % WIDTH % CELL - MARGIN, 0, chart - 1) + 1;
        p[(axis + 2) % 3] = 2 * txm_clampi(i / WIDTH % CELL - MARGIN, 0, chart - 1) + 1;
        const int stripe = (p[0] + 2 * p[1] + p[2]) / thickness % 2;
        for (int c = 0; c < 3; c++)
            picture[3 * i + c] = (uint8_t)((stripe ? 200 - 20 * c : 60 + 30 * c) +
                                           (int)txm_rng_below(&rng, 10));
        const int x = p[0] - 2 * chart, y = p[1] - 2 * chart, z = p[2] - 2 * chart;
        const int u = p[1] - chart, v = p[2] - chart;
        if (x * x + y * y + z * z < 40 * 40 || (side == 0 && u * u + v * v < 24 * 24)) mask[i] = 255;
    }
    texinpaint_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.image = golden_image(picture, WIDTH, HEIGHT, 3, TXM_U8);
    desc.mask = golden_image(mask, WIDTH, HEIGHT, 1, TXM_U8);
    desc.mesh.positions = s->positions;
    desc.mesh.indices = s->indices;
    desc.mesh.vertex_count = s->vertex_count;
    desc.mesh.face_count = s->triangle_count;
    desc.uv = uv;
    desc.uv_count = s->vertex_count;
    desc.seed = 5;
    return desc;
}

static golden_surface box_surface;
static float box_uv[2 * GOLDEN_VERTICES];

static uint64_t box(txm_env *env) {
    const texinpaint_desc desc = describe_box(&box_surface, box_uv, 26);
    return complete(&desc, env);
}

static uint64_t box_crest(txm_env *env) {
    texinpaint_desc desc = describe_box(&box_surface, box_uv, 40);
    desc.prior = TEXINPAINT_PRIOR_CREST;
    desc.gutter = -1;
    return complete(&desc, env);
}

static uint64_t smooth(txm_env *env) {
    const texinpaint_desc desc = describe_box(&box_surface, box_uv, 26);
    const txm_image image = golden_image(out, WIDTH, HEIGHT, 3, TXM_U8);
    golden_need(texinpaint_harmonic(&desc, env, &image), "harmonic", env);
    uint64_t hash = tk_hash(0, out, WIDTH * HEIGHT * 3);
    golden_need(texinpaint_dilate(&desc, env, &image), "dilate", env);
    return tk_hash(hash, out, WIDTH * HEIGHT * 3);
}

static uint64_t crest(txm_env *env) {
    texinpaint_crest_desc desc;
    texinpaint_crests *crests = NULL;
    uint64_t hash = 0;
    golden_ring(&box_surface, 0);
    memset(&desc, 0, sizeof desc);
    desc.mesh.positions = box_surface.positions;
    desc.mesh.indices = box_surface.indices;
    desc.mesh.vertex_count = box_surface.vertex_count;
    desc.mesh.face_count = box_surface.triangle_count;
    for (desc.kinds = 0; desc.kinds < 3; desc.kinds++) {
        golden_need(texinpaint_crest(&desc, env, &crests), "crest", env);
        for (size_t i = 0; i < crests->line_count; i++)
            hash = golden_hash(hash, crests->lines[i].points,
                               (size_t)crests->lines[i].count * 3 * sizeof(float), 4);
        texinpaint_crests_free(crests);
    }
    return hash;
}

static const golden_case cases[] = {{"bars", bars},     {"grain", grain},         {"wall", wall},
                                    {"guided", guided}, {"maps", maps},           {"box", box},
                                    {"crest", crest},   {"box-crest", box_crest}, {"smooth", smooth}};
GOLDEN_MAIN("texinpaint")
