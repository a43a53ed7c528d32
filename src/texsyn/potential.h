#ifndef TEXSYN_POTENTIAL_H
#define TEXSYN_POTENTIAL_H

#include "model.h"
#include "energy.h"

/* ---- potentials ---------------------------------------------------------------------------

   Every potential is controlled:

       V = integral + proportional gain * (h - h_ref),

   h the current histogram of the canvas, h_ref the example's, so that the energy of values that are
   too frequent rises; the integral part follows the error once a sweep. [1] derives the potentials
   from the statistics; controlling them needs far fewer sweeps.                              */

/* Minus a Gumbel variable, shuffled: entries i..i+31 for a random i are a noise row. */
static void txs_noise_table(int16_t *noise) {
    txm_rng rng = txm_rng_make(1, 2);
    for (int i = 0; i < TXS_NOISE; i++) {
        double gumbel = log(-log((i + 0.5) / (double)TXS_NOISE));
        int j = (int)txm_rng_below(&rng, (uint32_t)i + 1);
        noise[i] = noise[j];
        noise[j] = (int16_t)floor(gumbel * (TXS_NAT * TXS_FINE) + 0.5);
    }
    memcpy(noise + TXS_NOISE, noise, TXS_VALUES * sizeof *noise);
}

/* The ends of a clique type on a canvas of so many bands, each with the band it lies in and its
   form; returns how many. Their rows lie in the type's tables, TXS_TABLE bytes. */
static int txs_type_ends(const txs_level *level, const txs_type *t, const uint8_t *tables,
                         const txs_canvas *c, int bands, txs_end ends[4], int band[4],
                         int form[4]) {
    const ptrdiff_t tail = t->band * c->plane, head = t->other * c->plane;
    const ptrdiff_t parent = (bands + t->other) * c->plane;
    const ptrdiff_t d = t->dy * c->stride + t->dx, e = t->ey * c->stride + t->ex;
    const ptrdiff_t label = 2 * bands * c->plane + e;
    const uint8_t *table = tables + 31;
    const ptrdiff_t block = TXS_CLASSES * TXS_ROW;
    for (int i = 0; i < 4; i++) {
        memset(&ends[i], 0, sizeof ends[i]);
        band[i] = t->band;
        form[i] = 1;
        ends[i].table = table + i * block;
    }
    switch (t->kind) {
    case TEXSYN_SINGLE: return 0;
    case TEXSYN_PAIR: /* the head, the tail */
        form[0] = form[1] = 0;
        band[0] = t->other;
        ends[0].o1 = tail - d;
        ends[1].o1 = head + d;
        ends[1].table = table + TXS_ROW;
        return 2;
    case TEXSYN_PARENT:
        form[0] = 0;
        ends[0].o1 = parent;
        ends[0].table = table + TXS_ROW;
        return 1;
    case TEXSYN_VALUES:
        form[0] = form[1] = 3;
        ends[0].o1 = head + d;
        ends[0].classes = level->classes[t->other];
        ends[0].table = table - 31;
        band[1] = t->other;
        ends[1].o1 = tail - d;
        ends[1].classes = level->classes[t->band];
        ends[1].table = table - 31 + TXS_CLASSES * TXS_VALUES;
        return 2;
    case TEXSYN_CORNER: /* the arms, the corner */
        ends[0].o1 = ends[0].o3 = tail - d;
        ends[0].o2 = tail + e - d;
        ends[1].o1 = ends[1].o3 = tail - e;
        ends[1].o2 = tail + d - e;
        form[2] = 2;
        ends[2].o1 = tail + d;
        ends[2].o2 = tail + e;
        ends[2].table = table + 2 * block + 31 * TXS_ROW;
        return 3;
    case TEXSYN_SCALE: /* the head, the tail */
        ends[0].o1 = tail - d;
        ends[0].o2 = parent + e - d;
        ends[0].o3 = parent - e;
        ends[1].o1 = tail + d;
        ends[1].o2 = parent + e;
        ends[1].o3 = parent + d - e;
        return 2;
    case TEXSYN_FILTER: return 0;
    case TEXSYN_CONTEXT: /* the head, the tail; or the tail below its parent */
        form[0] = form[1] = 4;
        ends[0].o1 = parent;
        ends[0].o2 = label;
        ends[0].table = table + block;
        if (t->dx == 0 && t->dy == 0) return 1;
        ends[0].o1 = tail + d;
        ends[1].o1 = tail - d;
        ends[1].o2 = label - d;
        ends[1].table = table;
        return 2;
    default: /* TEXSYN_PARALLEL: head and tail of the one difference, of the other */
        ends[0].o1 = tail - d;
        ends[0].o2 = head + e;
        ends[0].o3 = head + e - d;
        ends[1].o1 = tail + d;
        ends[1].o2 = head + e + d;
        ends[1].o3 = head + e;
        band[2] = band[3] = t->other;
        ends[2].o1 = head - d;
        ends[2].o2 = tail - e;
        ends[2].o3 = tail - e - d;
        ends[3].o1 = head + d;
        ends[3].o2 = tail - e + d;
        ends[3].o3 = tail - e;
        return 4;
    }
}

