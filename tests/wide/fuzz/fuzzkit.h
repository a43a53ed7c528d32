/* fuzzkit.h - what the fuzz programs share: bytes that choose, memory that fails, pictures of random form
   SPDX-License-Identifier: MIT OR Unlicense

   A program has one function, LLVMFuzzerTestOneInput, that makes calls from bytes. With clang,
   -fsanitize=fuzzer,address,undefined runs it. With any compiler and -DFUZZ_STANDALONE main is here,
   for programs that define FUZZ_BYTES before the include. It makes so many bytes for each run, the same
   for the same seed and number, and tells which run went wrong: NAME RUNS [SEED [FIRST]]         */
#ifndef FUZZKIT_H
#define FUZZKIT_H

#include "texmath.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static long fuzz_succeeded; /* calls that did their work */

/* Ends the program unless what must hold does. */
#define must(holds) ((holds) ? (void)0 : fuzz_fail(#holds, __FILE__, __LINE__))
static inline void fuzz_fail(const char *what, const char *file, int line) {
    fprintf(stderr, "%s:%d: %s does not hold\n", file, line, what);
    abort();
}

/* ---- bytes that choose ------------------------------------------------------------------- */

typedef struct source { /* bytes, then what a generator seeded with them gives */
    const uint8_t *data;
    size_t size, at;
    txm_rng rng;
} source;

static inline source source_of(const uint8_t *data, size_t size) {
    source s;
    uint64_t hash = 0;
    for (size_t i = 0; i < size; i++) hash = txm_hash(hash + data[i]);
    s.data = data;
    s.size = size;
    s.at = 0;
    s.rng = txm_rng_make(hash, 1);
    return s;
}

static inline int pick_byte(source *s) {
    return s->at < s->size ? s->data[s->at++] : (int)txm_rng_below(&s->rng, 256);
}

/* A number below count. */
static inline int pick(source *s, int count) {
    const int high = pick_byte(s), low = pick_byte(s);
    return (256 * high + low) % count;
}

/* A number from 0 to 1, always of the generator. */
static inline float unit(source *s) {
    return txm_rng_float(&s->rng);
}

/* ---- memory ------------------------------------------------------------------------------- */

typedef struct memory { /* an allocator whose call fail_at fails */
    long calls, fail_at, blocks;
} memory;

static inline void *allocate(void *user, size_t bytes) {
    memory *m = (memory *)user;
    if (++m->calls == m->fail_at) return NULL;
    void *block = malloc(bytes);
    if (block) {
        memset(block, 0xa5, bytes);
        m->blocks++;
    }
    return block;
}

static inline void release(void *user, void *block) {
    ((memory *)user)->blocks--;
    free(block);
}

/* An environment in which bytes choose what fails: an allocation, or a report that cancels. */
typedef struct trouble {
    memory memory;
    long reports, cancel_at;
} trouble;

static inline int report(void *user, float fraction, const char *stage) {
    trouble *t = (trouble *)user;
    if (!(fraction >= 0 && fraction <= 1) || !stage) abort();
    if (t->cancel_at && t->reports >= t->cancel_at) abort(); /* it was cancelled before */
    return ++t->reports == t->cancel_at;
}

static inline txm_env troubled(trouble *t, source *s) {
    const int kind = pick(s, 8), when = 1 + pick(s, 200);
    txm_env env;
    memset(t, 0, sizeof *t);
    memset(&env, 0, sizeof env);
    if (kind == 0) t->memory.fail_at = when;
    if (kind == 1) t->cancel_at = 1 + when % 30;
    env.allocate = allocate;
    env.release = release;
    env.memory_user = &t->memory;
    env.progress = report;
    env.progress_user = t;
    return env;
}

/* The same for one of several calls: which of its own allocations or reports. */
static inline void plan_none(trouble *t) {
    t->memory.fail_at = t->cancel_at = 0;
}
static inline void plan_trouble(trouble *t, source *s) {
    const int kind = pick(s, 12), when = 1 + pick(s, 30);
    plan_none(t);
    if (kind == 0) t->memory.fail_at = t->memory.calls + when;
    if (kind == 1) t->cancel_at = t->reports + when;
}

/* After a call: an error has a message and a reason. */
static inline int succeeded(txm_status status, const trouble *t, const txm_env *env) {
    if (status == TXM_OK) return 1;
    if (!env->message[0]) abort();
    if (status == TXM_CANCELLED && t->reports != t->cancel_at) abort();
    if (status == TXM_OUT_OF_MEMORY && !t->memory.fail_at) abort();
    return 0;
}

/* ---- pictures, each in a block of its own, which ends where the picture ends --------------- */

enum { MOST_BLOCKS = 256, FRESH = 0x5c };

typedef struct pool {
    void *block[MOST_BLOCKS];
    int count;
} pool;

static inline uint8_t *take(pool *p, size_t bytes) {
    uint8_t *block = (uint8_t *)malloc(bytes ? bytes : 1);
    if (!block || p->count == MOST_BLOCKS) abort();
    p->block[p->count++] = block;
    memset(block, FRESH, bytes);
    return block;
}

