#ifndef TEXMATH_NUMBER_H
#define TEXMATH_NUMBER_H

#include "config.h"

/* ---- numbers ---------------------------------------------------------------------------- */

/* neither infinite nor NaN; looks at the bits, so that -ffast-math cannot remove it */
static inline int txm_is_finite(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return ((bits >> 52) & 0x7ff) != 0x7ff;
}

/* x rounded to float, in all cases. From -O2 on gcc 12 drops the rounding of neighbouring values
   that are widened again ((double)(float)x becomes x), so that results depend on what was inlined.
   Code that needs the same bits everywhere rounds with this, not with a cast: gcc must assume that
   the empty asm changes f, and it costs nothing. */
static inline float txm_float(double x) {
    float f = (float)x;
#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#if defined(__SSE2__)
    __asm__("" : "+x"(f));
#elif defined(__aarch64__)
    __asm__("" : "+w"(f));
#else
    __asm__("" : "+m"(f));
#endif
#endif
    return f;
}

static inline float txm_minf(float a, float b) {
    return b < a ? b : a;
}
static inline float txm_maxf(float a, float b) {
    return b > a ? b : a;
}
/* x limited to low..high; low for NaN */
static inline float txm_clampf(float x, float low, float high) {
    return x >= low ? txm_minf(x, high) : low;
}
static inline int txm_clampi(int x, int low, int high) {
    return x < low ? low : x > high ? high : x;
}
/* a (1 - t) + b t; exactly a at t = 0, b at t = 1, and a wherever a = b */
static inline float txm_lerpf(float a, float b, float t) {
    return txm_float((double)a - (double)a * t + (double)b * t);
}

/* the number of the lowest bit of x that is set, 0..63; x must not be 0 */
static inline int txm_lowest_bit(uint64_t x) {
#if defined(__GNUC__)
    return __builtin_ctzll(x);
#else
    int n = 0;
    for (int step = 32; step; step /= 2) {
        if (x & (((uint64_t)1 << step) - 1)) continue;
        x >>= step;
        n += step;
    }
    return n;
#endif
}

/* Sine and cosine of an angle of at most a few thousand turns, to 1e-10: reduced to -pi/4..pi/4,
   then Taylor. Sums, products and quotients only, so that the bits are the same everywhere,
   unlike those of the C library. */
static inline void txm_sincos(double angle, double *sine, double *cosine) {
    const double turns = angle * (2 / TXM_PI);
    const int quarter = (int)(turns + (turns < 0 ? -0.5 : 0.5));
    const double x = angle - quarter * (TXM_PI / 2), xx = x * x;
    const double s =
        x * (1 - xx / 6 * (1 - xx / 20 * (1 - xx / 42 * (1 - xx / 72 * (1 - xx / 110)))));
    const double c =
        1 - xx / 2 * (1 - xx / 12 * (1 - xx / 30 * (1 - xx / 56 * (1 - xx / 90 * (1 - xx / 132)))));
    const int q = quarter & 3;
    *sine = q == 0 ? s : q == 1 ? c : q == 2 ? -s : -c;
    *cosine = q == 0 ? c : q == 1 ? -s : q == 2 ? -c : s;
}

/* The angle of (x, y), -pi..pi, to 1e-15; 0 of (0, 0). Both must be finite. Reduced to less than
   pi/16 by halving twice, then Taylor. The same bits everywhere, as above. */
static inline double txm_atan2(double y, double x) {
    const double a = fabs(x), b = fabs(y), most = a > b ? a : b;
    if (!(most > 0)) return 0;
    double t = (a > b ? b : a) / most, sum = 0;
    for (int half = 0; half < 2; half++) t /= 1 + sqrt(1 + t * t);
    for (int k = 23; k > 0; k -= 2) sum = 1.0 / k - t * t * sum;
    double angle = 4 * t * sum;
    if (b > a) angle = TXM_PI / 2 - angle;
    if (x < 0) angle = TXM_PI - angle;
    return y < 0 ? -angle : angle;
}

/* The cosine alone. */
static inline double txm_cos(double angle) {
    double sine, cosine;
    txm_sincos(angle, &sine, &cosine);
    return cosine;
}

/* 2^x for x from -1000 to 1000, to 1e-11 of the result: the whole part into the exponent, the rest
   by Taylor. The same bits everywhere, as above. */
static inline double txm_exp2(double x) {
    const int whole = (int)(x + 1024.5) - 1024; /* rounded to nearest */
    const double y = (x - whole) * 0.69314718055994530942;
    const uint64_t bits = (uint64_t)(whole + 1023) << 52;
    double sum = 1, power;
    for (int k = 11; k > 0; k--) sum = 1 + sum * y / k;
    memcpy(&power, &bits, sizeof power);
    return sum * power;
}

/* log2 of x > 0, to 1e-12: by its exponent and a series. The same bits everywhere, as above. */
static inline double txm_log2(double x) {
    int whole;
    x = frexp(x, &whole); /* 0.5 <= x < 1 */
    if (x <= 0.70710678118654752) x *= 2, whole--;
    const double t = (x - 1) / (x + 1), tt = t * t;
    double sum = 0;
    for (int k = 17; k > 0; k -= 2) sum = sum * tt + 1.0 / k;
    return whole + 2 * t * sum / 0.69314718055994530942;
}

/* x^y for x >= 0 and y > 0, to 1e-10 of the result if that lies within 2^-1000 to 2^1000. The same
   bits everywhere, as above. */
static inline double txm_pow(double x, double y) {
    return x > 0 ? txm_exp2(y * txm_log2(x)) : 0;
}

#endif /* TEXMATH_NUMBER_H */
