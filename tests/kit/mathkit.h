/* mathkit.h - what the tests of texmath.h share: comparing, and random vectors
   SPDX-License-Identifier: MIT OR Unlicense

   Includes cmocka.h and testkit.h.                                                            */
#ifndef MATHKIT_H
#define MATHKIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "images.h"
#include "testkit.h"

static inline void assert_near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

static inline float random_float(txm_rng *rng, float low, float high) {
    return txm_lerpf(low, high, txm_rng_float(rng));
}

static inline txm_vec3 random_vec3(txm_rng *rng, float size) {
    const float x = random_float(rng, -size, size), y = random_float(rng, -size, size);
    return txm_v3(x, y, random_float(rng, -size, size));
}

/* a rotation whose parts are floats: of length 1 to their precision */
static inline txm_quat random_quat(txm_rng *rng) {
    double q[4], length;
    do {
        for (int k = 0; k < 4; k++) q[k] = (double)random_float(rng, -1, 1);
        length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    } while (length < 0.1);
    const txm_quat unit = {txm_float(q[0] / length), txm_float(q[1] / length),
                           txm_float(q[2] / length), txm_float(q[3] / length)};
    return unit;
}

static inline void assert_vec3(txm_vec3 a, txm_vec3 b, double tolerance) {
    assert_near(a.x, b.x, tolerance);
    assert_near(a.y, b.y, tolerance);
    assert_near(a.z, b.z, tolerance);
}

static inline void assert_floats(const float *a, const float *b, int count, double tolerance) {
    for (int i = 0; i < count; i++) assert_near(a[i], b[i], tolerance);
}

#endif /* MATHKIT_H */
