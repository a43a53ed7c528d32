/* copy_deep.c - read a picture of 16 bits and write it as PNG; for picture.sh
   SPDX-License-Identifier: MIT OR Unlicense */
#include "files/image_io.h"

#include <stdio.h>

int main(int argc, char **argv) {
    txm_image image;
    unsigned char *bytes = NULL;
    size_t size;
    const char *why = "give IN OUT";
    int ok = argc == 3 && image_read_deep(argv[1], 0, &image, &why);
    if (ok && image.sample != TXM_U16) ok = 0, why = "not 16 bits";
    ok = ok && image_encode(NULL, ".png", &image, &bytes, &size, &why);
    if (ok) {
        FILE *file = fopen(argv[2], "wb");
        ok = file && fwrite(bytes, 1, size, file) == size;
        if (file) ok &= fclose(file) == 0;
        why = "cannot write";
    }
    if (!ok) fprintf(stderr, "copy_deep: %s\n", why);
    free(bytes);
    return !ok;
}
