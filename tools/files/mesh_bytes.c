/* mesh_bytes.c - lists that grow, and the bytes of a file in the making
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

#include <stdarg.h>
#include <stdio.h>

/* ---- lists that grow --------------------------------------------------------------------- */

list list_of(size_t size) {
    list l = {NULL, 0, 0, 0};
    l.size = size;
    return l;
}

/* Room for exactly so many items in all, or more. */
int list_reserve(list *l, size_t capacity) {
    size_t bytes;
    if (capacity <= l->capacity) return 1;
    if (!txm_mul(capacity, l->size, 1, &bytes) || bytes == 0) return 0;
    void *items = realloc(l->items, bytes);
    if (!items) return 0;
    l->items = items;
    l->capacity = capacity;
    return 1;
}

/* Room for more items at the end, to be filled; NULL if there is no memory. */
void *list_add(list *l, size_t more) {
    size_t count;
    if (!txm_add(l->count, more, &count)) return NULL;
    if ((count > l->capacity || !l->items) && !list_reserve(l, count + count / 2 + 16)) return NULL;
    void *place = (char *)l->items + l->count * l->size;
    l->count = count;
    return place;
}

void list_free(list *l) {
    free(l->items);
    l->items = NULL;
    l->count = l->capacity = 0;
}

/* ---- a file in the making ---------------------------------------------------------------- */

sink sink_new(void) {
    sink s = {{NULL, 0, 0, 1}, 0};
    return s;
}

void sink_put(sink *s, const void *bytes, size_t n) {
    void *place = s->failed || n == 0 ? NULL : list_add(&s->bytes, n);
    if (place) memcpy(place, bytes, n);
    else if (n) s->failed = 1;
}

void sink_print(sink *s, const char *format, ...) {
    char line[256];
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    sink_put(s, line, n < 0 ? 0 : n < (int)sizeof line ? (size_t)n : sizeof line - 1);
}

/* Little-endian numbers. */
void sink_u16(sink *s, uint32_t v) {
    const unsigned char raw[2] = {(unsigned char)(v & 255), (unsigned char)(v >> 8 & 255)};
    sink_put(s, raw, 2);
}

void sink_u32(sink *s, uint32_t v) {
    const unsigned char raw[4] = {(unsigned char)(v & 255), (unsigned char)(v >> 8 & 255),
                                  (unsigned char)(v >> 16 & 255), (unsigned char)(v >> 24)};
    sink_put(s, raw, 4);
}

void sink_floats(sink *s, const float *v, size_t n) {
    for (size_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &v[i], 4);
        sink_u32(s, bits);
    }
}

void sink_doubles(sink *s, const double *v, size_t n) {
    for (size_t i = 0; i < n; i++) {
        uint64_t bits;
        memcpy(&bits, &v[i], 8);
        sink_u32(s, (uint32_t)(bits & 0xffffffffu));
        sink_u32(s, (uint32_t)(bits >> 32));
    }
}

int sink_finish(sink *s, unsigned char **bytes, size_t *size, const char **why) {
    *bytes = NULL;
    if (s->failed) {
        list_free(&s->bytes);
        return *why = "not enough memory to write this mesh", 0;
    }
    *bytes = (unsigned char *)s->bytes.items;
    *size = s->bytes.count;
    return 1;
}
