#ifndef TREEPIECES_WIND_H
#define TREEPIECES_WIND_H

#include "modes.h"

/* ---- wind -------------------------------------------------------------------------------- */

enum { TPC_WAVES = 4 };

/* A travelling gust: weight * sin(2 pi (along . (x, z) - rate * t + phase)). */
typedef struct tpc_wave {
    double along[2], rate, phase, weight;
} tpc_wave;

/* The wind at one time, and the step of the oscillators that ends then. */
typedef struct tpc_air {
    float direction[3], pressure, gusts;
    tpc_wave waves[TPC_WAVES];
    double time;
    struct {
        float xx, xv, vx, vv; /* (x, v) -> (xx x + xv v, vx x + vv v), x from the equilibrium */
        float give; /* radians at pressure 1 per sixteenth of the tree's height               */
        float flutter[TPC_PHASES];
    } classes[TPC_CLASSES];
} tpc_air;

/* sin(2 pi turns), for any number of turns */
static double tpc_sine_of_turns(double turns) {
    double sine, cosine;
    txm_sincos((turns - floor(turns)) * (2 * TXM_PI), &sine, &cosine);
    return sine;
}

/* The nearest rate, turns a second, at which the wind repeats itself after its period. */
static double tpc_periodic(const treepieces_wind *wind, double rate) {
    const double period = (double)wind->period, turns = floor(rate * period + 0.5);
    return period > 0 ? (turns > 1 ? turns : 1) / period : rate;
}

/* Waves of 90, 41, 19 and 9 m that travel about in the direction and at the speed of the wind. */
static void tpc_make_waves(const treepieces_wind *wind, tpc_air *air) {
    static const double lengths[TPC_WAVES] = {90, 41, 19, 9};
    static const double weights[TPC_WAVES] = {0.4, 0.3, 0.2, 0.1};
    txm_rng rng = txm_rng_make(wind->seed, 0x77696e64u);
    double sine, cosine;
    txm_sincos((double)wind->direction, &sine, &cosine);
    air->direction[0] = txm_float(cosine);
    air->direction[1] = 0;
    air->direction[2] = txm_float(-sine);
    const float fast = wind->speed / 15; /* from there on crowns give way and offer less to the wind */
    air->pressure = 0.0120185f * wind->speed * wind->speed / sqrtf(1 + fast * fast);
    air->gusts = wind->gusts;
    for (int i = 0; i < TPC_WAVES; i++) {
        tpc_wave *w = &air->waves[i];
        const double aside = 0.7 * ((double)txm_rng_float(&rng) - 0.5);
        txm_sincos((double)wind->direction + aside, &sine, &cosine);
        w->along[0] = cosine / lengths[i];
        w->along[1] = -sine / lengths[i];
        w->rate = (double)wind->speed * (0.8 + 0.4 * (double)txm_rng_float(&rng)) / lengths[i];
        w->rate = tpc_periodic(wind, w->rate);
        w->phase = (double)txm_rng_float(&rng);
        w->weight = weights[i];
    }
}

static float tpc_pressure(const tpc_air *air, const float position[3], double time) {
    double sum = 0;
    for (int i = 0; i < TPC_WAVES; i++) {
        const tpc_wave *w = &air->waves[i];
        sum += w->weight * tpc_sine_of_turns(w->along[0] * (double)position[0] +
                                             w->along[1] * (double)position[2] - w->rate * time +
                                             w->phase);
    }
    const float pressure = air->pressure * (1 + air->gusts * 1.5f * txm_float(sum));
    return pressure > 0 ? pressure : 0;
}

static int tpc_is_wind(const treepieces_wind *w) {
    return w && fabsf(w->direction) <= 1e4f && w->speed >= 0 && w->speed <= 100 && w->gusts >= 0 &&
           w->gusts <= 1 && w->period >= 0 && w->period <= 1e6f;
}

TREEPIECES_API float treepieces_gust(const treepieces_wind *wind, const float position[3],
                                     double time) {
    tpc_air air;
    if (!tpc_is_wind(wind) || !position || !txm_is_finite(time)) return 0;
    tpc_make_waves(wind, &air);
    return tpc_pressure(&air, position, time);
}

/* Class c has the frequency 0.3 * 2^(c / 3) Hz and the damping ratio d = 1/5. The step over dt is
   the exact solution of

       x'' + 2 d w x' + w^2 x = 0,   x = e^(-d w t) (a cos(k t) + b sin(k t)),  k = w sqrt(1 - d^2)

   so that it is right and stable for any dt. Thin branches bend further, and flutter. */
static void tpc_make_classes(const treepieces_wind *wind, double dt, tpc_air *air) {
    const double damping = 0.2, part = sqrt(1 - damping * damping);
    for (int c = 0; c < TPC_CLASSES; c++) {
        const double frequency = 0.3 * txm_exp2(c / 3.0), omega = 2 * TXM_PI * frequency;
        const double fade = damping * omega * dt;
        double e = 0, sine = 0, cosine = 0;
        if (fade < 60) { /* else the old swing has died out */
            e = txm_exp2(-fade * 1.44269504088896340736);
            txm_sincos(omega * part * dt, &sine, &cosine);
        }
        air->classes[c].xx = txm_float(e * (cosine + damping / part * sine));
        air->classes[c].xv = txm_float(e * sine / (omega * part));
        air->classes[c].vx = txm_float(-e * omega / part * sine);
        air->classes[c].vv = txm_float(e * (cosine - damping / part * sine));
        air->classes[c].give = txm_float(0.0055 * txm_exp2(0.6 * c));
        const double share = wind->gusts * (0.2 + 0.7 * (c < 4 ? c / 4.0 : 1));
        const double slow = tpc_periodic(wind, frequency), fast = tpc_periodic(wind, 1.618 * frequency);
        for (int k = 0; k < TPC_PHASES; k++)
            air->classes[c].flutter[k] =
                txm_float(share * (0.6 * tpc_sine_of_turns(slow * air->time + k * 0.381966) +
                                   0.4 * tpc_sine_of_turns(fast * air->time + k * 0.723607)));
    }
}

#endif /* TREEPIECES_WIND_H */
