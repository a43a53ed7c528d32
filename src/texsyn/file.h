#ifndef TEXSYN_FILE_H
#define TEXSYN_FILE_H

#include "neighbourhood.h"

/* ---- the model as bytes -------------------------------------------------------------------

   An adaptive binary arithmetic code (a range coder as LZMA has it). One description of the model,
   txs_code_model, serves for both directions: a coder either writes the value that it is given or
   returns the one that it reads. docs/model-format.md describes the bytes.                  */

enum { TXS_MAGIC_BYTES = 4, TXS_CRC_BYTES = 4, TXS_MAX_FILE = 1 << 20, TXS_UNARY = 14 };

typedef struct txs_coder {
    int reading, bad; /* bad: ran out of bytes, or an impossible value    */
    int version;      /* of the format                                    */
    uint8_t *out;     /* writing; NULL = only count                       */
    const uint8_t *in;
    size_t at, size;      /* bytes so far, bytes there are                    */
    uint64_t low;         /* writing: the interval's start, with a carry      */
    uint32_t range, code; /* its width; reading: where the code lies in it    */
    uint8_t held;         /* writing: a byte that a carry could still change  */
    size_t held_count;    /* and how many follow it that are all ones         */
} txs_coder;

static void txs_put(txs_coder *c, uint8_t byte) {
    if (c->out && c->at < c->size) c->out[c->at] = byte;
    c->at++;
}

static uint8_t txs_get(txs_coder *c) {
    if (c->at < c->size) return c->in[c->at++];
    c->bad = 1;
    return 0;
}

static void txs_shift(txs_coder *c) {
    if (c->low < 0xff000000u || c->low > 0xffffffffu) {
        uint8_t carry = (uint8_t)(c->low >> 32);
        for (; c->held_count; c->held_count--) {
            txs_put(c, (uint8_t)(c->held + carry));
            c->held = 0xff;
        }
        c->held = (uint8_t)(c->low >> 24);
    }
    c->held_count++;
    c->low = (c->low & 0x00ffffffu) << 8;
}

static void txs_coder_start(txs_coder *c) {
    c->range = 0xffffffffu;
    c->held_count = 1; /* a leading zero byte, as LZMA has it */
    for (int i = 0; i < 5 && c->reading; i++) c->code = c->code << 8 | txs_get(c);
}

static void txs_coder_finish(txs_coder *c) {
    for (int i = 0; i < 5; i++) txs_shift(c);
}

/* The probability of a 0 in 1/65536, and how many bits were coded with it, up to 24: it adapts
   faster at first. */
typedef struct txs_chance {
    uint16_t zero, seen;
} txs_chance;

static const txs_chance txs_even = {32768, 0};

/* Code one bit with its probability, and adapt that. */
static int txs_bit(txs_coder *c, txs_chance *p, int bit) {
    const uint32_t bound = (uint32_t)(((uint64_t)c->range * p->zero) >> 16);
    if (c->reading) bit = c->code >= bound;
    const int target = bit ? 512 : 65536 - 512;
    p->zero = (uint16_t)(p->zero + (target - p->zero) * 2 / (2 * p->seen + 3));
    if (p->seen < 24) p->seen++;
    if (!bit) {
        c->range = bound;
    } else {
        if (c->reading) c->code -= bound;
        else c->low += bound;
        c->range -= bound;
    }
    while (c->range < (1u << 24)) {
        c->range <<= 8;
        if (c->reading) c->code = c->code << 8 | txs_get(c);
        else txs_shift(c);
    }
    return bit;
}

/* count bits, highest first, each as likely 0 as 1 */
static uint32_t txs_raw(txs_coder *c, int count, uint32_t value) {
    uint32_t result = 0;
    for (int i = count - 1; i >= 0; i--) {
        txs_chance half = txs_even;
        result = result << 1 | (uint32_t)txs_bit(c, &half, (int)(value >> i & 1));
    }
    return result;
}

/* A raw number limited to low..high; anything else is not a model. */
static int txs_limited(txs_coder *c, int bits, int low, int high, int value) {
    value = (int)txs_raw(c, bits, (uint32_t)(value - low)) + low;
    if (value > high) c->bad = 1;
    return c->bad ? low : value;
}