/* Ends of a filter at one pixel, at most, if its tails have one parity. */
static int txs_shape_ends(int shape) {
    int at[TXS_MAX_MEMBERS][2], weight[TXS_MAX_MEMBERS], count[4] = {0}, most = 0;
    const int n = txs_shape_pixels(shape, at, weight);
    for (int i = 0; i < n; i++) {
        const int parity = (at[i][0] & 1) + 2 * (at[i][1] & 1);
        if (++count[parity] > most) most = count[parity];
    }
    return most;
}

/* Ends that a level's types put into one band, at most; a model must stay within TXS_MAX_ENDS. */
static int txs_most_ends(const txs_level *level, int bands) {
    int count[TXS_MAX_BANDS] = {0}, most = 0;
    for (int k = 0; k < level->type_count; k++) {
        const txs_type *t = &level->types[k];
        static const int tail[] = {0, 1, 1, 1, 3, 2, 2, 0, 2}, head[] = {0, 1, 0, 1, 0, 0, 2, 0, 0};
        count[t->band] += t->kind == TEXSYN_FILTER ? txs_shape_ends(t->shape) : tail[t->kind];
        count[t->other] += head[t->kind];
    }
    for (int b = 0; b < bands; b++)
        if (count[b] > most) most = count[b];
    return most;
}

