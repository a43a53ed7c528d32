/* fuzz_texinpaint.c - hostile pictures, masks, meshes and descriptions into texinpaint.h
   SPDX-License-Identifier: MIT OR Unlicense; fuzzkit.h says how to run it

   Bytes say what to make, and a generator seeded with them fills pictures and meshes. Whatever comes
   back must be as texinpaint.h promises: known texels unchanged, outputs untouched after an error,
   numbers finite, nothing leaked, the same bytes again where a step failed and was tried again.   */
#define TEXINPAINT_IMPLEMENTATION
#include "texinpaint.h"

#include "faults.h"

#define FUZZ_BYTES 8
#include "soupkit.h"

enum { MOST_SIDE = 56, MOST_PIXELS = MOST_SIDE * MOST_SIDE, MOST_MAPS = 3 };

typedef struct input {
    texinpaint_desc desc;
    texinpaint_map maps[MOST_MAPS];
    float pixels[MOST_MAPS + 1][4 * MOST_PIXELS];
    uint8_t mask[4 * MOST_PIXELS], source[4 * MOST_PIXELS];
    float positions[3 * MOST_VERTICES], uv[2 * MOST_VERTICES];
    uint32_t indices[3 * MOST_FACES], uv_indices[3 * MOST_FACES];
    float points[3][3 * 8];
    texinpaint_line lines[3];
    size_t vertices, faces;
} input;

static input in;
static float out[2][MOST_MAPS + 1][4 * MOST_PIXELS];

static size_t bytes_of(const txm_image *im) {
    return (size_t)im->width * (size_t)im->height * (size_t)im->channels * txm_sample_bytes(im->sample);
}

/* ---- pictures ------------------------------------------------------------------------------ */

static txm_image draw_picture(source *s, void *pixels, int width, int height) {
    static const txm_sample samples[4] = {TXM_U8, TXM_U8, TXM_U16, TXM_F32};
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = width;
    im.height = height;
    im.channels = 1 + pick(s, 4);
    im.sample = samples[pick(s, 4)];
    const int kind = pick(s, 6), period = 2 + pick(s, 12), slope = pick(s, 5) - 2;
    const float huge = im.sample == TXM_F32 && pick(s, 16) == 0 ? 1e30f : 1;
    for (int i = 0; i < width * height * im.channels; i++) {
        const int pixel = i / im.channels, c = i % im.channels, x = pixel % width, y = pixel / width;
        float v = 0.5f;
        if (kind == 0) v = unit(s);
        else if (kind == 1) v = (float)((x + slope * y + 64 * period) / period % 2);
        else if (kind == 2) v = 0.2f + 0.6f * (float)((x / period + y / period) % 2) + 0.1f * unit(s);
        else if (kind == 3) v = (float)x / (float)width + 0.02f * unit(s);
        else if (kind == 4) v = x * slope > y ? 0.9f : 0.1f;
        if (c == im.channels - 1 && c % 2 == 1 && pick(s, 2)) v = unit(s) < 0.3f ? 0 : 1;
        txm_image_set(&im, x, y, c, v * huge);
    }
    if (im.sample == TXM_F32 && pick(s, 40) == 0) ((float *)pixels)[0] = NAN;
    return im;
}

static txm_image draw_hole(source *s, uint8_t *pixels, int width, int height) {
    const int kind = pick(s, 9), channels = pick(s, 8) ? 1 : 1 + pick(s, 4);
    const int cx = pick(s, width), cy = pick(s, height), r = 1 + pick(s, 20), every = 1 + pick(s, 60);
    txm_image im;
    memset(&im, 0, sizeof im);
    im.pixels = pixels;
    im.width = width;
    im.height = height;
    im.channels = channels;
    for (int i = 0; i < width * height; i++) {
        const int x = i % width, y = i / width, dx = x - cx, dy = y - cy;
        int set = dx * dx + dy * dy < r * r;
        if (kind == 0) set = txm_rng_below(&s->rng, (uint32_t)every) == 0;
        else if (kind == 1) set = x < r || y < r / 2;
        else if (kind == 2) set = dx * dx + dy * dy > r * r;
        else if (kind == 3) set = every > 50 || (x > 2 && y > 2);
        else if (kind == 4) set = set || (abs(dx - 25) < 4 && abs(dy) < 9);
        for (int c = 0; c < channels; c++) pixels[i * channels + c] = (uint8_t)(set ? 255 : 0);
    }
    return im;
}