static inline void drain(pool *p) {
    while (p->count) free(p->block[--p->count]);
}

/* A view of fresh bytes: rows may be padded, and lie bottom-up. */
static inline txm_image fresh_image(pool *p, source *s, int width, int height, int channels,
                                    txm_sample sample) {
    const size_t unit = txm_sample_bytes(sample), rows = height > 1 ? (size_t)height : 1;
    const size_t row = (size_t)width * (size_t)channels * unit;
    const int form = pick(s, 8);
    const size_t stride = row + (form < 4 ? 0 : (size_t)(form - 3) * unit);
    uint8_t *bytes = take(p, stride * (rows - 1) + row);
    txm_image im;
    memset(&im, 0, sizeof im);
    im.width = width;
    im.height = height;
    im.channels = channels == 1 && form % 2 ? 0 : channels;
    im.sample = sample;
    im.pixels = bytes;
    if (form) im.stride = (ptrdiff_t)stride;
    if (form % 4 == 3) {
        im.stride = -im.stride;
        im.pixels = bytes + stride * (rows - 1);
    }
    return im;
}

static inline txm_sample any_sample(source *s) {
    const int k = pick(s, 3);
    return k == 0 ? TXM_U8 : k == 1 ? TXM_U16 : TXM_F32;
}

/* Flat, noise, a pattern, black and white, or a slope; alpha, if there is one, hides squares or comes
   and goes slowly. Now and then one float is none that a picture should have. */
static inline void paint(const txm_image *im, source *s) {
    static const float odd[6] = {-1.0f, 1e9f, -1e30f, 3e-39f, INFINITY, NAN};
    const int kind = pick(s, 5), veil = pick(s, 4), channels = im->channels ? im->channels : 1;
    txm_rng rng = txm_rng_make((uint64_t)pick(s, 256), 1);
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++)
            for (int c = 0; c < channels; c++) {
                float v = kind == 0   ? 0.4f
                          : kind == 1 ? txm_rng_float(&rng)
                          : kind == 2 ? (float)((x * 7 + y * 3 + c * 11) % 32) / 31.0f
                          : kind == 3 ? (float)((x / 5 + y / 3) % 2)
                                      : (float)(x + y) / (float)(im->width + im->height);
                if (channels % 2 == 0 && c == channels - 1)
                    v = veil == 0   ? 1.0f
                        : veil == 1 ? (float)((x / 4 + y / 4) % 2)
                        : veil == 2 ? (float)(x % 16) / 15.0f
                                    : txm_rng_float(&rng);
                txm_image_set(im, x, y, c, v);
            }
    if (im->sample == TXM_F32 && pick(s, 24) == 0)
        txm_image_set(im, pick(s, im->width), pick(s, im->height), 0, odd[pick(s, 6)]);
}

static inline txm_image any_image(pool *p, source *s, int width, int height, int channels,
                                  txm_sample sample) {
    const txm_image im = fresh_image(p, s, width, height, channels, sample);
    paint(&im, s);
    return im;
}

/* Is every byte as fresh_image left it? After an error results must be. */
static inline int is_fresh(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const size_t row = (size_t)im.width * (size_t)im.channels * txm_sample_bytes(im.sample);
    for (int y = 0; y < im.height; y++) {
        const uint8_t *bytes = (const uint8_t *)txm_image_row_const(&im, y);
        for (size_t i = 0; i < row; i++)
            if (bytes[i] != FRESH) return 0;
    }
    return 1;
}

/* Is the padding between its rows as it was? */
static inline int is_padding_fresh(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const size_t row = (size_t)im.width * (size_t)im.channels * txm_sample_bytes(im.sample);
    const size_t stride = (size_t)(im.stride < 0 ? -im.stride : im.stride);
    for (int y = 0; y < im.height; y++) {
        const int last = im.stride < 0 ? 0 : im.height - 1; /* in memory */
        const uint8_t *bytes = (const uint8_t *)txm_image_row_const(&im, y);
        for (size_t i = row; i < stride && y != last; i++)
            if (bytes[i] != FRESH) return 0;
    }
    return 1;
}

/* What a call has to keep to: results untouched after an error, their padding always. */
static inline void look_at_results(int success, const txm_image *out, int count) {
    for (int i = 0; i < count; i++)
        if (!(success ? is_padding_fresh(&out[i]) : is_fresh(&out[i]))) abort();
}

/* ---- pictures over bytes of the caller ----------------------------------------------------- */

/* A picture of random form over bytes of its own; bottom-up for every other one. */
static inline txm_image image_over(uint8_t *bytes, int width, int height, int channels,
                                   txm_sample sample, int choice) {
    const size_t unit = txm_sample_bytes(sample);
    const size_t row = ((size_t)width * (size_t)channels + (size_t)(choice / 2 % 3)) * unit;
    txm_image im;
    memset(&im, 0, sizeof im);
    im.width = width;
    im.height = height;
    im.channels = channels;
    im.sample = sample;
    im.stride = choice % 2 ? -(ptrdiff_t)row : (ptrdiff_t)row;
    im.pixels = choice % 2 ? bytes + row * (size_t)(height - 1) : bytes;
    return im;
}