static float txs_real(txs_coder *c, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    bits = txs_raw(c, 24, bits >> 8) << 8;
    memcpy(&value, &bits, sizeof value);
    if (!(fabsf(value) <= 1e9f)) c->bad = 1; /* NaN too */
    return c->bad ? 1 : value;
}

/* Contexts of a whole number that is mostly near 0: is it 0, its sign, its size in unary. */
typedef struct txs_context {
    txs_chance zero, sign, more[TXS_UNARY];
} txs_context;

static void txs_contexts_init(txs_context *x, int count) {
    for (int i = 0; i < count; i++) {
        x[i].zero = x[i].sign = txs_even;
        for (int j = 0; j < TXS_UNARY; j++) x[i].more[j] = txs_even;
    }
}

static int txs_number(txs_coder *c, txs_context *x, int value) {
    int size = abs(value), n = 1;
    if (!txs_bit(c, &x->zero, value != 0)) return 0;
    int negative = txs_bit(c, &x->sign, value < 0);
    while (n <= TXS_UNARY && txs_bit(c, &x->more[n - 1], size > n)) n++;
    if (n > TXS_UNARY) n += (int)txs_raw(c, 12, (uint32_t)(size - n));
    return negative ? -n : n;
}

typedef enum txs_mirror { TXS_NONE, TXS_REVERSED, TXS_DIAGONAL } txs_mirror;

/* A sequence, each entry coded as its difference from a prediction: the entry of the most similar
   sequence, shifted by most of the shift of the entry before, and mixed with the entry at the
   mirrored place if that is known already. The last difference chooses the context. */
static void txs_sequence(txs_coder *c, txs_context *x, int16_t *v, const int16_t *like, int count,
                         int low, int high, txs_mirror mirror) {
    int surprise = 0, drift = 0;
    for (int i = 0; i < count; i++) {
        int twin = i;
        if (mirror == TXS_REVERSED) twin = count - 1 - i;
        if (mirror == TXS_DIAGONAL) twin = i % TXS_CLASSES * TXS_CLASSES + i / TXS_CLASSES;
        int expected = like ? like[i] + drift * 3 / 4 : drift;
        if (twin < i) expected = (expected + 3 * v[twin] + 2) / 4;
        expected = txm_clampi(expected, low, high);
        txs_context *now = x + (abs(surprise) > 2 ? 3 : abs(surprise)) + (expected == low ? 4 : 0);
        surprise = txs_number(c, now, v[i] - expected);
        if (expected + surprise < low || expected + surprise > high) c->bad = 1;
        v[i] = (int16_t)(c->bad ? low : expected + surprise);
        drift = v[i] - (like ? like[i] : 0);
    }
}

/* All contexts: of displacements, histograms and potentials by the kind of the clique type. */
typedef struct txs_codec {
    txs_context place[4][TXS_KINDS], share[TXS_KINDS][8], potential[TXS_KINDS][8];
    int16_t used[TXS_BINS]; /* the potential, where it is kept */
} txs_codec;

/* The inverse of txs_round_statistics. A potential is kept only for bins that occur in the example;
   other bins get a high energy, which the control raises if they occur nevertheless. Returns 0 for
   an empty histogram. */
static int txs_unround_statistics(txs_type *t) {
    int32_t total = 0;
    for (int i = 0; i < TXS_BINS; i++) total += t->root[i] * t->root[i];
    for (int i = 0; i < TXS_BINS && total; i++) {
        t->share[i] = (int32_t)((int64_t)t->root[i] * t->root[i] * TXS_ONE / total);
        if (t->root[i] < TXS_RARE) t->level[i] = TXS_UNSEEN;
        t->potential[i] = (int16_t)(t->level[i] * TXS_COARSE);
    }
    return total > 0;
}

/* The type before k whose histogram is likely to look most like that of type k, or -1. */
static int txs_most_alike(const txs_level *l, int k) {
    const txs_type *t = &l->types[k];
    int best = -1, least = INT_MAX;
    for (int i = 0; i < k; i++) {
        const txs_type *o = &l->types[i];
        const int length = abs(t->dx) + abs(t->dy), other = abs(o->dx) + abs(o->dy);
        int distance = (o->band != t->band) * 200 + (o->other != t->other) * 100 +
                  8 * abs(length - other) + abs(o->dx - t->dx) + abs(o->dy - t->dy);
        if (o->kind == t->kind && distance <= least) {
            least = distance;
            best = i;
        }
    }
    return best;
}