/* ---- meshes -------------------------------------------------------------------------------- */

static uint32_t add_vertex(float x, float y, float z, float u, float v) {
    const size_t i = in.vertices++;
    if (i >= MOST_VERTICES) abort();
    in.positions[3 * i] = x;
    in.positions[3 * i + 1] = y;
    in.positions[3 * i + 2] = z;
    in.uv[2 * i] = u;
    in.uv[2 * i + 1] = v;
    return (uint32_t)i;
}

static void add_face(uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *f = in.indices + 3 * in.faces++;
    if (in.faces > MOST_FACES) abort();
    f[0] = a;
    f[1] = b;
    f[2] = c;
}

/* a sheet of n x m squares that is bent by an angle, in a box of the atlas */
static void add_sheet(source *s, int n, int m, float angle, float left, float top, float size) {
    const uint32_t first = (uint32_t)in.vertices;
    const float turn = (float)pick(s, 3) * 0.4f, shift = pick(s, 6) ? 0 : 0.25f;
    for (int j = 0; j <= m; j++) {
        for (int i = 0; i <= n; i++) {
            const float x = (float)i / (float)n, y = (float)j / (float)m, a = angle * x;
            const float px = angle > 0 ? sinf(a) / angle : x, pz = angle > 0 ? cosf(a) / angle : 0;
            add_vertex(px + shift, y + turn * shift, pz, left + size * (x - turn * y), top + size * y);
        }
    }
    for (int k = 0; k < n * m; k++) {
        const uint32_t a = first + (uint32_t)(k / n * (n + 1) + k % n), b = a + (uint32_t)n + 1;
        add_face(a, b, b + 1);
        add_face(a, b + 1, a + 1);
    }
}

static void draw_mesh(source *s) {
    static soup m;
    const int kind = pick(s, 8);
    if (kind < 2) return; /* a picture */
    if (kind == 2) {
        add_sheet(s, 1 + pick(s, 8), 1 + pick(s, 8), 0.9f * (float)pick(s, 7), 0.05f, 0.05f, 0.9f);
    } else if (kind == 3) { /* charts beside, over, mirrored to one another */
        for (int i = 1 + pick(s, 4); i > 0; i--)
            add_sheet(s, 1 + pick(s, 3), 1 + pick(s, 3), 0, 0.25f * (float)(pick(s, 9) - 2),
                      0.25f * (float)(pick(s, 9) - 2), 0.25f * (float)(pick(s, 7) - 3));
    } else if (kind > 5) { /* a soup, laid out flat or anyhow */
        const int flat = pick(s, 3);
        make_soup(&m, s);
        for (size_t i = 0; i < m.vertices; i++) {
            const float *p = m.positions + 3 * i;
            add_vertex(p[0], p[1], p[2], flat ? 0.3f + 0.3f * p[0] : unit(s), flat ? 0.3f + 0.3f * p[1] : unit(s));
        }
        for (size_t f = 0; f < m.faces; f++)
            add_face(m.indices[3 * f], m.indices[3 * f + 1], m.indices[3 * f + 2]);
    } else { /* anything */
        for (int i = 3 + pick(s, 12); i > 0; i--)
            add_vertex((float)pick(s, 3), (float)pick(s, 3), kind == 4 ? 0 : unit(s), unit(s), unit(s));
        for (int i = 1 + pick(s, 24); i > 0; i--)
            add_face((uint32_t)pick(s, (int)in.vertices), (uint32_t)pick(s, (int)in.vertices),
                     (uint32_t)pick(s, (int)in.vertices));
    }
    if (in.vertices == 0 || in.faces == 0) return;
    /* one of these, one time in two */
    const float scales[6] = {1e-30f, 1e-6f, 1e6f, 1e18f, 3e38f, 0};
    const size_t v = (size_t)pick(s, (int)in.vertices), f = (size_t)pick(s, (int)in.faces);
    switch (pick(s, 16)) {
    case 0: in.indices[3 * f] = in.indices[3 * f + 1]; break;
    case 1: in.uv[2 * v] = 4000.0f * unit(s); break;
    case 2: in.uv[2 * v + 1] = pick(s, 2) ? 5000 : NAN; break;
    case 3: in.positions[3 * v] = pick(s, 2) ? INFINITY : 1e20f; break;
    case 4: in.indices[3 * f + 2] = pick(s, 2) ? 0xffffffffu : (uint32_t)in.vertices - 1; break;
    case 5: {
        const float scale = scales[pick(s, 6)];
        for (size_t i = 0; i < 3 * in.vertices; i++) in.positions[i] *= scale;
        break;
    }
    case 6:
        for (size_t i = 0; i < 2 * in.vertices; i++) in.uv[i] = in.uv[i] * 8 - 4;
        break;
    case 7:
        for (size_t i = 0; i < in.vertices; i++) in.uv[2 * i + 1] = in.uv[1];
        break;
    default: break;
    }
    texinpaint_desc *d = &in.desc;
    d->mesh.positions = in.positions;
    d->mesh.vertex_count = in.vertices;
    d->mesh.indices = in.indices;
    d->mesh.face_count = in.faces;
    d->uv = pick(s, 40) ? in.uv : NULL;
    d->uv_count = in.vertices;
    if (pick(s, 4) == 0) {
        for (size_t i = 0; i < 3 * in.faces; i++)
            in.uv_indices[i] = pick(s, 8) ? in.indices[i] : (uint32_t)pick(s, (int)in.vertices);
        d->uv_indices = in.uv_indices;
    }
}

