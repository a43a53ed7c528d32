#ifndef TEXMATH_NORMAL_H
#define TEXMATH_NORMAL_H

#include "image.h"

/* ---- normal maps ------------------------------------------------------------------------ */

/* One coordinate of a normal map's vector, -1..1, of the sample that txm_image_get returns, and back.
   A flat surface must stay flat however it is turned or mirrored, so 128 of 255 is exactly 0, not
   1/255, and 32768 of 65535 likewise:

       8 bit: n = (s - 128) / 127,   16 bit: n = (s - 32768) / 32767,   float: n = 2 s - 1,

   and the sample 0, which would be below, is -1. */
static inline double txm_normal_decode(double value, txm_sample sample) {
    const double n = sample == TXM_U8    ? (value * 255 - 128) / 127
                     : sample == TXM_U16 ? (value * 65535 - 32768) / 32767
                                         : 2 * value - 1;
    return sample != TXM_F32 && n < -1 ? -1 : n;
}
static inline double txm_normal_encode(double n, txm_sample sample) {
    return sample == TXM_U8    ? (n * 127 + 128) / 255
           : sample == TXM_U16 ? (n * 32767 + 32768) / 65535
                               : 0.5 + 0.5 * n;
}

/* The vector of pixel (x, y) of a normal map, in any length. */
static inline void txm_normal_get(const txm_image *map, int x, int y, double n[3]) {
    for (int c = 0; c < 3; c++)
        n[c] = txm_normal_decode((double)txm_image_get(map, x, y, c), map->sample);
}

/* Turn a normal, the samples v of a map, with its picture, and give it unit length. axes: where x and y
   of the result point in the map, each right and down, at right angles and of any length but 0: a
   rotation or a reflection. is_down: green points down in the picture, not up. */
static inline void txm_normal_turn(const double axes[4], int is_down, txm_sample sample, float v[3]) {
    const double down = is_down ? 1 : -1; /* rows run downwards */
    const double nx = txm_normal_decode((double)v[0], sample);
    const double ny = txm_normal_decode((double)v[1], sample) * down;
    double nz = txm_normal_decode((double)v[2], sample);
    const double lx = sqrt(axes[0] * axes[0] + axes[1] * axes[1]);
    const double ly = sqrt(axes[2] * axes[2] + axes[3] * axes[3]);
    double x = (axes[0] * nx + axes[1] * ny) / lx;
    double y = (axes[2] * nx + axes[3] * ny) / ly;
    double length = sqrt(x * x + y * y + nz * nz);
    if (!(length > 1e-6)) {
        x = y = 0;
        nz = length = 1;
    }
    v[0] = txm_float(txm_normal_encode(x / length, sample));
    v[1] = txm_float(txm_normal_encode(y / length * down, sample));
    v[2] = txm_float(txm_normal_encode(nz / length, sample));
}

/* Does a picture look like a normal map? Its mean is within 30 degrees of (0, 0, 1), and at least 19
   of 20 pixels have unit length (within 0.06) and do not point down. For warnings: a picture of one
   light blue is one, too. Looks at about 4096 pixels, spread evenly. */
static inline int txm_image_is_normals(const txm_image *image) {
    const txm_image im = txm_image_resolve(*image);
    const int step_x = (im.width - 1) / 64 + 1, step_y = (im.height - 1) / 64 + 1;
    double sum[3] = {0, 0, 0}, seen = 0, good = 0;
    if (im.channels < 3) return 0;
    for (int y = step_y / 2; y < im.height; y += step_y) {
        for (int x = step_x / 2; x < im.width; x += step_x) {
            double n[3];
            if (im.channels == 4 && !(txm_image_get(&im, x, y, 3) > 0)) continue;
            txm_normal_get(&im, x, y, n);
            const double square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
            seen += 1;
            good += square > 0.94 * 0.94 && square < 1.06 * 1.06 && n[2] > -0.05;
            for (int c = 0; c < 3; c++) sum[c] += n[c];
        }
    }
    const double length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    return seen > 0 && good >= 0.95 * seen && sum[2] > 0.866 * length;
}

#endif /* TEXMATH_NORMAL_H */