/* Spread the potential v of a type (as bytes of rows) over the tables of its ends. */
static void txs_expand(const txs_level *level, const txs_type *t, const uint8_t *v,
                       uint8_t *table) {
    const uint8_t *class_of = txs_difference_class;
    enum { N = TXS_CLASSES, ROW = TXS_ROW, BLOCK = TXS_CLASSES * TXS_ROW };
    switch (t->kind) {
    case TEXSYN_PAIR:
    case TEXSYN_PARENT:
        for (int i = 0; i < TXS_DIFFERENCES; i++) {
            table[i] = v[i];
            table[ROW + i] = v[TXS_DIFFERENCES - 1 - i];
        }
        break;
    case TEXSYN_VALUES:
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_VALUES; i++) {
                table[q * TXS_VALUES + i] = v[level->classes[t->band][i] * N + q];
                table[(N + q) * TXS_VALUES + i] = v[q * N + level->classes[t->other][i]];
            }
        }
        break;
    case TEXSYN_CORNER:
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[class_of[i] * N + q];
                table[BLOCK + q * ROW + i] = v[q * N + class_of[i]];
            }
        }
        for (int delta = -31; delta <= 31; delta++) { /* difference 31 - i on one arm, delta more
                                                         on the other */
            uint8_t *row = table + 2 * BLOCK + (delta + 31) * ROW;
            for (int i = 0; i < TXS_DIFFERENCES; i++)
                row[i] = v[class_of[62 - i] * N + class_of[txm_clampi(62 - i + delta, 0, 62)]];
        }
        break;
    case TEXSYN_CONTEXT:
        for (int q = 0; q < TXS_LABELS; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[q * N + class_of[i]];
                table[BLOCK + q * ROW + i] = v[q * N + class_of[62 - i]];
            }
        }
        break;
    case TEXSYN_FILTER: {
        uint8_t classes[2 * TXS_MAX_RESPONSE + 1];
        txs_response_classes(t->scale, classes);
        for (int i = 0; i < TXS_RESPONSE_ROW; i++) {
            const int r = txm_clampi(i - (TXS_VALUES - 1), 0, 2 * TXS_MAX_RESPONSE);
            table[i] = v[classes[r]];
            table[TXS_RESPONSE_ROW + i] = v[classes[2 * TXS_MAX_RESPONSE - r]];
        }
        break;
    }
    default: /* TEXSYN_SCALE and, with the ends of the other difference, TEXSYN_PARALLEL */
        for (int q = 0; q < N; q++) {
            for (int i = 0; i < TXS_DIFFERENCES; i++) {
                table[q * ROW + i] = v[class_of[i] * N + q];
                table[BLOCK + q * ROW + i] = v[class_of[62 - i] * N + q];
                if (t->kind == TEXSYN_SCALE) continue;
                table[2 * BLOCK + q * ROW + i] = v[q * N + class_of[i]];
                table[3 * BLOCK + q * ROW + i] = v[q * N + class_of[62 - i]];
            }
        }
    }
}

/* How strongly the errors of a histogram act on its potential. */
typedef struct txs_gain {
    int proportional, integral; /* 1/TXS_WHOLE nat per unit of error, the latter once a sweep */
} txs_gain;

enum { TXS_WHOLE = 256 };

/* Control one type: its potential v, in steps of 1/(TXS_NAT TXS_PRECISE) nat, from the errors of
   its histogram; integrate as well if it is time. */
static void txs_steer(const txs_type *t, txs_gain gain, int integrate, const int32_t *histogram,
                      int32_t *integral, int32_t *v) {
    const int nat = TXS_NAT * TXS_PRECISE, bins = txs_bin_count(t->kind);
    const int32_t limit = (t->kind == TEXSYN_SINGLE ? 10 * TXS_NAT : 63) * TXS_PRECISE;
    int64_t total = 1;
    for (int i = 0; i < bins; i++) total += histogram[i];
    const int64_t scale = ((int64_t)TXS_ONE << 24) / total;
    for (int i = 0; i < bins; i++) {
        int32_t error = (int32_t)((histogram[i] * scale) >> 24) - t->share[i];
        int32_t pull = error * nat / TXS_ONE; /* for a gain of 1 nat per unit of error */
        if (integrate)
            integral[i] = txm_clampi(integral[i] + gain.integral * pull / TXS_WHOLE, -limit, limit);
        v[i] = txm_clampi(integral[i] + gain.proportional * pull / TXS_WHOLE, -limit, limit);
    }
}

/* Put a steered potential where the sampler looks it up: that of a single into the words that a
   candidate's energy starts from, any other into the tables of the ends. */
static void txs_publish(const txs_level *level, const txs_type *t, const int32_t *v,
                        int16_t single[TXS_VALUES], uint8_t *table) {
    uint8_t row[TXS_BINS];
    for (int i = 0; i < txs_bin_count(t->kind); i++) {
        if (t->kind == TEXSYN_SINGLE)
            single[(i >> 1) + (i & 1) * 16] =
                (int16_t)(i < level->values[t->band] ? v[i] / (TXS_PRECISE / TXS_FINE) : TXS_NEVER);
        else row[i] = (uint8_t)((v[i] + TXS_ZERO * TXS_PRECISE) / TXS_PRECISE);
    }
    if (t->kind != TEXSYN_SINGLE) txs_expand(level, t, row, table);
}

#endif /* TEXSYN_POTENTIAL_H */