/* ---- descriptions -------------------------------------------------------------------------- */

static void show(void *user, const char *name, const txm_image *picture) {
    txm_image_check(picture, name, 0, (txm_env *)user);
    uint64_t sum = 0;
    for (int y = 0; y < picture->height; y++) {
        const uint8_t *row = (const uint8_t *)txm_image_row_const(picture, y);
        for (int i = 0; i < picture->width * picture->channels; i++) sum += row[i];
    }
    if (!name[0] || sum == 1) abort();
}

static void draw_desc(source *s) {
    texinpaint_desc *d = &in.desc;
    memset(&in, 0, sizeof in);
    const int width = 1 + pick(s, pick(s, 3) ? MOST_SIDE : 12), height = 1 + pick(s, MOST_SIDE);
    d->image = draw_picture(s, in.pixels[0], width, height);
    d->mask = draw_hole(s, in.mask, width, height);
    if (pick(s, 5) == 0) d->source = draw_hole(s, in.source, width, height);
    d->map_count = pick(s, 3) ? 0 : 1 + pick(s, MOST_MAPS);
    for (int i = 0; i < d->map_count; i++) {
        in.maps[i].image = draw_picture(s, in.pixels[i + 1], width, height);
        in.maps[i].is_normal = in.maps[i].image.channels > 2 ? pick(s, 3) : 0;
        in.maps[i].is_label = pick(s, 3) == 0 && (in.maps[i].is_normal == 0 || pick(s, 20) == 0);
    }
    d->maps = in.maps;
    draw_mesh(s);
    d->gutter = pick(s, 5) - 1 + (pick(s, 20) ? 0 : 100);
    d->structure = pick(s, 20) ? pick(s, 4) : pick(s, 8) - 2;
    d->prior = pick(s, 3) ? 0 : pick(s, 3);
    d->line_count = d->prior ? pick(s, 4) : 0;
    d->lines = in.lines;
    for (int i = 0; i < d->line_count; i++) {
        in.lines[i].count = pick(s, 20) ? 2 + pick(s, 7) : 1;
        in.lines[i].points = in.points[i];
        for (int k = 0; k < 3 * 8; k++)
            in.points[i][k] = (unit(s) - 0.1f) * (d->mesh.face_count ? 1.2f : (float)MOST_SIDE);
        if (pick(s, 20) == 0) in.points[i][pick(s, 6)] = pick(s, 2) ? NAN : 1e30f;
    }
    d->alpha = pick(s, 4) ? 0 : (float)pick(s, 60);
    d->beta = pick(s, 4) ? 0 : pick(s, 90);
    d->seed = (uint64_t)pick(s, 256);
    if (pick(s, 4) == 0) d->show = show;
}

/* ---- checks -------------------------------------------------------------------------------- */

static const txm_image *map_of(int map) {
    return map ? &in.maps[map - 1].image : &in.desc.image;
}

static void outputs(int which, txm_image to[MOST_MAPS + 1]) {
    for (int m = 0; m <= in.desc.map_count; m++) {
        to[m] = *map_of(m);
        to[m].pixels = out[which][m];
    }
    memset(out[which], FRESH, sizeof out[which]);
}