/* Histogram and potential of type k. */
static void txs_code_statistics(txs_coder *c, txs_codec *z, txs_level *l, int level, int k) {
    txs_type *t = &l->types[k];
    const int bins = t->kind == TEXSYN_SINGLE ? l->values[t->band] : txs_bin_count(t->kind);
    const int like = txs_most_alike(l, k), same = t->band == t->other;
    int used = 0;
    txs_mirror mirror = TXS_NONE; /* differences are about as often v as -v */
    if (same && t->kind == TEXSYN_VALUES) mirror = TXS_DIAGONAL;
    else if (same && t->kind != TEXSYN_SINGLE && t->kind != TEXSYN_CORNER &&
             t->kind != TEXSYN_CONTEXT)
        mirror = TXS_REVERSED;
    txs_sequence(c, z->share[t->kind], t->root, like < 0 ? NULL : l->types[like].root, bins, 0,
                 txs_root_scale(t->kind, level), mirror);

    for (int i = 0; i < bins; i++)
        if (t->root[i] >= TXS_RARE) z->used[used++] = t->level[i];
    mirror = same && t->kind != TEXSYN_SINGLE ? TXS_REVERSED : TXS_NONE;
    txs_sequence(c, z->potential[t->kind], z->used, NULL, used, -TXS_STEEPEST, TXS_STEEPEST,
                 mirror);
    used = 0;
    for (int i = 0; i < bins; i++)
        if (t->root[i] >= TXS_RARE) t->level[i] = z->used[used++];
    if (!c->bad && !txs_unround_statistics(t)) c->bad = 1;
}

/* A filter within its band. */
static void txs_code_filter(txs_coder *c, txs_type *t) {
    t->other = t->band;
    t->shape = txs_limited(c, 4, 0, TXS_SHAPES - 1, t->shape);
    t->scale = txs_limited(c, 9, 1, TXS_MAX_RESPONSE, t->scale);
    t->dx = txs_shapes[t->shape].dx;
    t->dy = txs_shapes[t->shape].dy;
    t->ex = txs_shapes[t->shape].ex;
    t->ey = txs_shapes[t->shape].ey;
}

static void txs_code_type(txs_coder *c, txs_codec *z, txs_type *t, const texsyn_model *m,
                          int level) {
    if (c->version == 1) t->kind = txs_limited(c, 3, TEXSYN_PAIR, TEXSYN_PARALLEL, t->kind);
    else t->kind = txs_limited(c, 3, TEXSYN_PAIR, TEXSYN_CONTEXT, t->kind);
    t->band = txs_limited(c, 2, 0, m->bands - 1, t->band);
    t->phase = t->kind == TEXSYN_PAIR ? txs_limited(c, 2, 0, 2, t->phase) : 0;
    if (t->kind == TEXSYN_FILTER) {
        txs_code_filter(c, t);
        return;
    }
    t->other = t->kind == TEXSYN_CORNER || t->kind == TEXSYN_CONTEXT
                   ? t->band
                   : txs_limited(c, 2, 0, m->bands - 1, t->other);
    if ((t->kind == TEXSYN_PARENT || t->kind == TEXSYN_SCALE || t->kind == TEXSYN_CONTEXT) &&
        level + 1 == m->levels)
        c->bad = 1;
    if (t->kind != TEXSYN_PARENT) {
        t->dx = txs_number(c, &z->place[0][t->kind], t->dx);
        t->dy = txs_number(c, &z->place[1][t->kind], t->dy);
    }
    if (t->kind >= TEXSYN_CORNER) {
        t->ex = txs_number(c, &z->place[2][t->kind], t->ex);
        t->ey = txs_number(c, &z->place[3][t->kind], t->ey);
    }
    /* members that coincide would change together */
    const int same_d = t->dx == 0 && t->dy == 0, same_e = t->ex == 0 && t->ey == 0;
    const int equal = t->ex == t->dx && t->ey == t->dy,
              opposite = t->ex == -t->dx && t->ey == -t->dy;
    if (t->kind != TEXSYN_PARENT && same_d && t->kind != TEXSYN_CONTEXT &&
        (t->band == t->other || t->kind >= TEXSYN_CORNER))
        c->bad = 1;
    if (t->kind == TEXSYN_CORNER && (same_e || equal)) c->bad = 1;
    if (t->kind == TEXSYN_PARALLEL && t->band == t->other && (same_e || equal || opposite))
        c->bad = 1;
    /* and so would members that are drawn at the same time, see txs_visit */
    int at[TXS_MAX_MEMBERS][2], drawn = txs_footprint(t, at);
    if (t->kind == TEXSYN_SCALE || t->kind == TEXSYN_CONTEXT) drawn = 2;
    for (int i = 0; i < drawn; i++) {
        for (int j = 0; j < i; j++) {
            const int apart = at[i][0] - at[j][0];
            if (at[i][1] == at[j][1] && apart != 0 && apart % TXS_GRID == 0) c->bad = 1;
        }
    }
    if (abs(t->dx) > TXS_MAX_REACH || abs(t->dy) > TXS_MAX_REACH || abs(t->ex) > TXS_MAX_REACH ||
        abs(t->ey) > TXS_MAX_REACH || txs_reach(t) > TXS_MAX_REACH)
        c->bad = 1;
}

