/* crop.c - cut the middle out of a picture: crop IN OUT.png [SIDE [SHRINK]]
   SPDX-License-Identifier: MIT OR Unlicense

   SHRINK first averages blocks of SHRINK x SHRINK pixels; a picture smaller than SIDE x SIDE
   (default 256) is cut to a square of its shorter side.                                        */
#include "files/image_io.h"

#include <stdio.h>

static int fail(const char *path, const char *why) {
    fprintf(stderr, "crop: '%s': %s\n", path, why);
    return 1;
}

int main(int argc, char **argv) {
    txm_image in, out = {0};
    const char *why = NULL;
    if (argc < 3) return fail("", "usage: crop IN OUT.png [SIDE [SHRINK]]");
    int side = argc > 3 ? atoi(argv[3]) : 256, shrink = argc > 4 ? atoi(argv[4]) : 1;
    if (side < 1 || shrink < 1 || shrink > 64) return fail(argv[2], "bad size");
    if (!image_read(argv[1], 0, &in, &why)) return fail(argv[1], why);

    int w = in.width / shrink, h = in.height / shrink, c = in.channels;
    if (side > w) side = w;
    if (side > h) side = h;
    if (side < 1) return fail(argv[1], "too small");
    int left = (w - side) / 2, top = (h - side) / 2;
    out.width = out.height = side;
    out.channels = c;
    out.pixels = malloc((size_t)side * (size_t)side * (size_t)c);
    if (!out.pixels) return fail(argv[2], "out of memory");

    const unsigned char *from = (const unsigned char *)in.pixels;
    unsigned char *to = (unsigned char *)out.pixels;
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side * c; x++) {
            int sum = shrink * shrink / 2;
            for (int dy = 0; dy < shrink; dy++) {
                const unsigned char *row =
                    from + (size_t)((top + y) * shrink + dy) * (size_t)(in.width * c);
                for (int dx = 0; dx < shrink; dx++)
                    sum += row[((left + x / c) * shrink + dx) * c + x % c];
            }
            *to++ = (unsigned char)(sum / (shrink * shrink));
        }
    }

    const int ok = image_write(argv[2], &out, &why);
    free(out.pixels);
    image_free(&in);
    return ok ? 0 : fail(argv[2], why);
}