static void check_outputs(int which, int is_ok) {
    static uint8_t missing[MOST_PIXELS];
    if (is_ok) txm_mask_read(&in.desc.mask, TXM_MASK_REPLACES, missing);
    for (int m = 0; m <= in.desc.map_count; m++) {
        const txm_image *im = map_of(m);
        const size_t pixel = (size_t)im->channels * txm_sample_bytes(im->sample);
        const uint8_t *to = (const uint8_t *)out[which][m], *from = (const uint8_t *)in.pixels[m];
        for (size_t i = 0; i < bytes_of(im) && !is_ok; i++) {
            if (to[i] != FRESH) abort();
        }
        if (!is_ok) continue;
        for (int i = 0; i < im->width * im->height; i++) {
            if (missing[i]) continue;
            if (memcmp(to + (size_t)i * pixel, from + (size_t)i * pixel, pixel)) abort();
        }
        for (size_t i = 0; im->sample == TXM_F32 && i < bytes_of(im) / 4; i++) {
            if (!txm_is_finite(out[which][m][i])) abort();
        }
    }
}

static void check_status(txm_status status, const txm_env *env) {
    if (status == TXM_OK) return;
    if (!env->message[0]) abort();
    if (status != TXM_BAD_ARGUMENT && status != TXM_TOO_SMALL && status != TXM_TOO_LARGE) abort();
}

static void check_crests(void) {
    texinpaint_crest_desc desc;
    texinpaint_crests *crests = NULL;
    tk_memory memory;
    memset(&desc, 0, sizeof desc);
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    desc.mesh = in.desc.mesh;
    const txm_status status = texinpaint_crest(&desc, &env, &crests);
    check_status(status, &env);
    if ((status == TXM_OK) != (crests != NULL)) abort();
    for (size_t i = 0; crests && i < crests->line_count; i++) {
        for (int k = 0; k < 3 * crests->lines[i].count; k++)
            if (!txm_is_finite((double)crests->lines[i].points[k])) abort();
    }
    texinpaint_crests_free(crests);
    if (tk_leaks(&memory) != 0) abort();
}

/* Step by step, each step failing first now and then. */
static void check_steps(source *s, const txm_image *to) {
    tk_memory memory;
    tk_progress progress;
    texinpaint_job *job = NULL;
    int more = 1, tries = 0;
    memset(&memory, 0, sizeof memory);
    memset(&progress, 0, sizeof progress);
    txm_env env = tk_env(&memory, &progress);
    if (texinpaint_begin(&in.desc, &env, &job) != TXM_OK) abort();
    progress.last = 0;
    while (more) {
        memory.fail_at = pick(s, 3) && tries < 20 ? memory.calls + 1 + pick(s, 200) : 0;
        progress.cancel_at = pick(s, 3) == 0 && tries < 20 ? progress.calls + 1 + pick(s, 6) : 0;
        const txm_status status = texinpaint_step(job, &env, &more);
        const int cut = status == TXM_CANCELLED || status == TXM_OUT_OF_MEMORY;
        if (status != TXM_OK && !cut) abort();
        progress.calls = progress.cancel_at = 0;
        progress.late = 0;
        if (cut) progress.last = 0;
        tries += cut;
    }
    if (progress.errors) abort();
    for (int m = 0; m <= in.desc.map_count; m++) {
        if (texinpaint_draw(job, m, NULL, &to[m]) != TXM_OK) abort();
    }
    texinpaint_free(job);
    if (tk_leaks(&memory) != 0) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    source s = source_of(data, size);
    txm_image to[MOST_MAPS + 1];
    static txm_env env;
    draw_desc(&s);
    in.desc.show_user = &env;
    memset(&env, 0, sizeof env);
    const int way = pick(&s, 8);
    if (in.desc.mesh.face_count && way < 2) check_crests();
    outputs(0, to);
    txm_status status = way == 0   ? texinpaint_harmonic(&in.desc, &env, to)
                        : way == 1 ? texinpaint_dilate(&in.desc, &env, to)
                                   : texinpaint_complete(&in.desc, &env, to);
    check_status(status, &env);
    if (way != 1 || status != TXM_OK) check_outputs(0, status == TXM_OK);
    if (status == TXM_OK) fuzz_succeeded++;
    if (status != TXM_OK || way < 2 || way > 4) return 0;
    outputs(1, to);
    check_steps(&s, to);
    for (int m = 0; m <= in.desc.map_count; m++) {
        if (memcmp(out[0][m], out[1][m], bytes_of(&to[m]))) abort();
    }
    return 0;
}