/* The limits between the labels. */
static void txs_code_labels(txs_coder *c, txs_level *l) {
    for (int i = 0; i < 2; i++) {
        l->gradient_cut[i] = txs_limited(c, 15, 0, TXS_MAX_GRADIENT, l->gradient_cut[i]);
        l->curve_cut[i] = txs_limited(c, 9, -4 * TXS_VALUES, 4 * TXS_VALUES, l->curve_cut[i]);
    }
}

/* The whole model, to or from the coder. What reading allocates goes to the model's arena.
   Returns 0 if there is no memory. */
static int txs_code_model(txs_coder *c, texsyn_model *m, txs_codec *z) {
    static const int channels_of[] = {1, 3, 4};
    int kind = m->channels == 4 ? 2 : m->channels == 3 ? 1 : 0;
    m->channels = channels_of[txs_limited(c, 2, 0, 2, kind)];
    m->bands = txs_limited(c, 2, 1, m->channels, m->bands);
    m->levels = txs_limited(c, 3, 1, TXS_MAX_LEVELS, m->levels);
    for (int i = 0; i < m->channels; i++) m->mean[i] = txs_real(c, m->mean[i]);
    for (int b = 0; b < m->bands; b++) {
        for (int i = 0; i < m->channels; i++)
            m->basis[b][i] =
                (float)txs_limited(c, 16, -16384, 16384, (int)(m->basis[b][i] * 16384)) / 16384;
        m->dither[b] = (float)txs_limited(c, 8, 0, 255, (int)(m->dither[b] * 255 + 0.5f)) / 255;
    }
    memset(z, 0, sizeof *z);
    txs_contexts_init(&z->place[0][0], 4 * TXS_KINDS);
    txs_contexts_init(&z->share[0][0], TXS_KINDS * 8);
    txs_contexts_init(&z->potential[0][0], TXS_KINDS * 8);
    for (int i = m->levels - 1; i >= 0 && !c->bad; i--) {
        txs_level *l = &m->level[i];
        for (int b = 0; b < m->bands; b++) {
            l->values[b] = txs_limited(c, 5, 1, TXS_VALUES, l->values[b]);
            l->low[b] = txs_real(c, l->low[b]);
            l->step[b] = txs_real(c, l->step[b]);
            if (!(l->step[b] > 1e-6f)) c->bad = 1;
        }
        if (c->version > 1 && i + 1 < m->levels) txs_code_labels(c, l);
        l->type_count = txs_limited(c, 7, m->bands, TXS_MAX_TYPES, l->type_count);
        if (c->bad) break;
        if (c->reading) {
            l->types =
                (txs_type *)txm_arena_zero(&m->arena, (size_t)l->type_count, sizeof(txs_type));
            if (!l->types) return 0;
        }
        for (int k = 0; k < l->type_count && !c->bad; k++) {
            txs_type *t = &l->types[k];
            if (k < m->bands) t->band = t->other = k; /* singles, in the order of the bands */
            else txs_code_type(c, z, t, m, i);
            if (!c->bad) txs_code_statistics(c, z, l, i, k);
            if (k < m->bands && !c->bad) txs_make_classes(m, l, k);
        }
        int filters = 0;
        for (int k = 0; k < l->type_count && !c->bad; k++)
            filters += l->types[k].kind == TEXSYN_FILTER;
        if (filters > TXS_MAX_FILTERS) c->bad = 1;
        if (!c->bad && txs_most_ends(l, m->bands) > TXS_MAX_ENDS) c->bad = 1;
    }
    return 1;
}

