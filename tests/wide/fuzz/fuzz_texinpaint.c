/* fuzz_texinpaint.c - small strange pictures, masks and meshes into texinpaint.h
   SPDX-License-Identifier: MIT OR Unlicense

   With clang: -fsanitize=fuzzer,address,undefined. With any compiler: -DFUZZ_STANDALONE; the program
   then makes its inputs itself: fuzz_texinpaint RUNS [FIRST].

   The bytes say what picture, mask, maps, mesh and options there are: meshes that are not manifold, faces
   without area, coordinates outside the picture, masks of all or nothing. Each call must end with a
   known status and leak nothing. After success no known texel has changed, after a failure nothing has.
   Now and then an allocation fails, or the work is cancelled.                                    */
#define TEXINPAINT_IMPLEMENTATION
#include "texinpaint.h"

#include <stdio.h>
#include <stdlib.h>

enum { MOST_SIDE = 56, MOST_VERTICES = 40, MOST_FACES = 48, MOST_BYTES = 1 << 28 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* ---- the bytes, then zeros -------------------------------------------------------------------- */

typedef struct source {
    const uint8_t *at, *end;
} source;

static unsigned take(source *s, unsigned below) {
    const unsigned v = s->at < s->end ? *s->at++ : 0;
    return v % below;
}

/* ---- an allocator that counts, and fails at a chosen call ------------------------------------- */

typedef struct faults {
    long live, calls, reports;
    long fail_at, cancel_at; /* 0: never */
} faults;

static void *allocate(void *user, size_t bytes) {
    faults *f = (faults *)user;
    if (bytes > MOST_BYTES) {
        fprintf(stderr, "asked for %lu bytes\n", (unsigned long)bytes);
        abort();
    }
    if (++f->calls == f->fail_at) return NULL;
    f->live++;
    return malloc(bytes);
}

static void release(void *user, void *block) {
    ((faults *)user)->live--;
    free(block);
}

static int report(void *user, float fraction, const char *stage) {
    faults *f = (faults *)user;
    if (!(fraction >= 0 && fraction <= 1) || !stage) abort();
    return ++f->reports == f->cancel_at;
}

static txm_env make_env(faults *f) {
    txm_env env;
    memset(&env, 0, sizeof env);
    env.allocate = allocate;
    env.release = release;
    env.memory_user = f;
    env.progress = report;
    env.progress_user = f;
    return env;
}

/* ---- what is to be completed ------------------------------------------------------------------- */

typedef struct input {
    int side[2], channels;
    uint8_t picture[MOST_SIDE * MOST_SIDE * 4], mask[MOST_SIDE * MOST_SIDE], normal[MOST_SIDE * MOST_SIDE * 3];
    uint8_t allowed[MOST_SIDE * MOST_SIDE];
    float positions[3 * MOST_VERTICES], uv[2 * MOST_VERTICES], points[12];
    uint32_t indices[3 * MOST_FACES], uv_indices[3 * MOST_FACES];
    texinpaint_map map;
    texinpaint_line line;
    texinpaint_desc desc;
} input;

static txm_image image_of(void *pixels, const int side[2], int channels) {
    txm_image image;
    memset(&image, 0, sizeof image);
    image.pixels = pixels;
    image.width = side[0];
    image.height = side[1];
    image.channels = channels;
    return image;
}

/* Plain, striped, noisy or cut in two. */
static void fill_picture(input *in, source *s) {
    const unsigned kind = take(s, 4), step = 2 + take(s, 12), tilt = take(s, 5);
    for (int i = 0; i < in->side[0] * in->side[1]; i++) {
        const unsigned x = (unsigned)(i % in->side[0]), y = (unsigned)(i / in->side[0]);
        const unsigned noise = (unsigned)(txm_hash((uint64_t)i) >> 56);
        const unsigned v = kind == 0   ? 90
                           : kind == 1 ? (x * 2 + y * tilt) / step % 2 * 180 + noise / 32
                           : kind == 2 ? noise
                                       : (x + y > 40) * 200;
        for (int c = 0; c < in->channels; c++)
            in->picture[i * in->channels + c] = (uint8_t)(c == 3 && kind == 2 ? 255 : v + 10u * (unsigned)c);
        in->normal[3 * i] = (uint8_t)(128 + v / 8);
        in->normal[3 * i + 1] = (uint8_t)(128 - v / 9);
        in->normal[3 * i + 2] = 250;
    }
}

/* Discs, one bit in so many, all or nothing. */
static void fill_mask(const input *in, uint8_t *mask, source *s) {
    const unsigned kind = take(s, 8), every = 1 + take(s, 40);
    const int n = in->side[0] * in->side[1];
    memset(mask, 0, (size_t)n);
    if (kind == 6) memset(mask, 255, (size_t)n);
    for (int i = 0; i < n && kind == 7; i++) mask[i] = txm_hash((uint64_t)i) % every == 0 ? 255 : 0;
    for (unsigned k = 0; k < kind && kind < 6; k++) {
        const int cx = (int)take(s, MOST_SIDE), cy = (int)take(s, MOST_SIDE), r = (int)take(s, 16);
        for (int i = 0; i < n; i++) {
            const int x = i % in->side[0] - cx, y = i / in->side[0] - cy;
            if (x * x + y * y <= r * r) mask[i] = 255;
        }
    }
}

static float strange(source *s) {
    static const float list[8] = {0, 1, -1, 1e-30f, 1e30f, 3, -1e6f, 0.5f};
    const unsigned v = take(s, 256);
    return v < 8 ? list[v] : (float)v / 64 - 2;
}

/* A grid that is bent, or any triangles at all. */
static void fill_mesh(input *in, source *s) {
    const unsigned kind = take(s, 4);
    texinpaint_desc *d = &in->desc;
    if (kind == 0) return; /* a plain picture */
    const unsigned columns = 2 + take(s, 4), rows = 2 + take(s, 4), apart = take(s, 2);
    size_t faces = 0;
    d->mesh.vertex_count = columns * rows;
    for (unsigned i = 0; i < columns * rows; i++) {
        const unsigned x = i % columns, y = i / columns;
        const float bend = kind == 1 ? 0 : (float)take(s, 8) / 8;
        in->positions[3 * i] = kind == 3 ? strange(s) : (float)x;
        in->positions[3 * i + 1] = kind == 3 ? strange(s) : (float)y;
        in->positions[3 * i + 2] = bend;
        in->uv[2 * i] = kind == 3 ? strange(s) : ((float)x + 0.1f) / (float)(columns - 1) * 0.9f;
        in->uv[2 * i + 1] = kind == 3 ? strange(s) : ((float)y + 0.1f) / (float)(rows - 1) * 0.9f;
    }
    for (unsigned y = 0; y + 1 < rows && kind < 3; y++) {
        for (unsigned x = 0; x + 1 < columns; x++) {
            const uint32_t a = y * columns + x;
            const uint32_t corners[6] = {a, a + 1, a + columns + 1, a, a + columns + 1, a + columns};
            if (faces + 2 > MOST_FACES) break;
            memcpy(in->indices + 3 * faces, corners, sizeof corners);
            faces += 2;
        }
    }
    for (unsigned n = kind == 3 ? take(s, MOST_FACES) : take(s, 4); n && faces < MOST_FACES; n--, faces++) {
        for (size_t k = 0; k < 3; k++) in->indices[3 * faces + k] = take(s, columns * rows + (kind == 3 && n % 16 == 0));
    }
    d->mesh.positions = in->positions;
    d->mesh.indices = in->indices;
    d->mesh.face_count = faces;
    d->uv = in->uv;
    d->uv_count = columns * rows;
    for (size_t c = 0; c < 3 * faces; c++)
        in->uv_indices[c] = apart ? take(s, columns * rows) : in->indices[c];
    if (apart || take(s, 2)) d->uv_indices = in->uv_indices;
}

static void fill_input(input *in, source *s) {
    static const int counts[4] = {1, 2, 3, 4};
    texinpaint_desc *d = &in->desc;
    memset(in, 0, sizeof *in);
    in->side[0] = 1 + (int)take(s, MOST_SIDE);
    in->side[1] = take(s, 2) ? in->side[0] : 1 + (int)take(s, MOST_SIDE);
    in->channels = counts[take(s, 4)];
    fill_picture(in, s);
    fill_mask(in, in->mask, s);
    fill_mesh(in, s);
    d->image = image_of(in->picture, in->side, in->channels);
    d->mask = image_of(in->mask, in->side, 1);
    if (take(s, 4) == 0) {
        fill_mask(in, in->allowed, s);
        d->source = image_of(in->allowed, in->side, 1);
    }
    if (take(s, 2)) {
        in->map.image = image_of(in->normal, in->side, 3);
        in->map.is_normal = (int)take(s, 4);
        in->map.is_label = (int)take(s, 2);
        d->maps = &in->map;
        d->map_count = 1;
    }
    d->gutter = (int)take(s, 12) - 1;
    d->structure = (int)take(s, 5);
    d->prior = (int)take(s, 4);
    for (int i = 0; i < 12; i++) in->points[i] = d->mesh.face_count ? strange(s) : (float)take(s, 64);
    in->line.points = in->points;
    in->line.count = 2 + (int)take(s, 3);
    d->lines = &in->line;
    d->line_count = d->prior == TEXINPAINT_PRIOR_LINES ? 1 : 0;
    d->alpha = (float)take(s, 80);
    d->beta = (int)take(s, 80);
    d->seed = take(s, 256);
}

/* ---- the calls --------------------------------------------------------------------------------- */

static long succeeded;

/* Texels that may change: missing ones, and gutters. */
static void check_kept(const input *in, const uint8_t *made, const uint8_t *was, int channels, int is_dilated) {
    const int n = in->side[0] * in->side[1];
    for (int i = 0; i < n && !is_dilated; i++) {
        if (!in->mask[i] && memcmp(made + i * channels, was + i * channels, (size_t)channels)) {
            fprintf(stderr, "texel %d changed\n", i);
            abort();
        }
    }
}

static void call(const input *in, int which, faults *f) {
    static uint8_t first[MOST_SIDE * MOST_SIDE * 4], second[MOST_SIDE * MOST_SIDE * 3];
    const size_t n = (size_t)in->side[0] * (size_t)in->side[1];
    txm_env env = make_env(f);
    const txm_image out[2] = {image_of(first, in->side, in->channels), image_of(second, in->side, 3)};
    memset(first, 77, sizeof first);
    memset(second, 77, sizeof second);
    const txm_status status = which == 0   ? texinpaint_complete(&in->desc, &env, out)
                              : which == 1 ? texinpaint_harmonic(&in->desc, &env, out)
                                           : texinpaint_dilate(&in->desc, &env, out);
    if (f->live) {
        fprintf(stderr, "%ld blocks leaked\n", f->live);
        abort();
    }
    if (status == TXM_OK) {
        succeeded++;
        check_kept(in, first, in->picture, in->channels, which == 2);
        if (in->desc.map_count) check_kept(in, second, in->normal, 3, which == 2);
        return;
    }
    if (!env.message[0]) abort();
    if (status == TXM_OUT_OF_MEMORY && !f->fail_at) abort();
    if (status == TXM_CANCELLED && !f->cancel_at) abort();
    for (size_t i = 0; i < n * (size_t)in->channels; i++)
        if (first[i] != 77) abort();
}

static void call_crest(const input *in, faults *f) {
    texinpaint_crest_desc desc;
    texinpaint_crests *crests = NULL;
    txm_env env = make_env(f);
    memset(&desc, 0, sizeof desc);
    desc.mesh = in->desc.mesh;
    const txm_status status = texinpaint_crest(&desc, &env, &crests);
    if ((status == TXM_OK) != (crests != NULL)) abort();
    for (size_t i = 0; crests && i < crests->line_count; i++) {
        for (int k = 0; k < 3 * crests->lines[i].count; k++)
            if (!txm_is_finite((double)crests->lines[i].points[k])) abort();
    }
    texinpaint_crests_free(crests);
    if (f->live) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static input in;
    source s = {data, data + size};
    fill_input(&in, &s);
    const unsigned how = take(&s, 8);
    for (int which = 0; which < 4; which++) {
        faults f;
        memset(&f, 0, sizeof f);
        if (how == 6) f.fail_at = 1 + (long)take(&s, 255);
        if (how == 7) f.cancel_at = 1 + (long)take(&s, 60);
        if (which < 3) call(&in, which, &f);
        else call_crest(&in, &f);
    }
    return 0;
}

#ifdef FUZZ_STANDALONE
int main(int argc, char **argv) {
    static uint8_t data[512];
    const long runs = argc > 1 ? atol(argv[1]) : 0, from = argc > 2 ? atol(argv[2]) : 0;
    if (runs < 1) {
        fprintf(stderr, "usage: fuzz_texinpaint RUNS [FIRST]\n");
        return 2;
    }
    for (long i = from; i < from + runs; i++) {
        txm_rng rng = txm_rng_make((uint64_t)i, 0);
        for (size_t k = 0; k < sizeof data; k++) data[k] = (uint8_t)(txm_rng_next(&rng) >> 24);
        if (getenv("FUZZ_TELL")) fprintf(stderr, "run %ld\n", i);
        LLVMFuzzerTestOneInput(data, sizeof data);
    }
    printf("%ld runs, %ld calls succeeded\n", runs, succeeded);
    return succeeded > runs / 4 ? 0 : 1;
}
#endif
