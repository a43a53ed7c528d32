/* files.c - errors, memory and files
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

#include <stb/stb_image.h>
#include <stdarg.h>
#include <stdio.h>

int fail(forest_gl *f, const char *format, ...) {
    va_list list;
    va_start(list, format);
    vsnprintf(f->failed, sizeof f->failed, format, list);
    va_end(list);
    return 0;
}

int check(forest_gl *f, txm_status status) {
    return status == TXM_OK ? 1 : fail(f, "%s", f->env.message);
}

/* count * bytes zeroed bytes; NULL with f->failed set */
void *allocate(forest_gl *f, size_t count, size_t bytes) {
    void *memory = calloc(count ? count : 1, bytes);
    if (!memory) fail(f, "no memory");
    return memory;
}

txm_image image_of(void *pixels, int width, int height, int channels) {
    const txm_image image = {pixels, width, height, channels, TXM_U8, 0};
    return image;
}

/* The contents of a file, terminated by a 0, to be released with free; NULL if it cannot be read. */
char *read_file(const char *path) {
    FILE *file = fopen(path, "rb");
    size_t size = 0, capacity = 1 << 14;
    char *text = NULL;
    while (file) {
        char *more = (char *)realloc(text, capacity);
        if (!more) break;
        text = more;
        size += fread(text + size, 1, capacity - 1 - size, file);
        if (size < capacity - 1) break;
        capacity *= 2;
    }
    if (text) text[size] = 0;
    if (file) fclose(file);
    return text;
}

int new_image(forest_gl *f, txm_image *image, int width, int height, int channels) {
    void *pixels = allocate(f, (size_t)width * (size_t)height, (size_t)channels);
    *image = image_of(pixels, width, height, channels);
    return pixels != NULL;
}

int read_picture(forest_gl *f, const char *path, int channels, txm_image *image) {
    int width, height, had;
    stbi_uc *pixels = stbi_load(path, &width, &height, &had, channels);
    if (!pixels) return fail(f, "cannot read '%s': %s", path, stbi_failure_reason());
    *image = image_of(pixels, width, height, channels);
    return 1;
}