/* CRC-32 of IEEE 802.3, a bit at a time: models are small */
static uint32_t txs_crc(const uint8_t *bytes, size_t count) {
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
    return ~crc;
}

/* Does the file end in the CRC of what comes before? */
static int txs_is_intact(const uint8_t *bytes, size_t size) {
    uint32_t crc = 0;
    if (size < TXS_MAGIC_BYTES + TXS_CRC_BYTES || size - TXS_CRC_BYTES > TXS_MAX_FILE) return 0;
    size -= TXS_CRC_BYTES;
    for (int i = 0; i < TXS_CRC_BYTES; i++) crc |= (uint32_t)bytes[size + (size_t)i] << 8 * i;
    return crc == txs_crc(bytes, size);
}

/* A coder that reads a file; the last of the magic bytes is the version. */
static txs_coder txs_reader(const uint8_t *bytes, size_t size) {
    txs_coder c;
    memset(&c, 0, sizeof c);
    c.reading = 1;
    c.version = bytes[TXS_MAGIC_BYTES - 1] - '0';
    c.in = bytes;
    c.at = TXS_MAGIC_BYTES;
    c.size = size - TXS_CRC_BYTES;
    txs_coder_start(&c);
    return c;
}

/* What has a description that serves for both directions, as txs_code_model is one. */
typedef void txs_described(txs_coder *c, void *what);

/* Write a file: magic bytes with the version, the code, the CRC. See texsyn_save. */
static txm_status txs_write(const char *magic, int version, txs_described *describe, void *what,
                            txm_env *env, void *buffer, size_t capacity, size_t *size) {
    for (int writing = 0; writing < (buffer ? 2 : 1); writing++) {
        uint8_t *bytes = writing ? (uint8_t *)buffer : NULL; /* the first time only to count */
        txs_coder c;
        memset(&c, 0, sizeof c);
        c.out = bytes;
        c.version = version;
        c.size = capacity;
        for (int i = 0; i < TXS_MAGIC_BYTES - 1; i++) txs_put(&c, (uint8_t)magic[i]);
        txs_put(&c, (uint8_t)('0' + version));
        txs_coder_start(&c);
        describe(&c, what);
        txs_coder_finish(&c);
        *size = c.at + TXS_CRC_BYTES;
        if (buffer && capacity < *size)
            return txm_fail(env, TXM_TOO_SMALL, "save: the buffer is smaller than *size says");
        if (!writing) continue;
        const uint32_t crc = txs_crc(bytes, c.at);
        for (int i = 0; i < TXS_CRC_BYTES; i++) bytes[c.at + (size_t)i] = (uint8_t)(crc >> 8 * i);
    }
    return TXM_OK;
}

typedef struct txs_described_model {
    texsyn_model *model;
    txs_codec *codec;
} txs_described_model;

static void txs_describe_model(txs_coder *c, void *what) {
    txs_described_model *m = (txs_described_model *)what;
    txs_code_model(c, m->model, m->codec);
}

/* ---- public: models --------------------------------------------------------------------- */

TEXSYN_API void texsyn_model_free(texsyn_model *model) {
    if (model) txm_arena_free(&model->arena);
}

static texsyn_model *txs_model_make(txm_env *env) {
    txm_arena arena;
    txm_arena_init(&arena, env);
    texsyn_model *m = (texsyn_model *)txm_arena_zero(&arena, 1, sizeof *m);
    if (m) m->arena = arena;
    return m;
}