/* A mask of one of several kinds: specks, lines, a box, half, dust, or noise. */
static inline int is_masked(int kind, int x, int y, int a, int b, txm_rng *rng) {
    switch (kind % 7) {
    case 0: return txm_rng_below(rng, 20) == 0;
    case 1: return abs(x - y - a + 20) < 1 + b % 5;
    case 2: return x >= a && y >= b && x < a + b && y < a + b;
    case 3: return x > a;
    case 4: return x % (2 + a) == 0 && y % (2 + b) == 0;
    case 5: return x > 16 || y > 16;
    default: return txm_rng_below(rng, 2) == 0;
    }
}

static inline void draw_mask(const txm_image *mask, int kind, int a, int b, txm_rng *rng) {
    for (int y = 0; y < mask->height; y++)
        for (int x = 0; x < mask->width; x++) {
            const float value = is_masked(kind, x, y, a, b, rng) ? 1.0f : 0.0f;
            for (int c = 0; c < mask->channels; c++) txm_image_set(mask, x, y, c, value);
        }
}

/* A mask of random form and kind; of half of them the rim is soft or the values are any. */
static inline txm_image any_mask(pool *p, source *s, int width, int height, int channels,
                                 txm_sample sample) {
    const int kind = pick(s, 7), soft = pick(s, 4);
    txm_rng rng = txm_rng_make((uint64_t)pick(s, 256), 2);
    const txm_image mask = fresh_image(p, s, width, height, channels, sample);
    draw_mask(&mask, kind, pick(s, width + 4), pick(s, height + 4), &rng);
    for (int y = 0; y < height && soft < 2; y++)
        for (int x = 0; x < width; x++)
            for (int c = 0; c < channels; c++) {
                const float v = txm_image_get(&mask, x, y, c), noise = txm_rng_float(&rng);
                txm_image_set(&mask, x, y, c, soft ? 0.7f * v + 0.3f * noise : noise);
            }
    return mask;
}

static inline void draw_image(const txm_image *im, int kind, txm_rng *rng) {
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++)
            for (int c = 0; c < im->channels; c++) {
                float v = kind % 3 == 0   ? 0.5f
                          : kind % 3 == 1 ? txm_rng_float(rng)
                                          : (float)((x * 7 + y * 3 + c * 11) % 32) / 31.0f;
                if (c == 3 && kind % 2) v = (x / 4 + y / 4) % 2 ? 1.0f : 0.0f;
                txm_image_set(im, x, y, c, v);
            }
}

/* ---- running by itself -------------------------------------------------------------------- */

#if defined(FUZZ_STANDALONE) && defined(FUZZ_BYTES)

/* what the sanitizers find is told like what abort() finds */
const char *__asan_default_options(void), *__ubsan_default_options(void);
const char *__asan_default_options(void) {
    return "abort_on_error=1";
}
const char *__ubsan_default_options(void) {
    return "abort_on_error=1";
}

enum { FUZZ_SECONDS = 120 }; /* of the processor, for one run: more is an error */

void __attribute__((weak)) __sanitizer_print_stack_trace(void);

static long fuzz_run, fuzz_seed;

static void fuzz_tell(int number) {
    fprintf(stderr, "run %ld of seed %ld: signal %d\n", fuzz_run, fuzz_seed, number);
    if (__sanitizer_print_stack_trace) __sanitizer_print_stack_trace();
    signal(number, SIG_DFL);
    raise(number);
}

/* RUNS inputs; fails if hardly any call did its work. */
int main(int argc, char **argv) {
    const long runs = argc > 1 ? atol(argv[1]) : 0, first = argc > 3 ? atol(argv[3]) : 0;
    const struct itimerval limit = {{0, 0}, {FUZZ_SECONDS, 0}};
    fuzz_seed = argc > 2 ? atol(argv[2]) : 1;
    if (runs < 1) {
        fprintf(stderr, "usage: %s RUNS [SEED [FIRST]]\n", argv[0]);
        return 2;
    }
    signal(SIGABRT, fuzz_tell);
    signal(SIGVTALRM, fuzz_tell);
    for (fuzz_run = first; fuzz_run < first + runs; fuzz_run++) {
        uint8_t *data = (uint8_t *)malloc(FUZZ_BYTES);
        txm_rng rng = txm_rng_make((uint64_t)fuzz_seed, (uint64_t)fuzz_run);
        if (!data) return 1;
        for (size_t k = 0; k < FUZZ_BYTES; k++) data[k] = (uint8_t)(txm_rng_next(&rng) >> 7);
        setitimer(ITIMER_VIRTUAL, &limit, NULL);
        LLVMFuzzerTestOneInput(data, FUZZ_BYTES);
        free(data);
    }
    printf("%ld runs, %ld calls succeeded\n", runs, fuzz_succeeded);
    return fuzz_succeeded >= runs / 10 ? 0 : 1;
}

#endif

#endif /* FUZZKIT_H */
