#ifndef TEXMATH_COLOR_H
#define TEXMATH_COLOR_H

#include "vector.h"

/* ---- colour ----------------------------------------------------------------------------- */

/* sRGB code value to linear light and back [6]; 0..1 to 0..1. Outside, values go on along the
   same curves (below 0: the straight part), nothing is clamped. */
static inline float txm_srgb_to_linear(float s) {
    return txm_float(s <= 0.04045f ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4));
}
static inline float txm_linear_to_srgb(float l) {
    return txm_float(l <= 0.0031308f ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055);
}
static inline txm_vec3 txm_srgb_to_linear3(txm_vec3 s) {
    return txm_v3(txm_srgb_to_linear(s.x), txm_srgb_to_linear(s.y), txm_srgb_to_linear(s.z));
}
static inline txm_vec3 txm_linear_to_srgb3(txm_vec3 l) {
    return txm_v3(txm_linear_to_srgb(l.x), txm_linear_to_srgb(l.y), txm_linear_to_srgb(l.z));
}

/* Linear RGB of the sRGB primaries to CIE XYZ and back; white (1, 1, 1) is D65, XYZ (0.95047, 1,
   1.08883). Linear maps: any range. */
static inline txm_vec3 txm_rgb_to_xyz(txm_vec3 c) {
    return txm_v3(txm_float(0.4124564 * c.x + 0.3575761 * c.y + 0.1804375 * c.z),
                  txm_float(0.2126729 * c.x + 0.7151522 * c.y + 0.0721750 * c.z),
                  txm_float(0.0193339 * c.x + 0.1191920 * c.y + 0.9503041 * c.z));
}
static inline txm_vec3 txm_xyz_to_rgb(txm_vec3 c) {
    return txm_v3(txm_float(3.2404542 * c.x - 1.5371385 * c.y - 0.4985314 * c.z),
                  txm_float(-0.9692660 * c.x + 1.8760108 * c.y + 0.0415560 * c.z),
                  txm_float(0.0556434 * c.x - 0.2040259 * c.y + 1.0572252 * c.z));
}

/* f of CIE L*a*b*: cube root, straight below (6/29)^3; and its inverse */
static inline double txm_lab_f(double t) {
    return t > 216.0 / 24389.0 ? pow(t, 1.0 / 3.0) : (24389.0 / 27.0 * t + 16.0) / 116.0;
}
static inline double txm_lab_f_inverse(double f) {
    return f > 6.0 / 29.0 ? f * f * f : (116.0 * f - 16.0) * (27.0 / 24389.0);
}
/* CIE XYZ to L*a*b* under D65 and back [6]: L 0..100; a, b about -128..128; for sRGB colours
   a lies in -86.2..98.3, b in -107.9..94.5. The Euclidean distance is Delta E 1976. */
static inline txm_vec3 txm_xyz_to_lab(txm_vec3 c) {
    const double x = txm_lab_f(c.x / 0.95047), y = txm_lab_f(c.y), z = txm_lab_f(c.z / 1.08883);
    return txm_v3(txm_float(116 * y - 16), txm_float(500 * (x - y)), txm_float(200 * (y - z)));
}
static inline txm_vec3 txm_lab_to_xyz(txm_vec3 c) {
    const double y = (c.x + 16.0) / 116, x = y + c.y / 500.0, z = y - c.z / 200.0;
    return txm_v3(txm_float(0.95047 * txm_lab_f_inverse(x)), txm_float(txm_lab_f_inverse(y)),
                  txm_float(1.08883 * txm_lab_f_inverse(z)));
}
/* linear RGB to L*a*b* and back in one go */
static inline txm_vec3 txm_rgb_to_lab(txm_vec3 c) {
    return txm_xyz_to_lab(txm_rgb_to_xyz(c));
}
static inline txm_vec3 txm_lab_to_rgb(txm_vec3 c) {
    return txm_xyz_to_rgb(txm_lab_to_xyz(c));
}

/* RGB to opponent space and back: I1 = (R + G + B) / 3, I2 = (R - B) / 2, I3 = (2 G - R - B) / 4
   [2]. The three axes are at right angles and nearly uncorrelated in photographs. For RGB in
   0..1: I1 in 0..1, I2 and I3 in -0.5..0.5. A linear map of whatever RGB it is given. */
static inline txm_vec3 txm_rgb_to_opponent(txm_vec3 c) {
    const double r = c.x, g = c.y, b = c.z;
    return txm_v3(txm_float((r + g + b) / 3), txm_float((r - b) / 2),
                  txm_float((2 * g - r - b) / 4));
}
static inline txm_vec3 txm_opponent_to_rgb(txm_vec3 c) {
    const double i1 = c.x, i2 = c.y, i3 = c.z / 1.5;
    return txm_v3(txm_float(i1 + i2 - i3), txm_float(i1 + 2 * i3), txm_float(i1 - i2 - i3));
}

/* RGB in 0..1 to hue, saturation, value and back. Hue in turns: [0, 1), red 0, green 1/3, blue 2/3,
   0 for grays; going back, whole turns do not matter. Saturation and value 0..1. */
static inline txm_vec3 txm_rgb_to_hsv(txm_vec3 c) {
    const double r = c.x, g = c.y, b = c.z;
    const double v = fmax(r, fmax(g, b)), d = v - fmin(r, fmin(g, b));
    double h = 0;
    if (d > 0) {
        h = (r >= v ? (g - b) / d : g >= v ? 2 + (b - r) / d : 4 + (r - g) / d) / 6;
        if (h < 0) h += 1;
    }
    const float hue = txm_float(h);
    return txm_v3(hue < 1 ? hue : 0, v > 0 ? txm_float(d / v) : 0, txm_float(v));
}
static inline txm_vec3 txm_hsv_to_rgb(txm_vec3 c) {
    float out[3];
    for (int i = 0; i < 3; i++) {
        /* a trapezoid over the circle, shifted by a third for each channel */
        double t = c.x + (3 - i) / 3.0;
        t = fabs(6 * (t - floor(t)) - 3) - 1;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        out[i] = txm_float(c.z * (1 + c.y * (t - 1)));
    }
    return txm_v3(out[0], out[1], out[2]);
}

#endif /* TEXMATH_COLOR_H */