TEXSYN_API txm_status texsyn_save(const texsyn_model *model, txm_env *env, void *buffer,
                                  size_t capacity, size_t *size) {
    if (!model || !size) return txm_fail(env, TXM_BAD_ARGUMENT, "save: model or size is NULL");
    txm_arena arena;
    txm_arena_init(&arena, env);
    txs_codec *z = (txs_codec *)txm_arena_alloc(&arena, 1, sizeof *z);
    txs_type *types =
        (txs_type *)txm_arena_alloc(&arena, TXS_MAX_TYPES * TXS_MAX_LEVELS, sizeof *types);
    texsyn_model *copy = (texsyn_model *)txm_arena_alloc(&arena, 1, sizeof *copy);
    if (arena.failed) {
        txm_arena_free(&arena);
        return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to save the model");
    }
    *copy = *model; /* the coder stores what it codes, so it works on a copy */
    for (int i = 0; i < model->levels; i++) {
        const txs_level *l = &model->level[i];
        copy->level[i].types = types + i * TXS_MAX_TYPES;
        memcpy(copy->level[i].types, l->types, sizeof *types * (size_t)l->type_count);
    }
    txs_described_model what = {copy, z};
    const txm_status status =
        txs_write("TXS", copy->version, txs_describe_model, &what, env, buffer, capacity, size);
    txm_arena_free(&arena);
    return status;
}

TEXSYN_API txm_status texsyn_load(const void *data, size_t size, txm_env *env, texsyn_model **out) {
    const uint8_t *bytes = (const uint8_t *)data;
    if (out) *out = NULL;
    if (!data || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "load: data or out is NULL");
    if (size < TXS_MAGIC_BYTES + TXS_CRC_BYTES || (memcmp(bytes, "TXS1", TXS_MAGIC_BYTES) != 0 &&
                                                   memcmp(bytes, "TXS2", TXS_MAGIC_BYTES) != 0))
        return txm_fail(env, TXM_BAD_DATA, "not a texsyn model");
    if (!txs_is_intact(bytes, size))
        return txm_fail(env, TXM_BAD_DATA, "the model is damaged or cut short");

    texsyn_model *m = txs_model_make(env);
    txs_codec *z = (txs_codec *)txm_alloc(env, sizeof *z);
    txs_coder c = txs_reader(bytes, size);
    int enough = m && z;
    if (enough) {
        m->version = c.version;
        enough = txs_code_model(&c, m, z);
        c.bad |= c.at != c.size; /* the coder reads just what was written */
    }
    txm_free(env, z);
    if (enough && !c.bad) {
        *out = m;
        return TXM_OK;
    }
    texsyn_model_free(m);
    return enough ? txm_fail(env, TXM_BAD_DATA, "the model's contents contradict each other")
                  : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to load the model");
}

TEXSYN_API int texsyn_channels(const texsyn_model *model) {
    return model ? model->channels : 0;
}

TEXSYN_API int texsyn_level_count(const texsyn_model *model) {
    return model ? model->levels : 0;
}

TEXSYN_API int texsyn_band_count(const texsyn_model *model) {
    return model ? model->bands : 0;
}

TEXSYN_API int texsyn_clique_count(const texsyn_model *model) {
    int count = 0;
    for (int i = 0; model && i < model->levels; i++) count += model->level[i].type_count;
    return count;
}

TEXSYN_API int texsyn_clique_at(const texsyn_model *model, int index, texsyn_clique *clique,
                                float *bins, int bin_count) {
    for (int i = 0; model && index >= 0 && i < model->levels; i++) {
        if (index >= model->level[i].type_count) {
            index -= model->level[i].type_count;
            continue;
        }
        const txs_type *t = &model->level[i].types[index];
        const int n = txs_bin_count(t->kind);
        if (clique) {
            clique->kind = (texsyn_kind)t->kind;
            clique->level = i;
            clique->band = t->band;
            clique->other = t->other;
            clique->dx = t->dx;
            clique->dy = t->dy;
            clique->ex = t->ex;
            clique->ey = t->ey;
            clique->phase = t->phase;
        }
        for (int k = 0; bins && k < n && k < bin_count; k++)
            bins[k] = (float)t->share[k] / (float)TXS_ONE;
        return n;
    }
    return 0;
}

#endif /* TEXSYN_FILE_H */
